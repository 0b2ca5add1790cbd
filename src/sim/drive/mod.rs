//! Drives with command frames of their own, each written from its manual and without the codec of its family.

mod damiao;
mod lk;
mod odrive;
mod rmd;
mod robstride;
mod shaft;
mod vesc;

pub use damiao::DamiaoDrive;
pub use lk::LkDrive;
pub use odrive::OdriveDrive;
pub use rmd::RmdDrive;
pub use robstride::RobStrideDrive;
pub use shaft::DriveShaft;
pub use vesc::{VescDrive, VescMotor};
