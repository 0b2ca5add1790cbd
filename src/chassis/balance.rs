use super::leg::{BalanceModel, GRAVITY, LegEffort, LegState};
use super::{COMMAND_TIMEOUT_S, within};
use crate::control::state_space::{GainSchedule, LinearQuadraticRegulator, bryson};
use crate::error::ConfigError;
use crate::geometry::Attitude;
use crate::math::sin_cos;
use crate::units::{Angle, AngularVelocity};

/// What a [`Balancer`] does.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BalancePhase {
    /// Lies, or was never started: without efforts. The motors are to be disarmed.
    #[default]
    Fallen,
    /// Finds its balance with short legs, then extends them.
    Rising,
    /// Stands and drives.
    Standing,
    /// The wheels are off the floor: the legs stay below the body, the wheels are not driven.
    Airborne,
}

/// Lengths with a gain of their own.
const ROWS: usize = 8;

/// Balances a robot with two wheels and two legs, and drives it.
///
/// ```text
/// legs, wheels, attitude ──> lean, place, pitch ──> regulator of least cost, its gain by leg length ──> wheels, hips
///                       └──> length, roll ────────> spring, damper and weight ─────────────────────────> force along each leg
///                       └──> yaw rate, split ─────> difference of both wheels, of both hips
/// ```
/// Call [`update`](Self::update) at the time step of the constructor. The body's axes are x forward, y left, z up.
///
/// | event | rule | reaction |
/// |---|---|---|
/// | fall | roll or pitch beyond 40°; no attitude, no leg, a value that is NaN | `None` in this update and until [`start`](Self::start) |
/// | slip | the wheels differ by more than 1.2 m/s from the plant's model, which gets their efforts | what is beyond does not count, the place is not held |
/// | command | no [`set_motion`](Self::set_motion) in 0.1 s of updates | the motion counts as zero: the robot balances on the spot |
/// | lift-off | both legs push less than a fifth of the body's weight for 10 ms | wheels without torque, until a leg carries two fifths |
///
/// # Examples
/// ```
/// use drivetrain::chassis::{BalanceModel, BalancePhase, Balancer, FiveBar};
/// use drivetrain::geometry::{Attitude, Rotation3};
/// use drivetrain::units::AngularVelocity;
///
/// let model = BalanceModel {
///     wheel_radius_m: 0.075, wheel_kg: 0.7, wheel_kg_m2: 0.003, leg_kg: 1.2, leg_kg_m2: 0.01, leg_centre: 0.6,
///     body_kg: 14.0, body_kg_m2: 0.25, body_height_m: 0.03,
/// };
/// let mut robot = Balancer::new(&model, [0.14, 0.35], [6.0, 40.0], 0.001)?;
/// let leg = FiveBar::new(0.075, 0.15, 0.27)?;
/// let at_rest = [AngularVelocity::ZERO; 2];
/// let state = leg.state(leg.angles(0.2, 0.0).ok_or("reach")?, at_rest, [0.0; 2]).ok_or("closed")?;
/// let level = Attitude { rotation: Rotation3::IDENTITY, rates: [AngularVelocity::ZERO; 3] };
///
/// assert_eq!(robot.update(Some(&level), Some([state; 2]), at_rest), None); // not started
/// robot.start();
/// let [left, right] = robot.update(Some(&level), Some([state; 2]), at_rest).ok_or("lies")?;
/// assert_eq!((left.wheel_nm, robot.phase()), (right.wheel_nm, BalancePhase::Rising));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// See also V. Klemm and others, *LQR-assisted whole-body control of a wheeled bipedal robot with kinematic loops*, IEEE Robotics and
/// Automation Letters 5 (2020). The plant here follows from the energies of wheels, legs and body.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Balancer {
    radius_m: f32,
    weight_n: f32,
    dt_s: f32,
    lengths_m: [f32; 2],
    /// Of both wheels, and of both hips.
    limit_nm: [f32; 2],
    gains: GainSchedule<6, 2, ROWS>,
    /// Next velocity of the wheels, from the states and both inputs.
    motion: GainSchedule<8, 1, ROWS>,
    regulator: LinearQuadraticRegulator<6, 2>,
    phase: BalancePhase,
    /// Where the length is, on its way to `goal_m`.
    length_m: f32,
    goal_m: f32,
    velocity_m_s: f32,
    yaw_rad_s: f32,
    /// Of velocity and yaw rate, in steps of the updates.
    command_age_s: f32,
    /// From the place to hold, in m.
    place_m: f32,
    /// From the heading to hold, in rad.
    heading_rad: f32,
    /// Torque of the wheels that a slope needs, in Nm.
    trim_nm: f32,
    /// Velocity by the model of the plant.
    model_m_s: f32,
    is_slipping: bool,
    /// Torques of the last update, of wheels and hips together, in Nm.
    torques_nm: [f32; 2],
    /// For how long the next phase has been due, in s.
    due_s: f32,
}

/// Stiffness and damping of a leg, of roll, of the split between the legs, of yaw: N/m, N s/m; N/rad, N s/rad; Nm/rad, Nm s/rad, twice.
const LENGTH: (f32, f32) = (1_500.0, 120.0);
const ROLL: (f32, f32) = (300.0, 25.0);
const SPLIT: (f32, f32) = (60.0, 5.0);
const YAW: (f32, f32) = (4.0, 1.2);
/// Rate of a changing length in m/s.
const EXTENSION: f32 = 0.2;
/// Largest deviation of the place that counts in m, of the heading in rad.
const FAR: (f32, f32) = (0.3, 0.5);
/// Balance is found: pitch and lean in rad.
const UPRIGHT: f32 = 0.12;
/// Pitch on an edge of the body in rad; how stiffly the legs are held then, Nm/rad and Nm s/rad.
const LYING: f32 = 0.25;
const STIFF: (f32, f32) = (150.0, 8.0);
/// For so long in s, until the legs extend.
const FOUND_S: f32 = 0.3;
/// Difference to the model in m/s; how fast the model follows the wheels in 1/s.
const SLIP: (f32, f32) = (1.2, 50.0);
/// Trim in Nm for a metre and a second, and its limit. Wheels that drive on bring the body back: the sign is that of the gain.
const TRIM: (f32, f32) = (3.0, 5.0);

/// Shares of half the weight: lifted, landed.
const LIFTED: f32 = 0.2;
const LANDED: f32 = 0.4;

/// Errors that cost as much as the largest torques: lean, its rate, place, velocity, pitch, its rate.
const LARGEST: [f32; 6] = [0.3, 10.0, 0.5, 1.0, 0.2, 10.0];
/// Efforts that cost as much, as shares of the largest torques: wheels, hips. With these the fastest pole is at 25 1/s.
const SHARES: [f32; 2] = [0.4, 0.2];
/// Roll or pitch of a fall in rad: 40°.
const FALL: f32 = 0.7;

impl Balancer {
    /// Calculates the gains for leg lengths from the least to the largest, in m, of which the least is that of rising.
    ///
    /// `limit_nm` are the largest torques of both wheels, and of both hips, together: half of it is the limit of each, in every phase. The
    /// balance comes first, and turns and the difference between the legs get what it leaves. `dt_s` is the time step of the updates in s.
    /// Solves eight Riccati equations: at start, not in the loop.
    ///
    /// # Errors
    /// Those of [`BalanceModel::plant`]; [`ConfigError::Reversed`] with `lengths_m` when the least is not below the largest.
    /// [`ConfigError::NotPositive`] with `limit_nm` when a torque is not above zero.
    pub fn new(
        model: &BalanceModel,
        lengths_m: [f32; 2],
        limit_nm: [f32; 2],
        dt_s: f32,
    ) -> Result<Self, ConfigError> {
        let [least, largest] = lengths_m;
        if !(least < largest && largest.is_finite()) {
            return Err(ConfigError::Reversed("lengths_m"));
        }
        limit_nm.iter().try_for_each(|limit| super::positive(*limit, "limit_nm").map(|_| ()))?;
        let mut gains = [(0.0, [[0.0; 6]; 2]); ROWS];
        let mut motion = [(0.0, [[0.0; 8]]); ROWS];
        let per = 1.0 / (ROWS - 1) as f32;
        for (row, (gain, part)) in gains.iter_mut().zip(&mut motion).enumerate() {
            let length_m = least + (largest - least) * row as f32 * per;
            let plant = model.plant(length_m, dt_s)?;
            let [wheels, hips] = limit_nm;
            let acceptable = [SHARES[0] * wheels, SHARES[1] * hips];
            let (q, r) = (bryson(&LARGEST), bryson(&acceptable));
            let regulator = LinearQuadraticRegulator::new(&plant, &q, &r)?;
            *gain = (length_m, *regulator.gain());
            let ([_, _, _, of_states, ..], [_, _, _, of_inputs, ..]) = (*plant.a(), *plant.b());
            let [lean, lean_rate, place, velocity, pitch, rate] = of_states;
            let [wheel, hip] = of_inputs;
            *part = (length_m, [[lean, lean_rate, place, velocity, pitch, rate, wheel, hip]]);
        }
        let (_, first) = gains[0];
        Ok(Self {
            radius_m: model.wheel_radius_m,
            weight_n: GRAVITY * model.body_kg,
            dt_s,
            lengths_m,
            limit_nm,
            gains: GainSchedule::new(gains)?,
            motion: GainSchedule::new(motion)?,
            regulator: LinearQuadraticRegulator::from_gain(&first)?.with_output_limit(&limit_nm)?,
            phase: BalancePhase::Fallen,
            length_m: least,
            goal_m: 0.5 * (least + largest),
            velocity_m_s: 0.0,
            yaw_rad_s: 0.0,
            command_age_s: f32::MAX,
            place_m: 0.0,
            heading_rad: 0.0,
            trim_nm: 0.0,
            model_m_s: 0.0,
            is_slipping: false,
            torques_nm: [0.0; 2],
            due_s: 0.0,
        })
    }

    /// Rises, with the next update. The motors have to be armed by then.
    pub const fn start(&mut self) {
        self.phase = BalancePhase::Rising;
        self.length_m = 0.0;
        (self.place_m, self.heading_rad, self.trim_nm, self.model_m_s) = (0.0, 0.0, 0.0, 0.0);
        (self.is_slipping, self.torques_nm, self.due_s) = (false, [0.0; 2], 0.0);
    }

    /// Gives up balance: the next update returns `None`.
    pub const fn stop(&mut self) {
        self.phase = BalancePhase::Fallen;
    }

    /// Sets velocity in m/s, forward positive, and yaw rate in rad/s, counter-clockwise positive. A value that is NaN or infinite counts as zero.
    ///
    /// A command not renewed for 0.1 s counts as zero, as that of a [`Chassis`](super::Chassis); its age is the time of the updates since,
    /// a time step each. Each call has to stand for a fresh command of the pilot.
    pub const fn set_motion(&mut self, velocity_m_s: f32, yaw_rad_s: f32) {
        self.velocity_m_s = if velocity_m_s.is_finite() { velocity_m_s } else { 0.0 };
        self.yaw_rad_s = if yaw_rad_s.is_finite() { yaw_rad_s } else { 0.0 };
        self.command_age_s = 0.0;
    }

    /// Sets the length of the legs in m, within those of the constructor; NaN is the least. The length changes by 0.2 m/s.
    pub const fn set_length(&mut self, length_m: f32) {
        let [least, largest] = self.lengths_m;
        self.goal_m = length_m.max(least).min(largest);
    }

    /// Returns what the robot does.
    #[must_use]
    pub const fn phase(&self) -> BalancePhase {
        self.phase
    }

    /// Whether the wheels turn in another way than the model of the plant can.
    #[must_use]
    pub const fn is_slipping(&self) -> bool {
        self.is_slipping
    }

    /// Goes on by one time step, and returns the efforts of both legs: left, right.
    ///
    /// Takes the attitude of the body, the legs, and the velocities of the wheels against the bars that carry their motors, positive
    /// forward; left, right each. `None`: the robot has fallen, or a value is missing, NaN or infinite; disarm the motors at once.
    ///
    /// Costs 1424 instructions on a Cortex-M4F (`docs/figures.md`).
    pub fn update(
        &mut self,
        attitude: Option<&Attitude>,
        legs: Option<[LegState; 2]>,
        wheels: [AngularVelocity; 2],
    ) -> Option<[LegEffort; 2]> {
        if self.command_age_s > COMMAND_TIMEOUT_S {
            (self.velocity_m_s, self.yaw_rad_s) = (0.0, 0.0);
        }
        self.command_age_s += self.dt_s;
        let measured = attitude.zip(legs).filter(|_| self.phase != BalancePhase::Fallen);
        let result = measured.and_then(|(attitude, legs)| self.step(attitude, &legs, wheels));
        if result.is_none() {
            self.phase = BalancePhase::Fallen;
        }
        result
    }

    fn step(
        &mut self,
        attitude: &Attitude,
        legs: &[LegState; 2],
        wheels: [AngularVelocity; 2],
    ) -> Option<[LegEffort; 2]> {
        let [roll, pitch, _] = attitude.rotation.roll_pitch_yaw().map(Angle::as_radians);
        let [roll_rate, pitch_rate, yaw_rate] = attitude.rates.map(AngularVelocity::as_rad_per_s);
        if !(roll.abs() < FALL && pitch.abs() < FALL) {
            return None;
        }
        let [left, right] = legs;
        let [left_rad_s, right_rad_s] = wheels.map(AngularVelocity::as_rad_per_s);
        let lean = 0.5 * (left.angle_rad + right.angle_rad) + pitch;
        let lean_rate = 0.5 * (left.angle_rad_s + right.angle_rad_s) + pitch_rate;
        let carriers = left.carrier_rad_s + right.carrier_rad_s;
        let rolled = self.radius_m * (0.5 * (left_rad_s + right_rad_s + carriers) + pitch_rate);
        let length_m = 0.5 * (left.length_m + right.length_m);

        self.follow_support(left.force_n, right.force_n);
        let velocity = self.follow_slip(length_m, [lean, lean_rate, pitch, pitch_rate], rolled)?;
        let is_upright = pitch.abs() < UPRIGHT && lean.abs() < UPRIGHT;
        self.follow_length(length_m, is_upright);
        let is_airborne = self.phase == BalancePhase::Airborne;
        self.hold(velocity, yaw_rate, is_upright && !is_airborne);

        let target = if is_airborne { velocity } else { self.velocity_m_s };
        // In the air the legs stay below the body, which nothing can turn.
        let state = if is_airborne {
            [lean, lean_rate, 0.0, velocity, 0.0, 0.0]
        } else {
            [lean, lean_rate, self.place_m, velocity, pitch, pitch_rate]
        };
        self.regulator.set_gain(&self.gains.gain(length_m)?);
        let [wheel, hip] = self.regulator.step(&[0.0, 0.0, 0.0, target, 0.0, 0.0], &state);
        let wheel = if is_airborne { 0.0 } else { wheel + self.trim_nm };
        // On an edge of its body, the robot is a pendulum of one piece: legs that swing would step over it.
        let hip = if self.phase == BalancePhase::Rising && pitch.abs() > LYING {
            -STIFF.0 * (lean - pitch) - STIFF.1 * (lean_rate - pitch_rate)
        } else {
            hip
        };
        let (_, cos) = sin_cos(lean);
        let turn = if is_airborne {
            0.0
        } else {
            YAW.0 * self.heading_rad + YAW.1 * (yaw_rate - self.yaw_rad_s)
        };
        let split = SPLIT.0 * (left.angle_rad - right.angle_rad)
            + SPLIT.1 * (left.angle_rad_s - right.angle_rad_s);
        // A limit would hide an infinite value.
        if !(wheel + hip + turn + split).is_finite() {
            return None;
        }
        let [wheels_nm, hips_nm] = self.limit_nm;
        self.torques_nm = [within(wheel, wheels_nm), within(hip, hips_nm)];
        let [wheel, hip] = self.torques_nm.map(|of_both| 0.5 * of_both);
        // A motor at its limit has no torque for both: without the balance the robot falls, without the turn it is late.
        let turn = within(turn, 0.5 * wheels_nm - wheel.abs());
        let split = within(split, 0.5 * hips_nm - hip.abs());
        let tilt = ROLL.0 * roll + ROLL.1 * roll_rate;
        let effort = |leg: &LegState, side: f32| LegEffort {
            force_n: 0.5 * self.weight_n * cos + LENGTH.0 * (self.length_m - leg.length_m)
                - LENGTH.1 * leg.length_m_s
                - side * tilt,
            // The sum can round to a value beyond the limit.
            hip_nm: within(hip - side * split, 0.5 * hips_nm),
            wheel_nm: within(wheel + side * turn, 0.5 * wheels_nm),
        };
        let efforts = [effort(left, 1.0), effort(right, -1.0)];
        efforts.iter().all(|it| it.force_n.is_finite()).then_some(efforts)
    }

    /// Notes lift-off and landing.
    fn follow_support(&mut self, left_n: f32, right_n: f32) {
        let most = left_n.max(right_n);
        let half = 0.5 * self.weight_n;
        let (is_due, next, after_s) = match self.phase {
            BalancePhase::Standing => (most < LIFTED * half, BalancePhase::Airborne, 0.01),
            BalancePhase::Airborne => (most > LANDED * half, BalancePhase::Standing, 0.002),
            _ => return,
        };
        self.due_s = if is_due { self.due_s + self.dt_s } else { 0.0 };
        if self.due_s >= after_s {
            (self.phase, self.due_s, self.place_m) = (next, 0.0, 0.0);
        }
    }

    /// Compares the wheels with the model of the plant; returns the velocity that counts, in m/s.
    fn follow_slip(
        &mut self,
        length_m: f32,
        [lean, lean_rate, pitch, rate]: [f32; 4],
        rolled: f32,
    ) -> Option<f32> {
        let [row] = self.motion.gain(length_m)?;
        let [wheel, hip] = self.torques_nm;
        let parts = [lean, lean_rate, 0.0, self.model_m_s, pitch, rate, wheel, hip];
        let expected: f32 = row.iter().zip(parts).map(|(factor, part)| factor * part).sum();
        let off = rolled - expected;
        self.is_slipping = off.abs() > SLIP.0;
        self.model_m_s = expected + SLIP.1 * self.dt_s * off;
        // Not the model's velocity: with the torque of the wheels in it, the loop would run away from a push.
        off.is_finite().then_some(expected + within(off, SLIP.0))
    }

    /// Moves the length to its goal, once balance was found.
    fn follow_length(&mut self, length_m: f32, is_upright: bool) {
        let mut goal_m = self.goal_m;
        if self.phase == BalancePhase::Rising {
            if self.length_m == 0.0 {
                self.length_m = length_m; // where it lies
            }
            self.due_s = if is_upright { self.due_s + self.dt_s } else { 0.0 };
            if self.due_s < FOUND_S {
                goal_m = self.lengths_m[0];
            }
        }
        let way = goal_m - self.length_m;
        let step = EXTENSION * self.dt_s;
        self.length_m += within(way, step);
        if self.phase == BalancePhase::Rising && self.due_s >= FOUND_S && way.abs() <= step {
            (self.phase, self.due_s) = (BalancePhase::Standing, 0.0);
        }
    }

    /// Sums the deviations of place and heading, and the torque that a slope needs.
    fn hold(&mut self, velocity: f32, yaw_rate: f32, is_standing: bool) {
        if !is_standing || self.is_slipping {
            return;
        }
        self.place_m = within(self.place_m + (velocity - self.velocity_m_s) * self.dt_s, FAR.0);
        self.heading_rad =
            within(self.heading_rad + (yaw_rate - self.yaw_rad_s) * self.dt_s, FAR.1);
        self.trim_nm = within(self.trim_nm + TRIM.0 * self.place_m * self.dt_s, TRIM.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chassis::FiveBar;
    use crate::geometry::Rotation3;
    use proptest::prelude::*;

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
    const REST: [AngularVelocity; 2] = [AngularVelocity::ZERO; 2];

    fn balancer() -> Balancer {
        Balancer::new(&MODEL, [0.14, 0.36], [10.0, 50.0], 0.001).unwrap()
    }

    /// A leg at rest that pushes with this force.
    fn leg(length_m: f32, force_n: f32) -> LegState {
        let bars = FiveBar::new(0.075, 0.15, 0.27).unwrap();
        let mut state = bars.state(bars.angles(length_m, 0.0).unwrap(), REST, [0.0; 2]).unwrap();
        state.force_n = force_n;
        state
    }

    fn tilted(roll: f32, pitch: f32) -> Attitude {
        let [roll, pitch] = [roll, pitch].map(Angle::from_radians);
        let rotation = Rotation3::from_roll_pitch_yaw(roll, pitch, Angle::ZERO);
        Attitude { rotation, rates: [AngularVelocity::ZERO; 3] }
    }

    /// Holds the robot upright for some milliseconds, on legs of a given length and force.
    fn upright(robot: &mut Balancer, ms: u32, length_m: f32, force_n: f32) -> [LegEffort; 2] {
        let mut efforts = [LegEffort::default(); 2];
        for _ in 0..ms {
            let legs = Some([leg(length_m, force_n); 2]);
            efforts = robot.update(Some(&tilted(0.0, 0.0)), legs, REST).unwrap();
        }
        efforts
    }

    fn standing() -> Balancer {
        let mut robot = balancer();
        robot.start();
        upright(&mut robot, 1_500, 0.25, 69.0);
        assert_eq!(robot.phase(), BalancePhase::Standing);
        robot
    }

    #[test]
    fn wheels_drive_the_robot_and_lean_it_back_and_weight_makes_it_fall() {
        let plant = MODEL.plant(0.25, 0.001).unwrap();
        let driven = plant.predict(&[0.0; 6], &[1.0, 0.0]);
        assert!(driven[3] > 0.0 && driven[1] < 0.0);
        let leaning = plant.predict(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.0], &[0.0; 2]);
        assert!(leaning[1] > 0.0);
        // All of it as one piece on a wheel without mass: g / length, for the body alone.
        let body = BalanceModel {
            wheel_kg: 1e9,
            leg_kg: 0.0,
            leg_kg_m2: 0.0,
            body_height_m: 0.0,
            ..MODEL
        };
        let falling =
            body.plant(0.25, 0.001).unwrap().predict(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.0], &[0.0; 2]);
        assert!((falling[1] - 0.1 * GRAVITY / 0.25 * 0.001).abs() < 1e-6);
    }

    #[test]
    fn each_length_between_the_rows_is_stable_also_with_a_fifth_of_the_mass_more_or_less() {
        let robot = balancer();
        for share in [0.8, 1.0, 1.2] {
            for step in 0..15_u8 {
                let length_m = 0.14 + f32::from(step) * 0.22 / 14.0;
                let (body_kg, body_kg_m2) = (share * MODEL.body_kg, share * MODEL.body_kg_m2);
                let plant =
                    BalanceModel { body_kg, body_kg_m2, ..MODEL }.plant(length_m, 0.001).unwrap();
                let gain = robot.gains.gain(length_m).unwrap();
                let mut x = [0.1, 0.0, 0.2, 0.0, -0.1, 0.0];
                for _ in 0..6_000 {
                    let u = gain.map(|row| -row.iter().zip(x).map(|(k, x)| k * x).sum::<f32>());
                    x = plant.predict(&x, &u);
                }
                assert!(x.iter().all(|state| state.abs() < 2e-3), "{share} {length_m} {x:?}");
            }
        }
    }

    #[test]
    fn a_fall_to_any_side_or_a_missing_measurement_ends_in_the_same_update_and_stays() {
        let legs = Some([leg(0.25, 69.0); 2]);
        for attitude in [
            Some(tilted(0.72, 0.0)),
            Some(tilted(-0.72, 0.0)),
            Some(tilted(0.0, 0.72)),
            Some(tilted(0.0, -0.72)),
            None,
        ] {
            let mut robot = standing();
            assert_eq!(robot.update(attitude.as_ref(), legs, REST), None, "{attitude:?}");
            assert_eq!(robot.phase(), BalancePhase::Fallen);
            assert_eq!(robot.update(Some(&tilted(0.0, 0.0)), legs, REST), None);
            robot.start();
            assert!(robot.update(Some(&tilted(0.0, 0.0)), legs, REST).is_some());
        }
        let mut robot = standing();
        assert_eq!(robot.update(Some(&tilted(0.0, 0.0)), None, REST), None);
        let mut robot = standing();
        let unknown = [AngularVelocity::from_rad_per_s(f32::NAN); 2];
        assert_eq!(robot.update(Some(&tilted(0.0, 0.0)), legs, unknown), None);
        let mut robot = standing();
        robot.stop();
        assert_eq!(robot.update(Some(&tilted(0.0, 0.0)), legs, REST), None);
    }

    #[test]
    fn legs_that_push_nothing_for_10_ms_are_in_the_air_and_one_that_pushes_lands() {
        let mut robot = standing();
        upright(&mut robot, 9, 0.25, 5.0);
        assert_eq!(robot.phase(), BalancePhase::Standing);
        let efforts = upright(&mut robot, 2, 0.25, 5.0);
        assert_eq!(
            (robot.phase(), efforts[0].wheel_nm, efforts[1].wheel_nm),
            (BalancePhase::Airborne, 0.0, 0.0)
        );
        upright(&mut robot, 2, 0.25, 69.0);
        assert_eq!(robot.phase(), BalancePhase::Standing);
    }

    #[test]
    fn wheels_that_spin_up_beyond_the_model_slip_and_hold_no_place() {
        let mut robot = standing();
        let spinning = [AngularVelocity::from_rad_per_s(40.0); 2]; // 3 m/s
        let legs = Some([leg(0.25, 69.0); 2]);
        assert!(robot.update(Some(&tilted(0.0, 0.0)), legs, spinning).is_some());
        assert!(robot.is_slipping());
        assert!(robot.place_m.abs() < f32::EPSILON);
    }

    #[test]
    fn a_robot_on_its_edge_rises_with_short_legs_and_the_legs_extend_once_it_is_upright() {
        let mut robot = balancer();
        robot.start();
        let legs = Some([leg(0.14, 69.0); 2]);
        let lying = robot.update(Some(&tilted(0.0, 0.4)), legs, REST).unwrap();
        assert!(lying[0].wheel_nm > 4.9 && lying[0].hip_nm.abs() < 1e-3, "{lying:?}");
        let early = upright(&mut robot, 250, 0.14, 69.0);
        let late = upright(&mut robot, 200, 0.14, 69.0);
        assert!(late[0].force_n > early[0].force_n + 20.0);
        assert_eq!(robot.phase(), BalancePhase::Rising);
    }

    #[test]
    fn a_body_that_rolls_to_the_right_is_held_by_the_right_leg_and_a_heading_by_both_wheels() {
        let mut robot = standing();
        let legs = Some([leg(0.25, 69.0); 2]);
        let [left, right] = robot.update(Some(&tilted(0.1, 0.0)), legs, REST).unwrap();
        assert!(right.force_n - left.force_n > 50.0);
        robot.set_motion(f32::NAN, 1.0);
        let [left, right] = robot.update(Some(&tilted(0.0, 0.0)), legs, REST).unwrap();
        assert!(right.wheel_nm - left.wheel_nm > 2.0);
        robot.set_length(f32::NAN);
        assert!((robot.goal_m - 0.14).abs() < 1e-6);
        robot.set_length(1.0);
        assert!((robot.goal_m - 0.36).abs() < 1e-6);
    }

    #[test]
    fn a_motion_that_nobody_renews_for_100_ms_is_a_standstill_and_a_renewed_one_goes_on() {
        let target = |robot: &Balancer| (robot.velocity_m_s, robot.yaw_rad_s);
        let mut robot = standing();
        robot.set_motion(1.0, 2.0);
        upright(&mut robot, 99, 0.25, 69.0);
        assert_eq!(target(&robot), (1.0, 2.0));
        // A pilot that is dead: the balance goes on, toward zero.
        upright(&mut robot, 3, 0.25, 69.0);
        assert_eq!((target(&robot), robot.phase()), ((0.0, 0.0), BalancePhase::Standing));
        let mut told = robot;
        told.set_motion(0.0, 0.0);
        assert_eq!(upright(&mut robot, 9, 0.25, 69.0), upright(&mut told, 9, 0.25, 69.0));
        for _ in 0..50 {
            robot.set_motion(1.0, 2.0);
            upright(&mut robot, 10, 0.25, 69.0);
        }
        assert_eq!(target(&robot), (1.0, 2.0));
        // It ages while the robot lies, too.
        robot.stop();
        for _ in 0..150 {
            assert_eq!(robot.update(None, None, REST), None);
        }
        robot.start();
        upright(&mut robot, 1, 0.25, 69.0);
        assert_eq!(target(&robot), (0.0, 0.0));
    }

    #[test]
    fn a_turn_and_a_split_get_the_torque_that_the_balance_leaves() {
        let mut robot = standing();
        robot.set_motion(0.0, 6.0);
        let [left, right] = upright(&mut robot, 1, 0.25, 69.0);
        assert!(right.wheel_nm <= 5.0 && left.wheel_nm >= -5.0, "{left:?} {right:?}");
        assert!(right.wheel_nm - left.wheel_nm > 9.0, "{left:?} {right:?}");
        // The balance needs everything: both wheels drive under the body, and the turn waits.
        let legs = Some([leg(0.25, 69.0); 2]);
        let [left, right] = robot.update(Some(&tilted(0.0, 0.5)), legs, REST).unwrap();
        assert_eq!((left.wheel_nm, right.wheel_nm), (5.0, 5.0));
        // Hips that swing both legs back, and legs that are apart.
        let mut legs = [leg(0.25, 69.0); 2];
        (legs[0].angle_rad, legs[1].angle_rad) = (2.6, 2.0);
        let [left, right] = robot.update(Some(&tilted(0.0, 0.0)), Some(legs), REST).unwrap();
        assert_eq!((left.hip_nm, right.hip_nm), (-25.0, -25.0));
    }

    fn any() -> impl Strategy<Value = f32> {
        prop_oneof![
            30 => -0.6_f32..0.6,
            10 => -50.0_f32..50.0,
            1 => proptest::num::f32::ANY,
            1 => prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(f32::NEG_INFINITY)],
        ]
    }

    proptest! {
        #[test]
        fn each_wheel_and_each_hip_keeps_half_of_the_limit_and_a_turn_takes_nothing_of_the_balance(
            limits in [0.1_f32..40.0, 0.1_f32..200.0],
            phase in prop_oneof![
                Just(BalancePhase::Rising),
                Just(BalancePhase::Standing),
                Just(BalancePhase::Airborne),
            ],
            held in [any(), any(), any()],
            updates in prop::collection::vec(
                ([any(), any()], [any(), any(), any()], [any(), any()], [any(), any()], [any(), any()]),
                1..8,
            ),
            force_n in 0.0..140.0_f32,
        ) {
            let mut robot = Balancer::new(&MODEL, [0.14, 0.36], limits, 0.001).unwrap();
            robot.start();
            robot.phase = phase;
            let [place, heading, trim] = held.map(|part| if part.is_finite() { part } else { 0.0 });
            robot.place_m = within(place, FAR.0);
            robot.heading_rad = within(heading, FAR.1);
            robot.trim_nm = within(trim, TRIM.1);
            for (motion, [roll, pitch, wheel], [pitch_rate, yaw_rate], left, right) in updates {
                robot.set_motion(motion[0], motion[1]);
                let rates = [0.0, pitch_rate, yaw_rate].map(AngularVelocity::from_rad_per_s);
                let attitude = Attitude { rates, ..tilted(roll, pitch) };
                let legs = [left, right].map(|[angle_rad, rate_rad_s]| {
                    let mut leg = leg(0.25, force_n);
                    (leg.angle_rad, leg.angle_rad_s) = (angle_rad, rate_rad_s);
                    leg
                });
                let wheels = [AngularVelocity::from_rad_per_s(wheel); 2];
                let mut straight = robot;
                straight.set_motion(motion[0], 0.0);
                let straight = straight.update(Some(&attitude), Some(legs), wheels);
                let efforts = robot.update(Some(&attitude), Some(legs), wheels);
                if let (Some([left, right]), Some([other, one])) = (efforts, straight) {
                    let taken = left.wheel_nm + right.wheel_nm - other.wheel_nm - one.wheel_nm;
                    prop_assert!(taken.abs() <= 1e-5 * limits[0], "{taken} Nm of the balance");
                }
                for effort in efforts.into_iter().flatten() {
                    prop_assert!(effort.wheel_nm.abs() <= 0.5 * limits[0], "{effort:?}");
                    prop_assert!(effort.hip_nm.abs() <= 0.5 * limits[1], "{effort:?}");
                    prop_assert!(effort.force_n.is_finite(), "{effort:?}");
                }
            }
        }
    }

    #[test]
    fn a_model_or_lengths_that_make_no_robot_are_named() {
        let made = |model: BalanceModel, lengths| {
            Balancer::new(&model, lengths, [10.0, 50.0], 0.001).map(|_| ())
        };
        let lengths = [0.14, 0.36];
        assert_eq!(
            made(BalanceModel { body_kg: 0.0, ..MODEL }, lengths),
            Err(ConfigError::NotPositive("body_kg"))
        );
        assert_eq!(
            made(BalanceModel { leg_kg: -1.0, ..MODEL }, lengths),
            Err(ConfigError::Negative("leg_kg"))
        );
        assert_eq!(made(MODEL, [0.3, 0.2]), Err(ConfigError::Reversed("lengths_m")));
        assert_eq!(made(MODEL, [0.3, f32::INFINITY]), Err(ConfigError::Reversed("lengths_m")));
        let limit = Balancer::new(&MODEL, lengths, [0.0, 50.0], 0.001).map(|_| ());
        assert_eq!(limit, Err(ConfigError::NotPositive("limit_nm")));
    }
}
