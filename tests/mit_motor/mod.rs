//! A motor of one's own in MIT mode, without settings that are read: what a program had to write before the family `damiao`.

use drivetrain::frame::CanFrame;
use drivetrain::math::wrap_pi;
use drivetrain::motor::Impedance;
use drivetrain::motor::{Capabilities, Capability, Claim, Ingest, MotorName, Order};
use drivetrain::motor::{DriveProtocol, Target, Vitals};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::mit::{self, Feedback, Ranges};
use embedded_can::{Frame, Id, StandardId};

/// Position in rad, velocity in rad/s, torque in Nm: the registers PMAX, VMAX and TMAX of the drive have to say the same.
const PMAX_RAD: f32 = 12.5;
const RANGES: Ranges = match Ranges::new(PMAX_RAD, 30.0, 10.0) {
    Ok(ranges) => ranges,
    Err(_) => panic!("the ranges of a DM-J4310 are not valid"),
};
/// The rated torque and speed: no target asks for more.
const LIMIT_NM: f32 = 3.0;
const LIMIT_RAD_PER_S: f32 = 12.5;
/// Nm/rad and Nm s/rad: damped with 0.7 for an inertia of 0.01 kg m² at the output.
const STIFFNESS: f32 = 20.0;
const DAMPING: f32 = 0.6;
/// Clears the error that the drive reports; it stays disabled.
const CLEAR_ERROR: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFB];

/// Commands on its id; answers each of them on the master id: status and id, position, velocity, torque, two temperatures.
#[derive(Debug, Clone, Copy)]
pub(crate) struct J4310 {
    id: u8,
    master_id: u16,
    /// 0 disabled, 1 enabled, from 8 on an error; `None` before the first answer.
    status: Option<u8>,
    measured: Feedback,
    /// The position is at an end of its range: the shaft is there or beyond.
    is_at_end: bool,
    temperature_c: u8,
    effort: f32,
}

impl J4310 {
    /// Takes an id of 1 to 15, for which an answer has room, and the register `MST_ID` of the drive, which may be that of other
    /// drives too. `None` for another id.
    pub(crate) const fn new(id: u8, master_id: u16) -> Option<Self> {
        if !matches!(id, 1..=15) {
            return None;
        }
        let measured = Feedback { position_rad: 0.0, velocity_rad_per_s: 0.0, torque_nm: 0.0 };
        let (status, is_at_end) = (None, false);
        Some(Self { id, master_id, status, measured, is_at_end, temperature_c: 0, effort: 0.0 })
    }

    fn frame(&self, data: [u8; 8]) -> CanFrame {
        CanFrame::of(standard(self.id.into()), data)
    }

    /// The velocity next to the wanted one whose damping, beside so much torque, keeps within the limit.
    fn near(&self, wanted: f32, torque_nm: f32) -> f32 {
        let measured = self.measured.velocity_rad_per_s;
        let (least, most) = (-LIMIT_NM - torque_nm, LIMIT_NM - torque_nm);
        measured + (wanted - measured).clamp(least / DAMPING, most / DAMPING)
    }
}

impl DriveProtocol for J4310 {
    fn name(&self) -> MotorName {
        MotorName::new("DM-J4310", self.id)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let command = Claim::command(standard(self.id.into()), self.name());
        [command, Claim::feedback(standard(self.master_id), self.name()).shared()]
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        let [head, a, b, c, d, e, driver_c, rotor_c] = *frame.data() else {
            return Ingest::WrongLength(frame.length());
        };
        if head & 0xF != self.id {
            return Ingest::Unrelated;
        }
        let status = head >> 4;
        if !matches!(status, 0 | 1 | 8..=14) {
            return Ingest::WrongField;
        }
        self.status = Some(status);
        self.measured = RANGES.decode_feedback(&[a, b, c, d, e]);
        self.is_at_end = matches!([a, b], [0, 0] | [0xFF, 0xFF]);
        self.temperature_c = driver_c.max(rotor_c);
        Ingest::Taken
    }

    fn velocity(&self) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(self.measured.velocity_rad_per_s)
    }

    fn angle(&self) -> Option<Angle> {
        (!self.is_at_end).then(|| Angle::from_radians(self.measured.position_rad))
    }

    fn rest(&mut self) -> CanFrame {
        self.frame(RANGES.encode(&Impedance::FREE))
    }

    /// The loops are in the drive, so it takes no step. Position and velocity are sent so near that the torque, which is gains times
    /// what is left to go, keeps within the share of the limit.
    fn control(&mut self, Order { target, share, step: _ }: Order) -> CanFrame {
        let Feedback { position_rad, velocity_rad_per_s, .. } = self.measured;
        let (kp, kd) = (share * STIFFNESS, share * DAMPING);
        let command = match target {
            Target::Torque(nm) => Impedance::torque(nm.clamp(-share * LIMIT_NM, share * LIMIT_NM)),
            Target::Velocity(velocity) => {
                let wanted = velocity.as_rad_per_s().clamp(-LIMIT_RAD_PER_S, LIMIT_RAD_PER_S);
                Impedance {
                    velocity: AngularVelocity::from_rad_per_s(self.near(wanted, 0.0)),
                    damping: kd,
                    ..Impedance::FREE
                }
            }
            Target::Angle(angle) if !self.is_at_end => {
                let way = wrap_pi(angle.as_radians() - position_rad);
                let near = position_rad + way.clamp(-LIMIT_NM / STIFFNESS, LIMIT_NM / STIFFNESS);
                let near = near.clamp(-PMAX_RAD, PMAX_RAD);
                let velocity_rad_per_s = self.near(0.0, STIFFNESS * (near - position_rad));
                Impedance {
                    angle: Angle::from_radians(near),
                    velocity: AngularVelocity::from_rad_per_s(velocity_rad_per_s),
                    stiffness: kp,
                    damping: kd,
                    ..Impedance::FREE
                }
            }
            _ => Impedance::FREE,
        };
        let torque_nm = command.stiffness * (command.angle.as_radians() - position_rad)
            + command.damping * (command.velocity.as_rad_per_s() - velocity_rad_per_s)
            + command.torque_nm;
        self.effort = torque_nm / LIMIT_NM;
        self.frame(RANGES.encode(&command))
    }

    fn reset(&mut self) {
        self.effort = 0.0;
    }

    fn enable(&mut self, _sent: u8) -> Option<CanFrame> {
        Some(self.frame(mit::ENABLE))
    }

    fn disable(&mut self) -> Option<CanFrame> {
        let has_error = self.status.is_some_and(|status| status >= 8);
        Some(self.frame(if has_error { CLEAR_ERROR } else { mit::DISABLE }))
    }

    fn is_enabled(&self) -> Option<bool> {
        self.status.map(|status| status == 1)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Torque, Capability::Velocity, Capability::Angle])
            .with(Capability::Feedback)
            .with(Capability::Temperature)
            .with(Capability::ErrorCodes)
    }

    fn vitals(&self) -> Vitals {
        let error_code = self.status.filter(|status| *status >= 8);
        Vitals {
            temperature_c: Some(self.temperature_c.into()),
            has_fault: error_code.is_some(),
            has_warning: false,
            error_code: error_code.unwrap_or(0),
            effort: self.effort,
            speed: self.measured.velocity_rad_per_s / RANGES.velocity_rad_per_s(),
            current: self.measured.torque_nm / RANGES.torque_nm(),
        }
    }
}

fn standard(raw: u16) -> Id {
    StandardId::new(raw).unwrap_or(StandardId::MAX).into()
}
