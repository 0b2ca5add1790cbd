//! The TWAI of an ESP32-C3 fits as it is.
//!
//! Its controller holds one frame, which esp-hal cannot call back: when a plug is back, this frame leaves first, as old as it is.
//! In bus-off, both calls fail; the program stops and starts the driver, and the runner counts the errors until then.
#![no_std]
#![warn(missing_docs)]

use drivetrain::runner::{Nb, Port};
use esp_hal::DriverMode;
use esp_hal::twai::Twai;

/// Takes the whole driver, blocking or async.
pub fn esp_fits<'d, M: DriverMode>(twai: Twai<'d, M>) -> impl Port + use<'d, M> {
    Nb(twai)
}
