//! Legs of five bars, and the model of a robot that balances on two of them.

use super::positive;
use crate::control::solved;
use crate::control::state_space::LinearSystem;
use crate::error::{ConfigError, check};
use crate::math::{atan2, sin_cos, sqrt};
use crate::units::{Angle, AngularVelocity};

/// The kinematics of a leg of five bars: two joints at the body, a wheel at the lower end.
///
/// ```text
///          hip_m  hip_m                x forward, z up, from the middle of both joints
///     rear o---- + ----o front         angles are about y (left): positive turns x down
///    upper/      |      \upper         front: 0 points forward, rear: 180° points backward
///        o       |       o             length: from the middle of the joints to the wheel
///    lower \     |L    / lower         angle: positive when the wheel is behind, so that the leg leans forward
///            \   |   /
///              (wheel)                 the wheel's motor is on the lower bar of the front
/// ```
/// Derivatives are closed forms, so no state of the leg is a difference of angles over time.
///
/// # Examples
/// ```
/// use drivetrain::chassis::FiveBar;
/// use drivetrain::units::AngularVelocity;
///
/// let leg = FiveBar::new(0.075, 0.15, 0.27)?;
/// let angles = leg.angles(0.25, 0.1).ok_or("out of reach")?;
/// let state = leg.state(angles, [AngularVelocity::ZERO; 2], [0.0; 2]).ok_or("does not close")?;
/// assert!((state.length_m - 0.25).abs() < 2e-3 && (state.angle_rad - 0.1).abs() < 2e-2); // 1e-5 without `micromath`
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// Reference: J. J. Craig, *Introduction to Robotics*, 3rd edition, chapter 5 (Jacobian, static forces).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FiveBar {
    hip_m: f32,
    upper_m: f32,
    lower_m: f32,
}

/// A leg as seen from the body: a line from the hip to the wheel, its rates and its force.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LegState {
    /// From the hip to the axle of the wheel, in m.
    pub length_m: f32,
    /// Angle to the body's vertical in rad; positive leans forward.
    pub angle_rad: f32,
    /// Rate of the length in m/s.
    pub length_m_s: f32,
    /// Rate of the angle in rad/s.
    pub angle_rad_s: f32,
    /// Rate of the bar with the wheel's motor against the body in rad/s; positive turns forward down.
    pub carrier_rad_s: f32,
    /// Force along the leg that the measured torques of the joints make, in N; positive pushes the wheel away.
    pub force_n: f32,
    /// Rates of length, angle and carrier for each joint: front, rear.
    jacobian: [[f32; 2]; 3],
}

/// Efforts of a leg as a line with a wheel.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LegEffort {
    /// Force along the leg in N; positive pushes the wheel away.
    pub force_n: f32,
    /// Torque of the body on the leg in Nm; positive turns the leg forward.
    pub hip_nm: f32,
    /// Torque of the leg on the wheel in Nm; positive rolls forward.
    pub wheel_nm: f32,
}

/// A vector in the plane of the leg: x forward, z up.
type Flat = [f32; 2];

impl FiveBar {
    /// Takes half of the distance between the joints, and the lengths of upper and lower bars, in m.
    ///
    /// # Errors
    /// Names the length that is not above zero and finite. [`ConfigError::Conflict`] with `lower_m`: the upper bars cannot point
    /// outward, since `lower_m` is not longer than `upper_m` and `hip_m` together.
    pub const fn new(hip_m: f32, upper_m: f32, lower_m: f32) -> Result<Self, ConfigError> {
        check!(positive(hip_m, "hip_m"));
        check!(positive(upper_m, "upper_m"));
        check!(positive(lower_m, "lower_m"));
        check!(ConfigError::check_conflict(lower_m <= upper_m + hip_m, "lower_m"));
        Ok(Self { hip_m, upper_m, lower_m })
    }

    /// Returns the leg at the angles, rates and torques in Nm of both joints: front, rear.
    ///
    /// `None` if the bars cannot close, are within 3 % of their stretched or folded position, where forces have no bound, or if an argument is NaN or
    /// infinite.
    ///
    /// Costs 522 instructions on a Cortex-M4F, with the torques of a force (`docs/figures.md`).
    #[must_use]
    pub fn state(
        &self,
        angles: [Angle; 2],
        rates: [AngularVelocity; 2],
        torques_nm: [f32; 2],
    ) -> Option<LegState> {
        let [front, rear] = angles.map(|angle| sin_cos(angle.as_radians()));
        let knee =
            |hip_m: f32, (sin, cos): (f32, f32)| [hip_m + self.upper_m * cos, -self.upper_m * sin];
        let (front_knee, rear_knee) = (knee(self.hip_m, front), knee(-self.hip_m, rear));
        // Half of the way between the knees, and the height of the triangle below it.
        let half = [0.5 * (front_knee[0] - rear_knee[0]), 0.5 * (front_knee[1] - rear_knee[1])];
        let width = sqrt(dot(half, half));
        let height = sqrt((self.lower_m * self.lower_m - width * width).max(0.0));
        if !(height > LEAST * self.lower_m && width > LEAST * self.lower_m) {
            return None;
        }
        let down = [half[1] / width, -half[0] / width];
        let wheel = [
            0.5 * (front_knee[0] + rear_knee[0]) + height * down[0],
            0.5 * (front_knee[1] + rear_knee[1]) + height * down[1],
        ];
        let length_m = sqrt(dot(wheel, wheel));
        // The lower bars keep their length: both say how the wheel moves with each joint.
        let bars = [difference(wheel, front_knee), difference(wheel, rear_knee)];
        let determinant = bars[0][0] * bars[1][1] - bars[0][1] * bars[1][0];
        let moved = |first: f32, second: f32| -> Flat {
            [
                (first * bars[1][1] - second * bars[0][1]) / determinant,
                (second * bars[0][0] - first * bars[1][0]) / determinant,
            ]
        };
        let knee_moved = |(sin, cos): (f32, f32)| [-self.upper_m * sin, -self.upper_m * cos];
        let front_moved = knee_moved(front);
        let by_front = moved(dot(bars[0], front_moved), 0.0);
        let by_rear = moved(0.0, dot(bars[1], knee_moved(rear)));
        let square = length_m * length_m;
        let turned = |by: Flat| (wheel[1] * by[0] - wheel[0] * by[1]) / square;
        let of_carrier =
            |by: Flat| (bars[0][1] * by[0] - bars[0][0] * by[1]) / (self.lower_m * self.lower_m);
        let jacobian = [
            [dot(wheel, by_front) / length_m, dot(wheel, by_rear) / length_m],
            [turned(by_front), turned(by_rear)],
            [of_carrier(difference(by_front, front_moved)), of_carrier(by_rear)],
        ];
        let rates = rates.map(AngularVelocity::as_rad_per_s);
        let [along, around, _] = jacobian;
        let force_n = (torques_nm[0] * around[1] - torques_nm[1] * around[0])
            / (along[0] * around[1] - along[1] * around[0]);
        let [length_m_s, angle_rad_s, carrier_rad_s] = jacobian.map(|row| dot(row, rates));
        let state = LegState {
            length_m,
            angle_rad: atan2(-wheel[0], -wheel[1]),
            length_m_s,
            angle_rad_s,
            carrier_rad_s,
            force_n,
            jacobian,
        };
        let values = [length_m, force_n, length_m_s, angle_rad_s, carrier_rad_s];
        values.iter().all(|value| value.is_finite()).then_some(state)
    }

    /// Returns the angles of both joints, front and rear, at a length in m and an angle in rad, with both upper bars outward; `None` out of reach.
    #[must_use]
    pub fn angles(&self, length_m: f32, angle_rad: f32) -> Option<[Angle; 2]> {
        let (sin, cos) = sin_cos(angle_rad);
        let wheel = [-length_m * sin, -length_m * cos];
        let angle = |hip_m: f32, outward: f32| {
            let way = difference(wheel, [hip_m, 0.0]);
            let square = dot(way, way);
            let distance = sqrt(square);
            let upper = self.upper_m * self.upper_m - self.lower_m * self.lower_m;
            let cosine = (upper + square) / (2.0 * self.upper_m * distance);
            let at_hip = atan2(sqrt((1.0 - cosine * cosine).max(0.0)), cosine);
            let angle = Angle::from_radians(atan2(-way[1], way[0]) - outward * at_hip);
            (cosine.abs() <= 1.0).then_some(angle)
        };
        Some([angle(self.hip_m, 1.0)?, angle(-self.hip_m, -1.0)?])
    }
}

/// Least height and width of the triangle of the lower bars, as a share of them.
const LEAST: f32 = 0.03;

impl LegState {
    /// Returns the torques in Nm of both joints, front and rear, that make these efforts: the virtual model of a line with a wheel.
    ///
    /// The wheel's motor pushes against the bar that carries it, and not against the line; the torques compensate the difference.
    #[must_use]
    pub fn torques(&self, effort: &LegEffort) -> [f32; 2] {
        let [along, around, carrier] = self.jacobian;
        let joint = |along: f32, around: f32, carrier: f32| {
            along * effort.force_n
                + around * (effort.hip_nm - effort.wheel_nm)
                + carrier * effort.wheel_nm
        };
        [joint(along[0], around[0], carrier[0]), joint(along[1], around[1], carrier[1])]
    }
}

fn dot(a: Flat, b: Flat) -> f32 {
    a[0] * b[0] + a[1] * b[1]
}

fn difference(a: Flat, b: Flat) -> Flat {
    [a[0] - b[0], a[1] - b[1]]
}

/// Masses and lengths of a robot that balances on two wheels with legs.
///
/// All of them describe the robot as it stands: a wheel on the floor, a line as leg, a body on top.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BalanceModel {
    /// Radius of a wheel in m.
    pub wheel_radius_m: f32,
    /// Mass of a wheel in kg.
    pub wheel_kg: f32,
    /// Inertia of a wheel about its axle in kg m², with that of the rotor times the square of its gear.
    pub wheel_kg_m2: f32,
    /// Mass of a leg in kg.
    pub leg_kg: f32,
    /// Inertia of a leg about its centre of mass in kg m².
    pub leg_kg_m2: f32,
    /// Where the centre of mass of a leg is: 0 at the wheel, 1 at the hip.
    pub leg_centre: f32,
    /// Mass of the body in kg.
    pub body_kg: f32,
    /// Inertia of the body for pitch about its centre of mass in kg m².
    pub body_kg_m2: f32,
    /// Height of the body's centre of mass above the hips in m; positive is above.
    pub body_height_m: f32,
}

/// Standard gravity in m/s².
pub(super) const GRAVITY: f32 = 9.806_65;

impl BalanceModel {
    /// Returns the plant about upright, for a leg length in m and a time step in s.
    ///
    /// ```text
    /// states   lean of the legs to the vertical, its rate; place and velocity of the wheels; pitch of the body, its rate (rad, m, s)
    /// inputs   torque of the wheels, torque of the body on the legs, of both sides together, in Nm
    /// ```
    /// Positive leans and rolls forward.
    ///
    /// # Errors
    /// Names the parameter: a length, mass or inertia of the wheels or the body that is not above zero; another one that is not finite.
    pub fn plant(&self, length_m: f32, dt_s: f32) -> Result<LinearSystem<6, 2>, ConfigError> {
        let positive = [
            (self.wheel_radius_m, "wheel_radius_m"),
            (self.wheel_kg, "wheel_kg"),
            (self.body_kg, "body_kg"),
            (self.body_kg_m2, "body_kg_m2"),
            (length_m, "length_m"),
        ];
        for (value, name) in positive {
            super::positive(value, name)?;
        }
        let not_negative = [
            (self.wheel_kg_m2, "wheel_kg_m2"),
            (self.leg_kg, "leg_kg"),
            (self.leg_kg_m2, "leg_kg_m2"),
            (self.leg_centre, "leg_centre"),
        ];
        for (value, name) in not_negative {
            super::not_negative(value, name)?;
        }
        if !self.body_height_m.is_finite() {
            return Err(ConfigError::NotFinite("body_height_m"));
        }
        let radius = self.wheel_radius_m;
        let wheels = 2.0 * (self.wheel_kg + self.wheel_kg_m2 / (radius * radius));
        let (leg, centre) = (2.0 * self.leg_kg, self.leg_centre * length_m);
        let (body, height) = (self.body_kg, self.body_height_m);
        // Kinetic energy of place, lean and pitch: half of vᵀ M v.
        let by_lean = leg * centre + body * length_m;
        let of_lean = leg * centre * centre + 2.0 * self.leg_kg_m2 + body * length_m * length_m;
        let mass = [
            [wheels + leg + body, by_lean, body * height],
            [by_lean, of_lean, body * length_m * height],
            [body * height, body * length_m * height, self.body_kg_m2 + body * height * height],
        ];
        // What moves them: lean and pitch by gravity, torques of the wheels and the hips.
        let forces = [
            [0.0, 0.0, 1.0 / radius, 0.0],
            [GRAVITY * by_lean, 0.0, -1.0, 1.0],
            [0.0, GRAVITY * body * height, 0.0, -1.0],
        ];
        // Without a solution, the plant is not finite, and refused.
        let [place, lean, pitch] = solved(&mass, &forces).unwrap_or([[f32::NAN; 4]; 3]);
        let states = |[lean, pitch, ..]: [f32; 4]| [lean, 0.0, 0.0, 0.0, pitch, 0.0];
        let inputs = |[.., wheel, hip]: [f32; 4]| [wheel, hip];
        let a = [
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            states(lean),
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            states(place),
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            states(pitch),
        ];
        let b = [[0.0; 2], inputs(lean), [0.0; 2], inputs(place), [0.0; 2], inputs(pitch)];
        LinearSystem::discretized(&a, &b, dt_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Angles of `micromath` are up to 0.3° off, and their differences are no rates.
    const IS_EXACT: bool = !cfg!(feature = "micromath");
    const LEG: FiveBar = FiveBar { hip_m: 0.075, upper_m: 0.15, lower_m: 0.27 };

    fn state(angles: [f32; 2], rates: [f32; 2], torques_nm: [f32; 2]) -> Option<LegState> {
        let rates = rates.map(AngularVelocity::from_rad_per_s);
        LEG.state(angles.map(Angle::from_radians), rates, torques_nm)
    }

    fn angles(length_m: f32, angle_rad: f32) -> [f32; 2] {
        LEG.angles(length_m, angle_rad).unwrap().map(Angle::as_radians)
    }

    #[test]
    fn a_wheel_that_moves_backward_leans_the_leg_forward() {
        let forward = state(angles(0.25, 0.2), [0.0; 2], [0.0; 2]).unwrap();
        assert!(forward.angle_rad > 0.19);
        // Both joints turn forward down: the wheel goes backward.
        let turned = state(angles(0.25, 0.0), [1.0, 1.0], [0.0; 2]).unwrap();
        assert!(turned.angle_rad_s > 0.3 && turned.length_m_s.abs() < 1e-6);
        // The front turns down and the rear too, against it: the leg gets longer.
        let longer = state(angles(0.25, 0.0), [1.0, -1.0], [0.0; 2]).unwrap();
        assert!(longer.length_m_s > 0.05 && longer.angle_rad_s.abs() < 1e-5);
    }

    #[test]
    fn bars_that_do_not_close_or_that_are_stretched_are_no_leg() {
        assert_eq!(state([0.0, core::f32::consts::PI], [0.0; 2], [0.0; 2]).map(|_| ()), Some(()));
        assert_eq!(state([-1.6, 4.7], [f32::NAN, 0.0], [0.0; 2]), None);
        assert_eq!(state([f32::NAN, 3.0], [0.0; 2], [0.0; 2]), None);
        let wide = FiveBar { lower_m: 0.225_05, ..LEG };
        let flat = [Angle::from_radians(0.0), Angle::from_radians(core::f32::consts::PI)];
        assert_eq!(wide.state(flat, [AngularVelocity::ZERO; 2], [0.0; 2]), None);
        assert_eq!(LEG.angles(0.5, 0.0), None);
        assert_eq!(LEG.angles(f32::NAN, 0.0), None);
    }

    #[test]
    fn lengths_that_make_no_leg_are_named() {
        assert_eq!(FiveBar::new(0.0, 0.15, 0.27), Err(ConfigError::NotPositive("hip_m")));
        assert_eq!(FiveBar::new(0.075, f32::NAN, 0.27), Err(ConfigError::NotPositive("upper_m")));
        assert_eq!(FiveBar::new(0.075, 0.15, -1.0), Err(ConfigError::NotPositive("lower_m")));
        assert_eq!(FiveBar::new(0.075, 0.15, 0.2), Err(ConfigError::Conflict("lower_m")));
    }

    proptest! {
        #[test]
        fn length_and_angle_come_back(length_m in 0.15_f32..0.36, angle_rad in -0.5_f32..0.5) {
            let found = state(angles(length_m, angle_rad), [0.0; 2], [0.0; 2]).unwrap();
            let (length_off, angle_off) = if IS_EXACT { (1e-5, 1e-4) } else { (5e-3, 3e-2) };
            prop_assert!((found.length_m - length_m).abs() < length_off);
            prop_assert!((found.angle_rad - angle_rad).abs() < angle_off);
        }

        #[test]
        fn rates_are_the_differences_over_time(
            length_m in 0.15_f32..0.36, angle_rad in -0.5_f32..0.5, rates in prop::array::uniform2(-3.0_f32..3.0),
        ) {
            let start = angles(length_m, angle_rad);
            let dt_s = 1e-3;
            let at = |time_s: f32| {
                state([start[0] + rates[0] * time_s, start[1] + rates[1] * time_s], rates, [0.0; 2]).unwrap()
            };
            let (before, now, after) = (at(-dt_s), at(0.0), at(dt_s));
            let rate = |of: fn(&LegState) -> f32| (of(&after) - of(&before)) / (2.0 * dt_s);
            prop_assert!(!IS_EXACT || (rate(|it| it.length_m) - now.length_m_s).abs() < 2e-3);
            prop_assert!(!IS_EXACT || (rate(|it| it.angle_rad) - now.angle_rad_s).abs() < 5e-3);
        }

        #[test]
        fn joints_have_the_power_of_the_line_and_its_wheel(
            length_m in 0.15_f32..0.36, angle_rad in -0.5_f32..0.5, rates in prop::array::uniform2(-3.0_f32..3.0),
            force_n in -200.0_f32..200.0, hip_nm in -20.0_f32..20.0, wheel_nm in -5.0_f32..5.0,
        ) {
            let leg = state(angles(length_m, angle_rad), rates, [0.0; 2]).unwrap();
            let effort = LegEffort { force_n, hip_nm, wheel_nm };
            let torques = leg.torques(&effort);
            let of_joints = dot(torques, rates);
            // The wheel's motor takes from the bar what it gives to the wheel, the line only that of its own turn.
            let of_line = force_n * leg.length_m_s + (hip_nm - wheel_nm) * leg.angle_rad_s + wheel_nm * leg.carrier_rad_s;
            prop_assert!((of_joints - of_line).abs() < 1e-3 * (1.0 + of_line.abs()));
            let pushed = LegEffort { wheel_nm: 0.0, ..effort };
            let measured = state(angles(length_m, angle_rad), rates, leg.torques(&pushed)).unwrap();
            prop_assert!((measured.force_n - force_n).abs() < 0.05);
        }
    }
}
