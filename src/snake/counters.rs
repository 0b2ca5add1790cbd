/// Counters of a bus. All saturate, except `packed` and `superseded`, which wrap at 2^32.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counters {
    /// Accepted replies.
    pub replies: u32,
    /// Frames with a joint's id and another length than 6.
    pub bad_length: u32,
    /// Frames with a joint's id that are no reply, or that name an unknown register.
    pub bad_field: u32,
    /// Frames with a joint's id that only a controller sends: there is a second controller on the bus.
    pub foreign_commands: u32,
    /// Frames with the id of a joint that is not attached.
    pub unattached: u32,
    /// Requests sent, less requests given back.
    pub requests: u32,
    /// Requests not answered in time, including requests given back after that.
    pub unanswered: u32,
    /// Updates with a time step of zero, negative, infinite or NaN, or with a time that stood still.
    pub bad_steps: u32,
    /// Frames that were ready: chosen by an update, or disables, whenever due; wraps.
    pub packed: u32,
    /// Frames replaced by newer ones before they were taken, or after they were given back; wraps.
    pub superseded: u32,
}

impl Counters {
    pub(super) const NONE: Self = Self {
        replies: 0,
        bad_length: 0,
        bad_field: 0,
        foreign_commands: 0,
        unattached: 0,
        requests: 0,
        unanswered: 0,
        bad_steps: 0,
        packed: 0,
        superseded: 0,
    };
}

/// Counts one more; saturates.
pub(super) const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
