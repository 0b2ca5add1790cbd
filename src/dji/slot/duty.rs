//! Action of a motor, and its execution by an update.

/// Action set by the target of a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Action {
    Rest,
    Raw,
    Velocity,
    /// By the shortest way.
    Angle,
    Position,
    /// By the remaining way that another sensor measures.
    Measured,
}

impl Action {
    /// Tells whether the action goes to a position of the shaft.
    pub(super) const fn is_way(self) -> bool {
        matches!(self, Self::Angle | Self::Position)
    }
}

/// Task of an update: the action itself in the usual, simple case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Duty {
    Rest,
    /// The first run of any action since a rest.
    First,
    Raw,
    /// The speed loop, plain and with the full output: its own limit is enough.
    Velocity,
    /// Both loops, as above.
    Position,
    /// Any other action, within the available output; also the first run of an action in place of another.
    Other,
}
