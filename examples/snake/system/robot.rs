//! The firmware of the microcontroller, at 1 kHz.

use super::driver::Queued;
use super::{JOINTS, seconds};
use drivetrain::control::PidConfig;
use drivetrain::dji::{self, Bus, Gm6020Voltage, Handle, M2006};
use drivetrain::encoder::Position;
use drivetrain::motor::{BusLoad, Devices};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::Simulation;
use drivetrain::snake::{Config, Joint, Joints};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::feetech::{self, Goal, Present, ServoId, Status, register};
use drivetrain::wire::hipnuc::{self, Imu};
use drivetrain::wire::host_link::{
    COMMAND_LENGTH, HostCommand, Reset, TELEMETRY_LENGTH, Telemetry, TelemetryFormat,
};
use drivetrain::wire::{Counts, Deframer, Receiver};
use std::error::Error;

/// Three commands may be damaged in a row.
pub(crate) const HOST_DEADLINE: Duration = Duration::from_millis(160);
const COMMAND_PERIOD: Duration = Duration::from_millis(50);
/// A command that comes so late is damaged: the joints go on for a period as they went,
const COMMAND_LATE: Duration = Duration::from_millis(8);
/// and for another one, but no further than this, in degrees.
const FURTHEST_DEG: f32 = 8.0;
const IMU_DEADLINE: Duration = Duration::from_millis(50);
const TELEMETRY_TICKS: u32 = 50;
const SERVO_TICKS: u32 = 20;

/// rad/s per rad, at most 8 rad/s; V per rad/s and V per rad.
const YAW: (PidConfig, PidConfig) =
    (PidConfig::new(15.0, 0.0, 0.0).with_output_limit(8.0), PidConfig::new(1.0, 5.0, 0.0));
/// rad/s per rad, at most 8 rad/s; A per rad/s and A per rad.
const FINGER: (PidConfig, PidConfig) =
    (PidConfig::new(15.0, 0.0, 0.0).with_output_limit(8.0), PidConfig::new(0.8, 4.0, 0.0));

/// What happened, for the log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Event {
    HostHeard,
    HostLost,
    Zeroed,
    Armed,
    /// Everything, whatever the reason.
    Relaxed(&'static str),
    Refused(String),
}

/// Bytes to send.
#[derive(Debug, Default)]
pub(crate) struct Output {
    pub(crate) host: Vec<u8>,
    pub(crate) servo: Vec<u8>,
}

type Shell<'w> = Runner<Nb<Queued<'w>>, &'w Simulation, (Joints, Bus)>;

pub(crate) struct Robot<'w> {
    pub(crate) runner: Shell<'w>,
    pub(crate) joints: [Joint; JOINTS],
    pub(crate) yaw: Handle<Gm6020Voltage>,
    pub(crate) finger: Handle<M2006>,
    host: Receiver<HostCommand, COMMAND_LENGTH>,
    imus: [Receiver<Imu, { hipnuc::MAX_FRAME }>; 4],
    servo: Deframer<Status, { feetech::MAX_FRAME }>,
    pub(crate) servo_position: Option<Present>,
    /// When the last command came, and how fast its targets moved, in pulses a second.
    heard: Instant,
    rates: [f32; JOINTS],
    /// As in the last command, of which only a change does something; `None` before the first, and after a silence.
    reset: Option<Reset>,
    drives: bool,
    ticks: u32,
    pub(crate) accepted: Vec<HostCommand>,
    pub(crate) events: Vec<(f32, Event)>,
}

impl<'w> Robot<'w> {
    pub(crate) fn new(world: &'w Simulation) -> Result<Self, Box<dyn Error>> {
        let mut joints = Joints::new();
        let mut handles = Vec::new();
        for id in 1..=12 {
            handles.push(joints.attach(Config::new(id))?);
        }
        // Their frames go out in each tick: a load that does not depend on what is held.
        let mut bus = Bus::new().with_keep_alive(Duration::from_millis(1));
        let yaw = dji::Config::<Gm6020Voltage>::new(1).position_loop(YAW.0, YAW.1);
        let finger = dji::Config::<M2006>::new(1).position_loop(FINGER.0, FINGER.1);
        let (yaw, finger) = (bus.attach(yaw)?, bus.attach(finger)?);
        let port = Nb(Queued::new(world.controller()));
        Ok(Self {
            runner: Runner::new(port, world.clock(), (joints, bus)),
            joints: handles.try_into().map_err(|_| "12 joints")?,
            yaw,
            finger,
            host: Receiver::new(HOST_DEADLINE),
            imus: std::array::from_fn(|_| Receiver::new(IMU_DEADLINE)),
            servo: Deframer::new(),
            servo_position: None,
            heard: Instant::START,
            rates: [0.0; JOINTS],
            reset: None,
            drives: false,
            ticks: 0,
            accepted: Vec::new(),
            events: Vec::new(),
        })
    }

    /// The load of the bus when everything moves.
    pub(crate) fn load(&self) -> BusLoad {
        let (joints, bus) = self.runner.device();
        joints.load().and(&bus.load())
    }

    /// What an idle loop does: takes received frames, and lets the driver send.
    pub(crate) fn poll(&mut self) {
        self.runner.poll(16);
        self.runner.port_mut().0.pump();
    }

    pub(crate) fn hear_host(&mut self, mut bytes: &[u8], now: Instant) {
        while let Some(command) = self.host.read(&mut bytes, now) {
            let gap_s = now.since(self.heard).as_secs_f32();
            let before =
                self.accepted.last().filter(|_| command.reset == Reset::None && gap_s < 0.2);
            self.rates = [0.0; JOINTS];
            if let Some(before) = before {
                let both = command.positions_pulses.iter().zip(&before.positions_pulses);
                for (rate, (new, old)) in self.rates.iter_mut().zip(both) {
                    let way = new.saturating_sub(*old);
                    *rate = way as f32 / gap_s.max(0.01);
                }
            }
            self.heard = now;
            self.accepted.push(command);
        }
    }

    pub(crate) fn hear_imu(&mut self, index: usize, mut bytes: &[u8], now: Instant) {
        if let Some(imu) = self.imus.get_mut(index) {
            while imu.read(&mut bytes, now).is_some() {}
        }
    }

    pub(crate) fn hear_servo(&mut self, mut bytes: &[u8]) {
        while let Some(status) = self.servo.read(&mut bytes) {
            self.servo_position = Present::from_status(&status).or(self.servo_position);
        }
    }

    pub(crate) fn due(&mut self) -> Option<Tick> {
        self.runner.due()
    }

    pub(crate) fn tick(&mut self, tick: Tick, output: &mut Output) {
        let now = tick.now();
        while let Some(edge) = self.host.edge(now) {
            let event = if edge.began { Event::HostLost } else { Event::HostHeard };
            self.events.push((seconds(edge.at), event));
        }
        match self.host.latest(now) {
            Some(command) => {
                // The first order after power-on and after a silence is that of nobody: a change is an order.
                let before = self.reset.replace(command.reset);
                if before.is_some_and(|before| before != command.reset) {
                    self.obey(command.reset, tick);
                }
                let age_us = now.since(self.heard + COMMAND_LATE).as_micros();
                self.follow(&command, age_us / COMMAND_PERIOD.as_micros());
            }
            None => {
                self.reset = None;
                self.relax(now, "the host is silent");
            }
        }
        // One motor less, and the others stop as well.
        if !self.runner.is_armed() {
            self.relax(now, "a motor is lost");
        }
        self.runner.tick(tick);
        self.lead_servo(output);
        if self.ticks.is_multiple_of(TELEMETRY_TICKS) {
            let mut buffer = [0; TELEMETRY_LENGTH];
            let telemetry = TelemetryFormat::new();
            if let Ok(frame) = telemetry.encode(&self.telemetry(now), &mut buffer) {
                output.host.extend_from_slice(frame);
            }
        }
        self.ticks += 1;
    }

    fn obey(&mut self, reset: Reset, tick: Tick) {
        match reset {
            Reset::Rezero => {
                self.relax(tick.now(), "to be zeroed");
                self.zero(tick.now());
                self.arm(tick);
            }
            Reset::Enable => self.arm(tick),
            Reset::Disable => self.relax(tick.now(), "the host wants it"),
            Reset::None | Reset::Other(_) => {}
        }
    }

    fn zero(&mut self, now: Instant) {
        let (joints, bus) = self.runner.device_mut();
        let zeroed = self.joints.iter().map(|joint| joints.zero(*joint));
        let outcome = zeroed.fold(bus.zero(self.yaw).and(bus.zero(self.finger)), Result::and);
        self.log(
            now,
            outcome.map_or_else(|why| Event::Refused(why.to_string()), |()| Event::Zeroed),
        );
    }

    fn arm(&mut self, tick: Tick) {
        let outcome = self.runner.arm(tick);
        self.drives = self.runner.is_armed();
        self.log(
            tick.now(),
            outcome.map_or_else(|why| Event::Refused(why.to_string()), |()| Event::Armed),
        );
    }

    fn relax(&mut self, now: Instant, why: &'static str) {
        if std::mem::take(&mut self.drives) {
            self.runner.device_mut().disarm();
            self.log(now, Event::Relaxed(why));
        }
    }

    fn log(&mut self, now: Instant, event: Event) {
        self.events.push((seconds(now), event));
    }

    /// Targets in RAM only; refused ones are those of motors that are not armed.
    fn follow(&mut self, command: &HostCommand, missing: u64) {
        let further_s = missing.min(2) as f32 * COMMAND_PERIOD.as_secs_f32();
        let (joints, bus) = self.runner.device_mut();
        let targets = command.positions_pulses.iter().zip(command.speeds_rpm).zip(self.rates);
        for (joint, ((pulses, rpm), rate)) in self.joints.iter().zip(targets) {
            let way = super::degrees_of(rate * further_s).clamp(-FURTHEST_DEG, FURTHEST_DEG);
            let target_pulses = pulses.saturating_add(super::pulses(way));
            _ = joints.set_speed(*joint, AngularVelocity::from_rpm(rpm.into()));
            _ = joints.set_pulses(*joint, target_pulses);
        }
        let position = |degrees: i16| Position::from_angle(Angle::from_degrees(degrees.into()));
        _ = bus.set_position(self.yaw, position(command.gm6020_position));
        _ = bus.set_position(self.finger, position(command.c610_position));
    }

    /// Torque, goal and question in turn, each 20 ms.
    fn lead_servo(&self, output: &mut Output) {
        let mut buffer = [0; feetech::MAX_FRAME];
        let instruction = match self.ticks % SERVO_TICKS {
            0 => feetech::write(ServoId::ONE, register::TORQUE, &[self.drives.into()], &mut buffer),
            6 if self.drives => {
                let degrees = self.accepted.last().map_or(180, |command| command.sts3032_degrees);
                let position = i32::from(degrees) * i32::from(feetech::COUNTS_PER_TURN) / 360;
                let position = i16::try_from(position).unwrap_or(i16::MAX);
                let goal = Goal { acceleration: 50, position, time: 0, speed: 2_250 };
                feetech::write(ServoId::ONE, Goal::ADDRESS, &goal.to_bytes(), &mut buffer)
            }
            12 => feetech::read(ServoId::ONE, Present::ADDRESS, Present::LENGTH, &mut buffer),
            _ => return,
        };
        output.servo.extend_from_slice(instruction.unwrap_or(&[]));
    }

    fn telemetry(&self, now: Instant) -> Telemetry {
        let (joints, bus) = self.runner.device();
        let states = self.joints.map(|joint| joints.state(joint));
        let turned = |turns: f32| whole(turns * 360.0);
        Telemetry {
            positions_pulses: states.map(|state| state.map_or(0, |state| state.pulses)),
            speeds_rpm: states.map(|state| state.map_or(0, |state| rpm(state.velocity))),
            gm6020_position: bus
                .state(self.yaw)
                .map_or(0, |state| turned(state.position.as_turns())),
            c610_position: bus
                .state(self.finger)
                .map_or(0, |state| turned(state.position.as_turns())),
            imu_angles_deg: self.imus.each_ref().map(|imu| match imu.latest(now) {
                Some(imu) => {
                    let (roll, pitch, yaw) = imu.euler_roll_x();
                    [pitch, roll, yaw].map(Angle::as_degrees)
                }
                // Better no angle than an old one.
                None => [f32::NAN; 3],
            }),
        }
    }

    pub(crate) fn host_counts(&self) -> Counts {
        self.host.counts()
    }

    pub(crate) fn host_losses(&self) -> u32 {
        self.host.losses()
    }

    pub(crate) fn imu_counts(&self) -> [Counts; 4] {
        self.imus.each_ref().map(Receiver::counts)
    }

    pub(crate) fn servo_counts(&self) -> Counts {
        self.servo.counts()
    }
}

#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn whole(degrees: f32) -> i32 {
    degrees.round() as i32
}

#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn rpm(velocity: AngularVelocity) -> i8 {
    velocity.as_rpm().round() as i8
}
