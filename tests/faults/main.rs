//! The catalogue of faults in `docs/faults.md`, driven through the simulator and the public API.
//!
//! A test's name begins with the id of its row; `table.rs` holds both together. `cargo run --release --example faults`
//! runs the same functions and prints what they saw.

#![cfg(test)]

mod arming;
#[path = "../odrive/bench.rs"]
mod axle;
#[path = "../damiao/bench.rs"]
mod bench;
mod case;
mod catalogue;
mod clocks;
mod commands;
mod drives;
mod health;
#[path = "../lk/bench.rs"]
mod lk_bench;
mod odrive;
mod plausibility;
mod receive;
mod registration;
mod rig;
mod rmd;
#[path = "../rmd/bench.rs"]
mod rmd_bench;
mod robstride;
#[path = "../robstride/bench.rs"]
mod robstride_bench;
mod rows;
mod table;
mod timing;
mod transmit;
#[path = "../vesc/bench.rs"]
mod vesc_bench;
