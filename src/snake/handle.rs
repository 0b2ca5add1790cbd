/// Names a joint of a bus: one byte, `Copy`.
///
/// A handle of a detached joint finds nothing, even after another joint took its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Joint(u8);

impl Joint {
    /// Number of joints that can follow each other in one place.
    pub(super) const GENERATIONS: u8 = 16;

    /// Index in the low half, generation in the high half.
    pub(super) const fn new(index: u8, generation: u8) -> Self {
        Self(generation << 4 | (index & 15))
    }

    pub(super) const fn index(self) -> usize {
        (self.0 & 15) as usize
    }

    pub(super) const fn generation(self) -> u8 {
        self.0 >> 4
    }
}
