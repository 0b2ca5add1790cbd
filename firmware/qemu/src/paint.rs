//! Counts bytes of stack with paint.

use core::hint::black_box;

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
