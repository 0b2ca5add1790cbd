//! Counts what a program runs on a simulated core, built as the program is built.
//!
//! Prints a line for each figure: `row <name> <mean> <least> <most>` in instructions, `size <type> <bytes>`.
//! `figures.py` reads them.

#![no_std]
#![no_main]

mod cycle;
mod dearest;
mod driver;
mod driver_frame;
#[path = "../../qemu/src/meter.rs"]
mod meter;
#[path = "../../qemu/src/report.rs"]
mod report;
#[path = "../../qemu/src/wiring.rs"]
mod wiring;

use core::panic::PanicInfo;
use cortex_m_semihosting::{debug, hprintln};

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(mut peripherals) = cortex_m::Peripherals::take() {
        meter::start(&mut peripherals.SYST);
        cycle::rows();
        report::row("tick_dearest_found", &[dearest::exact(&dearest::found())]);
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
