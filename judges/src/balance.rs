//! The program of a robot that balances, for `judges/balance.py`: two M3508 as wheels, four DM-J8009P as joints of two legs, a HiPNUC IMU.
//!
//! ```text
//! drivetrain-judges balance       a line in each millisecond, a line out:
//!   TIME_US [i:HEX] [BUS:ID#HEX]... [start] [stop] [motion=M_S,RAD_S] [length=M]
//!   PHASE SLIPS [BUS:ID#HEX]...
//! ```
//! Buses: 0 the wheels (left 1, right 2, whose motor is mirrored), 1 and 2 the legs, left and right (front 1, rear 2). `i:` bytes of the
//! IMU. Phases: 0 fallen, 1 rising, 2 standing, 3 airborne. The controller knows the nominal robot alone.

use crate::Outcome;
use crate::defect::defects;
use drivetrain::chassis::{BalanceModel, BalancePhase, Balancer, FiveBar, LegEffort, LegState};
use drivetrain::damiao::{Model, Motor};
use drivetrain::dji::{self, Bus, Handle, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::geometry::AttitudeSource;
use drivetrain::motor::{Actuator, Devices, ImpedanceControl};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity, Current};
use drivetrain::wire::Receiver;
use drivetrain::wire::hipnuc::{Imu, MAX_FRAME};
use embedded_can::{Frame, Id, StandardId};
use std::fmt::Write as _;
use std::io::{BufRead, Write};

const DT_S: f32 = 0.001;
const MODEL: BalanceModel = BalanceModel {
    wheel_radius_m: 0.075,
    wheel_kg: 0.8,
    wheel_kg_m2: 0.0045,
    leg_kg: 1.1,
    leg_kg_m2: 0.012,
    leg_centre: 0.6,
    body_kg: 14.0,
    body_kg_m2: 0.25,
    body_height_m: 0.03,
};
/// Least and largest length of a leg, in m.
const LENGTHS_M: [f32; 2] = [0.14, 0.36];
/// Of both wheels and of both legs, in Nm.
const LIMIT_NM: [f32; 2] = [10.0, 50.0];
const JOINT_NM: f32 = 40.0;
/// Nm for 1 A at the output shaft of an M3508.
const NM_PER_A: f32 = 0.3;
/// The time after arming in which a guard opens its outputs.
const OPENING: u32 = 250;

defects! {
    /// A fall disarms the motors after 50 ms.
    Late = "late",
    /// The wheels drive the wrong way.
    Reversed = "reversed",
}

type Leg = [Actuator<Motor>; 2];

struct Robot {
    wheels: Bus,
    handles: [Handle<M3508>; 2],
    legs: [Leg; 2],
    bars: FiveBar,
    imu: Receiver<Imu, MAX_FRAME>,
    balancer: Balancer,
    /// The pilot wants it to stand.
    is_wanted: bool,
    /// Ticks since arming.
    armed: Option<u32>,
    defect: Defect,
    /// Ticks since a fall that the defect has not noticed.
    late: u32,
}

fn leg() -> Outcome<Leg> {
    let joint = |id| -> Outcome<_> {
        let mode = ImpedanceControl::new(JOINT_NM)?;
        Ok(Actuator::new(Motor::new(Model::J8009, id, mode)?))
    };
    Ok([joint(1)?, joint(2)?])
}

impl Robot {
    fn new() -> Outcome<Self> {
        let mut wheels = Bus::new();
        let left = wheels.attach(dji::Config::<M3508>::new(1))?;
        let right = wheels.attach(dji::Config::<M3508>::new(2).reversed())?;
        Ok(Self {
            wheels,
            handles: [left, right],
            legs: [leg()?, leg()?],
            bars: FiveBar::new(0.075, 0.15, 0.27)?,
            imu: Receiver::new(Duration::from_millis(15)),
            balancer: Balancer::new(&MODEL, LENGTHS_M, LIMIT_NM, DT_S)?,
            is_wanted: false,
            armed: None,
            defect: Defect::None,
            late: 0,
        })
    }

    fn hear(&mut self, word: &str, now: Instant) -> Outcome<()> {
        match word.split_once([':', '=']) {
            None if word == "start" => self.is_wanted = true,
            None if word == "stop" => self.is_wanted = false,
            Some(("motion", values)) => {
                let (velocity, yaw) = values.split_once(',').ok_or("one number")?;
                self.balancer.set_motion(velocity.parse()?, yaw.parse()?);
            }
            Some(("length", value)) => self.balancer.set_length(value.parse()?),
            Some(("i", digits)) => {
                let bytes = bytes(digits)?;
                let mut rest = bytes.as_slice();
                while self.imu.read(&mut rest, now).is_some() {}
            }
            Some((bus, text)) => {
                let frame = frame(text)?;
                _ = match bus {
                    "0" => self.wheels.ingest(&frame, now),
                    "1" => self.legs[0].ingest(&frame, now),
                    "2" => self.legs[1].ingest(&frame, now),
                    _ => return Err(format!("no bus {bus}").into()),
                };
            }
            None => return Err(format!("no word {word}").into()),
        }
        Ok(())
    }

    fn legs(&self) -> Option<[LegState; 2]> {
        let state = |leg: &Leg| {
            let [front, rear] = leg.each_ref().map(|joint| joint.motor().feedback());
            let (front, rear) = (front?.measured, rear?.measured);
            self.bars.state(
                [front.position_rad, rear.position_rad].map(Angle::from_radians),
                [front.velocity_rad_per_s, rear.velocity_rad_per_s]
                    .map(AngularVelocity::from_rad_per_s),
                [front.torque_nm, rear.torque_nm],
            )
        };
        let [left, right] = &self.legs;
        Some([state(left)?, state(right)?])
    }

    fn arm(&mut self, now: Instant) -> bool {
        let [left, right] = &mut self.legs;
        // Each says why it does not, and is asked again: a few ms of questions to the drives come first.
        let legs = [left.arm(now), right.arm(now)];
        self.wheels.arm(now).is_ok() && legs.iter().all(Result::is_ok)
    }

    fn is_armed(&mut self) -> bool {
        self.wheels.is_armed() && self.legs.iter_mut().all(|leg| leg.is_armed())
    }

    fn disarm(&mut self) {
        self.wheels.disarm();
        self.legs.iter_mut().for_each(|leg| leg.disarm());
        (self.is_wanted, self.armed) = (false, None);
        self.balancer.stop();
    }

    fn step(&mut self, tick: Tick) {
        let now = tick.now();
        let is_armed = self.is_armed();
        match self.armed {
            None => {
                if self.is_wanted && self.arm(now) {
                    self.armed = Some(0);
                }
            }
            Some(_) if !self.is_wanted || !is_armed => self.disarm(),
            Some(ticks) => {
                self.armed = Some(ticks.saturating_add(1));
                if ticks == OPENING {
                    self.balancer.start();
                }
            }
        }
        let wheels = self.handles.map(|wheel| self.wheels.state(wheel).map(|it| it.velocity));
        let rates = wheels.map(|rate| rate.unwrap_or(AngularVelocity::from_rad_per_s(f32::NAN)));
        let (attitude, legs) = (self.imu.attitude(now), self.legs());
        let efforts = self.balancer.update(attitude.as_ref(), legs, rates);
        let is_opening = self.armed.is_some_and(|ticks| ticks <= OPENING);
        match (efforts, legs) {
            (Some(efforts), Some(legs)) => self.drive(&efforts, &legs),
            (None, Some(legs)) if is_opening => self.drive(&[LegEffort::default(); 2], &legs),
            _ if self.armed.is_some() && self.is_noticed() => self.disarm(),
            _ => {}
        }
        self.wheels.update(tick);
        self.legs.iter_mut().for_each(|leg| leg.update(tick));
    }

    fn is_noticed(&mut self) -> bool {
        self.late += 1;
        self.defect != Defect::Late || self.late > 50
    }

    fn drive(&mut self, efforts: &[LegEffort; 2], states: &[LegState; 2]) {
        for (((wheel, leg), effort), state) in
            self.handles.iter().zip(&mut self.legs).zip(efforts).zip(states)
        {
            let sign = if self.defect == Defect::Reversed { -1.0 } else { 1.0 };
            let current = Current::from_amperes(sign * effort.wheel_nm / NM_PER_A);
            // A refusal is a motor that is not armed: the next tick sees that.
            _ = self.wheels.set_current(*wheel, current);
            for (joint, torque_nm) in leg.iter_mut().zip(state.torques(effort)) {
                _ = joint.set_torque(torque_nm.clamp(-JOINT_NM, JOINT_NM));
            }
        }
    }
}

pub fn run(arguments: &[&str], input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let mut robot = Robot::new()?;
    let ([], defect) = Defect::split(arguments)? else {
        return Err("see the head of judges/src/balance.rs for the arguments".into());
    };
    robot.defect = defect;
    let mut answer = String::new();
    for line in input.lines() {
        let line = line?;
        let mut words = line.split_whitespace();
        let now = Instant::from_micros(words.next().ok_or("an empty line")?.parse()?);
        for word in words {
            robot.hear(word, now)?;
        }
        robot.step(Tick::new(now, DT_S));
        answer.clear();
        let phase = match robot.balancer.phase() {
            BalancePhase::Fallen => 0,
            BalancePhase::Rising => 1,
            BalancePhase::Standing => 2,
            BalancePhase::Airborne => 3,
        };
        write!(answer, "{phase} {}", u8::from(robot.balancer.is_slipping()))?;
        while let Some(frame) = robot.wheels.next_frame() {
            put(&mut answer, 0, &frame)?;
        }
        for (leg, bus) in robot.legs.iter_mut().zip(1..) {
            // As many as the legs have: a fifth would be one that does not end.
            for _ in 0..4 {
                let Some(frame) = leg.next_frame(0) else { break };
                put(&mut answer, bus, &frame)?;
            }
        }
        writeln!(output, "{answer}")?;
        output.flush()?;
    }
    Ok(())
}

fn put(text: &mut String, bus: u8, frame: &CanFrame) -> Outcome<()> {
    let Id::Standard(id) = frame.id() else { return Err("an extended frame".into()) };
    write!(text, " {bus}:{:X}#", id.as_raw())?;
    for byte in frame.data() {
        write!(text, "{byte:02X}")?;
    }
    Ok(())
}

fn frame(text: &str) -> Outcome<CanFrame> {
    let (id, digits) = text.split_once('#').ok_or("no #")?;
    let id = StandardId::new(u16::from_str_radix(id, 16)?).ok_or("not an 11-bit id")?;
    CanFrame::new(id, &bytes(digits)?).ok_or_else(|| "more than eight bytes".into())
}

fn bytes(digits: &str) -> Outcome<Vec<u8>> {
    let byte = |at| digits.get(at..at + 2).and_then(|pair| u8::from_str_radix(pair, 16).ok());
    (0..digits.len())
        .step_by(2)
        .map(|at| byte(at).ok_or_else(|| format!("no byte in {digits}").into()))
        .collect()
}
