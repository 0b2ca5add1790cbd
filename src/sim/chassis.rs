use super::MotorKey;
use super::body::{Body, Contact, Rolling, Velocity};
use super::esc::Esc;
use super::motor::MOTORS;
use crate::geometry::{self, Pose2, Rotation2, Twist, Vec2, World};
use crate::units::Angle;

/// A chassis to attach to a [`Simulation`](super::Simulation): a rigid body on wheels of any layout, all with slip.
///
/// The weight rests on all wheels alike. The floor holds each [`Wheel`] according to its kind, with a force of at most
/// friction times load, in all directions together; below this force the slip is some millimetres a second. Castors do
/// not count as wheels: they roll freely and carry nothing. Friction of motors and gearboxes belongs to the motors.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::geometry::Vec2;
/// use drivetrain::sim::{SimError, ChassisConfig, MotorConfig, Wheel, Simulation};
/// use drivetrain::time::Duration;
/// use embedded_can::nb::Can;
///
/// let world = Simulation::new(1);
/// let wheel = |id, x, y| -> Result<Wheel, SimError> {
///     Ok(Wheel::mecanum(world.attach(MotorConfig::m3508(id))?, 0.076, Vec2::new(x, y)))
/// };
/// // The motors sit inside with their shafts outward: those on the right turn clockwise to drive forward.
/// let wheels = [
///     wheel(2, 0.2, 0.18)?,
///     wheel(1, 0.2, -0.18)?.reversed(),
///     wheel(3, -0.2, 0.18)?,
///     wheel(4, -0.2, -0.18)?.reversed(),
/// ];
/// world.attach_chassis(ChassisConfig::new(&wheels).with_mass_kg(20.0))?;
///
/// // 2 A forward on every wheel.
/// let forward = CanFrame::standard(0x200, [0xF9, 0x9A, 6, 0x66, 6, 0x66, 0xF9, 0x9A]).ok_or("id")?;
/// world.controller().transmit(&forward).map_err(|_| "refused")?;
/// world.advance(Duration::from_millis(500));
/// let (pose, twist) = world.chassis().ok_or("no chassis")?;
/// assert!(twist.vx_m_s > 0.4 && twist.vy_m_s.abs() < 0.01 && pose.x_m > 0.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChassisConfig {
    wheels: [Option<Wheel>; Self::MAX_WHEELS],
    too_many: bool,
    mass_kg: f32,
    yaw_inertia_kg_m2: f32,
    friction: f32,
}

impl ChassisConfig {
    /// The largest number of wheels of a chassis.
    pub const MAX_WHEELS: usize = 8;

    /// Takes the wheels. The body weighs 20 kg, turns with 0.8 kg m² and grips with 0.8, until told otherwise.
    #[must_use]
    pub fn new(wheels: &[Wheel]) -> Self {
        let mut places = [None; Self::MAX_WHEELS];
        for (place, wheel) in places.iter_mut().zip(wheels) {
            *place = Some(*wheel);
        }
        let too_many = wheels.len() > Self::MAX_WHEELS;
        Self { wheels: places, too_many, mass_kg: 20.0, yaw_inertia_kg_m2: 0.8, friction: 0.8 }
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

    /// Sets the friction of wheels on the floor, as force over load.
    #[must_use]
    pub const fn with_friction(self, friction: f32) -> Self {
        Self { friction, ..self }
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// The name of the first invalid parameter: no wheel or more than eight, a length, mass, inertia or friction that is not
    /// above zero and at most 1000, a direction that is not finite, a joint as the motor of a wheel, a roller that lies nearly
    /// across its wheel.
    pub fn validate(&self) -> Result<(), &'static str> {
        if self.too_many || self.wheels().next().is_none() {
            return Err("number of wheels");
        }
        self.wheels().try_for_each(Wheel::validate)?;
        let named = [
            (self.mass_kg, "mass_kg"),
            (self.yaw_inertia_kg_m2, "yaw_inertia_kg_m2"),
            (self.friction, "friction"),
        ];
        match named.into_iter().find(|(value, _)| !(*value > 0.0 && *value <= 1e3)) {
            Some((_, name)) => Err(name),
            None => Ok(()),
        }
    }

    fn wheels(&self) -> impl Iterator<Item = &Wheel> + Clone {
        self.wheels.iter().flatten()
    }
}

/// A chassis in a world: its body and its wheels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chassis {
    pub(crate) body: Body,
    wheels: [Option<Mounted>; ChassisConfig::MAX_WHEELS],
}

/// A wheel with its constants.
#[derive(Debug, Clone, Copy)]
struct Mounted {
    wheel: Wheel,
    /// The present contact; turns with the steering motor only.
    contact: Contact,
    /// Its share of the inertia of its motor: one, unless the motor drives other wheels too.
    share: f32,
}

impl Chassis {
    /// Takes a valid configuration.
    pub(crate) fn new(config: &ChassisConfig) -> Self {
        let contacts = config.wheels().map(|wheel| wheel.contact(None));
        let ChassisConfig { mass_kg, yaw_inertia_kg_m2, friction, .. } = *config;
        let on_motor_of = |wheel: &Wheel| {
            let same = config.wheels().filter(|other| other.motor() == wheel.motor());
            same.fold(0.0, |count, _| count + 1.0_f32)
        };
        Self {
            body: Body::new(contacts, mass_kg, yaw_inertia_kg_m2, friction),
            wheels: config.wheels.map(|wheel| {
                let wheel = wheel?;
                let (contact, share) = (wheel.contact(None), 1.0 / on_motor_of(&wheel));
                Some(Mounted { wheel, contact, share })
            }),
        }
    }

    /// Moves the chassis on its motors by one step, and returns the torque of the ground on each motor. A wheel without
    /// a motor stands still.
    pub(crate) fn step(&mut self, escs: &Escs, dt_s: f32) -> [f32; MOTORS] {
        let esc = |motor: MotorKey| escs.get(motor.index())?.as_ref();
        let mut rolling = [NONE; ChassisConfig::MAX_WHEELS];
        let mut count = 0;
        for (place, mounted) in rolling.iter_mut().zip(self.wheels.iter_mut().flatten()) {
            let Mounted { wheel, contact, share } = mounted;
            if let Some(steering) = wheel.steering_motor().and_then(esc) {
                *contact = wheel.contact(Some(steering.rotor.shaft_rad()));
            }
            let (velocity, inertia) = match esc(wheel.motor()) {
                Some(esc) => (wheel.sign() * esc.rotor.velocity(), *share * esc.rotor.inertia()),
                None => (0.0, 1.0),
            };
            *place = Rolling { contact: *contact, velocity, inertia, torque: 0.0 };
            count += 1;
        }
        let rolling = rolling.get_mut(..count).unwrap_or_default();
        self.body.step(rolling, dt_s);
        let mut ground_nm = [0.0; MOTORS];
        for (rolling, mounted) in rolling.iter().zip(self.wheels.iter().flatten()) {
            if let Some(sum) = ground_nm.get_mut(mounted.wheel.motor().index()) {
                *sum += mounted.wheel.sign() * rolling.torque;
            }
        }
        ground_nm
    }

    #[expect(clippy::cast_possible_truncation, reason = "some metres and radians")]
    pub(crate) fn state(&self) -> (Pose2<World>, Twist<geometry::Body>) {
        let (x_m, y_m, heading_rad) = self.body.pose();
        let Velocity { vx, vy, wz } = self.body.velocity_body();
        let pose = Pose2::new(x_m as f32, y_m as f32, Angle::from_radians(heading_rad as f32));
        (pose, Twist::new(vx, vy, wz))
    }
}

/// The motors of a world.
pub(crate) type Escs = [Option<Esc>; MOTORS];

const NONE: Rolling = Rolling {
    contact: Contact {
        position: geometry::Vec2::ZERO,
        along: geometry::Vec2::ZERO,
        reach: 0.0,
        holds_across: false,
    },
    velocity: 0.0,
    inertia: 1.0,
    torque: 0.0,
};

/// A wheel under a simulated chassis: its motor, its contact with the floor, and the directions in which the floor
/// holds it.
///
/// | made by | the floor holds it | it rolls |
/// |---|---|---|
/// | [`plain`](Self::plain) | along and across | forward |
/// | [`steered`](Self::steered) | along and across | where its steering motor points |
/// | [`omni`](Self::omni) | along its rolling direction | in the direction given |
/// | [`mecanum`](Self::mecanum) | along the axis of the roller that touches it | forward |
///
/// A motor that turns counter-clockwise rolls its wheel forward; behind [`reversed`](Self::reversed), backward.
///
/// # Examples
/// ```
/// use drivetrain::geometry::Vec2;
/// use drivetrain::sim::{MotorConfig, Wheel, Simulation};
/// use drivetrain::units::Angle;
///
/// let world = Simulation::new(1);
/// let drive = world.attach(MotorConfig::m3508(1))?;
/// let steering = world.attach(MotorConfig::gm6020_voltage(1).with_rotor_angle(2048))?;
/// // The module points forward when its absolute encoder shows 90 degrees, as it does now.
/// let wheel = Wheel::steered(drive, 0.06, Vec2::new(0.2, 0.2), steering, Angle::from_degrees(90.0));
/// assert_eq!(wheel.position_m(), Vec2::new(0.2, 0.2));
/// # Ok::<(), drivetrain::sim::SimError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Wheel {
    motor: MotorKey,
    radius_m: f32,
    position_m: Vec2,
    direction: Angle,
    /// Of the roller on the floor; `None` for a tyre, which rolls only ahead.
    roller_axis: Option<Angle>,
    reversed: bool,
    steering: Option<(MotorKey, Angle)>,
}

impl Wheel {
    /// Takes a wheel with a tyre, rolling forward, at its place from the centre of mass in m.
    #[must_use]
    pub const fn plain(motor: MotorKey, radius_m: f32, position_m: Vec2) -> Self {
        Self {
            motor,
            radius_m,
            position_m,
            direction: Angle::ZERO,
            roller_axis: None,
            reversed: false,
            steering: None,
        }
    }

    /// Takes a wheel with a tyre, turned by a second motor about the vertical through its contact, one to one.
    ///
    /// Counter-clockwise is to the left. At the angle `zero` of the second motor's shaft the wheel points forward.
    #[must_use]
    pub const fn steered(
        motor: MotorKey,
        radius_m: f32,
        position_m: Vec2,
        steering: MotorKey,
        zero: Angle,
    ) -> Self {
        Self { steering: Some((steering, zero)), ..Self::plain(motor, radius_m, position_m) }
    }

    /// Takes an omni wheel and its rolling direction, counter-clockwise from forward; motion across this direction is
    /// free.
    #[must_use]
    pub const fn omni(motor: MotorKey, radius_m: f32, position_m: Vec2, direction: Angle) -> Self {
        let plain = Self::plain(motor, radius_m, position_m);
        Self { direction, roller_axis: Some(direction), ..plain }
    }

    /// Takes a mecanum wheel in the usual mounting: front left and rear right, the rollers on the floor lie at -45
    /// degrees, front right and rear left at 45, so the four form an O.
    #[must_use]
    pub const fn mecanum(motor: MotorKey, radius_m: f32, position_m: Vec2) -> Self {
        let degrees = if position_m.x * position_m.y > 0.0 { -45.0 } else { 45.0 };
        Self::plain(motor, radius_m, position_m).with_roller_axis(Angle::from_degrees(degrees))
    }

    /// Sets how the axis of the roller on the floor lies, counter-clockwise from forward.
    #[must_use]
    pub const fn with_roller_axis(self, axis: Angle) -> Self {
        Self { roller_axis: Some(axis), ..self }
    }

    /// Makes the motor turn clockwise to roll forward: mounted the other way round.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self { reversed: !self.reversed, ..self }
    }

    /// Returns where the wheel touches the floor, in m from the centre of mass.
    #[must_use]
    pub const fn position_m(&self) -> Vec2 {
        self.position_m
    }

    /// Names the invalid parameter.
    pub(crate) fn validate(&self) -> Result<(), &'static str> {
        let near = |length: f32| length.abs() <= 1e3;
        if self.motor.is_joint() || self.steering.is_some_and(|(motor, _)| motor.is_joint()) {
            return Err("motor");
        }
        if !(self.radius_m > 0.0 && near(self.radius_m)) {
            return Err("wheel_radius_m");
        }
        if !(near(self.position_m.x) && near(self.position_m.y)) {
            return Err("position_m");
        }
        if !self.direction.is_finite() || !self.steering.is_none_or(|(_, zero)| zero.is_finite()) {
            return Err("direction");
        }
        // A roller across the wheel turns freely at any motion of the wheel.
        let pulls =
            self.roller_axis.is_none_or(|_| self.contact(None).reach.abs() > 0.1 * self.radius_m);
        if pulls { Ok(()) } else { Err("roller_axis") }
    }

    /// Returns how the wheel holds the floor while its steering motor shows an angle in rad.
    pub(crate) fn contact(&self, steering_rad: Option<f32>) -> Contact {
        let turned = match (self.steering, steering_rad) {
            (Some((_, zero)), Some(shown)) => Angle::from_radians(shown - zero.as_radians()),
            _ => Angle::ZERO,
        };
        let unit = |angle: Angle| Rotation2::new(angle + turned).apply(Vec2::new(1.0, 0.0));
        let rolling = unit(self.direction);
        let along = self.roller_axis.map_or(rolling, unit);
        Contact {
            position: self.position_m,
            along,
            reach: self.radius_m * rolling.dot(along),
            holds_across: self.roller_axis.is_none(),
        }
    }

    pub(crate) const fn motor(&self) -> MotorKey {
        self.motor
    }

    pub(crate) const fn steering_motor(&self) -> Option<MotorKey> {
        match self.steering {
            Some((motor, _)) => Some(motor),
            None => None,
        }
    }

    /// Returns 1, or -1 for a motor that turns clockwise to roll forward.
    pub(crate) const fn sign(&self) -> f32 {
        if self.reversed { -1.0 } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::CanFrame;
    use crate::geometry::Vec2;
    use crate::sim::motor::Model;
    use crate::sim::{MotorConfig, SimError, Simulation};
    use crate::time::Duration;
    use crate::units::Angle;
    use embedded_can::nb::Can;
    use std::string::ToString;

    fn corner(motor: MotorKey) -> Wheel {
        Wheel::mecanum(motor, 0.076, Vec2::new(0.2, 0.18))
    }

    fn four(motor: MotorKey) -> [Wheel; 4] {
        [(0.2, 0.18), (0.2, -0.18), (-0.2, 0.18), (-0.2, -0.18)]
            .map(|(x, y)| Wheel::mecanum(motor, 0.076, Vec2::new(x, y)))
    }

    #[test]
    fn an_invalid_parameter_is_named() {
        let motor = MotorKey::new(0).unwrap();
        let config = ChassisConfig::new(&four(motor));
        assert_eq!(config.validate(), Ok(()));
        let one = |wheel| ChassisConfig::new(&[wheel]);
        let nan = Angle::from_radians(f32::NAN);
        let table = [
            (ChassisConfig::new(&[]), "number of wheels"),
            (ChassisConfig::new(&[corner(motor); 9]), "number of wheels"),
            (one(Wheel::plain(motor, 0.0, Vec2::ZERO)), "wheel_radius_m"),
            (one(Wheel::plain(motor, f32::INFINITY, Vec2::ZERO)), "wheel_radius_m"),
            (one(Wheel::plain(motor, 0.1, Vec2::new(f32::NAN, 0.0))), "position_m"),
            (one(Wheel::omni(motor, 0.1, Vec2::ZERO, nan)), "direction"),
            (one(Wheel::steered(motor, 0.1, Vec2::ZERO, motor, nan)), "direction"),
            (one(corner(motor).with_roller_axis(Angle::from_degrees(90.0))), "roller_axis"),
            (one(corner(motor).with_roller_axis(nan)), "roller_axis"),
            (one(corner(MotorKey::of_joint(0).unwrap())), "motor"),
            (config.with_mass_kg(-1.0), "mass_kg"),
            (config.with_yaw_inertia_kg_m2(f32::NAN), "yaw_inertia_kg_m2"),
            (config.with_friction(f32::INFINITY), "friction"),
        ];
        for (config, name) in table {
            assert_eq!(config.validate(), Err(name));
            let error = Simulation::new(1).attach_chassis(config);
            assert_eq!(error, Err(SimError::Chassis(name)));
            assert!(SimError::Chassis(name).to_string().starts_with(name));
        }
    }

    #[test]
    fn a_chassis_on_motors_of_another_world_stands_and_can_be_pushed() {
        let world = Simulation::new(1);
        world.attach_chassis(ChassisConfig::new(&four(MotorKey::new(15).unwrap()))).unwrap();
        world.push_chassis(0.0, 1_000.0, f32::NAN);
        world.advance(Duration::from_millis(100));
        let (pose, twist) = world.chassis().unwrap();
        assert!(pose.y_m > 0.1 && pose.x_m.abs() < 1e-3, "{pose:?}");
        assert!(twist.wz_rad_s.abs() < 1e-3);
    }

    fn amperes(world: &Simulation, per_slot: [i16; 4]) {
        let words = per_slot.map(|amperes| (amperes * 819).to_be_bytes());
        let data = words.as_flattened().try_into().unwrap();
        let frame = CanFrame::standard(0x200, data).unwrap();
        assert_eq!(world.controller().transmit(&frame), Ok(None));
        world.advance(Duration::from_millis(500));
    }

    #[test]
    fn a_motor_that_drives_two_wheels_of_its_side_drives_both() {
        let world = Simulation::new(1);
        let left = world.attach(MotorConfig::new(Model::M3508, 1)).unwrap();
        let right = world.attach(MotorConfig::new(Model::M3508, 2)).unwrap();
        let wheel = |motor, x, y| Wheel::plain(motor, 0.076, Vec2::new(x, y));
        let tracks = [
            wheel(left, 0.1, 0.2),
            wheel(left, -0.1, 0.2),
            wheel(right, 0.1, -0.2).reversed(),
            wheel(right, -0.1, -0.2).reversed(),
        ];
        world.attach_chassis(ChassisConfig::new(&tracks)).unwrap();
        amperes(&world, [5, -5, 0, 0]);
        // Twice 1.5 Nm less friction, on 20 kg and the wheels.
        let (torque, mass) = (2.0 * (1.5 - 0.14), 20.0 + 2.0 * 8e-3 / (0.076 * 0.076));
        let expected = torque / 0.076 / mass * 0.5;
        let (_, twist) = world.chassis().unwrap();
        assert!((twist.vx_m_s / expected - 1.0).abs() < 0.05, "{twist:?} and not {expected}");
        assert!(twist.vy_m_s.abs() < 1e-3 && twist.wz_rad_s.abs() < 1e-3);
    }

    #[test]
    fn a_module_drives_where_its_steering_motor_points_from_its_zero() {
        let world = Simulation::new(1);
        let wheel = |id: u8, x, y| {
            let drive = world.attach(MotorConfig::new(Model::M3508, id)).unwrap();
            // 90 degrees on the encoder of a module whose zero is at 45.
            let steering = MotorConfig::new(Model::Gm6020Voltage, id).with_rotor_angle(2048);
            let steering = world.attach(steering).unwrap();
            Wheel::steered(drive, 0.06, Vec2::new(x, y), steering, Angle::from_degrees(45.0))
        };
        let modules = [(1, 0.2), (2, -0.2)].map(|(id, x)| wheel(id, x, 0.1));
        world.attach_chassis(ChassisConfig::new(&modules)).unwrap();
        amperes(&world, [2, 2, 0, 0]);
        let (_, twist) = world.chassis().unwrap();
        assert!(twist.vx_m_s > 0.1 && (twist.vx_m_s - twist.vy_m_s).abs() < 0.01, "{twist:?}");
    }
}
