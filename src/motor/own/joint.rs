//! The joint on the shaft of the drive: targets and measurements in its own direction, from its own zero.

use super::{Impedance, Own, OwnMotor, Target};
use crate::motor::{AngleDrive, Capabilities, Capability, TargetError, VelocityDrive};
use crate::units::{Angle, AngularVelocity};

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

    /// The drive may have lost its supply between two angles, in which the joint turned by less than half a turn.
    pub(super) fn doubt_zero(&mut self, before: Option<Angle>, after: Option<Angle>) {
        self.zero = match (self.zero, before, after) {
            (Zero::Placed(zero), Some(before), Some(after)) => {
                let way = after - before;
                Zero::Placed(zero + way - way.wrapped())
            }
            (Zero::Placed(_) | Zero::Found(_), ..) => Zero::Lost,
            (zero, ..) => zero,
        };
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
