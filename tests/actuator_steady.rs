//! An actuator that goes on as before, beside one that applies all of its rules each time: whatever happens, both do the same.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::encoder::GearRatio;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, Devices, DriveProtocol, HealthConfig, ImpedanceControl, Timeouts,
    VelocityDrive,
};
use drivetrain::sim::{
    DamiaoDrive, Drive, LkDrive, OdriveDrive, RmdDrive, RobStrideDrive, VescDrive,
};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::{damiao, lk, odrive, rmd, robstride, vesc};
use std::collections::VecDeque;
use std::fmt::Debug;

static FREE: HealthConfig = HealthConfig::new().with_temperatures(60, 80);
static LIMITED: HealthConfig =
    FREE.with_soft_limits(Angle::from_degrees(-90.0), Angle::from_degrees(90.0));

struct Random(u32);

impl Random {
    fn below(&mut self, limit: u32) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 16) % limit
    }

    /// True once in so many.
    fn once_in(&mut self, many: u32) -> bool {
        self.below(many) == 0
    }
}

/// Two actuators of one drive; the second forgets before each call that nothing is due.
struct Twins<M, D> {
    one: Actuator<M>,
    other: Actuator<M>,
    timeouts: Timeouts,
    health: &'static HealthConfig,
    drive: D,
    answers: VecDeque<CanFrame>,
    now: u64,
    random: Random,
    driven: u32,
}

impl<M: DriveProtocol + Copy + Debug, D: Drive> Twins<M, D> {
    fn new(motor: M, drive: D, timeouts: Timeouts, seed: u32) -> Self {
        let health = if seed.is_multiple_of(3) { &LIMITED } else { &FREE };
        let one = Actuator::new(motor).with_timeouts(timeouts).with_health(health).unwrap();
        let (answers, random) = (VecDeque::new(), Random(seed));
        Self {
            one,
            other: one,
            timeouts,
            health,
            drive,
            answers,
            now: 5_000_000,
            random,
            driven: 0,
        }
    }

    fn both<T: PartialEq + Debug>(&mut self, call: impl Fn(&mut Actuator<M>) -> T) -> T {
        self.other = self.other.with_timeouts(self.timeouts).with_health(self.health).unwrap();
        let (one, other) = (call(&mut self.one), call(&mut self.other));
        assert_eq!(one, other, "at {} us", self.now);
        one
    }

    fn at(&self) -> Instant {
        Instant::from_micros(self.now)
    }

    fn hear(&mut self) {
        let calls = self.random.below(4);
        let back_us = if self.random.once_in(50) { u64::from(self.random.below(2_000)) } else { 0 };
        for _ in 0..calls {
            let Some(frame) = self.answers.pop_front() else { break };
            if self.random.once_in(200) {
                continue; // lost
            }
            let at = Instant::from_micros(self.now - back_us);
            _ = self.both(|motor| motor.ingest(&frame, at));
        }
    }

    fn ask(&mut self) {
        let (kind, value) = (self.random.below(40), self.random.below(20) as f32 * 0.1 - 1.0);
        _ = self.both(|motor| match kind {
            0 => motor.set_torque(value),
            1 => motor.set_angle((), Angle::from_radians(value)),
            2 => motor.set_velocity((), AngularVelocity::from_rad_per_s(f32::NAN)),
            3..6 => Ok(()),
            _ => motor.set_velocity((), AngularVelocity::from_rad_per_s(value)),
        });
    }

    fn interfere(&mut self) {
        let at = self.at();
        match self.random.below(12) {
            0 => self.both(|motor| motor.disarm()),
            1 => self.both(|motor| motor.trip()),
            2 => self.both(|motor| motor.emergency_stop()),
            3 => self.both(|motor| motor.clear_emergency_stop()),
            4 => self.now += u64::from(self.random.below(30_000)),
            5 => self.now -= u64::from(self.random.below(3_000)),
            6 => self.answers.clear(),
            7 => _ = self.both(|motor| motor.set_present_angle(Angle::from_radians(0.3))),
            8 => self.both(|motor| motor.forget_zero()),
            9 => {
                let frame = self.one.claims().next().map(|claim| CanFrame::of(claim.id(), [0; 8]));
                frame.map(|frame| self.both(|motor| motor.ingest(&frame, at)));
            }
            _ => {}
        }
        _ = self.both(|motor| motor.arm(at));
    }

    fn update(&mut self) {
        let dt_s = if self.random.once_in(300) { 0.0 } else { 0.001 };
        let tick = Tick::new(self.at(), dt_s);
        self.both(|motor| motor.update(tick));
        while let Some(frame) = self.both(|motor| motor.next_frame(0)) {
            match self.random.below(400) {
                0 => _ = self.both(|motor| motor.requeue(&frame)),
                1 => {
                    _ = self.both(|motor| motor.put_back(&frame));
                    break;
                }
                _ => self.answers.extend(self.drive.hear(&frame)),
            }
        }
        self.drive.step(0.001);
        self.answers.extend(std::iter::from_fn(|| self.drive.next_frame()));
        self.driven += u32::from(self.one.guard().has_target());
        while self.both(|motor| motor.next_edge()).is_some() {}
        if self.random.once_in(20) {
            self.both(|motor| format!("{} {:?}", motor.health(), motor.velocity(())));
            self.both(|motor| (motor.superseded(), motor.angle(())));
        }
    }

    /// Returns the share of updates with a target.
    fn run(mut self, updates: u32) -> f32 {
        for update in 0..updates {
            self.now += 1_000 + u64::from(self.random.below(100));
            self.hear();
            self.ask();
            if self.random.once_in(500) {
                self.interfere();
            } else if update % 400 == 399 {
                let at = self.at();
                self.both(|motor| motor.clear_emergency_stop());
                _ = self.both(|motor| motor.arm(at));
            }
            self.update();
        }
        self.driven as f32 / updates as f32
    }
}

fn control() -> ImpedanceControl {
    let control = ImpedanceControl::new(3.0).unwrap();
    control.with_loops(PidConfig::new(10.0, 0.0, 0.0), PidConfig::new(0.8, 4.0, 0.001)).unwrap()
}

/// Runs some seeds; the motor is driven in a good part of the updates.
fn compare<M: DriveProtocol + Copy + Debug, D: Drive>(make: impl Fn() -> (M, D)) {
    let polled = Timeouts::new()
        .with_feedback(Duration::from_millis(40), Duration::from_millis(400))
        .unwrap();
    let mut driven = 0.0;
    for seed in 0..40_u32 {
        let timeouts = if seed.is_multiple_of(2) { Timeouts::new() } else { polled };
        let (motor, drive) = make();
        driven += Twins::new(motor, drive, timeouts, seed * 977 + 1).run(5_000) / 40.0;
    }
    assert!(driven > 0.2, "{driven}");
}

#[test]
fn damiao() {
    let model = damiao::Model::J4310;
    compare(|| (damiao::Motor::new(model, 1, control()).unwrap(), DamiaoDrive::of(model, 1)));
}

#[test]
fn robstride() {
    let model = robstride::Model::RS02;
    compare(|| (robstride::Motor::new(model, 1, control()).unwrap(), RobStrideDrive::of(model, 1)));
}

#[test]
fn lk() {
    let model = lk::Model::MF9025_16T;
    compare(|| (lk::Motor::new(model, 1, control()).unwrap(), LkDrive::of(model, 1)));
}

#[test]
fn rmd() {
    let model = rmd::Model::X8_120;
    compare(|| {
        let drive = RmdDrive::new(1, model.torque_constant());
        (rmd::Motor::new(model, 1, control()).unwrap(), drive)
    });
}

#[test]
fn odrive() {
    let (model, firmware) = (odrive::Model::D6374, odrive::Firmware::V0_6);
    let fastest = AngularVelocity::from_rad_per_s(20.0);
    compare(|| {
        let drive = OdriveDrive::new(1, true, model.torque_constant(), 1.0);
        let motor = odrive::Motor::new(model, firmware, 1, fastest, control()).unwrap();
        (motor, drive.with_periods(0.1, 0.001))
    });
}

/// A VESC and whether it has reported in this cycle.
struct Reporting(VescDrive, bool);

impl Drive for Reporting {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        self.0.hear(frame)
    }

    fn step(&mut self, dt_s: f32) {
        self.0.step(dt_s);
        self.1 = false;
    }

    fn next_frame(&mut self) -> Option<CanFrame> {
        let is_due = !std::mem::replace(&mut self.1, true);
        self.0.report(9).filter(|_| is_due)
    }
}

#[test]
fn vesc() {
    let model = vesc::Model {
        name: "hub",
        pole_pairs: 15,
        gear: GearRatio::DIRECT,
        torque_constant_nm_per_a: 0.5,
        current_limit_a: 20.0,
        max_velocity: AngularVelocity::from_rpm(500.0),
    };
    let mode = vesc::Mode::current_with_speed_loop(PidConfig::new(0.8, 4.0, 0.001)).unwrap();
    compare(|| {
        let drive = Reporting(VescDrive::of(model, 1), false);
        (vesc::Motor::new(model, 1, mode).unwrap(), drive)
    });
}
