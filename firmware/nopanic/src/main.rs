//! Links only when no public function of `drivetrain` can panic: the panic handler calls what nobody defines.
//!
//! Every public function stands here once, called out of line with opaque arguments. `link.py` links this for four
//! targets at three levels, looks at the symbols of the image, and compares the list with the sources. Formatting
//! (`Debug`, `Display`) is not here: `core::fmt` has panic paths of its own.

#![no_std]
#![no_main]

mod chassis;
mod damiao;
mod functions;
mod geometry;
mod health;
mod lk;
mod manipulator;
mod odrive;
mod opaque;
mod pwm;
mod rmd;
mod robstride;
mod shaping;
mod shooter;
mod snake;
mod vesc;
mod wire;

use core::panic::PanicInfo;

#[cfg(not(feature = "show"))]
unsafe extern "C" {
    /// Defined nowhere.
    fn a_function_of_drivetrain_can_panic() -> !;
}

/// With the feature `show` the image links, and its disassembly tells who calls.
#[cfg(feature = "show")]
#[unsafe(no_mangle)]
#[inline(never)]
unsafe extern "C" fn a_function_of_drivetrain_can_panic() -> ! {
    loop {
        core::hint::spin_loop();
    }
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    // SAFETY: does not exist.
    unsafe { a_function_of_drivetrain_can_panic() }
}

#[unsafe(no_mangle)]
extern "C" fn _start() -> ! {
    loop {
        functions::call_all();
    }
}
