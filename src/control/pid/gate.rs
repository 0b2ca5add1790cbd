//! Comparisons of sizes in one integer instruction, which NaN and infinity never pass.

/// Marks a stored error or measurement as unknown: arithmetic with it never passes a [`gate`].
pub(super) const UNKNOWN: f32 = f32::INFINITY;

/// A gate that nothing passes.
pub(super) const CLOSED: u32 = 0;

/// Encodes a limit so that one integer comparison tells whether a value is within ±`limit`, and neither NaN nor infinite.
pub(super) const fn gate(limit: f32) -> u32 {
    open_gate(limit) + 1
}

/// As [`gate`], but what is just `limit` does not pass. Zero gives [`CLOSED`].
pub(super) const fn open_gate(limit: f32) -> u32 {
    limit.to_bits() << 1
}

/// Returns the limit that a gate encodes.
#[inline]
pub(super) const fn limit_of(gate: u32) -> f32 {
    f32::from_bits(gate >> 1)
}

#[inline]
pub(super) const fn passes(value: f32, gate: u32) -> bool {
    magnitude(value) < gate
}

/// Sizes in an order that one integer comparison tells; NaN is larger than all numbers.
#[inline]
const fn magnitude(value: f32) -> u32 {
    value.to_bits() << 1
}
