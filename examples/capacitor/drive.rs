//! A robot of 20 kg that drives to and fro under 60 W, and bursts on its super-capacitor while the pilot holds the key.

use super::supply::{CAPACITOR_J, Supply};
use drivetrain::chassis::{
    CapacitorPlan, Chassis, ChassisLimits, Mecanum, MecanumWheels, PowerBuffer, PowerFit,
    PowerModel,
};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::geometry::{Twist, Vec2};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, Line, MotorConfig, MotorKey, SimError, Simulation, Wheel};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use drivetrain::wire::referee::Referee;
use drivetrain::wire::supercap::hkust::{self, HkustState};
use std::error::Error;

/// What the robot keeps: of the buffer, and of the capacitor. The loop of the buffer aims 5 J higher.
pub(crate) const BUFFER_RESERVE_J: f32 = 20.0;
pub(crate) const RESERVE_J: f32 = 600.0;
/// The most that a burst adds, in W.
pub(crate) const BURST_W: f32 = 150.0;
/// While nothing is heard of the referee system, in W.
const SAFE_LIMIT_W: u16 = 45;
/// An older state of the controller does not count.
const FRESH: Duration = Duration::from_millis(50);

pub(crate) const END_S: f32 = 16.0;
/// The key is held.
pub(crate) const BURST_S: (f32, f32) = (4.0, 10.0);
/// Then the robot stands.
pub(crate) const STANDS_S: f32 = 13.0;

const SPEED: PidConfig = PidConfig::new(4.0, 10.0, 0.0);
const RADIUS_M: f32 = 0.076;

/// One millisecond.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) time_s: f32,
    pub(crate) speed_m_s: f32,
    pub(crate) chassis_w: f32,
    pub(crate) supply_w: f32,
    /// What the robot allowed itself.
    pub(crate) allowed_w: f32,
    pub(crate) buffer_j: f32,
    pub(crate) capacitor_j: f32,
}

/// The parts that fail on the way.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Lost {
    /// The cable of the referee system, from 6 s on.
    pub(crate) referee: bool,
    /// The frames of the capacitor's controller, from 6 s on.
    pub(crate) capacitor: bool,
}

const LOST_S: f32 = 6.0;

/// The power that the four motors may take, from what is heard.
struct Limiter {
    referee: Referee,
    heard: Option<(HkustState, Instant)>,
    buffer: PowerBuffer,
    plan: CapacitorPlan,
    fit: PowerFit,
    allowed_w: f32,
}

impl Limiter {
    fn new() -> Result<Self, Box<dyn Error>> {
        let spend = PidConfig::new(4.0, 0.0, 0.0).with_output_limit(120.0);
        // V s/rad and Ω of the data sheet, some of it wrong: the fit finds the rest.
        let start = PowerModel::new(0.0, 0.475, 0.1, 0.0)?;
        Ok(Self {
            referee: Referee::new(SAFE_LIMIT_W),
            heard: None,
            buffer: PowerBuffer::new(BUFFER_RESERVE_J + 5.0, spend)?,
            plan: CapacitorPlan::new(CAPACITOR_J, RESERVE_J)?.with_most_w(BURST_W)?,
            fit: PowerFit::new(start, 0.999),
            allowed_w: 0.0,
        })
    }

    /// Plans this tick, and returns the command to the controller.
    fn plan(&mut self, is_burst: bool, now: Instant, dt_s: f32) -> [u8; 8] {
        let limit_w = self.referee.power_limit_w(now);
        let charge_j = self.referee.buffer_energy_j(now);
        let supply_w = self.buffer.allowance_w(limit_w, charge_j, dt_s).min(limit_w);
        let fresh = self.heard.filter(|(_, at)| now.since(*at) <= FRESH);
        let share = fresh.and_then(|(state, _)| state.energy());
        self.allowed_w = self.plan.allowance_w(supply_w, share, is_burst);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 250")]
        let (told_w, told_j) = (supply_w as u16, charge_j.unwrap_or(0.0) as u16);
        hkust::command(true, told_w, told_j)
    }

    /// Between the update of the loops and the frames: the currents are known, and not yet on the wire.
    fn limit(&self, bus: &mut Bus, wheels: MecanumWheels<Handle<M3508>>) {
        let loads = wheels.map(|wheel| {
            (
                bus.commanded_current(wheel).map_or(0.0, |current| current.as_amperes()),
                bus.state(wheel).map_or(AngularVelocity::ZERO, |state| state.velocity),
            )
        });
        let (scale, _) = self.fit.model().cut(loads, self.allowed_w);
        bus.scale_outputs(wheels, scale);
    }

    /// Learns the losses of the motors from the power that the controller measures.
    fn learn(&mut self, bus: &Bus, wheels: MecanumWheels<Handle<M3508>>, measured_w: f32) {
        if let Some(states) = wheels.map(|wheel| bus.state(wheel)).all() {
            let present = states.map(|state| (state.current.as_amperes(), state.velocity));
            self.fit.learn(present, measured_w);
        }
    }
}

/// To and fro, 2.5 m/s, each way for 1.5 s.
fn wanted(time_s: f32) -> Twist<drivetrain::geometry::Body> {
    if !(0.5..STANDS_S).contains(&time_s) {
        return Twist::ZERO;
    }
    let ahead = (time_s - 0.5).rem_euclid(3.0) < 1.5;
    Twist::new(if ahead { 2.5 } else { -2.5 }, 0.0, 0.0)
}

/// Front right, front left, rear left, rear right.
fn attach(world: &Simulation) -> Result<[MotorKey; 4], SimError> {
    let key = |id| world.attach(MotorConfig::m3508(id));
    let keys = [key(1)?, key(2)?, key(3)?, key(4)?];
    let places = [(0.2, -0.18), (0.2, 0.18), (-0.2, 0.18), (-0.2, -0.18)];
    let wheel = |(key, (x, y))| {
        let wheel = Wheel::mecanum(key, RADIUS_M, Vec2::new(x, y));
        if y < 0.0 { wheel.reversed() } else { wheel }
    };
    let floor: Vec<Wheel> = keys.into_iter().zip(places).map(wheel).collect();
    world.attach_chassis(ChassisConfig::new(&floor).with_mass_kg(20.0))?;
    Ok(keys)
}

pub(crate) fn run(has_burst: bool, lost: Lost) -> Result<Vec<Sample>, Box<dyn Error>> {
    let world = Simulation::new(4);
    let keys = attach(&world)?;
    let mut bus = Bus::new();
    let wheel = |id| Config::<M3508>::new(id).speed_loop(SPEED);
    let wheels = MecanumWheels {
        front_left: bus.attach(wheel(2))?,
        front_right: bus.attach(wheel(1).reversed())?,
        rear_left: bus.attach(wheel(3))?,
        rear_right: bus.attach(wheel(4).reversed())?,
    };
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut chassis = Chassis::new(Mecanum::new(RADIUS_M, Vec2::new(0.2, 0.18))?);
    let limits = ChassisLimits::new()
        .with_acceleration(6.0, 20.0)
        .with_wheel_speed(AngularVelocity::from_rpm(450.0));
    chassis.set_limits(limits)?;
    let (mut supply, mut limiter) = (Supply::new(), Limiter::new()?);

    let mut samples = Vec::new();
    let seconds = |now: Instant| now.since(Instant::START).as_secs_f32();
    while seconds(world.now()) < END_S {
        world.advance(Duration::from_micros(100));
        let now = world.now();
        let mut frames = [None; 4];
        runner.poll_with(16, |frame| {
            if let Some(place) = frames.iter_mut().find(|place| place.is_none()) {
                *place = Some(*frame);
            }
        });
        for frame in frames.into_iter().flatten() {
            if let Some(state) = hkust::decode(&frame) {
                limiter.heard = Some((state, now));
                limiter.learn(runner.device(), wheels, state.chassis_w);
            }
        }
        let Some(tick) = runner.due() else { continue };
        let time_s = seconds(tick.now());
        // This robot arms by itself, which only a simulated one may.
        let _not_yet = runner.is_armed() || runner.arm(tick).is_ok();

        let power = |key: &MotorKey| world.motor(*key).map_or(0.0, |state| state.power_w);
        let frame = supply.step(keys.iter().map(power).sum(), now)?;
        if let Some(frame) = frame.filter(|_| !(lost.capacitor && time_s >= LOST_S)) {
            world.inject(Line::Can1, frame)?;
        }
        let mut buffer = [0; 64];
        let mut received = supply.receive(now, &mut buffer);
        if !(lost.referee && time_s >= LOST_S) {
            while limiter.referee.read(&mut received, now).is_some() {}
        }

        chassis.set_body(wanted(time_s));
        chassis.drive(runner.device_mut(), wheels, tick);
        let is_burst = has_burst && (BURST_S.0..BURST_S.1).contains(&time_s);
        supply.tell(limiter.plan(is_burst, now, tick.dt_s()));
        runner.tick_limited(tick, |bus| limiter.limit(bus, wheels));
        samples.push(Sample {
            time_s,
            speed_m_s: world.chassis().ok_or("no chassis")?.1.linear().norm(),
            chassis_w: supply.chassis_w,
            supply_w: supply.supply_w,
            allowed_w: limiter.allowed_w,
            buffer_j: supply.buffer_j,
            capacitor_j: supply.capacitor_j,
        });
    }
    Ok(samples)
}

/// The mean of a value within some seconds.
pub(crate) fn mean(
    samples: &[Sample],
    (from_s, until_s): (f32, f32),
    value: fn(&Sample) -> f32,
) -> f32 {
    let within = samples.iter().filter(|sample| (from_s..until_s).contains(&sample.time_s));
    let (sum, count) =
        within.fold((0.0, 0.0), |(sum, count), sample| (sum + value(sample), count + 1.0_f32));
    sum / count.max(1.0)
}

/// The least of a value.
pub(crate) fn least(samples: &[Sample], value: fn(&Sample) -> f32) -> f32 {
    samples.iter().map(value).fold(f32::INFINITY, f32::min)
}
