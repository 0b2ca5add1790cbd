//! Functions of `drivetrain` as machine code with a C interface: what `prove.py` proves, for all inputs.
//!
//! Each goes through the public API only, so that a change of the internals leaves the proofs as they are; but where nothing
//! may change, the words of the bus are compared as well. [`faulty`] has for each of them one with an error of the kind
//! that is found in the field: the same proof has to fail on it.

#![no_std]
#![no_main]

mod faulty;
mod frames;
mod timeouts;
mod words;

use core::cell::UnsafeCell;
use core::panic::PanicInfo;
use drivetrain::dji::Feedback;
use drivetrain::encoder;

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    panicked()
}

/// No path may lead here.
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn panicked() -> ! {
    loop {
        core::hint::spin_loop();
    }
}

/// Only ever looked at, never run from here.
#[unsafe(no_mangle)]
extern "C" fn _start() -> ! {
    loop {
        core::hint::spin_loop();
    }
}

/// A value that the functions of this image change.
#[repr(transparent)]
struct Shared<T>(UnsafeCell<T>);

// SAFETY: one thread, in a simulator.
unsafe impl<T> Sync for Shared<T> {}

impl<T> Shared<T> {
    const fn new(value: T) -> Self {
        Self(UnsafeCell::new(value))
    }

    /// To be called once.
    #[expect(clippy::mut_from_ref, reason = "the only one")]
    fn get(&self) -> &mut T {
        // SAFETY: each caller has a value of its own, and each call of the image begins with a memory of its own.
        unsafe { &mut *self.0.get() }
    }
}

/// The eight bytes of two big-endian words.
const fn bytes(high: u32, low: u32) -> [u8; 8] {
    let ([a, b, c, d], [e, f, g, h]) = (high.to_be_bytes(), low.to_be_bytes());
    [a, b, c, d, e, f, g, h]
}

/// Decodes feedback: 1 and angle, rpm, current, temperature, error; or 0 for a frame that is refused.
#[unsafe(no_mangle)]
extern "C" fn decode(high: u32, low: u32, fields: &mut [i32; 5]) -> u32 {
    match Feedback::decode(&bytes(high, low)) {
        Some(feedback) => {
            *fields = [
                i32::from(feedback.angle()),
                i32::from(feedback.rpm()),
                i32::from(feedback.current()),
                i32::from(feedback.temperature()),
                i32::from(feedback.error()),
            ];
            1
        }
        None => 0,
    }
}

/// The way from one angle to the next.
#[unsafe(no_mangle)]
extern "C" fn unwrap(previous: u32, next: u32) -> i32 {
    encoder::shortest(previous as u16, next as u16)
}
