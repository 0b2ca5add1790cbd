//! What stands for a board in the images: a driver, a clock and a pilot, as far as a program sees them.

#[path = "../driver_frame.rs"]
mod driver_frame;

use core::hint::black_box;
use core::panic::PanicInfo;
pub use driver_frame::DriverFrame;
use embedded_can::ErrorKind;

pub struct Board;

impl embedded_can::nb::Can for Board {
    type Frame = DriverFrame;
    type Error = ErrorKind;

    #[inline(never)]
    fn transmit(&mut self, frame: &DriverFrame) -> nb::Result<Option<DriverFrame>, ErrorKind> {
        black_box(frame);
        Ok(None)
    }

    #[inline(never)]
    fn receive(&mut self) -> nb::Result<DriverFrame, ErrorKind> {
        black_box(None).ok_or(nb::Error::WouldBlock)
    }
}

/// Returns a time in µs, of which nothing is known.
#[inline(never)]
pub fn micros() -> u64 {
    black_box(0)
}

/// Returns what a pilot asks for: whether the switch is on, and three numbers.
#[inline(never)]
pub fn pilot() -> (bool, [f32; 3]) {
    black_box((false, [0.0; 3]))
}

/// What a program does that cannot go on.
#[inline(never)]
pub fn halt() -> ! {
    loop {
        core::hint::spin_loop();
    }
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    halt()
}
