//! Eight joints of Damiao in MIT mode, as a program drives them: each an actuator with our speed loop.

use crate::constant_time::UP_TIMES;
use crate::drives;
use crate::meter::instructions;
use crate::report::row;
use crate::wiring::START;
use core::hint::black_box;
use drivetrain::control::{Pid, PidConfig};
use drivetrain::damiao::{Model, Motor};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Impedance;
use drivetrain::motor::{Actuator, Devices, ImpedanceControl, Ingest, VelocityDrive};
use drivetrain::sim::{DamiaoDrive, Drive};
use drivetrain::time::{Duration, Instant, Tick, TimeStep};
use drivetrain::units::AngularVelocity;
use drivetrain::wire::mit::{self, Ranges};
use embedded_can::{Frame, Id};

const MOTORS: usize = 8;

type Joints = [Actuator<Motor>; MOTORS];

struct Arm {
    joints: Joints,
    drives: [DamiaoDrive; MOTORS],
    answers: [Option<CanFrame>; MOTORS],
    now: Instant,
}

impl Arm {
    /// Makes eight joints that are driven. Their drives have one master id, or each its own.
    fn new(is_shared: bool, is_armed: bool, from: u8, now: Instant) -> Self {
        let ids: [u8; MOTORS] = core::array::from_fn(|index| index as u8 + from);
        let master_id = |id: u8| if is_shared { 0x7E } else { 0x10 + u16::from(id) };
        let mode = ImpedanceControl::new(3.0).unwrap();
        let mode = mode.with_loops(PidConfig::new(10.0, 0.0, 0.0), PidConfig::new(0.8, 4.0, 0.001));
        let mode = mode.unwrap();
        let joints = ids.map(|id| {
            let motor = Motor::new(Model::J4310, black_box(id), mode).unwrap();
            Actuator::new(motor.with_master_id(master_id(id)).unwrap()).with_opening(Duration::ZERO)
        });
        let drives = ids
            .map(|id| DamiaoDrive::of(Model::J4310, id).with_register(7, f32::from(master_id(id))));
        let mut arm = Self { joints, drives, answers: [None; MOTORS], now };
        for cycle in 0..300 {
            arm.cycle();
            if is_armed && cycle == 100 {
                arm.joints.arm(arm.now).unwrap();
            }
        }
        assert!(arm.drives.iter().all(|drive| drive.is_enabled() == is_armed));
        arm
    }

    fn ask(&mut self) {
        for joint in &mut self.joints {
            _ = joint.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
        }
    }

    fn cycle(&mut self) {
        self.pass();
        for frame in self.answers.iter().flatten() {
            assert_eq!(self.joints.ingest(frame, self.now), Ingest::Taken);
        }
        self.joints.update(Tick::new(self.now, 0.001));
        self.send();
    }

    /// Lets a period pass, with new targets.
    fn pass(&mut self) {
        self.now = self.now + Duration::from_millis(1);
        self.ask();
    }

    /// Has the drives take the commands, move and answer.
    fn send(&mut self) {
        self.answers = [None; MOTORS];
        while let Some(frame) = self.joints.next_frame(0) {
            self.hear(&frame);
        }
        for drive in &mut self.drives {
            drive.step(0.001);
        }
    }

    fn hear(&mut self, frame: &CanFrame) {
        for (drive, place) in self.drives.iter_mut().zip(&mut self.answers) {
            *place = drive.hear(frame).or(*place);
        }
    }
}

/// The whole tick: feedback in, loops, commands out.
#[unsafe(no_mangle)]
#[inline(never)]
fn joints_tick(joints: &mut Joints, answers: &[CanFrame; MOTORS], tick: Tick) {
    for answer in answers {
        _ = joints.ingest(answer, tick.now());
    }
    joints.update(tick);
    while let Some(frame) = joints.next_frame(0) {
        black_box(&frame);
    }
}

#[unsafe(no_mangle)]
#[inline(never)]
fn joints_ingest(joints: &mut Joints, answers: &[CanFrame; MOTORS], now: Instant) {
    for answer in answers {
        _ = joints.ingest(answer, now);
    }
}

#[unsafe(no_mangle)]
#[inline(never)]
fn joints_ingest_alone(joint: &mut Actuator<Motor>, answer: &CanFrame, now: Instant) {
    _ = Devices::ingest(joint, answer, now);
}

/// A joint without link, arming, ages, health or power: what the rules of a motor cost is the difference.
pub struct Bare {
    measured: mit::Feedback,
    speed: Pid,
}

/// The same work without a rule: feedback in by the place of its id, the plain speed loop, a torque out.
#[unsafe(no_mangle)]
#[inline(never)]
fn joints_bare(
    joints: &mut [Bare; MOTORS],
    answers: &[CanFrame; MOTORS],
    ranges: &Ranges,
    dt_s: f32,
) {
    for answer in answers {
        let (Id::Standard(id), &[head, a, b, c, d, e, ..]) = (answer.id(), answer.data()) else {
            continue;
        };
        let place = usize::from(id.as_raw()).wrapping_sub(0x11);
        let Some(joint) = joints.get_mut(place) else { continue };
        if usize::from(head & 0xF) == place + 1 {
            joint.measured = ranges.decode_feedback(&[a, b, c, d, e]);
        }
    }
    let step = TimeStep::of(dt_s);
    for (id, joint) in (1..).zip(joints) {
        let torque_nm = joint.speed.step(1.0, joint.measured.velocity_rad_per_s, &step);
        let data = ranges.encode(&Impedance::torque(torque_nm));
        black_box(&CanFrame::standard(id, data));
    }
}

fn bare() -> u32 {
    let answers = Arm::new(false, true, 1, START).answers.map(Option::unwrap);
    let speed = PidConfig::new(0.8, 4.0, 0.001).with_output_limit(3.0);
    let mut joints = [(); MOTORS]
        .map(|()| Bare { measured: mit::Feedback::default(), speed: Pid::new(speed).unwrap() });
    let ranges = Ranges::new(12.5, 30.0, 10.0).unwrap();
    let function = joints_bare as fn(&mut [Bare; MOTORS], &[CanFrame; MOTORS], &Ranges, f32);
    let figure = instructions(function, |tick, _| tick(&mut joints, &answers, &ranges, 0.001));
    assert!(joints.iter().all(|joint| joint.speed.output() != 0.0));
    figure
}

/// Commands do not arrive here, so the drives answer with what they had: the targets are the same in each cycle.
fn tick(is_shared: bool, is_armed: bool) -> u32 {
    let Arm { mut joints, answers, now, .. } = Arm::new(is_shared, is_armed, 1, START);
    let answers = answers.map(Option::unwrap);
    let mut now = now;
    instructions(joints_tick as fn(&mut Joints, &[CanFrame; MOTORS], Tick), |tick, _| {
        now = now + Duration::from_millis(1);
        for joint in &mut joints {
            _ = joint.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
        }
        tick(&mut joints, &answers, Tick::new(now, 0.001));
    })
}

fn ingest(is_shared: bool, from: u8, start: Instant) -> u32 {
    let Arm { mut joints, answers, now, .. } = Arm::new(is_shared, true, from, start);
    let answers = answers.map(Option::unwrap);
    let function = joints_ingest as fn(&mut Joints, &[CanFrame; MOTORS], Instant);
    let whole = instructions(function, |ingest, _| ingest(&mut joints, &answers, now));
    whole / MOTORS as u32
}

fn ingest_alone() -> u32 {
    let Arm { mut joints, answers, now, .. } = Arm::new(false, true, 1, START);
    let ([joint, ..], [Some(answer), ..]) = (&mut joints, answers) else { return u32::MAX };
    let function = joints_ingest_alone as fn(&mut Actuator<Motor>, &CanFrame, Instant);
    instructions(function, |ingest, _| ingest(joint, &answer, now))
}

fn decode() -> u32 {
    let Arm { joints, answers, .. } = Arm::new(false, true, 1, START);
    let ([joint, ..], [Some(answer), ..]) = (joints, answers) else { return u32::MAX };
    drives::decoding(&joint, &answer)
}

pub fn rows() {
    row("joints_tick", &[tick(false, true)]);
    row("joints_bare", &[bare()]);
    row("joints_tick_shared", &[tick(true, true)]);
    row("joints_disarmed", &[tick(false, false)]);
    row("joints_ingest", &[ingest(false, 1, START)]);
    row("joints_ingest_alone", &[ingest_alone()]);
    row("joints_decode", &[decode()]);
    row("joints_ingest_shared", &[ingest(true, 1, START)]);
    let mut frames = [0; UP_TIMES.len()];
    for (figure, (from, start)) in frames.iter_mut().zip((1..).zip(UP_TIMES)) {
        *figure = ingest(false, from, start);
    }
    row("constant_ingest_damiao", &frames);
}
