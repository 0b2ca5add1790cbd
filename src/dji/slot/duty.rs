//! What a motor is asked to do, and what an update does about it.

/// What a motor is asked to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Action {
    Rest,
    Raw,
    Velocity,
    /// The shortest way.
    Angle,
    Position,
    /// The way that another sensor leaves.
    Measured,
}

impl Action {
    /// Tells whether it goes to a place of the shaft.
    pub(super) const fn is_way(self) -> bool {
        matches!(self, Self::Angle | Self::Position)
    }
}

/// What an update does: the action, where that is as simple as it nearly always is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Duty {
    Rest,
    /// Whatever is asked for, for the first time since a rest.
    First,
    Raw,
    /// The speed loop, plain and with the full output: what it gives within its limit needs no other.
    Velocity,
    /// Both loops, as above.
    Position,
    /// Whatever else is asked for, within what is left of the output; also what is asked for in place of another.
    Other,
}
