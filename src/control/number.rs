//! Arithmetic that stays finite.

/// Returns `value` within `lower..=upper`, which the caller knows to be in order.
#[inline]
pub(super) const fn limited(value: f32, lower: f32, upper: f32) -> f32 {
    if value > upper {
        upper
    } else if value < lower {
        lower
    } else {
        value
    }
}

/// Returns `value`, or the largest number of its sign when it is infinite, or zero when it is NaN.
#[inline]
pub(super) const fn finite(value: f32) -> f32 {
    if value.abs() <= f32::MAX {
        value
    } else if value.is_nan() {
        0.0
    } else {
        f32::MAX.copysign(value)
    }
}
