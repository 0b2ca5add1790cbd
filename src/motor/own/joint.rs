//! The joint on the shaft of the drive: targets and measurements in its own direction, from its own zero.

use super::{Impedance, Own, OwnMotor, Target};
use crate::motor::{AngleDrive, Capabilities, Capability, TargetError, VelocityDrive};
use crate::units::{Angle, AngularVelocity};

/// A reading of the angle, with the stamp of its feedback.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reading {
    pub(super) angle: Angle,
    pub(super) velocity: AngularVelocity,
    pub(super) at: u32,
}

/// Feedback may have waited in a buffer for so long, in s.
const WAITED_S: f32 = 0.04;
/// After a longer time of feedback without an angle, in s, whole turns are not known.
const UNKNOWN_S: f32 = 0.1;

impl Reading {
    /// Returns the largest way in rad of the shaft to a later reading: at the larger of both velocities, for a little longer than the time
    /// between them, and beside that 0.25 rad, and 8 rad/s for a shaft that sped up and stopped meanwhile.
    fn furthest(&self, later: &Self, gap_s: f32) -> f32 {
        let (one, other) = (self.velocity.as_rad_per_s(), later.velocity.as_rad_per_s());
        // A velocity that is no number counts as none.
        let fastest = one.abs().max(other.abs()).max(0.0);
        0.25 + 8.0 * gap_s + 1.5 * fastest * gap_s.max(WAITED_S)
    }

    fn gap_s(&self, later: &Self) -> f32 {
        later.at.wrapping_sub(self.at) as f32 * 1e-6
    }
}

/// The direction and the zero of the joint: its angle is `sign * (angle of the drive - zero)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joint {
    pub(super) sign: f32,
    pub(super) zero: Zero,
    /// The last angle of a drive whose zero depends on its supply.
    last: Option<Reading>,
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
    pub(super) const DIRECT: Self = Self { sign: 1.0, zero: Zero::OfDrive, last: None };

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

    /// Takes the angle of a frame of feedback, so long after the frame before, after a silence or not. A drive counts anew if the angle is further away than the shaft can
    /// have turned. Returns by how much the drive counts further than before; `None` if the zero is lost.
    ///
    /// A jump by whole turns is no loss: some drives count within a turn.
    pub(super) fn follow(
        &mut self,
        reading: Option<Reading>,
        gap_us: u32,
        is_silence: bool,
    ) -> Option<Angle> {
        let last = self.last;
        self.last = reading.or(last);
        let (reading, last) = match (reading, last) {
            (Some(reading), Some(last)) => (reading, last),
            _ if is_silence => return self.lose_zero(),
            _ => return Some(Angle::ZERO),
        };
        let (gap_s, known_s) = (last.gap_s(&reading), UNKNOWN_S.max(gap_us as f32 * 1e-6));
        let furthest = last.furthest(&reading, gap_s.min(known_s));
        let way = reading.angle - last.angle;
        let turns = way - way.wrapped();
        let is_usual = |way: Angle| !is_silence && way.as_radians().abs() <= furthest;
        match &mut self.zero {
            _ if is_usual(way) => Some(Angle::ZERO),
            _ if !is_silence && gap_s > known_s => self.lose_zero(),
            Zero::Placed(zero) => {
                *zero = *zero + turns;
                Some(turns)
            }
            Zero::Found(zero) if is_usual(way.wrapped()) => {
                *zero = *zero + turns;
                Some(turns)
            }
            _ => self.lose_zero(),
        }
    }

    const fn lose_zero(&mut self) -> Option<Angle> {
        (self.zero, self.last) = (Zero::Lost, None);
        None
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
