use super::MotorKey;
use super::body::{Body, Velocity};
use crate::chassis::{MecanumGeometry, MecanumWheels};
use crate::geometry::{self, Twist};

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
/// use drivetrain::chassis::{MecanumGeometry, MecanumWheels};
/// use drivetrain::frame::CanFrame;
/// use drivetrain::sim::{ChassisConfig, Model, MotorConfig, World};
/// use drivetrain::time::Duration;
/// use embedded_can::nb::Can;
///
/// let world = World::new(1);
/// let ids = MecanumWheels { front_left: 2, front_right: 1, rear_left: 3, rear_right: 4 };
/// let wheels = ids.try_map(|id| world.attach(MotorConfig::new(Model::M3508, id)))?;
/// let geometry =
///     MecanumGeometry { wheel_radius_m: 0.076, half_wheelbase_m: 0.2, half_track_m: 0.18 };
/// world.attach_chassis(ChassisConfig::new(geometry).with_mass_kg(20.0), wheels)?;
///
/// // 2 A forward on every wheel: on the right the motors turn the other way.
/// let forward = CanFrame::standard(0x200, [0xF9, 0x9A, 6, 0x66, 6, 0x66, 0xF9, 0x9A]).ok_or("id")?;
/// world.controller().transmit(&forward).map_err(|_| "refused")?;
/// world.advance(Duration::from_millis(500));
/// let state = world.chassis().ok_or("no chassis")?;
/// assert!(state.twist.vx_m_s > 0.4 && state.twist.vy_m_s.abs() < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChassisConfig {
    geometry: MecanumGeometry,
    mass_kg: f32,
    yaw_inertia_kg_m2: f32,
    friction: f32,
}

impl ChassisConfig {
    /// Takes the dimensions. The body weighs 20 kg, turns with 0.8 kg m² and grips with 0.8, until told otherwise.
    #[must_use]
    pub const fn new(geometry: MecanumGeometry) -> Self {
        Self { geometry, mass_kg: 20.0, yaw_inertia_kg_m2: 0.8, friction: 0.8 }
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
        Err(if bad(self.geometry.wheel_radius_m) {
            "wheel_radius_m"
        } else if bad(self.geometry.half_wheelbase_m) {
            "half_wheelbase_m"
        } else if bad(self.geometry.half_track_m) {
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
            self.geometry.wheel_radius_m,
            self.geometry.half_wheelbase_m + self.geometry.half_track_m,
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
    /// Velocity in the body's frame.
    pub twist: Twist<geometry::Body>,
}

/// A chassis in a world: its body and its wheels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chassis {
    pub(crate) body: Body,
    pub(crate) wheels: MecanumWheels<MotorKey>,
}

/// The direction in which each motor turns to drive forward.
const FORWARD: MecanumWheels<f32> =
    MecanumWheels { front_left: 1.0, front_right: -1.0, rear_left: 1.0, rear_right: -1.0 };

impl Chassis {
    /// Returns every wheel's motor with the direction in which it turns to drive forward.
    pub(crate) fn mounted(&self) -> [(MotorKey, f32); 4] {
        self.wheels.zip(FORWARD).into_array()
    }

    pub(crate) fn state(&self) -> ChassisState {
        let (x_m, y_m, heading_rad) = self.body.pose();
        let Velocity { vx, vy, wz } = self.body.velocity_body();
        ChassisState { x_m, y_m, heading_rad, twist: Twist::new(vx, vy, wz) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{AttachError, World};
    use std::string::ToString;

    const GEOMETRY: MecanumGeometry =
        MecanumGeometry { wheel_radius_m: 0.076, half_wheelbase_m: 0.2, half_track_m: 0.18 };

    #[test]
    fn a_parameter_that_makes_no_sense_is_named() {
        let config = ChassisConfig::new(GEOMETRY);
        assert_eq!(config.validate(), Ok(()));
        let flat = MecanumGeometry { wheel_radius_m: 0.0, ..GEOMETRY };
        let table = [
            (ChassisConfig::new(flat), "wheel_radius_m"),
            (config.with_mass_kg(-1.0), "mass_kg"),
            (config.with_yaw_inertia_kg_m2(f32::NAN), "yaw_inertia_kg_m2"),
            (config.with_friction(f32::INFINITY), "friction"),
        ];
        for (config, name) in table {
            assert_eq!(config.validate(), Err(name));
            let error = World::new(1).attach_chassis(config, MecanumWheels::splat(MotorKey(0)));
            assert_eq!(error, Err(AttachError::Chassis(name)));
            assert!(AttachError::Chassis(name).to_string().starts_with(name));
        }
    }

    #[test]
    fn a_chassis_on_motors_of_another_world_stands_and_can_be_pushed() {
        let world = World::new(1);
        let wheels = MecanumWheels::splat(MotorKey(15));
        world.attach_chassis(ChassisConfig::new(GEOMETRY), wheels).unwrap();
        world.push_chassis(0.0, 1_000.0, f32::NAN);
        world.advance(crate::time::Duration::from_millis(100));
        let state = world.chassis().unwrap();
        assert!(state.y_m > 0.1 && state.x_m.abs() < 1e-3, "{state:?}");
        assert!(state.twist.wz_rad_s.abs() < 1e-3);
    }
}
