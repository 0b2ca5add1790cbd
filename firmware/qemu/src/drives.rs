//! Eight actuators of each other family, as a program drives them: with our speed loop, by torque or current.

use crate::constant_time::UP_TIMES;
use crate::meter::instructions;
use crate::report::row;
use crate::wiring::START;
use core::fmt::Debug;
use core::hint::black_box;
use drivetrain::control::PidConfig;
use drivetrain::encoder::GearRatio;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, Devices, DriveProtocol, ImpedanceControl, Ingest, VelocityDrive,
};
use drivetrain::sim::{
    self, DriveShaft, LkDrive, OdriveDrive, RmdDrive, RobStrideDrive, VescDrive,
};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use drivetrain::{lk, odrive, rmd, robstride, vesc};

const MOTORS: usize = 8;
const SPEED: AngularVelocity = AngularVelocity::from_rad_per_s(1.0);
const SPEED_LOOP: PidConfig = PidConfig::new(0.8, 4.0, 0.001);

/// A simulated drive.
trait Drive: sim::Drive {
    fn shaft(&self) -> &DriveShaft;
    /// Tells whether a frame is the feedback of the shaft.
    fn is_feedback(frame: &CanFrame) -> bool;
}

impl Drive for LkDrive {
    fn shaft(&self) -> &DriveShaft {
        self.shaft()
    }
    fn is_feedback(frame: &CanFrame) -> bool {
        frame.bytes()[0] == 0xA1
    }
}

impl Drive for RmdDrive {
    fn shaft(&self) -> &DriveShaft {
        self.shaft()
    }
    fn is_feedback(frame: &CanFrame) -> bool {
        frame.bytes()[0] == 0xA1
    }
}

impl Drive for RobStrideDrive {
    fn shaft(&self) -> &DriveShaft {
        self.shaft()
    }
    fn is_feedback(frame: &CanFrame) -> bool {
        frame.header() >> 24 & 0x1F == 2
    }
}

impl Drive for OdriveDrive {
    fn shaft(&self) -> &DriveShaft {
        self.shaft()
    }
    fn is_feedback(frame: &CanFrame) -> bool {
        frame.header() & 0x1F == 0x09
    }
}

/// A VESC and whether it has reported in this cycle.
struct Vesc(VescDrive, bool);

impl sim::Drive for Vesc {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        self.0.hear(frame)
    }
    fn step(&mut self, dt_s: f32) {
        self.0.step(dt_s);
        self.1 = false;
    }
    fn next_frame(&mut self) -> Option<CanFrame> {
        let is_due = !core::mem::replace(&mut self.1, true);
        self.0.report(9).filter(|_| is_due)
    }
}

impl Drive for Vesc {
    fn shaft(&self) -> &DriveShaft {
        self.0.shaft()
    }
    fn is_feedback(frame: &CanFrame) -> bool {
        frame.header() >> 8 & 0xFF == 9
    }
}

/// Eight driven motors, and the last frames of their drives.
struct Group<M, D> {
    motors: [Actuator<M>; MOTORS],
    drives: [D; MOTORS],
    feedback: [Option<CanFrame>; MOTORS],
    /// The last frame of each drive that is no feedback.
    others: [Option<CanFrame>; MOTORS],
    now: Instant,
}

impl<M: DriveProtocol + Debug, D: Drive> Group<M, D> {
    fn new(motors: [M; MOTORS], drives: [D; MOTORS], now: Instant) -> Self {
        let motors = motors.map(|motor| Actuator::new(motor).with_opening(Duration::ZERO));
        let (feedback, others) = ([None; MOTORS], [None; MOTORS]);
        let mut group = Self { motors, drives, feedback, others, now };
        for cycle in 0..1_200 {
            group.cycle();
            if cycle == 300 {
                group.motors.arm(group.now).unwrap();
            }
        }
        for drive in &group.drives {
            let speed = drive.shaft().velocity_rad_per_s();
            assert!((speed - 1.0).abs() < 0.2, "{speed} rad/s");
        }
        group
    }

    fn cycle(&mut self) {
        self.now = self.now + Duration::from_millis(1);
        for motor in &mut self.motors {
            _ = motor.set_velocity((), SPEED);
        }
        self.motors.update(Tick::new(self.now, 0.001));
        while let Some(frame) = self.motors.next_frame(0) {
            for index in 0..MOTORS {
                let answer = self.drives[index].hear(&frame);
                self.take(index, answer);
            }
        }
        for index in 0..MOTORS {
            self.drives[index].step(0.001);
            while let Some(frame) = self.drives[index].next_frame() {
                self.take(index, Some(frame));
            }
        }
    }

    fn take(&mut self, index: usize, frame: Option<CanFrame>) {
        let Some(frame) = frame else { return };
        assert_eq!(self.motors.ingest(&frame, self.now), Ingest::Taken);
        let place = if D::is_feedback(&frame) { &mut self.feedback } else { &mut self.others };
        place[index] = Some(frame);
    }
}

/// The whole tick: feedback in, loops, commands out.
#[inline(never)]
fn whole<M: DriveProtocol>(
    motors: &mut [Actuator<M>; MOTORS],
    feedback: &[CanFrame; MOTORS],
    tick: Tick,
) {
    for frame in feedback {
        _ = motors.ingest(frame, tick.now());
    }
    motors.update(tick);
    while let Some(frame) = motors.next_frame(0) {
        black_box(&frame);
    }
}

#[inline(never)]
fn ingest<M: DriveProtocol>(
    motors: &mut [Actuator<M>; MOTORS],
    feedback: &[CanFrame; MOTORS],
    now: Instant,
) {
    for frame in feedback {
        _ = motors.ingest(frame, now);
    }
}

#[inline(never)]
fn decode<M: DriveProtocol>(motor: &mut M, frame: &CanFrame) {
    assert!(motor.decode(frame) == Ingest::Taken);
}

/// Returns the instructions of a frame by the codec of its motor alone, without its route and the rules of an actuator.
pub fn decoding<M: DriveProtocol + Copy>(motor: &Actuator<M>, frame: &CanFrame) -> u32 {
    let mut motor = *motor.motor();
    instructions(decode as fn(&mut M, &CanFrame), |decode, _| decode(&mut motor, frame))
}

/// The names of a family's rows.
macro_rules! names {
    ($family:literal) => {
        [
            concat!($family, "_tick"),
            concat!($family, "_ingest"),
            concat!("constant_ingest_", $family),
            concat!($family, "_decode"),
        ]
    };
}

/// Prints the tick, and a frame of the feedback: of other ids after each up-time, too. Commands do not arrive here, so the drives repeat
/// their last frames; frames other than feedback come each 100 ms, and do not count.
fn measure<M: DriveProtocol + Copy + Debug, D: Drive>(
    names: [&str; 4],
    make: impl Fn([u8; MOTORS], Instant) -> Group<M, D>,
) {
    let function = ingest as fn(&mut [Actuator<M>; MOTORS], &[CanFrame; MOTORS], Instant);
    let mut frames = [0; UP_TIMES.len()];
    for (figure, (from, start)) in frames.iter_mut().zip((1..).zip(UP_TIMES)) {
        let Group { mut motors, feedback, now, .. } = make(ids(from), start);
        let feedback = feedback.map(Option::unwrap);
        let all = instructions(function, |ingest, _| ingest(&mut motors, &feedback, now));
        *figure = all / MOTORS as u32;
    }
    let Group { mut motors, feedback, others, mut now, .. } = make(ids(1), START);
    let feedback = feedback.map(Option::unwrap);
    let function = whole as fn(&mut [Actuator<M>; MOTORS], &[CanFrame; MOTORS], Tick);
    let figure = instructions(function, |whole, call| {
        now = now + Duration::from_millis(1);
        if call % 100 == 0 {
            for frame in others.iter().flatten() {
                _ = motors.ingest(frame, now);
            }
        }
        for motor in &mut motors {
            _ = motor.set_velocity((), SPEED);
        }
        whole(&mut motors, &feedback, Tick::new(now, 0.001));
    });
    assert!(motors.iter().all(|motor| motor.guard().has_target()));
    row(names[0], &[figure]);
    row(names[1], &frames[..1]);
    row(names[2], &frames);
    row(names[3], &[decoding(&motors[0], &feedback[0])]);
}

fn ids(from: u8) -> [u8; MOTORS] {
    core::array::from_fn(|index| black_box(index as u8 + from))
}

/// 3 Nm at most.
fn torque() -> ImpedanceControl {
    let mode = ImpedanceControl::new(3.0).unwrap();
    mode.with_loops(PidConfig::new(10.0, 0.0, 0.0), SPEED_LOOP).unwrap()
}

pub fn rows() {
    let model = lk::Model::MF9025_16T;
    measure(names!("lk"), |ids, start| {
        let motors = ids.map(|id| lk::Motor::new(model, id, torque()).unwrap());
        let drives = ids.map(|id| LkDrive::of(model, id));
        Group::new(motors, drives, start)
    });

    let model = rmd::Model::X8_120;
    measure(names!("rmd"), |ids, start| {
        let motors = ids.map(|id| rmd::Motor::new(model, id, torque()).unwrap());
        let drives = ids.map(|id| RmdDrive::new(id, model.torque_constant()));
        Group::new(motors, drives, start)
    });

    let model = robstride::Model::RS02;
    measure(names!("robstride"), |ids, start| {
        let motors = ids.map(|id| robstride::Motor::new(model, id, torque()).unwrap());
        let drives = ids.map(|id| RobStrideDrive::of(model, id));
        Group::new(motors, drives, start)
    });

    let (model, firmware) = (odrive::Model::D6374, odrive::Firmware::V0_6);
    let fastest = AngularVelocity::from_rad_per_s(20.0);
    measure(names!("odrive"), |ids, start| {
        let motors =
            ids.map(|id| odrive::Motor::new(model, firmware, id, fastest, torque()).unwrap());
        let drives = ids.map(|id| {
            OdriveDrive::new(id, true, model.torque_constant(), 1.0).with_periods(0.1, 0.001)
        });
        Group::new(motors, drives, start)
    });

    let model = vesc::Model {
        name: "hub",
        pole_pairs: 15,
        gear: GearRatio::DIRECT,
        torque_constant_nm_per_a: 0.5,
        current_limit_a: 20.0,
        max_velocity: AngularVelocity::from_rpm(500.0),
    };
    let motor = vesc::Model {
        current_limit_a: 40.0,
        max_velocity: AngularVelocity::from_rad_per_s(60.0),
        ..model
    };
    let mode = vesc::Mode::current_with_speed_loop(SPEED_LOOP).unwrap();
    measure(names!("vesc"), |ids, start| {
        let motors = ids.map(|id| vesc::Motor::new(model, id, mode).unwrap());
        let drives = ids.map(|id| Vesc(VescDrive::of(motor, id), false));
        Group::new(motors, drives, start)
    });
}
