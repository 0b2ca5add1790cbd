//! Counts instructions with the timer.

use core::hint::black_box;
use cortex_m::peripheral::{SYST, syst::SystClkSource};

/// Calls in one measurement: the figure is their mean.
pub const CALLS: u32 = 1_000;

/// QEMU's `-icount shift=0` takes one ns an instruction, and the timer of this board runs at 25 MHz.
const INSTRUCTIONS_A_TICK: u32 = 40;

/// Reference of a measured call: a call with the same arguments to an empty function, with the stack frame that this target forces
/// on every function (push, mov, pop). A figure is the difference of both calls.
#[inline(never)]
extern "C" fn returns_at_once() {}

pub fn start(timer: &mut SYST) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(0xFF_FFFF);
    timer.clear_current();
    timer.enable_counter();
}

/// Returns the instructions of one call of `function`, a function pointer: `each` calls its argument, once
/// `function` and once an empty function, and the difference is the figure.
pub fn instructions<F: Copy>(function: F, each: impl FnMut(F, u32)) -> u32 {
    instructions_of(CALLS, function, each)
}

/// The same of fewer calls: exact to half of `INSTRUCTIONS_A_TICK / calls`.
pub fn instructions_of<F: Copy>(calls: u32, function: F, mut each: impl FnMut(F, u32)) -> u32 {
    const { assert!(size_of::<F>() == size_of::<extern "C" fn()>()) };
    // SAFETY: `F` is a function pointer; the callee touches nothing, and no caller looks at its result.
    let nothing: F = unsafe {
        core::mem::transmute_copy::<extern "C" fn(), F>(&(returns_at_once as extern "C" fn()))
    };
    let taken = ticks(calls, function, &mut each);
    let overhead = ticks(calls, nothing, &mut each);
    (taken.saturating_sub(overhead) * INSTRUCTIONS_A_TICK + calls / 2) / calls
}

#[inline(never)]
fn ticks<F: Copy>(calls: u32, function: F, each: &mut impl FnMut(F, u32)) -> u32 {
    let function = black_box(function);
    let start = SYST::get_current();
    for call in 0..calls {
        each(function, call);
    }
    start.wrapping_sub(SYST::get_current()) & 0xFF_FFFF
}
