/// Counters of a bus. All saturate, except `packed` and `superseded`, which wrap at 2^32.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counters {
    /// Feedback frames of another length than 8 bytes.
    pub bad_length: u32,
    /// Feedback frames with an angle above 8191.
    pub bad_field: u32,
    /// Frames with a feedback id of this family but no attached motor: a sign of a wrong id switch.
    pub unattached: u32,
    /// Updates with a time step of zero, negative or NaN, or with a time that did not move on.
    pub bad_steps: u32,
    /// Command frames made ready by updates; wraps.
    pub packed: u32,
    /// Command frames replaced by newer ones before they were taken, or after they were given back; wraps.
    pub superseded: u32,
}

/// Refused frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rejects {
    pub(super) bad_length: u32,
    pub(super) bad_field: u32,
    pub(super) unattached: u32,
}

impl Rejects {
    pub(super) const NONE: Self = Self { bad_length: 0, bad_field: 0, unattached: 0 };
}
