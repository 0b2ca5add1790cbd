use crate::control::number::limited;
use crate::math;

/// Returns the lesser one of two, and the second if the first is NaN.
pub(super) const fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Returns how far away a function passes zero at most, that is below zero by `depth` and bends upward by `bend` at least.
pub(super) fn reach(depth: f32, slope: f32, bend: f32) -> f32 {
    let root = math::quick_root(slope * slope + 2.0 * bend * depth);
    if slope > 0.0 { 2.0 * depth / (slope + root) } else { (root - slope) / bend }
}

/// Finds where a function passes zero upward, which it does once between `low` and `high`.
///
/// A step of the share `close` is the last one: the next one would be of its square.
pub(super) fn root<const STEPS: u32>(
    [low, high]: [f32; 2],
    guess: f32,
    close: f32,
    function: impl Fn(f32) -> (f32, f32),
) -> f32 {
    let (mut low, mut high, mut x) = (low, high, guess);
    for _ in 0..STEPS {
        let (value, slope) = function(x);
        if value > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let step = value / slope;
        let next = x - step;
        if step.abs() <= close * x.abs() {
            return limited(next, low, high);
        }
        x = if next >= low && next <= high { next } else { 0.5 * (low + high) };
    }
    x
}
