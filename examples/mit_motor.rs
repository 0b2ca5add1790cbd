//! Two motors in MIT mode (Damiao DM-J4310) as motors of your own, on one bus, with one id for the answers of both.
//!
//! Such a drive is enabled by a frame before it follows, and eight zero bytes are its full negative torque: the motor says what
//! rest is. The drives are played by hand on the simulated bus. One turns, one holds an angle; then a drive loses its supply
//! for a moment, and at the end there is an emergency stop. `cargo run --example mit_motor`
//!
//! A drive whose cable is cut goes on with its last command unless its own time-out is set: the register `TIMEOUT` (9) of a Damiao
//! drive, in units of 50 µs, where 2000 is 100 ms and 0 is none. No program can do that for it: set it before the first run.

mod console;

use drivetrain::frame::CanFrame;
use drivetrain::math::wrap_pi;
use drivetrain::motor::{Capabilities, Capability, Claim, Ingest, Malformed, MotorName, Order};
use drivetrain::motor::{Own, OwnMotor, Role, Severity, Target, Vitals};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::mit::{self, Command, Feedback, Ranges};
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

impl OwnMotor for J4310 {
    fn name(&self) -> MotorName {
        MotorName::new("DM-J4310", self.id)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let command = Claim::new(standard(self.id.into()), Role::Command, self.name());
        [command, Claim::new(standard(self.master_id), Role::Feedback, self.name()).shared()]
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        let [head, a, b, c, d, e, driver_c, rotor_c] = *frame.data() else {
            return Ingest::Malformed(Malformed::Length(frame.length()));
        };
        if head & 0xF != self.id {
            return Ingest::Unrelated;
        }
        let status = head >> 4;
        if !matches!(status, 0 | 1 | 8..=14) {
            return Ingest::Malformed(Malformed::Field);
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
        self.frame(RANGES.encode(&Command::REST))
    }

    /// The loops are in the drive, so it takes no step. Position and velocity are sent so near that the torque, which is gains times
    /// what is left to go, keeps within the share of the limit.
    fn control(&mut self, Order { target, share, step: _ }: Order) -> CanFrame {
        let Feedback { position_rad, velocity_rad_per_s, .. } = self.measured;
        let (kp, kd) = (share * STIFFNESS, share * DAMPING);
        let command = match target {
            Target::Torque(nm) => Command::torque(nm.clamp(-share * LIMIT_NM, share * LIMIT_NM)),
            Target::Velocity(velocity) => {
                let wanted = velocity.as_rad_per_s().clamp(-LIMIT_RAD_PER_S, LIMIT_RAD_PER_S);
                Command { velocity_rad_per_s: self.near(wanted, 0.0), kd, ..Command::REST }
            }
            Target::Angle(angle) if !self.is_at_end => {
                let way = wrap_pi(angle.as_radians() - position_rad);
                let near = position_rad + way.clamp(-LIMIT_NM / STIFFNESS, LIMIT_NM / STIFFNESS);
                let near = near.clamp(-PMAX_RAD, PMAX_RAD);
                let velocity_rad_per_s = self.near(0.0, STIFFNESS * (near - position_rad));
                Command { position_rad: near, velocity_rad_per_s, kp, kd, ..Command::REST }
            }
            _ => Command::REST,
        };
        let torque_nm = command.kp * (command.position_rad - position_rad)
            + command.kd * (command.velocity_rad_per_s - velocity_rad_per_s)
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
            error: error_code.map(|_| Severity::Fault),
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

/// That is all of it. From here on: the simulator, with the part of the drives played by hand.
fn main() -> Result<(), Box<dyn std::error::Error>> {
    simulation::drive()
}

mod simulation {
    use super::*;
    use drivetrain::motor::{AngleDrive, Condition, Devices, VelocityDrive};
    use drivetrain::runner::{Nb, Runner};
    use drivetrain::sim::{Line, Simulation};
    use drivetrain::time::Duration;
    use std::error::Error;

    const INERTIA_KG_M2: f32 = 0.01;
    const FRICTION_NM_S: f32 = 0.01;
    /// Of both drives.
    const MASTER_ID: u16 = 0x010;

    /// A drive and its shaft.
    struct Drive {
        id: u8,
        is_enabled: bool,
        command: Command,
        shaft: Feedback,
        answers: u8,
    }

    impl Drive {
        fn new(id: u8) -> Self {
            let (command, shaft) = (Command::REST, Feedback::default());
            Self { id, is_enabled: false, command, shaft, answers: 0 }
        }

        /// Follows a frame, and owes an answer.
        fn hear(&mut self, frame: &CanFrame) {
            if frame.id() != standard(self.id.into()) {
                return;
            }
            self.answers += 1;
            match *frame.bytes() {
                mit::ENABLE => self.is_enabled = true,
                mit::DISABLE => self.is_enabled = false,
                command => self.command = RANGES.decode(&command),
            }
        }

        fn step(&mut self, dt_s: f32) {
            let Feedback { position_rad, velocity_rad_per_s, .. } = self.shaft;
            let Command { kp, kd, .. } = self.command;
            let torque_nm = kp * (self.command.position_rad - position_rad)
                + kd * (self.command.velocity_rad_per_s - velocity_rad_per_s)
                + self.command.torque_nm;
            self.shaft.torque_nm = if self.is_enabled { torque_nm.clamp(-7.0, 7.0) } else { 0.0 };
            let accelerating_nm = self.shaft.torque_nm - FRICTION_NM_S * velocity_rad_per_s;
            self.shaft.velocity_rad_per_s += accelerating_nm / INERTIA_KG_M2 * dt_s;
            self.shaft.position_rad += self.shaft.velocity_rad_per_s * dt_s;
        }

        /// The answers that it owes.
        fn answers(&mut self) -> impl Iterator<Item = CanFrame> {
            let [a, b, c, d, e] = RANGES.encode_feedback(&self.shaft);
            let head = u8::from(self.is_enabled) << 4 | self.id;
            let answer = CanFrame::of(standard(MASTER_ID), [head, a, b, c, d, e, 40, 35]);
            std::iter::repeat_n(answer, std::mem::take(&mut self.answers).into())
        }
    }

    pub(crate) fn drive() -> Result<(), Box<dyn Error>> {
        let world = Simulation::new(1);
        let mut drives = [Drive::new(1), Drive::new(2)];
        let motor = |id| J4310::new(id, MASTER_ID).map(Own::new).ok_or("ids are 1 to 15");
        let robot = [motor(1)?, motor(2)?];
        let mut runner = Runner::new(Nb(world.controller()), world.clock(), robot);
        let (wheel, joint) = (AngularVelocity::from_rad_per_s(6.0), Angle::from_degrees(90.0));
        let mut edges = Vec::new();
        for ms in 0..2_000 {
            world.advance_with(Duration::from_millis(1), |record| {
                drives.iter_mut().for_each(|drive| drive.hear(&record.frame));
            });
            for drive in &mut drives {
                drive.step(0.001);
                for answer in drive.answers() {
                    let _full = world.inject(Line::Can1, answer);
                }
            }
            runner.poll(16);
            let Some(tick) = runner.due() else { continue };
            match ms {
                50 | 1_100 => runner.arm(tick)?,     // the pilot asks, twice in all
                800 => drives[1].is_enabled = false, // its supply fails for a moment
                1_600 => runner.device_mut().emergency_stop(),
                _ => {}
            }
            let [first, second] = runner.device_mut();
            _ = first.set_velocity((), wheel); // refused until armed
            _ = second.set_angle((), joint);
            runner.tick(tick);
            while let Some(edge) = runner.device_mut().next_edge() {
                console::line(format_args!("{edge}"));
                edges.push((edge.motor.id(), edge.condition, edge.began));
            }
            if ms % 200 == 199 {
                let state = drives.each_ref().map(|drive| {
                    let Feedback { velocity_rad_per_s, position_rad, torque_nm } = drive.shaft;
                    let power = if drive.is_enabled { "on " } else { "off" };
                    let degrees = position_rad.to_degrees() % 360.0;
                    format!(
                        "{power} {velocity_rad_per_s:5.2} rad/s {degrees:6.1}° {torque_nm:6.3} Nm"
                    )
                });
                console::line(format_args!("{:>5} ms   {}", ms + 1, state.join("   ")));
            }
            let at =
                (drives[0].shaft.velocity_rad_per_s, drives[1].shaft.position_rad.to_degrees());
            if (ms == 790 || ms == 1_590) && ((at.0 - 6.0).abs() > 0.2 || (at.1 - 90.0).abs() > 1.0)
            {
                return Err(format!("{at:?} is not 6 rad/s and 90 degrees").into());
            }
        }
        if edges != [(2, Condition::Fault, true), (2, Condition::Fault, false)] {
            return Err(format!("one loss of supply was expected, not {edges:?}").into());
        }
        let half_a_count_nm = RANGES.torque_nm() / 4095.0;
        let rests = |drive: &Drive| {
            let Command { kp, kd, torque_nm, .. } = drive.command;
            !drive.is_enabled && kp + kd == 0.0 && torque_nm.abs() < 1.001 * half_a_count_nm
        };
        if drives.iter().all(rests) { Ok(()) } else { Err("a drive does not rest".into()) }
    }
}
