//! Drives with command frames of their own, each written from its manual and without the codec of its family.

mod damiao;
mod odrive;
mod shaft;

pub use damiao::DamiaoDrive;
pub use odrive::OdriveDrive;
pub use shaft::DriveShaft;
