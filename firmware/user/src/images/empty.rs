//! A program that does nothing with its board: what the bytes of the others are compared with.

#![no_std]
#![no_main]

mod board;

use board::{Board, micros, pilot};
use core::hint::black_box;
use embedded_can::nb::Can;
// The vector table.
use cortex_m as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut can = Board;
    loop {
        if let Ok(frame) = can.receive() {
            _ = black_box(can.transmit(&frame));
        }
        black_box((micros(), pilot()));
    }
}
