/// What a bus has counted; every counter saturates or, for frames, wraps at 2^32.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counters {
    /// Feedback frames of another length than 8 bytes.
    pub bad_length: u32,
    /// Feedback frames with an angle above 8191.
    pub bad_field: u32,
    /// Frames with a feedback id of this family that no attached motor has: a wrong id switch shows here.
    pub unattached: u32,
    /// Updates whose time step was zero, negative or NaN, or whose time did not move on.
    pub bad_steps: u32,
    /// Command frames that an update had ready; wraps.
    pub packed: u32,
    /// Command frames that were replaced by newer ones before they were taken, or after they were given back; wraps.
    pub superseded: u32,
}

/// The frames that were refused.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rejects {
    pub(super) bad_length: u32,
    pub(super) bad_field: u32,
    pub(super) unattached: u32,
}

impl Rejects {
    pub(super) const NONE: Self = Self { bad_length: 0, bad_field: 0, unattached: 0 };
}
