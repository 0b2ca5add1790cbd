//! What every motor has in common, whatever its family.
//!
//! The bus owns the motors and the application holds small `Copy` handles, so the traits here are
//! implemented by the *owner* of the motors and take the handle as an argument: nothing borrows a motor.
//!
//! ```text
//! chassis ── set_velocity(handle, target) ──> owner (a bus)      RAM only
//! chassis <── velocity(handle) ────────────── owner
//! ```

mod drive;

pub use drive::{TargetError, VelocityDrive};
