//! Filters for measurements and commands.
//!
//! | filter | takes out | delay | time step |
//! |---|---|---|---|
//! | [`LowPass`] | noise, gently | its time constant | any, from call to call |
//! | [`Biquad`] | noise, steeply; one resonance | about `0.2 / cutoff` | fixed |
//! | [`Window::mean`] | noise, and a disturbance of exactly `N` samples | `(N - 1) / 2` samples | fixed |
//! | [`Window::median`] | single wrong samples | `(N - 1) / 2` samples | fixed |
//!
//! A filter starts at rest on its first sample, so there is no transient from zero. A NaN or infinite sample changes
//! nothing: the last output is returned and the sample is counted.

mod biquad;
mod low_pass;
mod window;

pub use biquad::Biquad;
pub use low_pass::LowPass;
pub use window::Window;
