//! Any frame, any time, any call, any trouble of the drive: an own motor of each family keeps its drive at rest unless it is armed
//! and has a target. The judge is the simulated drive, which hears each frame.
#![no_main]

use drivetrain::damiao;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    AngleDrive, CanDevice, Devices, Impedance, ImpedanceControl, Ingest, Own, OwnMotor, Role,
    VelocityDrive,
};
use drivetrain::sim::DamiaoDrive;
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain_fuzz::{Clock, Input};
use embedded_can::{ExtendedId, Frame, StandardId};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut input = Input(data);
    let mode = ImpedanceControl::new(3.0).unwrap();
    let gains = mode.with_gains(20.0, 0.6).unwrap();
    let limit = AngularVelocity::from_rad_per_s(8.0);
    match input.byte() % 4 {
        0 => run(damiao_motor(mode), damiao_drive(1.0), &mut input),
        1 => run(damiao_motor(gains), damiao_drive(1.0), &mut input),
        2 => run(damiao_motor(damiao::PositionVelocity::new(limit)), damiao_drive(2.0), &mut input),
        _ => run(damiao_motor(damiao::Velocity::new(limit)), damiao_drive(3.0), &mut input),
    }
});

/// A simulated drive.
trait Drive {
    /// The largest torque at rest: half a count of its command.
    const REST_NM: f32;

    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame>;
    fn step(&mut self, dt_s: f32);
    fn torque_nm(&self) -> f32;
    /// Makes trouble of some kind.
    fn suffer(&mut self, kind: u8);
}

impl Drive for DamiaoDrive {
    const REST_NM: f32 = 10.0 / 4095.0;

    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        Self::hear(self, frame)
    }
    fn step(&mut self, dt_s: f32) {
        Self::step(self, dt_s);
    }
    fn torque_nm(&self) -> f32 {
        self.shaft().torque_nm()
    }
    fn suffer(&mut self, kind: u8) {
        match kind % 3 {
            0 => self.fail(8 + kind % 7),
            1 => self.lose_supply(),
            _ => self.shaft_mut().set_load(f32::from(kind) * 0.01 - 1.0),
        }
    }
}

fn damiao_motor<M: damiao::Mode>(mode: M) -> damiao::Motor<M> {
    damiao::Motor::new(damiao::Model::J4310, 1, mode).unwrap()
}

fn damiao_drive(mode: f32) -> DamiaoDrive {
    DamiaoDrive::new(1, 0x11, [12.5, 30.0, 10.0]).with_register(10, mode)
}

/// A motor, its drive, and what the drive answered.
struct Bench<M, D> {
    own: Own<M>,
    drive: D,
    answers: Vec<CanFrame>,
}

fn run<M: OwnMotor, D: Drive>(motor: M, drive: D, input: &mut Input) {
    let mut bench = Bench { own: Own::new(motor), drive, answers: Vec::new() };
    let mut clock = Clock::new(1_000);
    let mut now = Instant::from_micros(clock.read());
    let mut left_ms = 2_000;
    while !input.is_empty() {
        match input.byte() {
            0..=59 => {
                now = Instant::from_micros(clock.pass(input));
                if let Some(frame) = frame_for(&bench.own, input) {
                    bench.ingest(&frame, now);
                }
            }
            60..=99 => bench.set(input.byte(), input.float()),
            100..=119 => _ = Devices::arm(&mut bench.own, now),
            120..=124 => Devices::disarm(&mut bench.own),
            125..=127 => Devices::trip(&mut bench.own),
            128..=131 => Devices::emergency_stop(&mut bench.own),
            132..=137 => Devices::clear_emergency_stop(&mut bench.own),
            138..=141 => while Devices::next_edge(&mut bench.own).is_some() {},
            142..=151 => bench.drive.suffer(input.byte()),
            152..=199 => {
                let (how, kind, value, length) = (
                    input.byte(),
                    input.byte(),
                    input.float(),
                    u32::from(input.byte()).min(left_ms),
                );
                left_ms -= length;
                for _ in 0..length {
                    now = Instant::from_micros(clock.go_well());
                    if how & 1 == 0 {
                        bench.hear(now);
                    }
                    if how & 2 == 0 {
                        bench.set(kind, value);
                    }
                    bench.update(Tick::new(now, 0.001), 0);
                    if how & 0xFC == 0 {
                        _ = Devices::arm(&mut bench.own, now);
                    }
                }
            }
            200..=219 => bench.hear(now),
            _ => {
                now = Instant::from_micros(clock.pass(input));
                let refused = input.byte();
                bench.update(Tick::new(now, input.step_s()), refused);
            }
        }
    }
}

/// A frame with an id of the motor as a rule, of any content and length.
fn frame_for<M: OwnMotor>(own: &Own<M>, input: &mut Input) -> Option<CanFrame> {
    let (form, length, place) = (input.byte(), usize::from(input.byte() % 9), input.byte());
    let data: [u8; 8] = input.bytes();
    let data = data.get(..if form < 192 { 8 } else { length })?;
    let claims: Vec<_> = CanDevice::claims(own).collect();
    let claim = claims.get(usize::from(place) % claims.len())?;
    match form % 8 {
        0 => CanFrame::new(StandardId::new(u16::from_be_bytes([place & 7, form]))?, data),
        1 => CanFrame::new(
            ExtendedId::new(u32::from_be_bytes([place & 0x1F, form, 0, place]))?,
            data,
        ),
        2 => CanFrame::new_remote(claim.id(), data.len()),
        _ => CanFrame::new(claim.id(), data),
    }
}

impl<M: OwnMotor, D: Drive> Bench<M, D> {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) {
        let before = format!("{:?}", self.own.motor().vitals());
        if Devices::ingest(&mut self.own, frame, now) != Ingest::Taken {
            assert_eq!(before, format!("{:?}", self.own.motor().vitals()), "refused: {frame:?}");
        }
    }

    /// The answers of the drive arrive.
    fn hear(&mut self, now: Instant) {
        for answer in std::mem::take(&mut self.answers) {
            self.ingest(&answer, now);
        }
    }

    fn set(&mut self, kind: u8, value: f32) {
        let angle = Angle::from_radians(value);
        let is_taken = match kind % 4 {
            0 => self.own.set_torque(value).is_ok(),
            1 => self.own.set_velocity((), AngularVelocity::from_rad_per_s(value)).is_ok(),
            2 => self.own.set_angle((), angle).is_ok(),
            _ => {
                let (stiffness, damping) = (f32::from(kind), f32::from(kind) * 0.02);
                self.own
                    .set_impedance(Impedance { angle, stiffness, damping, ..Impedance::FREE })
                    .is_ok()
            }
        };
        assert!(!is_taken || (value.is_finite() && self.own.is_armed()), "{value} was taken");
    }

    /// Runs an update. The driver gives the frames of which `refused` has a bit back, but not those of a motor at rest.
    fn update(&mut self, tick: Tick, refused: u8) {
        Devices::update(&mut self.own, tick);
        let is_driven = self.own.is_armed() && self.own.guard().has_target();
        for turn in 0..4 {
            let Some(frame) = Devices::next_frame(&mut self.own, turn) else { break };
            assert!(turn < 2, "more than two frames in an update: {frame:?}");
            let is_claimed = CanDevice::claims(&self.own)
                .any(|claim| claim.role() == Role::Command && claim.covers(frame.id()));
            assert!(is_claimed, "{frame:?}");
            if is_driven && refused & 1 << turn != 0 {
                assert!(Devices::requeue(&mut self.own, &frame));
                continue;
            }
            self.answers.extend(self.drive.hear(&frame));
        }
        self.drive.step(1e-5);
        let torque_nm = self.drive.torque_nm();
        assert!(is_driven || torque_nm.abs() <= D::REST_NM, "{torque_nm} Nm at rest");
        self.drive.step(0.00099);
    }
}
