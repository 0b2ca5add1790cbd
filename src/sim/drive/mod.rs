//! Drives with command frames of their own, each written from its manual and without the codec of its family.

mod damiao;
mod robstride;
mod shaft;

pub use damiao::DamiaoDrive;
pub use robstride::RobStrideDrive;
pub use shaft::DriveShaft;
