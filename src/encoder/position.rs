use crate::units::Angle;
use core::f32::consts::TAU;

/// A multi-turn position of an output shaft: whole turns and an angle within the turn.
///
/// The turns are an integer, so a position keeps its resolution however far the shaft has gone.
///
/// # Examples
/// ```
/// use drivetrain::encoder::Position;
/// use drivetrain::units::Angle;
///
/// let position = Position::new(-1, Angle::from_degrees(270.0));
/// assert_eq!(position, Position::from_angle(Angle::from_degrees(-90.0)));
/// assert_eq!(position.as_turns(), -0.25);
/// assert_eq!(Position::from_turns(1_000_000).angle(), Angle::ZERO);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Position {
    turns: i64,
    angle: Angle,
}

impl Position {
    /// Zero turns, zero angle.
    pub const ZERO: Self = Self { turns: 0, angle: Angle::ZERO };

    /// Takes whole turns and an angle to add. A NaN or infinite angle is kept and later refused.
    #[must_use]
    pub const fn new(turns: i64, angle: Angle) -> Self {
        let Self { turns: more, angle } = Self::from_angle(angle);
        Self { turns: turns.saturating_add(more), angle }
    }

    /// Takes whole turns.
    #[must_use]
    pub const fn from_turns(turns: i64) -> Self {
        Self { turns, angle: Angle::ZERO }
    }

    /// Takes any angle, which may be more than one turn; beyond 2^31 turns it saturates.
    #[must_use]
    pub const fn from_angle(angle: Angle) -> Self {
        let turns = angle.as_turns();
        if !turns.is_finite() {
            return Self { turns: 0, angle };
        }
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let truncated = turns as i32;
        let whole = if truncated as f32 > turns { truncated.saturating_sub(1) } else { truncated };
        let rest = turns - whole as f32;
        // A negative tiny rest rounds up to a whole turn; beyond 2^31 turns nothing sensible is left, in either direction.
        if rest >= 1.0 {
            Self { turns: whole as i64 + 1, angle: Angle::ZERO }
        } else if rest < 0.0 {
            Self { turns: whole as i64, angle: Angle::ZERO }
        } else {
            Self { turns: whole as i64, angle: Angle::from_radians(rest * TAU) }
        }
    }

    /// Returns whole turns, rounded towards minus infinity.
    #[must_use]
    pub const fn turns(self) -> i64 {
        self.turns
    }

    /// Returns the angle within the turn: 0 up to, but not including, one turn.
    #[must_use]
    pub const fn angle(self) -> Angle {
        self.angle
    }

    /// Returns all of it in turns, rounded to `f32`: single rotor counts are lost after some hundred turns.
    #[must_use]
    pub const fn as_turns(self) -> f32 {
        self.turns as f32 + self.angle.as_turns()
    }

    /// Returns all of it as one angle, rounded to `f32`.
    #[must_use]
    pub const fn as_angle(self) -> Angle {
        Angle::from_turns(self.as_turns())
    }

    /// Tells whether the angle is neither NaN nor infinite.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.angle.is_finite()
    }
}

impl core::ops::Add<Angle> for Position {
    type Output = Self;
    fn add(self, angle: Angle) -> Self {
        Self::new(self.turns, self.angle + angle)
    }
}

/// The way from one position to another; exact near zero, rounded to `f32` far away.
impl core::ops::Sub for Position {
    type Output = Angle;
    fn sub(self, from: Self) -> Angle {
        Angle::from_turns(self.turns.saturating_sub(from.turns) as f32) + (self.angle - from.angle)
    }
}

/// What is known of the absolute angle of an output shaft.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Homing {
    /// The encoder sits on the output shaft: the angle is absolute from the first frame.
    Absolute,
    /// Geared, not zeroed yet: the position is relative to where the motor was at power-on.
    #[default]
    Relative,
    /// Geared and zeroed: the position is relative to the zero that was set.
    Homed,
    /// Was known, until a gap in the feedback left the number of turns in doubt.
    Uncertain,
}

impl Homing {
    /// Tells whether an absolute angle may be commanded.
    #[must_use]
    pub const fn is_known(self) -> bool {
        matches!(self, Self::Absolute | Self::Homed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_negative_tiny_angle_is_not_a_whole_turn_within_the_turn() {
        for turns in [-1e-30_f32, -1e-9, -f32::MIN_POSITIVE] {
            let position = Position::from_angle(Angle::from_turns(turns));
            assert_eq!(position, Position::ZERO);
        }
    }

    #[test]
    fn the_angle_stays_within_its_turn() {
        for degrees in [-720.0_f32, -361.0, -0.01, 0.0, 359.99, 360.0, 1e6, -1e6, 3e12, -3e12] {
            let position = Position::from_angle(Angle::from_degrees(degrees));
            let turns = position.angle().as_turns();
            assert!((0.0..1.0).contains(&turns), "{degrees}: {position:?}");
            let error = (position.as_angle().as_degrees() - degrees).abs();
            assert!(error <= 1e-6 * degrees.abs().max(360.0) || degrees.abs() > 1e12);
        }
    }

    #[test]
    fn beyond_two_to_the_31_turns_it_saturates_on_a_whole_turn() {
        for (degrees, turns) in [(3e12, 1 << 31), (-3e12, -1 << 31), (-f32::MAX, -1 << 31)] {
            let position = Position::from_angle(Angle::from_degrees(degrees));
            assert_eq!(position, Position::from_turns(turns), "{degrees}");
        }
    }

    #[test]
    fn a_difference_far_out_is_as_exact_as_near_zero() {
        let far = Position::from_turns(1_000_000_000_000);
        let step = Angle::from_degrees(0.1);
        assert!((((far + step) - far).as_degrees() - 0.1).abs() < 1e-5);
    }

    #[test]
    fn nan_stays_visible() {
        assert!(!Position::from_angle(Angle::from_radians(f32::NAN)).is_finite());
        assert!(!Position::from_angle(Angle::from_radians(f32::INFINITY)).is_finite());
    }
}
