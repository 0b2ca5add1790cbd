//! Identification against motors whose physics is written here in `f64`, and against the simulator.

#![cfg(test)]

use drivetrain::control::{Excitation, Identification, IdentificationError, Pid, PidConfig, Plant};
use drivetrain::time::TimeStep;
use drivetrain::units::Angle;
use std::collections::VecDeque;
use std::f64::consts::PI;

const TICK_S: f64 = 0.001;
const SUBSTEPS: usize = 20;
const MOTORS: u64 = 200;

/// Uniform numbers by SplitMix64.
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
        if std::env::var("VERBOSE").is_ok() {
            println!("{seed} {:.4?} {truth:?}", errors.last().unwrap());
        }

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
    let within = |index: usize| errors.iter().filter(|error| error[index] < 0.05).count();
    let margin = margins.iter().copied().fold(0.0, f64::max);
    println!(
        "kS {:.4} ({}), kV {:.4} ({}), kA {:.4} ({}), delay {:.3} ticks; margin {margin:.2} degrees ({capped} at the most lag); faster {faster}",
        most(0),
        within(0),
        most(1),
        within(1),
        most(2),
        within(2),
        most(3),
    );
    assert!(most(0) < 0.05 && most(1) < 0.05 && most(2) < 0.05 && most(3) < 0.5);
    assert!(margin < 5.0 && margins.len() > 150);
    assert!(faster >= 190);
}
