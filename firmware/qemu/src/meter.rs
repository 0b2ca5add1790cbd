//! Counts instructions with the timer and bytes of stack with paint.

use core::hint::black_box;
use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m_semihosting::hprintln;

/// Calls in one measurement: the figure is their mean.
pub const CALLS: u32 = 1_000;

/// QEMU's `-icount shift=0` takes one ns an instruction, and the timer of this board runs at 25 MHz.
const INSTRUCTIONS_A_TICK: u32 = 40;

/// What a measured call is compared with: a call with the same arguments to a function with nothing but the frame that
/// this target forces on every one (push, mov, pop). A figure is what a function does beyond being one.
#[inline(never)]
extern "C" fn returns_at_once() {}

pub fn start(timer: &mut SYST) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(0xFF_FFFF);
    timer.clear_current();
    timer.enable_counter();
}

/// Returns the instructions of one call of `function`, a function pointer: `each` calls what it is given, once with
/// `function` and once with one that returns at once, and the difference is the figure.
pub fn instructions<F: Copy>(function: F, mut each: impl FnMut(F, u32)) -> u32 {
    const { assert!(size_of::<F>() == size_of::<extern "C" fn()>()) };
    // SAFETY: `F` is a function pointer; the callee touches nothing, and no caller looks at its result.
    let nothing: F = unsafe {
        core::mem::transmute_copy::<extern "C" fn(), F>(&(returns_at_once as extern "C" fn()))
    };
    let taken = ticks(function, &mut each);
    let overhead = ticks(nothing, &mut each);
    (taken.saturating_sub(overhead) * INSTRUCTIONS_A_TICK + CALLS / 2) / CALLS
}

#[inline(never)]
fn ticks<F: Copy>(function: F, each: &mut impl FnMut(F, u32)) -> u32 {
    let function = black_box(function);
    let start = SYST::get_current();
    for call in 0..CALLS {
        each(function, call);
    }
    start.wrapping_sub(SYST::get_current()) & 0xFF_FFFF
}

/// Returns the bytes of stack that `work` uses beyond those of a call that does nothing.
pub fn stack(work: impl FnOnce()) -> usize {
    let nothing = painted(|| {
        black_box(());
    });
    painted(work).saturating_sub(nothing)
}

#[inline(never)]
fn painted(work: impl FnOnce()) -> usize {
    const PAINT: u32 = 0xC0FF_EE11;
    const WORDS: usize = 4_096;
    let bottom = stack_pointer().wrapping_sub(WORDS);
    for word in 0..WORDS {
        // SAFETY: below the frame of this function is memory that nobody uses: 4 MiB, and no interrupt runs.
        unsafe { bottom.add(word).write_volatile(PAINT) };
    }
    work();
    let kept = (0..WORDS).take_while(|word| {
        // SAFETY: as above.
        unsafe { bottom.add(*word).read_volatile() == PAINT }
    });
    (WORDS - kept.count()) * size_of::<u32>()
}

#[inline(always)]
fn stack_pointer() -> *mut u32 {
    let pointer: *mut u32;
    // SAFETY: only reads the register.
    unsafe { core::arch::asm!("mov {}, sp", out(reg) pointer, options(nomem, nostack)) };
    pointer
}

/// Prints the mean of several figures, the least and the most.
pub fn row(name: &str, figures: &[u32]) {
    let count = figures.len() as u32;
    let mean = (figures.iter().sum::<u32>() + count / 2) / count;
    let (least, most) =
        figures.iter().fold((u32::MAX, 0), |(least, most), x| (least.min(*x), most.max(*x)));
    hprintln!("row {} {} {} {}", name, mean, least, most);
}
