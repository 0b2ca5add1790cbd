use super::MotorKey;
use super::body::{Body, Velocity};

/// A mecanum chassis to attach to a [`World`](super::World): a rigid body on four wheels that can slip.
///
/// The rollers that touch the floor form an O. The motors sit inside with their shafts outward, so those on the
/// right turn clockwise to drive forward. The weight rests on all wheels alike.
///
/// The ground holds a wheel along the axis of the roller that touches it, with a force of at most friction times
/// load; below that the slip is some millimetres a second. Friction of motors and gearboxes is the motors' own.
///
/// # Examples
/// ```
/// use drivetrain::sim::ChassisConfig;
///
/// let chassis = ChassisConfig::new(0.076, 0.2, 0.18).with_mass_kg(25.0);
/// assert!(chassis.validate().is_ok());
/// assert_eq!(ChassisConfig::new(0.0, 0.2, 0.18).validate(), Err("wheel_radius_m"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChassisConfig {
    wheel_radius_m: f32,
    half_wheelbase_m: f32,
    half_track_m: f32,
    mass_kg: f32,
    yaw_inertia_kg_m2: f32,
    friction: f32,
}

impl ChassisConfig {
    /// Takes the radius of the wheels, half the distance of the axles, and half the distance of left and right
    /// wheels, all in m. The body weighs 20 kg, turns with 0.8 kg m² and grips with 0.8, until told otherwise.
    #[must_use]
    pub const fn new(wheel_radius_m: f32, half_wheelbase_m: f32, half_track_m: f32) -> Self {
        Self {
            wheel_radius_m,
            half_wheelbase_m,
            half_track_m,
            mass_kg: 20.0,
            yaw_inertia_kg_m2: 0.8,
            friction: 0.8,
        }
    }

    /// Sets the mass in kg, wheels included.
    #[must_use]
    pub const fn with_mass_kg(self, mass_kg: f32) -> Self {
        Self { mass_kg, ..self }
    }

    /// Sets the moment of inertia about the vertical axis in kg m².
    #[must_use]
    pub const fn with_yaw_inertia_kg_m2(self, yaw_inertia_kg_m2: f32) -> Self {
        Self { yaw_inertia_kg_m2, ..self }
    }

    /// Sets the friction of rollers on the floor, as force over load.
    #[must_use]
    pub const fn with_friction(self, friction: f32) -> Self {
        Self { friction, ..self }
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// The name of the first that is not above zero and at most 1000.
    pub const fn validate(&self) -> Result<(), &'static str> {
        const fn bad(value: f32) -> bool {
            !(value > 0.0 && value <= 1e3)
        }
        Err(if bad(self.wheel_radius_m) {
            "wheel_radius_m"
        } else if bad(self.half_wheelbase_m) {
            "half_wheelbase_m"
        } else if bad(self.half_track_m) {
            "half_track_m"
        } else if bad(self.mass_kg) {
            "mass_kg"
        } else if bad(self.yaw_inertia_kg_m2) {
            "yaw_inertia_kg_m2"
        } else if bad(self.friction) {
            "friction"
        } else {
            return Ok(());
        })
    }

    pub(crate) const fn body(&self) -> Body {
        Body::new(
            self.wheel_radius_m,
            self.half_wheelbase_m + self.half_track_m,
            self.mass_kg,
            self.yaw_inertia_kg_m2,
            self.friction,
        )
    }
}

/// Where a simulated chassis truly is, and how it truly moves.
///
/// The chassis starts at the origin, facing along the world's x axis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ChassisState {
    /// Along the world's x axis, in m.
    pub x_m: f64,
    /// Along the world's y axis, in m.
    pub y_m: f64,
    /// Counter-clockwise from the world's x axis, in rad, not reduced to one turn.
    pub heading_rad: f64,
    /// Forward velocity in m/s.
    pub vx_m_s: f32,
    /// Velocity to the left in m/s.
    pub vy_m_s: f32,
    /// Turn rate in rad/s, counter-clockwise positive.
    pub wz_rad_s: f32,
}

/// A chassis in a world: its body and its wheels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chassis {
    pub(crate) body: Body,
    /// Front left, front right, rear left, rear right.
    pub(crate) wheels: [MotorKey; 4],
}

/// The direction in which each motor turns to drive forward.
pub(crate) const FORWARD: [f32; 4] = [1.0, -1.0, 1.0, -1.0];

impl Chassis {
    pub(crate) fn state(&self) -> ChassisState {
        let (x_m, y_m, heading_rad) = self.body.pose();
        let Velocity { vx, vy, wz } = self.body.velocity_body();
        ChassisState { x_m, y_m, heading_rad, vx_m_s: vx, vy_m_s: vy, wz_rad_s: wz }
    }
}
