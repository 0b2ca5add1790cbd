//! One run of everything, in simulated time.

use super::host::{Action, Host, Operator};
use super::plant::Plant;
use super::robot::{Event, Output, Robot};
use super::{JOINTS, at, degrees, seconds};
use drivetrain::motor::BusLoad;
use drivetrain::sim::{Fault, Line, SerialLine, Simulation, Traffic, Transmission};
use drivetrain::snake::{Counters, State};
use drivetrain::wire::Counts;
use drivetrain::wire::host_link::{COMMAND_LENGTH, HostCommand, Reset, Telemetry};
use std::error::Error;

pub(crate) const BAUD: u32 = 115_200;
/// Bytes with a wrong bit, missing, and made up, by their share. A usual line: about one frame in fifty is damaged.
const NOISE: [f32; 3] = [2e-4, 5e-5, 5e-5];
/// One frame in a thousand gets through.
const STORM: [f32; 3] = [0.08, 0.02, 0.02];
/// When a fault begins, and when the operator tries again.
pub(crate) const FAULT_S: f32 = 4.0;
pub(crate) const AGAIN_S: f32 = 5.6;
/// The joint that is hit, by its index.
pub(crate) const HIT: usize = 4;

/// The faults that a run can have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Trouble {
    HostLineCut,
    CorruptStream,
    SilentJoint,
    ResetInMotion,
    JointPowerLoss,
    ControllerReset,
}

impl Trouble {
    pub(crate) const ALL: [Self; 6] = [
        Self::HostLineCut,
        Self::CorruptStream,
        Self::SilentJoint,
        Self::ResetInMotion,
        Self::JointPowerLoss,
        Self::ControllerReset,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::HostLineCut => "host-line-cut",
            Self::CorruptStream => "corrupt-stream",
            Self::SilentJoint => "silent-joint",
            Self::ResetInMotion => "reset-in-motion",
            Self::JointPowerLoss => "joint-power-loss",
            Self::ControllerReset => "controller-reset",
        }
    }

    /// How long it lasts.
    pub(crate) fn length_s(self) -> f32 {
        match self {
            Self::HostLineCut | Self::CorruptStream => 1.0,
            Self::SilentJoint => 0.6,
            Self::JointPowerLoss => 0.3,
            Self::ResetInMotion | Self::ControllerReset => 0.0,
        }
    }

    fn operator(self) -> Operator {
        let start = Operator::start();
        match self {
            Self::ResetInMotion => {
                let Operator(mut steps) = start;
                steps.push((FAULT_S, Action::Reset(Reset::Rezero)));
                steps.push((AGAIN_S, Action::Gait));
                Operator(steps)
            }
            // Where the zero was is forgotten.
            Self::SilentJoint | Self::JointPowerLoss | Self::ControllerReset => {
                start.and_again(AGAIN_S, true)
            }
            _ => start.and_again(AGAIN_S, false),
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Setup {
    pub(crate) seconds: f32,
    pub(crate) seed: u64,
    pub(crate) trouble: Option<Trouble>,
}

/// One millisecond.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) time_s: f32,
    /// Where the joints are to be, where they truly are from their zero, and from where they began; degrees.
    pub(crate) wanted_deg: [f32; JOINTS],
    pub(crate) true_deg: [f32; JOINTS],
    pub(crate) absolute_deg: [f32; JOINTS],
    pub(crate) rate_deg_s: [f32; JOINTS],
    /// GM6020, C610 and servo: wanted and true, in degrees.
    pub(crate) gripper_deg: [(f32, f32); 3],
    pub(crate) armed: bool,
    pub(crate) enabled: [bool; JOINTS],
    /// The gait has its full swing.
    pub(crate) swings: bool,
}

/// What came of it.
pub(crate) struct Run {
    pub(crate) setup: Setup,
    pub(crate) samples: Vec<Sample>,
    pub(crate) events: Vec<(f32, Event)>,
    /// From the full swing on, to the fault.
    pub(crate) traffic: Traffic,
    pub(crate) budget: BusLoad,
    pub(crate) down: (SerialLine, Counts),
    pub(crate) up: (SerialLine, Counts),
    pub(crate) sent: Vec<HostCommand>,
    pub(crate) accepted: Vec<HostCommand>,
    pub(crate) last_telemetry: Option<Telemetry>,
    pub(crate) host_losses: u32,
    pub(crate) imus: [(u32, Counts); 4],
    pub(crate) servo: Counts,
    pub(crate) servo_deg: Option<f32>,
    pub(crate) joints: [Option<State>; JOINTS],
    pub(crate) counters: Counters,
    pub(crate) collisions: u32,
    /// Of the controller's receive queue, and ticks that came late.
    pub(crate) overruns: (u32, u32),
}

impl Setup {
    /// From the full swing on, to the fault or the end: when the load is measured.
    pub(crate) fn steady(&self) -> (f32, f32) {
        (3.0, if self.trouble.is_some() { FAULT_S } else { self.seconds })
    }

    /// Shows each frame on the bus.
    pub(crate) fn run(&self, mut show: impl FnMut(&Transmission)) -> Result<Run, Box<dyn Error>> {
        let world = Simulation::new(self.seed);
        let mut plant = Plant::new(&world, self.seed)?;
        let mut robot = Robot::new(&world)?;
        let mut host = Host::new(self.trouble.map_or_else(Operator::start, Trouble::operator));
        let (mut down, mut up) =
            (SerialLine::new(BAUD, self.seed + 1), SerialLine::new(BAUD, self.seed + 2));
        self.schedule(&world, &plant)?;
        let (steady_from, steady_until) = self.steady();
        let (mut before, mut traffic) = (None, None);
        let mut samples = Vec::new();
        let (mut events, mut accepted) = (Vec::new(), Vec::new());
        let (mut output, mut buffer) = (Output::default(), [0; 256]);
        let mut resets = self.trouble == Some(Trouble::ControllerReset);
        while world.now() < at(self.seconds) {
            plant.step(&mut show);
            let now = world.now();
            let time_s = seconds(now);
            self.disturb(time_s, &mut down, &mut up);
            if resets && time_s >= FAULT_S {
                resets = false;
                events.append(&mut robot.events);
                accepted.append(&mut robot.accepted);
                robot = Robot::new(&world)?;
            }
            let mut frame = [0; COMMAND_LENGTH];
            if let Some(bytes) = host.command(now, &mut frame) {
                down.send(bytes, now);
            }
            host.receive(up.receive(now, &mut buffer), now);
            robot.hear_host(down.receive(now, &mut buffer), now);
            for (index, imu) in plant.imus.iter_mut().enumerate() {
                robot.hear_imu(index, imu.line.receive(now, &mut buffer), now);
            }
            robot.hear_servo(plant.servo.from.receive(now, &mut buffer));
            robot.poll();
            let Some(tick) = robot.due() else { continue };
            robot.tick(tick, &mut output);
            up.send(&output.host, now);
            plant.servo.to.send(&output.servo, now);
            output.host.clear();
            output.servo.clear();
            if time_s >= steady_from {
                before.get_or_insert(world.traffic(Line::Can1));
            }
            if time_s < steady_until {
                traffic = Some(world.traffic(Line::Can1));
            }
            samples.push(observe(time_s, &host, &mut robot, &plant));
        }
        events.append(&mut robot.events);
        accepted.append(&mut robot.accepted);
        let states = plant.states();
        let imus = robot.imu_counts();
        let mut sent = plant.imus.iter().map(super::imu::Imu::sent);
        Ok(Run {
            setup: *self,
            samples,
            events,
            traffic: traffic.unwrap_or_default().since(&before.unwrap_or_default()),
            budget: robot.load(),
            down: (down, robot.host_counts()),
            up: (up, host.counts()),
            last_telemetry: host.latest,
            sent: host.sent,
            accepted,
            host_losses: robot.host_losses(),
            imus: imus.map(|counts| (sent.next().unwrap_or(0), counts)),
            servo: robot.servo_counts(),
            servo_deg: robot.servo_position.map(|present| present.angle().as_degrees()),
            joints: robot.joints.map(|joint| robot.runner.device().0.state(joint)),
            counters: robot.runner.device().0.counters(),
            collisions: states.iter().flatten().map(|state| state.collisions).sum(),
            overruns: (world.traffic(Line::Can1).overruns, robot.runner.statistics().overruns),
        })
    }

    fn schedule(&self, world: &Simulation, plant: &Plant<'_>) -> Result<(), Box<dyn Error>> {
        let key = *plant.joints.get(HIT).ok_or("no such joint")?;
        let fault = match self.trouble {
            Some(Trouble::SilentJoint) => Fault::Silent(key),
            Some(Trouble::JointPowerLoss) => Fault::PowerLoss { motor: key, forgets_angle: true },
            _ => return Ok(()),
        };
        let length_s = self.trouble.map_or(0.0, Trouble::length_s);
        world.fault(fault, at(FAULT_S)..at(FAULT_S + length_s))?;
        Ok(())
    }

    fn disturb(&self, time_s: f32, down: &mut SerialLine, up: &mut SerialLine) {
        let hits = |trouble: Trouble| {
            let window = FAULT_S..FAULT_S + trouble.length_s();
            self.trouble == Some(trouble) && window.contains(&time_s)
        };
        let [flipped, dropped, inserted] = if hits(Trouble::CorruptStream) { STORM } else { NOISE };
        for line in [down, up] {
            line.set_cut(hits(Trouble::HostLineCut));
            line.set_flipped(flipped);
            line.set_dropped(dropped);
            line.set_inserted(inserted);
        }
    }
}

fn observe(time_s: f32, host: &Host, robot: &mut Robot<'_>, plant: &Plant<'_>) -> Sample {
    let states = plant.states();
    let armed = robot.runner.is_armed();
    let (joints, _) = robot.runner.device();
    let offsets = robot.joints.map(|joint| joints.offset(joint).unwrap_or_default());
    let mut true_deg = [0.0; JOINTS];
    for ((angle, state), offset) in true_deg.iter_mut().zip(states).zip(offsets) {
        *angle = state.map_or(0.0, |state| degrees(state.drive_counts.wrapping_sub(offset)));
    }
    let asked = robot.accepted.last().copied().unwrap_or_default();
    let (_, bus) = robot.runner.device();
    let turned = |turns: Option<f32>| turns.unwrap_or(0.0) * 360.0;
    let yaw = turned(bus.state(robot.yaw).map(|state| state.position.as_turns()));
    let finger = turned(bus.state(robot.finger).map(|state| state.position.as_turns()));
    Sample {
        time_s,
        wanted_deg: std::array::from_fn(|joint| host.operator.wanted_deg(joint, time_s)),
        true_deg,
        absolute_deg: states
            .map(|state| state.map_or(0.0, |state| state.position.as_angle().as_degrees())),
        rate_deg_s: states.map(|state| state.map_or(0.0, |s| s.velocity.as_degrees_per_s())),
        gripper_deg: [
            (asked.gm6020_position.into(), yaw),
            (asked.c610_position.into(), finger),
            (asked.sts3032_degrees.into(), plant.servo.degrees()),
        ],
        armed,
        enabled: states.map(|state| state.is_some_and(|state| state.is_enabled)),
        swings: host.operator.swings_for(time_s).is_some(),
    }
}

impl Run {
    /// Returns the samples of full swing: before the fault, or after it.
    pub(crate) fn swinging(&self, after: bool) -> impl Iterator<Item = &Sample> + Clone {
        let ends = if self.setup.trouble.is_some() { FAULT_S } else { f32::INFINITY };
        self.samples.iter().filter(move |sample| {
            sample.swings && if after { sample.time_s >= AGAIN_S } else { sample.time_s < ends }
        })
    }

    /// Returns the RMS and the largest error of a joint, in degrees.
    pub(crate) fn error_deg(&self, joint: usize, after: bool) -> (f32, f32) {
        let errors = self
            .swinging(after)
            .filter_map(|sample| Some(sample.true_deg.get(joint)? - sample.wanted_deg.get(joint)?));
        let (mut sum, mut most, mut count) = (0.0_f64, 0.0_f32, 0.0_f64);
        for error in errors {
            sum += f64::from(error) * f64::from(error);
            most = most.max(error.abs());
            count += 1.0;
        }
        #[expect(clippy::cast_possible_truncation, reason = "some degrees")]
        let rms = (sum / count.max(1.0)).sqrt() as f32;
        (if count > 0.0 { rms } else { f32::NAN }, most)
    }

    /// Returns the worst RMS of all joints, in degrees; NaN when there was nothing to measure.
    pub(crate) fn worst_rms_deg(&self, after: bool) -> f32 {
        let errors = (0..JOINTS).map(|joint| self.error_deg(joint, after).0);
        errors.fold(0.0, |worst, rms| if worst > rms || worst.is_nan() { worst } else { rms })
    }
}
