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

/// Where an action goes to. It stands apart from the action, so that an update has one byte to look at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    /// The lower half of the turns, [near](crate::encoder::Shaft::near) to those of the shaft; or bits of the rad/s.
    pub(super) turns: u32,
    /// Raw command, bits of the rad/s or of the way, or phase of the shaft.
    pub(super) value: i32,
}

impl Goal {
    pub(super) const NONE: Self = Self::of(0);

    pub(super) const fn of(value: i32) -> Self {
        Self { turns: 0, value }
    }

    pub(super) const fn raw(&self) -> i32 {
        self.value
    }

    pub(super) const fn rad_per_s(&self) -> f32 {
        f32::from_bits(self.value.cast_unsigned())
    }

    pub(super) const fn phase(&self) -> i32 {
        self.value
    }

    pub(super) const fn turns(&self) -> u32 {
        self.turns
    }

    /// A way in rad, and the rate in rad/s that goes with it.
    pub(super) const fn measured(way: f32, rad_per_s: f32) -> Self {
        Self { turns: rad_per_s.to_bits(), value: way.to_bits().cast_signed() }
    }

    pub(super) const fn way(&self) -> f32 {
        f32::from_bits(self.value.cast_unsigned())
    }

    pub(super) const fn rate(&self) -> f32 {
        f32::from_bits(self.turns)
    }
}
