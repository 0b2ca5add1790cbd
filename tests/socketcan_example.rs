//! What the example `socketcan` says is written by threads of their own. How it drives is held on a real CAN stack, by
//! `tests/vcan/run`.

#![cfg(test)]
#![cfg(target_os = "linux")]

#[path = "../examples/socketcan/outlet.rs"]
mod outlet;
