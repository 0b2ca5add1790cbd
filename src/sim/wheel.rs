use super::MotorKey;
use super::body::Contact;
use crate::geometry::{Rotation2, Vec2};
use crate::units::Angle;

/// A wheel under a simulated chassis: its motor, its contact with the floor, and the directions in which the floor
/// holds it.
///
/// | made by | the floor holds it | it rolls |
/// |---|---|---|
/// | [`plain`](Self::plain) | along and across | forward |
/// | [`steered`](Self::steered) | along and across | where its steering motor points |
/// | [`omni`](Self::omni) | along its rolling direction | in the direction given |
/// | [`mecanum`](Self::mecanum) | along the axis of the roller that touches it | forward |
///
/// A motor that turns counter-clockwise rolls its wheel forward; behind [`reversed`](Self::reversed), backward.
///
/// # Examples
/// ```
/// use drivetrain::geometry::Vec2;
/// use drivetrain::sim::{MotorConfig, Wheel, Simulation};
/// use drivetrain::units::Angle;
///
/// let world = Simulation::new(1);
/// let drive = world.attach(MotorConfig::m3508(1))?;
/// let steering = world.attach(MotorConfig::gm6020_voltage(1).with_rotor_angle(2048))?;
/// // The module points forward when its absolute encoder shows 90 degrees, as it does now.
/// let wheel = Wheel::steered(drive, 0.06, Vec2::new(0.2, 0.2), steering, Angle::from_degrees(90.0));
/// assert_eq!(wheel.position_m(), Vec2::new(0.2, 0.2));
/// # Ok::<(), drivetrain::sim::SimError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Wheel {
    motor: MotorKey,
    radius_m: f32,
    position_m: Vec2,
    direction: Angle,
    /// Of the roller on the floor; `None` for a tyre, which rolls only ahead.
    roller_axis: Option<Angle>,
    reversed: bool,
    steering: Option<(MotorKey, Angle)>,
}

impl Wheel {
    /// Takes a wheel with a tyre, rolling forward, at its place from the centre of mass in m.
    #[must_use]
    pub const fn plain(motor: MotorKey, radius_m: f32, position_m: Vec2) -> Self {
        Self {
            motor,
            radius_m,
            position_m,
            direction: Angle::ZERO,
            roller_axis: None,
            reversed: false,
            steering: None,
        }
    }

    /// Takes a wheel with a tyre, turned by a second motor about the vertical through its contact, one to one.
    ///
    /// Counter-clockwise is to the left. At the angle `zero` of the second motor's shaft the wheel points forward.
    #[must_use]
    pub const fn steered(
        motor: MotorKey,
        radius_m: f32,
        position_m: Vec2,
        steering: MotorKey,
        zero: Angle,
    ) -> Self {
        Self { steering: Some((steering, zero)), ..Self::plain(motor, radius_m, position_m) }
    }

    /// Takes an omni wheel and its rolling direction, counter-clockwise from forward; motion across this direction is
    /// free.
    #[must_use]
    pub const fn omni(motor: MotorKey, radius_m: f32, position_m: Vec2, direction: Angle) -> Self {
        let plain = Self::plain(motor, radius_m, position_m);
        Self { direction, roller_axis: Some(direction), ..plain }
    }

    /// Takes a mecanum wheel in the usual mounting: front left and rear right, the rollers on the floor lie at -45
    /// degrees, front right and rear left at 45, so the four form an O.
    #[must_use]
    pub const fn mecanum(motor: MotorKey, radius_m: f32, position_m: Vec2) -> Self {
        let degrees = if position_m.x * position_m.y > 0.0 { -45.0 } else { 45.0 };
        Self::plain(motor, radius_m, position_m).with_roller_axis(Angle::from_degrees(degrees))
    }

    /// Sets how the axis of the roller on the floor lies, counter-clockwise from forward.
    #[must_use]
    pub const fn with_roller_axis(self, axis: Angle) -> Self {
        Self { roller_axis: Some(axis), ..self }
    }

    /// Makes the motor turn clockwise to roll forward: mounted the other way round.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self { reversed: !self.reversed, ..self }
    }

    /// Returns where the wheel touches the floor, in m from the centre of mass.
    #[must_use]
    pub const fn position_m(&self) -> Vec2 {
        self.position_m
    }

    /// Names the invalid parameter.
    pub(crate) fn validate(&self) -> Result<(), &'static str> {
        let near = |length: f32| length.abs() <= 1e3;
        if self.motor.is_joint() || self.steering.is_some_and(|(motor, _)| motor.is_joint()) {
            return Err("motor");
        }
        if !(self.radius_m > 0.0 && near(self.radius_m)) {
            return Err("wheel_radius_m");
        }
        if !(near(self.position_m.x) && near(self.position_m.y)) {
            return Err("position_m");
        }
        if !self.direction.is_finite() || !self.steering.is_none_or(|(_, zero)| zero.is_finite()) {
            return Err("direction");
        }
        // A roller across the wheel turns freely at any motion of the wheel.
        let pulls =
            self.roller_axis.is_none_or(|_| self.contact(None).reach.abs() > 0.1 * self.radius_m);
        if pulls { Ok(()) } else { Err("roller_axis") }
    }

    /// Returns how the wheel holds the floor while its steering motor shows an angle in rad.
    pub(crate) fn contact(&self, steering_rad: Option<f32>) -> Contact {
        let turned = match (self.steering, steering_rad) {
            (Some((_, zero)), Some(shown)) => Angle::from_radians(shown - zero.as_radians()),
            _ => Angle::ZERO,
        };
        let unit = |angle: Angle| Rotation2::new(angle + turned).apply(Vec2::new(1.0, 0.0));
        let rolling = unit(self.direction);
        let along = self.roller_axis.map_or(rolling, unit);
        Contact {
            position: self.position_m,
            along,
            reach: self.radius_m * rolling.dot(along),
            holds_across: self.roller_axis.is_none(),
        }
    }

    pub(crate) const fn motor(&self) -> MotorKey {
        self.motor
    }

    pub(crate) const fn steering_motor(&self) -> Option<MotorKey> {
        match self.steering {
            Some((motor, _)) => Some(motor),
            None => None,
        }
    }

    /// Returns 1, or -1 for a motor that turns clockwise to roll forward.
    pub(crate) const fn sign(&self) -> f32 {
        if self.reversed { -1.0 } else { 1.0 }
    }
}
