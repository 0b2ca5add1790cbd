//! The catalogue of faults in `docs/faults.md`, driven through the simulator and the public API.
//!
//! A test's name begins with the id of its row; `table.rs` holds both together.

#![cfg(test)]

mod commands;
mod plausibility;
mod receive;
mod registration;
mod rig;
mod table;
mod timing;
mod transmit;
