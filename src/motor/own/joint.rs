//! The joint on the shaft of the drive: targets and measurements in its own direction, from its own zero.

use super::{Impedance, Own, OwnMotor, Target};
use crate::motor::{AngleDrive, Capabilities, Capability, TargetError, VelocityDrive};
use crate::units::{Angle, AngularVelocity};

/// No shaft turns further between two frames than at the larger of both velocities, and this much, in rad and of that way.
const WAY: (f32, f32) = (0.5, 0.5);

/// Angle and velocity of the shaft, as the drive reports them.
pub(super) struct Reading(pub(super) Option<Angle>, pub(super) AngularVelocity);

impl Reading {
    /// Returns the way to a later reading.
    pub(super) fn way_to(&self, later: &Self) -> Option<Angle> {
        Some(later.0? - self.0?)
    }

    /// Tells whether the angle of a later reading is further away than the shaft turned meanwhile: the drive counts anew.
    pub(super) fn jumps_to(&self, later: &Self, gap_us: u32) -> bool {
        let fastest = self.1.as_rad_per_s().abs().max(later.1.as_rad_per_s().abs());
        let turned = fastest * gap_us as f32 * 1e-6;
        self.way_to(later)
            .is_some_and(|way| way.as_radians().abs() > turned + WAY.0 + WAY.1 * turned)
    }
}

/// The direction and the zero of the joint: its angle is `sign * (angle of the drive - zero)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joint {
    pub(super) sign: f32,
    pub(super) zero: Zero,
}

/// The angle of the drive where the joint is at zero.
#[derive(Debug, Clone, Copy)]
pub(super) enum Zero {
    /// The zero of the drive.
    OfDrive,
    /// Given with the configuration, within a turn: whole turns are not known before the joint was heard.
    Given(Angle),
    /// Of a drive that knows its angle within a turn: whole turns follow the joint over a loss of the supply.
    Placed(Angle),
    /// Of a drive that counts from where it was switched on.
    Found(Angle),
    /// The drive may have lost its supply since.
    Lost,
}

impl Joint {
    /// The joint turns and counts as its drive.
    pub(super) const DIRECT: Self = Self { sign: 1.0, zero: Zero::OfDrive };

    /// Places a given zero in the turn where the joint is heard first.
    pub(super) fn place_zero(&mut self, measured: Option<Angle>) {
        if let (Zero::Given(zero), Some(measured)) = (self.zero, measured) {
            self.zero = Zero::Placed(measured - (measured - zero).wrapped());
        }
    }

    /// Tells whether the zero is lost, or its turn, if the drive counts its turns anew.
    pub(super) const fn depends_on_supply(&self) -> bool {
        matches!(self.zero, Zero::Placed(_) | Zero::Found(_))
    }

    /// The drive may have counted anew between two angles, `way` apart, in which the joint turned by less than half a turn. Returns by
    /// how much the drive counts further than before; `None` if the zero is lost.
    pub(super) fn doubt_zero(&mut self, way: Option<Angle>) -> Option<Angle> {
        match (self.zero, way) {
            (Zero::Placed(zero), Some(way)) => {
                let turns = way - way.wrapped();
                self.zero = Zero::Placed(zero + turns);
                Some(turns)
            }
            (Zero::Placed(_) | Zero::Found(_), _) => {
                self.zero = Zero::Lost;
                None
            }
            _ => Some(Angle::ZERO),
        }
    }

    const fn zero(&self) -> Option<Angle> {
        match self.zero {
            Zero::OfDrive => Some(Angle::ZERO),
            Zero::Placed(zero) | Zero::Found(zero) => Some(zero),
            Zero::Given(_) | Zero::Lost => None,
        }
    }

    fn angle_of_drive(&self, angle: Angle) -> Result<Angle, TargetError> {
        Ok(self.zero().ok_or(TargetError::NotHomed)? + angle * self.sign)
    }

    /// Returns the target in the direction of the drive.
    ///
    /// # Errors
    /// [`TargetError::NotHomed`] for an angle whose zero is lost.
    pub(super) fn target_of_drive(&self, target: Target) -> Result<Target, TargetError> {
        Ok(match target {
            Target::Torque(torque_nm) => Target::Torque(torque_nm * self.sign),
            Target::Velocity(velocity) => Target::Velocity(velocity * self.sign),
            Target::Angle(angle) => Target::Angle(self.angle_of_drive(angle)?),
            Target::Impedance(impedance) => Target::Impedance(Impedance {
                angle: self.angle_of_drive(impedance.angle)?,
                velocity: impedance.velocity * self.sign,
                torque_nm: impedance.torque_nm * self.sign,
                ..impedance
            }),
        })
    }
}

/// There is one motor, so its handle is `()`.
impl<M: OwnMotor> VelocityDrive<()> for Own<M> {
    fn velocity(&self, (): ()) -> Option<AngularVelocity> {
        self.is_online().then(|| self.motor.velocity() * self.joint.sign)
    }

    fn capabilities(&self, (): ()) -> Capabilities {
        self.motor.capabilities()
    }

    fn set_velocity(&mut self, (): (), target: AngularVelocity) -> Result<(), TargetError> {
        self.set(Capability::Velocity, Target::Velocity(target))
    }
}

impl<M: OwnMotor> AngleDrive<()> for Own<M> {
    fn angle(&self, (): ()) -> Option<Angle> {
        Some((self.measured_angle()? - self.joint.zero()?) * self.joint.sign)
    }

    fn set_angle(&mut self, (): (), target: Angle) -> Result<(), TargetError> {
        self.set(Capability::Angle, Target::Angle(target))
    }
}
