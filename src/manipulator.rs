//! Arms of several joints: the effort that holds their weight.
//!
//! ```text
//!        z                        elbow: axis -y through (0.25, 0, 0)
//!        ^    shoulder: axis -y    |
//!        |    through (0, 0, 0)    v          x
//!  base  o=========================o==========>
//!        | axis z                      the zero pose: all positions are 0
//! ```
//!
//! An arm is data: for each joint, from the base outward, its axis and the moved masses, all measured in the **base frame**
//! in the **zero pose**. No frame of a link is needed, nor an order of rotations (the screw axes of a product of exponentials). The
//! axes x, y, z are those of [`geometry`](crate::geometry): z points up if the base stands upright.
//!
//! | item | meaning |
//! |---|---|
//! | [`ArmJoint`] | an axis to turn about, or to slide along, and the masses between this joint and the next |
//! | [`SerialArm`] | the joints, a payload and the direction of gravity; from positions to efforts |
//!
//! # Signs and units
//! The position of a rotary joint is an angle in rad, positive counter-clockwise about its axis (right hand); of a prismatic joint,
//! a way in m, positive along its axis. Efforts are in Nm and N with the same signs: the effort is that of the **motor**, so a positive effort pushes the position upward. An encoder with another zero or sense is converted by the caller.
//!
//! # Example
//! The arm of the drawing lifts with positive angles. Level and stretched, the shoulder carries both links:
//!
//! ```
//! use drivetrain::geometry::Vec3;
//! use drivetrain::manipulator::{ArmJoint, SerialArm};
//!
//! let (up, lifting) = (Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.0, -1.0, 0.0));
//! let along = |x_m| Vec3::new(x_m, 0.0, 0.0);
//! let arm = SerialArm::new([
//!     ArmJoint::revolute(up, Vec3::ZERO)?,
//!     ArmJoint::revolute(lifting, Vec3::ZERO)?.with_mass(0.6, along(0.125))?,
//!     ArmJoint::revolute(lifting, along(0.25))?.with_mass(0.4, along(0.35))?,
//! ]);
//! let [base, shoulder, elbow] = arm.holding_efforts(&[0.3, 0.0, 0.0]).ok_or("a position is unknown")?;
//! assert_eq!(base, 0.0);
//! assert!((shoulder - 9.81 * (0.6 * 0.125 + 0.4 * 0.35)).abs() < 1e-6);
//! assert!((elbow - 9.81 * 0.4 * 0.10).abs() < 1e-6);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! # Limits
//! Joints follow each other: a closed chain (a parallelogram, a belt from a motor in the base) is not a serial arm. Inertia, friction
//! and springs are not in the effort. The example `arm` drives one; `judges/README.md` has the comparison with `MuJoCo`.
//!
//! Reference: Lynch and Park, *Modern Robotics*, 4.1 (product of exponentials) and 8.3 (Newton and Euler, at rest).

use crate::error::ConfigError;
use crate::geometry::Vec3;
use crate::math::sin_cos;

/// The longest distance from the origin in m, and the largest mass in kg, of a part.
const MOST: f32 = 1_000.0;

/// A joint of a serial arm with its link, in the base frame in the zero pose.
///
/// Without [`with_mass`](Self::with_mass) the link weighs nothing.
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::geometry::Vec3;
/// use drivetrain::manipulator::ArmJoint;
///
/// // A tube of 0.6 kg, and the motor of the next joint at its end.
/// let shoulder = ArmJoint::revolute(Vec3::new(0.0, -1.0, 0.0), Vec3::ZERO)?
///     .with_mass(0.6, Vec3::new(0.125, 0.0, 0.0))?
///     .with_mass(0.3, Vec3::new(0.25, 0.0, 0.0))?;
/// assert!((shoulder.mass_kg() - 0.9).abs() < 1e-6);
/// assert_eq!(ArmJoint::prismatic(Vec3::ZERO), Err(ConfigError::NotPositive("length of the axis")));
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ArmJoint {
    /// Of length 1.
    axis: Vec3,
    motion: JointMotion,
    load: Load,
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum JointMotion {
    /// About the axis through this place.
    Turns(Vec3),
    Slides,
}

/// Masses as one: the sum, and the sum of mass times place, in kg and kg m.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Load {
    mass: f32,
    moment: Vec3,
}

impl ArmJoint {
    /// Takes a rotary joint: its axis, of any length above 1e-6, and a place on the axis in m.
    ///
    /// Any place on the axis will do.
    ///
    /// # Errors
    /// [`ConfigError`] if a number is NaN or infinite, the axis has no length, or the place is farther than 1000 m.
    pub fn revolute(axis: Vec3, through_m: Vec3) -> Result<Self, ConfigError> {
        place("through_m", through_m)?;
        Self::new(axis, JointMotion::Turns(through_m))
    }

    /// Takes a prismatic joint: its axis, of any length above 1e-6.
    ///
    /// # Errors
    /// [`ConfigError`] if a number is NaN or infinite, or the axis has no length.
    pub fn prismatic(axis: Vec3) -> Result<Self, ConfigError> {
        Self::new(axis, JointMotion::Slides)
    }

    /// Adds a mass in kg to the link between this joint and the next, with its centre of mass in m.
    ///
    /// A link of several parts takes one call for each.
    ///
    /// # Errors
    /// [`ConfigError`] if the mass is negative or above 1000 kg, or the centre farther than 1000 m; NaN is neither.
    pub fn with_mass(self, mass_kg: f32, centre_m: Vec3) -> Result<Self, ConfigError> {
        Ok(Self { load: self.load.plus(Load::new(mass_kg, centre_m)?), ..self })
    }

    /// Returns the mass of the link in kg.
    #[must_use]
    pub const fn mass_kg(&self) -> f32 {
        self.load.mass
    }

    fn new(axis: Vec3, motion: JointMotion) -> Result<Self, ConfigError> {
        const LEAST: f32 = 1e-6;
        if !axis.is_finite() {
            return Err(ConfigError::NotFinite("axis"));
        }
        // Squares of large numbers would overflow.
        let size = axis.x.abs().max(axis.y.abs()).max(axis.z.abs());
        if size < LEAST {
            return Err(ConfigError::NotPositive("length of the axis"));
        }
        let [x, y, z] = [axis.x, axis.y, axis.z].map(|part| part / size);
        let scaled = Vec3::new(x, y, z);
        Ok(Self { axis: scaled * (1.0 / scaled.norm()), motion, load: Load::NONE })
    }
}

impl Load {
    const NONE: Self = Self { mass: 0.0, moment: Vec3::ZERO };

    fn new(mass_kg: f32, centre_m: Vec3) -> Result<Self, ConfigError> {
        ConfigError::check_range("mass_kg", mass_kg, 0.0, MOST)?;
        place("centre_m", centre_m)?;
        Ok(Self { mass: mass_kg, moment: centre_m * mass_kg })
    }

    fn plus(self, other: Self) -> Self {
        Self { mass: self.mass + other.mass, moment: self.moment + other.moment }
    }
}

fn place(parameter: &'static str, place: Vec3) -> Result<(), ConfigError> {
    ConfigError::check_range(parameter, place.x, -MOST, MOST)?;
    ConfigError::check_range(parameter, place.y, -MOST, MOST)?;
    ConfigError::check_range(parameter, place.z, -MOST, MOST)
}

/// An arm of `N` joints that follow each other, from the base outward.
///
/// # Examples
/// A lift of 2 kg that carries a forearm with a gripper, and takes up a crate:
/// ```
/// use drivetrain::geometry::Vec3;
/// use drivetrain::manipulator::{ArmJoint, SerialArm};
///
/// let up = Vec3::new(0.0, 0.0, 1.0);
/// let mut arm = SerialArm::new([
///     ArmJoint::prismatic(up)?.with_mass(2.0, Vec3::ZERO)?,
///     ArmJoint::revolute(Vec3::new(0.0, -1.0, 0.0), Vec3::ZERO)?.with_mass(0.5, Vec3::new(0.2, 0.0, 0.0))?,
/// ]);
/// let poses = [[0.1, 0.0], [0.1, core::f32::consts::FRAC_PI_2]]; // level, and upright
/// let [level, upright] = poses.map(|pose| arm.holding_efforts(&pose).unwrap_or_default());
/// assert!((level[0] - 24.525).abs() < 1e-5 && (level[1] - 0.981).abs() < 1e-6); // N, Nm
/// assert!((upright[0] - 24.525).abs() < 1e-5 && upright[1].abs() < 1e-6);
///
/// arm.set_payload(1.0, Vec3::new(0.4, 0.0, 0.0))?;
/// let [lift_n, forearm_nm] = arm.holding_efforts(&[0.1, 0.0]).ok_or("a position is unknown")?;
/// assert!((lift_n - 34.335).abs() < 1e-5 && (forearm_nm - 4.905).abs() < 1e-5);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SerialArm<const N: usize> {
    joints: [ArmJoint; N],
    payload: Load,
    gravity: Vec3,
}

impl<const N: usize> SerialArm<N> {
    /// The acceleration of gravity in the base frame of an upright base, in m/s².
    pub const UPRIGHT: Vec3 = Vec3::new(0.0, 0.0, -9.81);

    /// Takes the joints from the base outward; the base stands upright, and there is no payload.
    #[must_use]
    pub const fn new(joints: [ArmJoint; N]) -> Self {
        Self { joints, payload: Load::NONE, gravity: Self::UPRIGHT }
    }

    /// Sets the acceleration of gravity in the base frame, in m/s².
    ///
    /// For a tilted or hanging base, this is [`UPRIGHT`](Self::UPRIGHT) behind the inverse of its attitude.
    ///
    /// # Errors
    /// [`ConfigError::NotFinite`] for NaN and infinity, and [`ConfigError::Unusable`] above 1000 m/s²; the arm then keeps the last.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::geometry::{Rotation3, Vec3};
    /// use drivetrain::manipulator::{ArmJoint, SerialArm};
    /// use drivetrain::units::Angle;
    ///
    /// let link = ArmJoint::revolute(Vec3::new(0.0, -1.0, 0.0), Vec3::ZERO)?.with_mass(1.0, Vec3::new(0.5, 0.0, 0.0))?;
    /// let mut arm = SerialArm::new([link]);
    /// // The chassis stands on a slope, nose up by 30 degrees: the level arm points up by as much.
    /// let attitude = Rotation3::from_roll_pitch_yaw(Angle::ZERO, Angle::from_degrees(-30.0), Angle::ZERO);
    /// arm.set_gravity(attitude.inverse().apply(SerialArm::<1>::UPRIGHT))?;
    /// let [effort_nm] = arm.holding_efforts(&[0.0]).unwrap_or_default();
    /// assert!((effort_nm - 9.81 * 0.5 * 0.866_025_4).abs() < 1e-5);
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub fn set_gravity(&mut self, gravity_m_s2: Vec3) -> Result<(), ConfigError> {
        if !gravity_m_s2.is_finite() {
            return Err(ConfigError::NotFinite("gravity_m_s2"));
        }
        // The negation of NaN or of an infinite square.
        let is_valid = gravity_m_s2.dot(gravity_m_s2) <= 1e6;
        if !is_valid {
            return Err(ConfigError::Unusable("gravity_m_s2"));
        }
        self.gravity = gravity_m_s2;
        Ok(())
    }

    /// Sets the mass that the last link carries, in kg, and its centre in m, in the base frame **in the zero pose**; 0 kg is none.
    ///
    /// A controller that takes over a new payload at once jumps by its weight: set it when the gripper has closed.
    ///
    /// # Errors
    /// [`ConfigError`] if the mass is negative or above 1000 kg, or the centre farther than 1000 m; NaN is neither. The arm then
    /// keeps the last payload.
    pub fn set_payload(&mut self, mass_kg: f32, centre_m: Vec3) -> Result<(), ConfigError> {
        self.payload = Load::new(mass_kg, centre_m)?;
        Ok(())
    }

    /// Returns the efforts that hold the weight of the arm at these positions: Nm of rotary joints, N of prismatic joints.
    ///
    /// If a position is NaN or infinite, or an effort is beyond `f32`, the result is `None`: the weight of the arm is unknown then,
    /// and no number would hold it. Efforts are right to 2e-6 of the weight
    /// times the size of the arm.
    ///
    /// Two passes: gravity is turned outward into each link, then the masses are gathered inward. In the frame of a link, axis and
    /// centre of mass stay where the zero pose has them.
    ///
    /// Costs 1253 instructions on a Cortex-M4F, for six joints (`docs/figures.md`).
    #[must_use]
    pub fn holding_efforts(&self, positions: &[f32; N]) -> Option<[f32; N]> {
        let mut links = self.joints.each_ref().map(|joint| Link {
            joint,
            position: 0.0,
            sine: 0.0,
            cosine: 1.0,
            gravity: self.gravity,
            effort: 0.0,
        });
        let mut gravity = self.gravity;
        for (link, &position) in links.iter_mut().zip(positions) {
            link.position = position;
            if let JointMotion::Turns(_) = link.joint.motion {
                (link.sine, link.cosine) = sin_cos(position);
                gravity = turned(gravity, link.joint.axis, -link.sine, link.cosine);
            }
            link.gravity = gravity;
        }
        let mut load = self.payload;
        for link in links.iter_mut().rev() {
            let ArmJoint { axis, motion, load: own } = *link.joint;
            load = load.plus(own);
            match motion {
                JointMotion::Turns(through) => {
                    let lever = load.moment - through * load.mass;
                    link.effort = -axis.dot(lever.cross(link.gravity));
                    load.moment = through * load.mass + turned(lever, axis, link.sine, link.cosine);
                }
                JointMotion::Slides => {
                    link.effort = -axis.dot(link.gravity) * load.mass;
                    load.moment = load.moment + axis * (link.position * load.mass);
                }
            }
        }
        let is_known =
            links.iter().all(|link| link.position.is_finite() && link.effort.is_finite());
        is_known.then(|| links.map(|link| link.effort))
    }
}

/// A joint on the way outward and back.
struct Link<'a> {
    joint: &'a ArmJoint,
    position: f32,
    sine: f32,
    cosine: f32,
    /// In the frame of the link.
    gravity: Vec3,
    effort: f32,
}

/// Returns a vector turned about an axis of length 1, by the angle of this sine and cosine (Rodrigues).
fn turned(vector: Vec3, axis: Vec3, sine: f32, cosine: f32) -> Vec3 {
    vector * cosine + axis.cross(vector) * sine + axis * (axis.dot(vector) * (1.0 - cosine))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    const UP: Vec3 = Vec3::new(0.0, 0.0, 1.0);
    const NAN: Vec3 = Vec3::new(0.0, f32::NAN, 0.0);
    const FAR: Vec3 = Vec3::new(0.0, 0.0, -1_001.0);

    #[test]
    fn an_axis_without_length_or_of_no_number_is_refused() {
        let short = Vec3::new(1e-7, 0.0, -1e-7);
        let endless = Vec3::new(f32::INFINITY, 0.0, 0.0);
        for (axis, error) in [
            (Vec3::ZERO, ConfigError::NotPositive("length of the axis")),
            (short, ConfigError::NotPositive("length of the axis")),
            (NAN, ConfigError::NotFinite("axis")),
            (endless, ConfigError::NotFinite("axis")),
        ] {
            assert_eq!(ArmJoint::revolute(axis, Vec3::ZERO), Err(error));
            assert_eq!(ArmJoint::prismatic(axis), Err(error));
        }
    }

    #[test]
    fn an_axis_of_any_length_counts_as_one_of_length_1() {
        for length in [1e-5, 0.3, 1.0, 40.0, 1e30] {
            let joint = ArmJoint::prismatic(Vec3::new(3.0, 0.0, -4.0) * (0.2 * length)).unwrap();
            assert!((joint.axis - Vec3::new(0.6, 0.0, -0.8)).norm() < 2e-7, "{joint:?}");
        }
    }

    #[test]
    fn a_mass_or_a_place_beyond_its_range_is_named_with_its_value() {
        let joint = ArmJoint::prismatic(UP).unwrap();
        for mass in [-0.1, 1_000.5, f32::NAN, f32::INFINITY] {
            let error = joint.with_mass(mass, Vec3::ZERO).unwrap_err();
            assert_eq!(error.to_string(), std::format!("mass_kg {mass}: 0 to 1000 are allowed"));
        }
        for centre in [NAN, FAR] {
            assert_eq!(joint.with_mass(1.0, centre).unwrap_err().parameter(), "centre_m");
            assert_eq!(ArmJoint::revolute(UP, centre).unwrap_err().parameter(), "through_m");
        }
    }

    type Place = [f64; 3];

    /// A joint in `f64`: axis (any length), place on it if it turns, mass, centre.
    #[derive(Debug, Clone, Copy)]
    struct Data {
        axis: Vec3,
        through: Option<Vec3>,
        mass: f32,
        centre: Vec3,
    }

    const fn exact(vector: Vec3) -> Place {
        [vector.x as f64, vector.y as f64, vector.z as f64]
    }

    fn plus(a: Place, b: Place, factor: f64) -> Place {
        std::array::from_fn(|part| a[part] + factor * b[part])
    }

    /// Moves a place by one joint: a quaternion, and no sum that gravity has anything to do with.
    fn moved(joint: &Data, position: f64, place: Place) -> Place {
        let axis = exact(joint.axis);
        let length = axis.iter().map(|part| part * part).sum::<f64>().sqrt();
        let axis = axis.map(|part| part / length);
        let Some(through) = joint.through.map(exact) else { return plus(place, axis, position) };
        let (sine, w) = (0.5 * position).sin_cos();
        let [x, y, z] = axis.map(|part| part * sine);
        let [px, py, pz] = plus(place, through, -1.0);
        let rows = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        plus(rows.map(|[a, b, c]| a * px + b * py + c * pz), through, 1.0)
    }

    /// The potential energy in J: the weight of each mass at its place in the world, by forward kinematics.
    fn energy(joints: &[Data], payload: (f32, Vec3), gravity: Vec3, positions: &[f64]) -> f64 {
        let masses = joints.iter().map(|joint| (joint.mass, joint.centre)).chain([payload]);
        let lasts = (1..=joints.len()).chain([joints.len()]);
        masses.zip(lasts).fold(0.0, |energy, ((mass, centre), last)| {
            let outward = joints.iter().zip(positions).take(last).rev();
            let place = outward.fold(exact(centre), |place, (joint, q)| moved(joint, *q, place));
            let height: f64 = place.iter().zip(exact(gravity)).map(|(x, g)| -x * g).sum();
            energy + f64::from(mass) * height
        })
    }

    fn arm<const N: usize>(data: &[Data; N], payload: (f32, Vec3), gravity: Vec3) -> SerialArm<N> {
        let mut arm = SerialArm::new(data.map(|joint| {
            let made = match joint.through {
                Some(through) => ArmJoint::revolute(joint.axis, through),
                None => ArmJoint::prismatic(joint.axis),
            };
            made.unwrap().with_mass(joint.mass, joint.centre).unwrap()
        }));
        arm.set_payload(payload.0, payload.1).unwrap();
        arm.set_gravity(gravity).unwrap();
        arm
    }

    /// The effort is what a small motion of the joint adds to the energy.
    fn holds_by_energy<const N: usize>(
        data: &[Data],
        payload: (f32, Vec3),
        gravity: Vec3,
        positions: &[f32],
    ) -> Result<(), TestCaseError> {
        const STEP: f64 = 1e-4;
        let data: &[Data; N] = data[..N].try_into().unwrap();
        let positions: &[f32; N] = positions[..N].try_into().unwrap();
        let efforts = arm(data, payload, gravity).holding_efforts(positions).unwrap();
        let weight: f32 = data.iter().map(|joint| joint.mass).sum::<f32>() + payload.0;
        // Places lie within 1.8 m of the origin, and 6 joints slide by 2 m each.
        let most = f64::from(weight * gravity.norm()) * (14.0 * 1.8 + 12.0);
        for (index, effort) in efforts.into_iter().enumerate() {
            let at = |step: f64| {
                let mut positions = positions.map(f64::from);
                positions[index] += step;
                energy(data, payload, gravity, &positions)
            };
            let gradient = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            let error = (f64::from(effort) - gradient).abs();
            prop_assert!(error < 1e-6 * most, "joint {index} of {N}: {effort} {gradient}");
        }
        Ok(())
    }

    fn vectors() -> impl Strategy<Value = Vec3> {
        (-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    fn joints() -> impl Strategy<Value = Data> {
        let axis = vectors().prop_filter("no axis", |axis| axis.norm() > 0.1);
        (axis, vectors(), proptest::bool::weighted(0.75), 0.0_f32..5.0, vectors()).prop_map(
            |(axis, through, turns, mass, centre)| Data {
                axis,
                through: turns.then_some(through),
                mass,
                centre,
            },
        )
    }

    proptest! {
        #[test]
        fn the_effort_is_the_gradient_of_the_potential_energy(
            data in prop::collection::vec(joints(), 6),
            payload in (0.0_f32..3.0, vectors()),
            gravity in vectors().prop_map(|way| way * 9.81),
            positions in prop::collection::vec(-3.2_f32..3.2, 6),
        ) {
            // Joints that slide by up to 2 m.
            let positions: std::vec::Vec<f32> = data.iter().zip(positions).map(|(joint, position)| {
                if joint.through.is_some() { position } else { 0.6 * position }
            }).collect();
            holds_by_energy::<1>(&data, payload, gravity, &positions)?;
            holds_by_energy::<2>(&data, payload, gravity, &positions)?;
            holds_by_energy::<3>(&data, payload, gravity, &positions)?;
            holds_by_energy::<4>(&data, payload, gravity, &positions)?;
            holds_by_energy::<5>(&data, payload, gravity, &positions)?;
            holds_by_energy::<6>(&data, payload, gravity, &positions)?;
        }

        #[test]
        fn a_payload_is_a_mass_of_the_last_link(
            data in prop::collection::vec(joints(), 3),
            mass in 0.0_f32..3.0,
            centre in vectors(),
            positions in prop::array::uniform3(-3.0_f32..3.0),
        ) {
            let data: &[Data; 3] = data.as_slice().try_into().unwrap();
            let gravity = SerialArm::<3>::UPRIGHT;
            let carried = arm(data, (mass, centre), gravity).holding_efforts(&positions).unwrap();
            let mut welded = arm(data, (0.0, Vec3::ZERO), gravity);
            welded.joints[2] = welded.joints[2].with_mass(mass, centre).unwrap();
            for (a, b) in carried.into_iter().zip(welded.holding_efforts(&positions).unwrap()) {
                prop_assert!((a - b).abs() < 1e-3, "{a} {b}");
            }
        }
    }

    fn pendulum() -> SerialArm<1> {
        let link = ArmJoint::revolute(Vec3::new(0.0, -1.0, 0.0), Vec3::ZERO).unwrap();
        SerialArm::new([link.with_mass(2.0, Vec3::new(0.5, 0.0, 0.0)).unwrap()])
    }

    #[test]
    fn a_level_link_needs_its_weight_times_its_lever_upward_and_an_upright_one_nothing() {
        let arm = pendulum();
        for (degrees, effort) in [(0.0_f32, 9.81), (60.0, 4.905), (90.0, 0.0), (180.0, -9.81)] {
            let [held] = arm.holding_efforts(&[degrees.to_radians()]).unwrap();
            assert!((held - effort).abs() < 2e-6, "{degrees}: {held}");
        }
    }

    #[test]
    fn without_a_position_there_is_no_effort() {
        let slide = ArmJoint::prismatic(Vec3::new(1.0, 0.0, 0.0)).unwrap();
        let [link] = pendulum().joints;
        let arm = SerialArm::new([link, slide.with_mass(1.0, Vec3::ZERO).unwrap()]);
        assert!(arm.holding_efforts(&[0.5, 0.5]).is_some());
        for unknown in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(arm.holding_efforts(&[unknown, 0.0]), None);
            assert_eq!(arm.holding_efforts(&[0.0, unknown]), None);
        }
        assert_eq!(arm.holding_efforts(&[0.0, f32::MAX]), None, "the effort is beyond f32");
    }

    #[test]
    fn gravity_that_is_no_number_or_beyond_range_is_refused_and_the_last_stays() {
        let mut arm = pendulum();
        for gravity in [Vec3::new(0.0, f32::NAN, 0.0), Vec3::new(f32::INFINITY, 0.0, 0.0)] {
            assert_eq!(arm.set_gravity(gravity), Err(ConfigError::NotFinite("gravity_m_s2")));
        }
        for gravity in [Vec3::new(0.0, 0.0, -1_001.0), Vec3::new(1e30, 0.0, 0.0)] {
            assert_eq!(arm.set_gravity(gravity), Err(ConfigError::Unusable("gravity_m_s2")));
        }
        assert!(arm.set_payload(-1.0, Vec3::ZERO).is_err());
        assert_eq!(arm, pendulum());
        arm.set_gravity(Vec3::ZERO).unwrap(); // in orbit
        assert_eq!(arm.holding_efforts(&[0.0]), Some([0.0]));
    }
}
