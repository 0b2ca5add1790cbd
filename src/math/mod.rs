//! The few elementary functions of motor control, in `f32`, small and fast on a Cortex-M4F.
//!
//! | function | result | largest error, measured |
//! |---|---|---|
//! | [`sin_cos`] | sine and cosine, `const` | 1.6e-7 in ±π, 1.8e-7 up to ±1000 |
//! | [`sqrt`] | square root | half a unit in the last place; 1 unit without `libm` |
//! | [`atan2`] | angle of a vector, -π..=π | 2.7e-7; 0.005 with `micromath` |
//! | [`wrap_pi`], [`wrap_tau`] | an angle in [-π, π) or [0, 2π), `const` | 4e-7 up to ±10 000 |
//! | [`wrap`], [`wrap_positive`] | the same for any period, `const` | 0; `wrap_positive` rounds its sum once |
//!
//! Nothing here panics, and NaN in gives NaN out. `f32::sin` and its like do not exist without `std`, and the
//! portable ones cost a thousand instructions on a target without `f64` hardware.
//!
//! ```
//! use drivetrain::math;
//!
//! const QUARTER: (f32, f32) = math::sin_cos(core::f32::consts::FRAC_PI_2);
//! assert!(QUARTER.0 == 1.0 && QUARTER.1.abs() < 2e-7);
//! assert_eq!(math::wrap(370.0, 360.0), 10.0);
//! ```

mod root;
#[cfg(test)]
pub(crate) mod tests;
mod trigonometry;
mod wrap;

pub use root::sqrt;
pub(crate) use root::{cube_root, quick_root};
pub use trigonometry::{atan2, sin_cos};
pub(crate) use wrap::rest;
pub use wrap::{wrap, wrap_pi, wrap_positive, wrap_tau};

/// Added to and taken from a number of at most 2^22, leaves the nearest integer: 1.5 * 2^23, whose last bit counts ones.
const ROUND: f32 = 12_582_912.0;
