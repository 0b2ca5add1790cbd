//! Measures the crate on a simulated Cortex-M4F through its public API.
//!
//! Prints a line for each figure: `row <name> <mean> <least> <most>` in instructions, `stack <name> <bytes>`,
//! `size <type> <bytes>`, and `closed_loop <hash> <frames>`. `figures.py` reads them.

#![no_std]
#![no_main]

mod arm;
mod balance;
mod bytes;
mod calls;
mod closed_loop;
mod constant_time;
mod controllers;
mod drives;
mod joints;
mod meter;
mod motion;
mod paint;
mod report;
mod robot;
mod rows;
mod snake;
mod state_space;
mod wiring;

use core::panic::PanicInfo;
use cortex_m_semihosting::{debug, hprintln};

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(mut peripherals) = cortex_m::Peripherals::take() {
        meter::start(&mut peripherals.SYST);
        hprintln!("level {}", env!("OPT_LEVEL"));
        let (hash, frames) = closed_loop::run();
        hprintln!("closed_loop {:016x} {}", hash, frames);
        rows::motors();
        calls::rows();
        joints::rows();
        drives::rows();
        snake::rows();
        rows::control();
        robot::rows();
        controllers::rows();
        motion::rows();
        state_space::rows();
        arm::rows();
        balance::rows();
        rows::math();
        rows::space();
        bytes::rows();
        constant_time::show();
        rows::stack();
        rows::sizes();
        debug::exit(debug::EXIT_SUCCESS);
    }
    fail()
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    hprintln!("{}", info);
    fail()
}

fn fail() -> ! {
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
