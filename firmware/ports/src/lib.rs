//! Drivers of others under drivetrain's runner: a type that fits as it is, or the newtype that makes it fit.
//!
//! | crate | what it implements | port |
//! |---|---|---|
//! | `bxcan` 0.8 | `embedded_can::nb::Can`, of embedded-can 0.4 | fits: [`bxcan_fits`] |
//! | `mcp25xx` 0.4 | the same | fits; with abort: [`Mcp25xx`] |
//! | `mcp2515` 0.3 | `embedded_can::blocking::Can`, though it never waits | [`Mcp2515`] |
//! | `fdcan` 0.2 | nothing: headers and slices of its own | [`Fdcan`] |
//! | `embedded-can-interface` 0.1 | traits of its own, which drivers implement | [`Interface`] |
#![cfg_attr(not(test), no_std)]
#![warn(missing_docs)]

mod fdcan;
mod interface;
mod mcp2515;
mod mcp25xx;
#[cfg(test)]
mod tests;

pub use self::fdcan::Fdcan;
pub use interface::Interface;
pub use mcp25xx::Mcp25xx;
pub use mcp2515::Mcp2515;

use bxcan::{Can, Instance};
use drivetrain::runner::Nb;

/// bxcan's whole driver fits. Its halves need the newtype of `firmware/boards/c-board-rtic`, which also has the abort.
pub fn bxcan_fits<I: Instance>(can: Can<I>) -> Nb<Can<I>> {
    Nb(can)
}
