//! The catalogue of faults in `docs/faults.md`, driven through the simulator and the public API.
//!
//! A test's name begins with the id of its row; `table.rs` holds both together. `cargo run --release --example faults`
//! runs the same functions and prints what they saw.

#![cfg(test)]

mod arming;
#[path = "../damiao/bench.rs"]
mod bench;
mod case;
mod catalogue;
mod clocks;
mod commands;
mod drives;
mod health;
mod plausibility;
mod receive;
mod registration;
mod rig;
#[path = "../robstride/bench.rs"]
mod robstride;
mod rows;
mod table;
mod timing;
mod transmit;
