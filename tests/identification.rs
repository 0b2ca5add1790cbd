//! Identification against motors whose physics is written here in `f64`, and against the simulator.

#![cfg(test)]
#![cfg(feature = "sim")]
#![expect(clippy::cast_possible_truncation, reason = "the judge is in `f64`, the crate in `f32`")]
#![expect(clippy::cast_sign_loss, reason = "a number of parts of a tick, drawn above zero")]
#![expect(
    clippy::float_cmp,
    reason = "an effort that ended is exactly zero, as is a speed at rest"
)]

use drivetrain::control::{Excitation, Identification, IdentificationError, Pid, PidConfig, Plant};
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::{Duration, TimeStep};
use drivetrain::units::{Angle, Current};
use std::collections::VecDeque;
use std::f64::consts::PI;

const TICK_S: f64 = 0.001;
const SUBSTEPS: usize = 20;
const MOTORS: u64 = 200;

/// Uniform numbers by `SplitMix64`.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.unit()
    }

    fn log_between(&mut self, least: f64, most: f64) -> f64 {
        least * (most / least).powf(self.unit())
    }
}

/// A motor with its load, in A and rad/s.
#[derive(Debug, Clone, Copy)]
struct Truth {
    ks: f64,
    kv: f64,
    ka: f64,
    /// In parts of a tick.
    delay_substeps: usize,
    /// The largest error of the speed, rad/s.
    noise: f64,
    /// Between rotor and load, rad; zero without a gap.
    backlash: f64,
    /// Of the rotor, in the inertia.
    rotor_share: f64,
    effort_limit: f64,
    speed_limit: f64,
}

impl Truth {
    fn random(random: &mut Random) -> Self {
        let effort_limit = random.between(5.0, 20.0);
        let speed_limit = random.between(20.0, 60.0);
        let has_backlash = random.unit() < 0.5;
        Self {
            ks: effort_limit * random.between(0.03, 0.2),
            kv: effort_limit / speed_limit * random.between(0.1, 0.6),
            // From rest to the limit in 50 to 500 ms.
            ka: effort_limit / speed_limit * random.log_between(0.05, 0.5),
            delay_substeps: (random.unit() * 121.0) as usize,
            noise: speed_limit * random.between(0.0, 0.005),
            backlash: if has_backlash { random.between(0.001, 0.01) } else { 0.0 },
            rotor_share: random.between(0.3, 0.7),
            effort_limit,
            speed_limit,
        }
    }

    fn delay_s(&self) -> f64 {
        self.delay_substeps as f64 * TICK_S / SUBSTEPS as f64
    }
}

/// The motor in motion: two masses and the gap between them, friction at the load.
struct Motor {
    truth: Truth,
    efforts: VecDeque<f64>,
    rotor: f64,
    load: f64,
    /// Angle of the rotor from the middle of the gap.
    gap: f64,
    noise: Random,
}

/// One step of a mass with dry friction.
fn slide(speed: f64, push: f64, friction: f64, inertia: f64, dt_s: f64) -> f64 {
    if speed == 0.0 && push.abs() <= friction {
        return 0.0;
    }
    let way = if speed == 0.0 { push.signum() } else { speed.signum() };
    let next = speed + (push - friction * way) / inertia * dt_s;
    // Friction stops the mass; the next step tells whether it stays.
    if next * way < 0.0 { 0.0 } else { next }
}

impl Motor {
    fn new(truth: Truth, seed: u64) -> Self {
        let efforts = VecDeque::from(vec![0.0; truth.delay_substeps]);
        Self { truth, efforts, rotor: 0.0, load: 0.0, gap: 0.0, noise: Random(seed) }
    }

    fn advance(&mut self, effort: f64) {
        let effort = effort.clamp(-self.truth.effort_limit, self.truth.effort_limit);
        for _ in 0..SUBSTEPS {
            self.efforts.push_back(effort);
            let push = self.efforts.pop_front().unwrap();
            self.substep(push, TICK_S / SUBSTEPS as f64);
        }
    }

    fn substep(&mut self, push: f64, dt_s: f64) {
        let Truth { ks, kv, ka, backlash, rotor_share, .. } = self.truth;
        let half = backlash / 2.0;
        let (rotor, load) = (ka * rotor_share, ka * (1.0 - rotor_share));
        let together = slide(self.load, push - kv * self.load, ks, ka, dt_s);
        // The force of the rotor on the load, if both moved together.
        let resistance = kv * self.load + ks * together.signum() * f64::from(together != 0.0);
        let force = load * (together - self.load) / dt_s + resistance;
        let holds = if self.load == 0.0 && together == 0.0 { push } else { force };
        let at_end = self.gap.abs() >= half;
        let is_pushed = holds * self.gap >= 0.0;
        if backlash == 0.0 || (at_end && is_pushed && (self.rotor - self.load).abs() < 1e-9) {
            (self.rotor, self.load) = (together, together);
            return;
        }
        self.rotor += push / rotor * dt_s;
        self.load = slide(self.load, -kv * self.load, ks, load, dt_s);
        self.gap += (self.rotor - self.load) * dt_s;
        if self.gap.abs() >= half && (self.rotor - self.load) * self.gap > 0.0 {
            self.gap = half.copysign(self.gap);
            let common = (rotor * self.rotor + load * self.load) / ka;
            (self.rotor, self.load) = (common, common);
        }
    }

    fn measured(&mut self) -> f32 {
        (self.rotor + self.truth.noise * self.noise.between(-1.0, 1.0)) as f32
    }
}

/// Holds a figure to its limit, and its row in `docs/judged.md` to the figure.
fn hold(figure: &str, cases: usize, allowed: f64, worst: f64) {
    const PAGE: &str = include_str!("../docs/judged.md");
    println!("{figure}: {worst:.3e} of {allowed}");
    assert!(worst <= allowed, "{figure}: {worst}");
    let begin = format!("| identification | {figure} |");
    let row = PAGE.lines().find(|line| line.starts_with(&begin));
    let row = row.unwrap_or_else(|| panic!("docs/judged.md has no row for {figure}"));
    let cells: Vec<&str> = row.split('|').map(str::trim).collect();
    assert_eq!(cells[4..6], [cases.to_string(), allowed.to_string()], "{row}");
    let quoted: f64 = cells[6].parse().unwrap();
    assert!(worst <= quoted && worst >= quoted / 2.0, "{row}: {worst:.3e}");
}

/// Excites the motor within its limits, and returns its plant and the largest speed of the run.
fn identify(truth: &Truth, seed: u64) -> (Result<Plant, IdentificationError>, f64) {
    let mut motor = Motor::new(*truth, seed);
    let way = 200.0;
    let mut excitation =
        Excitation::new(truth.effort_limit as f32, truth.speed_limit as f32, way).unwrap();
    let standstill = 1.5 * truth.noise as f32;
    let mut identification = Identification::new(truth.effort_limit as f32, standstill).unwrap();
    let mut fastest = 0.0_f64;
    while !excitation.is_complete() {
        let speed = motor.measured();
        let effort = excitation.update(speed, TICK_S as f32);
        identification.sample(effort, speed, TICK_S as f32);
        motor.advance(f64::from(effort));
        fastest = fastest.max(motor.rotor.abs());
    }
    let result = match excitation.failure() {
        Some(error) => Err(error),
        None => identification.result(),
    };
    (result, fastest)
}

/// Gain and phase of the open loop at `frequency` in rad/s: exact for a held effort, a dead time and a PI by trapezoids.
fn open_loop(truth: &Truth, (kp, ki): (f64, f64), frequency: f64) -> (f64, f64) {
    let Truth { kv, ka, .. } = *truth;
    let whole = truth.delay_substeps / SUBSTEPS;
    let part = (truth.delay_substeps % SUBSTEPS) as f64 / SUBSTEPS as f64;
    let rate = kv / ka;
    let late = (-rate * (1.0 - part) * TICK_S).exp();
    let (first, second) = ((1.0 - late) / kv, late * (1.0 - (-rate * part * TICK_S).exp()) / kv);
    let angle = frequency * TICK_S;
    // As complex numbers: z, the PI, and the plant without its whole ticks.
    let z = (angle.cos(), angle.sin());
    let pi = (kp, -ki * TICK_S / 2.0 / (angle / 2.0).tan());
    let above = (first + second * z.0, -second * z.1);
    let below = (z.0 - (-rate * TICK_S).exp(), z.1);
    let size = |(x, y): (f64, f64)| x.hypot(y);
    let turn = |(x, y): (f64, f64)| y.atan2(x);
    let gain = size(pi) * size(above) / size(below);
    (gain, turn(pi) + turn(above) - turn(below) - angle * whole as f64)
}

/// Crossover in rad/s, and phase margin in degrees, of the highest crossover in a sweep.
fn margin(truth: &Truth, gains: (f64, f64)) -> (f64, f64) {
    let mut frequency = 0.99 * PI / TICK_S;
    while open_loop(truth, gains, frequency).0 < 1.0 {
        frequency /= 1.0005;
        assert!(frequency > 0.1, "no crossover");
    }
    let (_, phase) = open_loop(truth, gains, frequency);
    (frequency, (PI + phase).to_degrees())
}

/// Integral of time and absolute error, of a step from rest to half of the largest speed, for 1 s.
fn itae(truth: &Truth, config: PidConfig, seed: u64) -> f64 {
    let mut motor = Motor::new(*truth, seed);
    let mut pid = Pid::new(config.with_output_limit(truth.effort_limit as f32)).unwrap();
    let target = 0.5 * truth.speed_limit;
    let mut sum = 0.0;
    for tick in 0..1_000 {
        let speed = motor.measured();
        motor.advance(pid.step(target as f32, speed, &TimeStep::of(TICK_S as f32)).into());
        sum += f64::from(tick) * TICK_S * (target - motor.load).abs() * TICK_S;
    }
    sum
}

/// Gains by hand: all of the effort at an error of a tenth of the largest speed, and 0.2 s for the integral to do the same.
fn by_hand(truth: &Truth) -> PidConfig {
    let kp = (10.0 * truth.effort_limit / truth.speed_limit) as f32;
    PidConfig::new(kp, kp / 0.2, 0.0)
}

#[test]
fn two_hundred_motors_are_identified_tuned_and_faster_than_by_hand() {
    let mut random = Random(28);
    let (mut errors, mut margins, mut faster, mut capped) = (Vec::new(), Vec::new(), 0, 0);
    for seed in 0..MOTORS {
        let truth = Truth::random(&mut random);
        let wanted = random.between(45.0, 70.0);
        let share = random.between(0.4, 1.0);
        let (plant, fastest) = identify(&truth, seed);
        let plant = plant.unwrap_or_else(|error| panic!("{seed}: {error}, {truth:?}"));
        assert!(fastest <= truth.speed_limit, "{seed}: {fastest} rad/s, {truth:?}");
        let relative = |found: f32, real: f64| (f64::from(found) / real - 1.0).abs();
        let delay = (f64::from(plant.delay_s) - truth.delay_s()).abs() / TICK_S;
        errors.push([
            relative(plant.ks, truth.ks),
            relative(plant.kv, truth.kv),
            relative(plant.ka, truth.ka),
            delay,
        ]);

        let phase_margin = Angle::from_degrees(wanted as f32);
        let bandwidth = share as f32 * plant.bandwidth(phase_margin).unwrap();
        let (kp, ki, _) = plant.speed_loop(bandwidth, phase_margin).unwrap().gains();
        let (crossover, measured) = margin(&truth, (kp.into(), ki.into()));
        if ki / (kp * bandwidth) > 3.7 {
            capped += 1;
            assert!(measured > wanted - 5.0, "{seed}: {measured} of {wanted}, {truth:?}");
        } else {
            margins.push((measured - wanted).abs());
        }
        let off = crossover / f64::from(bandwidth) - 1.0;
        assert!(off.abs() < 0.06, "{seed}: crossover off by {off}, {truth:?}");

        let sixty = Angle::from_degrees(60.0);
        let tuned = plant.speed_loop(plant.bandwidth(sixty).unwrap(), sixty).unwrap();
        faster += u32::from(itae(&truth, tuned, seed) < itae(&truth, by_hand(&truth), seed));
    }
    let most = |index: usize| errors.iter().map(|error| error[index]).fold(0.0, f64::max);
    let margin = margins.iter().copied().fold(0.0, f64::max);
    println!("{capped} at the most lag");
    let motors = errors.len();
    for (index, parameter) in ["kS", "kV", "kA"].into_iter().enumerate() {
        hold(&format!("`{parameter}` of random motors"), motors, 0.05, most(index));
    }
    hold("delay of random motors, ticks", motors, 0.5, most(3));
    assert!(margins.len() > 150);
    hold("phase margin of the tuned loop, degrees", margins.len(), 5.0, margin);
    let slower = motors as f64 - f64::from(faster);
    hold("tuned loops no better than gains by hand", motors, 10.0, slower);
}

/// An M3508 of the simulator with this load inertia in kg m², load friction in Nm, and noise of its speed in rpm of the rotor.
fn identify_m3508(inertia: f32, friction: f32, noise_rpm: f32, seed: u64) -> Plant {
    let world = Simulation::new(seed);
    let config = MotorConfig::m3508(1).with_load_inertia_kg_m2(inertia);
    let config = config.with_load_friction_nm(friction).with_speed_noise_rpm(noise_rpm);
    world.attach(config).unwrap();
    let mut bus = Bus::new();
    // An output that opens after arming is not the recorded effort.
    let motor = bus.attach(Config::<M3508>::new(1).with_opening(Duration::ZERO)).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut excitation = Excitation::new(10.0, 40.0, 200.0).unwrap().with_duration(20.0).unwrap();
    let mut identification = Identification::new(20.0, 0.2).unwrap();
    let mut armed = false;
    while !excitation.is_complete() {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        armed = armed || runner.arm(tick).is_ok();
        let speed = runner.device().state(motor).map(|state| state.velocity.as_rad_per_s());
        if let (true, Some(speed)) = (armed, speed) {
            let effort = excitation.update(speed, tick.dt_s());
            identification.sample(effort, speed, tick.dt_s());
            _ = runner.device_mut().set_current(motor, Current::from_amperes(effort));
        }
        runner.tick(tick);
    }
    assert_eq!(excitation.failure(), None);
    identification.result().unwrap()
}

/// Facts and estimates of the simulated M3508: 0.008 kg m², 0.12 Nm, 2.2 mNm s/rad and 0.3 Nm/A at the output shaft.
///
/// The resistance takes 2 % of the effort at 28 rad/s, the fastest speed: 12 % of it, with noise of 10 rpm, are 0.3 % of the effort.
#[test]
fn the_simulated_m3508_is_found_with_its_load_over_the_bus() {
    for (noise_rpm, most) in [(3.0, [0.05; 3]), (10.0, [0.05, 0.12, 0.05])] {
        let mut random = Random(27);
        let mut worst = [0.0_f64; 3];
        for seed in 0..30 {
            let inertia = random.between(0.0, 0.05);
            let friction = random.between(0.0, 0.5);
            let plant = identify_m3508(inertia as f32, friction as f32, noise_rpm, seed);
            let off = |found: f32, real: f64| (f64::from(found) / (real / 0.3) - 1.0).abs();
            let (ks, ka) = (off(plant.ks, 0.12 + friction), off(plant.ka, 0.008 + inertia));
            let errors = [ks, off(plant.kv, 2.2e-3), ka];
            worst = core::array::from_fn(|index| worst[index].max(errors[index]));
            assert!((0.000_5..0.003).contains(&plant.delay_s), "{plant:?}");
        }
        for ((parameter, most), worst) in ["kS", "kV", "kA"].into_iter().zip(most).zip(worst) {
            let what = format!("`{parameter}` of a simulated M3508, noise of {noise_rpm} rpm");
            hold(&what, 30, most, worst);
        }
    }
}

#[test]
fn a_run_that_tells_nothing_is_refused_with_its_reason() {
    let run = |samples: u32, effort: fn(u32) -> f32, speed: fn(u32) -> f32| {
        let mut identification = Identification::new(10.0, 0.1).unwrap();
        for tick in 0..samples {
            identification.sample(effort(tick), speed(tick), 0.001);
        }
        identification.result().unwrap_err()
    };
    // At rest; always forwards; efforts of which the drive gives a part; noise alone.
    assert_eq!(run(5_000, |_| 2.0, |_| 0.0), IdentificationError::NotExcited);
    let forwards = |tick: u32| 5.0 + 0.001 * tick as f32;
    assert_eq!(run(5_000, |_| 2.0, forwards), IdentificationError::NotExcited);
    let swing = |tick: u32| 10.0 * (tick as f32 / 100.0).sin();
    assert_eq!(run(5_000, |_| 12.0, swing), IdentificationError::Saturated);
    let noise = |tick: u32| (tick.wrapping_mul(2_654_435_761) >> 16) as f32 / 3_276.8 - 10.0;
    let steps = |tick: u32| if tick % 300 < 150 { 5.0 } else { -5.0 };
    let error = run(5_000, steps, noise);
    assert!([IdentificationError::TooNoisy, IdentificationError::NotExcited].contains(&error));
}

#[test]
fn a_response_later_than_the_search_is_named() {
    let truth = Truth {
        ks: 0.5,
        kv: 0.05,
        ka: 0.05,
        delay_substeps: 20 * SUBSTEPS,
        noise: 0.0,
        backlash: 0.0,
        rotor_share: 1.0,
        effort_limit: 10.0,
        speed_limit: 60.0,
    };
    assert_eq!(identify(&truth, 1).0, Err(IdentificationError::DelayTooLong));
}

#[test]
fn the_excitation_keeps_its_way_and_its_speed_and_ends_at_rest() {
    let mut random = Random(7);
    for seed in 0..40 {
        let truth = Truth::random(&mut random);
        let way = truth.speed_limit * random.log_between(0.02, 1.0);
        let (effort, speed) = (truth.effort_limit as f32, truth.speed_limit as f32);
        let mut excitation = Excitation::new(effort, speed, way as f32).unwrap();
        let mut motor = Motor::new(truth, seed);
        let (mut position, mut farthest) = (0.0_f64, 0.0_f64);
        while !excitation.is_complete() {
            let effort = excitation.update(motor.measured(), TICK_S as f32);
            assert!(effort.abs() <= truth.effort_limit as f32);
            motor.advance(effort.into());
            position += motor.rotor * TICK_S;
            farthest = farthest.max(position.abs());
        }
        let failure = excitation.failure();
        assert!(failure.is_none_or(|error| error == IdentificationError::TooFar), "{failure:?}");
        // Where a swing is no longer than the delay, the limit ends the run; the shaft then runs out.
        if failure.is_none() {
            assert!(farthest <= way * 1.01, "{seed}: {farthest} of {way}, {truth:?}");
            assert!(motor.rotor.abs() < 0.2 * truth.speed_limit, "{seed}: {}", motor.rotor);
        } else {
            assert!(way < 0.2 * truth.speed_limit, "{seed}: {way}, {truth:?}");
        }
        assert_eq!(excitation.update(1.0, 0.001), 0.0);
    }
}

#[test]
fn feedback_that_is_missing_or_not_finite_ends_the_excitation() {
    for (speed, dt_s) in [(f32::NAN, 0.001), (f32::INFINITY, 0.001), (0.0, 0.2)] {
        let mut excitation = Excitation::new(5.0, 30.0, 100.0).unwrap();
        assert!(excitation.update(0.0, 0.001) > 0.0);
        assert_eq!(excitation.update(speed, dt_s), 0.0);
        assert_eq!(excitation.failure(), Some(IdentificationError::NoFeedback));
        assert_eq!(excitation.update(0.0, 0.001), 0.0);
    }
}

#[test]
fn a_loop_beyond_the_reach_of_its_delay_is_refused_and_one_within_has_its_margin() {
    let plant = Plant::new(0.4, 0.02, 0.03, 0.004, 0.001).unwrap();
    let sixty = Angle::from_degrees(60.0);
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(plant.speed_loop(bad, sixty).unwrap_err().parameter(), "bandwidth");
        let margin = Angle::from_degrees(bad);
        assert!(bad == 0.0 || plant.speed_loop(50.0, margin).is_err());
        assert!(Plant::new(bad, 0.0, -1.0, 0.0, 0.001).is_err());
    }
    let fastest = plant.bandwidth(sixty).unwrap();
    assert!(plant.speed_loop(2.0 * fastest, sixty).is_err());
    assert!(plant.position_loop(fastest, sixty).is_err());
    let truth = Truth {
        ks: 0.0,
        kv: 0.02,
        ka: 0.03,
        delay_substeps: 4 * SUBSTEPS,
        noise: 0.0,
        backlash: 0.0,
        rotor_share: 1.0,
        effort_limit: 10.0,
        speed_limit: 30.0,
    };
    let (kp, ki, _) = plant.speed_loop(fastest, sixty).unwrap().gains();
    let (crossover, measured) = margin(&truth, (kp.into(), ki.into()));
    assert!((crossover / f64::from(fastest) - 1.0).abs() < 0.002, "{crossover} of {fastest}");
    assert!((measured - 60.0).abs() < 0.1, "{measured}");
}
