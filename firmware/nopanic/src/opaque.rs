//! Calls a function with arguments that the optimiser knows nothing about.

use core::hint::black_box;

/// Returns a value of any type that could be any value of that type. Only ever linked, never run.
#[inline(always)]
pub fn any<T>() -> T {
    let place = black_box(0x2000_0000 as *const T);
    // SAFETY: none: the image is not run. The optimiser has to take the place for a valid `T`.
    unsafe { place.read_volatile() }
}

/// A function whose every argument can be had from [`any`].
pub trait Function<Arguments> {
    fn call(self);
}

macro_rules! function {
    ($($argument:ident),*) => {
        impl<F, R, $($argument),*> Function<($($argument,)*)> for F
        where
            F: FnOnce($($argument),*) -> R,
        {
            #[inline(never)]
            fn call(self) {
                black_box(self($(any::<$argument>()),*));
            }
        }
    };
}

function!();
function!(A);
function!(A, B);
function!(A, B, C);
function!(A, B, C, D);
function!(A, B, C, D, E);
