use drivetrain::chassis::{Chassis, ChassisLimits, Omni};
use drivetrain::control::PidConfig;
use drivetrain::dji::{AttachError, Bus, Config, Handle, M3508};
use drivetrain::error::ConfigError;
use drivetrain::geometry::{Body, Twist};
use drivetrain::time::Tick;
use drivetrain::units::AngularVelocity;

/// In m: radius of a wheel, and its distance from the centre.
pub const RADIUS_M: f32 = 0.076;
pub const DISTANCE_M: f32 = 0.22;
/// A per rad/s, A per rad: three omni wheels under 15 kg.
const SPEED: PidConfig = PidConfig::new(3.9, 4.8, 0.0);

/// The mark of the bus of the wheels.
#[derive(Debug)]
pub struct Lower;

/// Reason for a robot that cannot be set up: a motor that its bus refuses, or a value out of range.
#[derive(Debug)]
pub enum SetupError {
    Motor(AttachError),
    Value(ConfigError),
}

impl From<AttachError> for SetupError {
    fn from(error: AttachError) -> Self {
        Self::Motor(error)
    }
}

impl From<ConfigError> for SetupError {
    fn from(error: ConfigError) -> Self {
        Self::Value(error)
    }
}

impl core::fmt::Display for SetupError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Motor(error) => error.fmt(f),
            Self::Value(error) => error.fmt(f),
        }
    }
}

/// Three omni wheels: front left, front right, rear.
#[derive(Debug)]
pub struct Base {
    pub wheels: [Handle<M3508, Lower>; 3],
    pub chassis: Chassis<Omni<3>>,
}

impl Base {
    /// Attaches the wheels with the ids 1, 2 and 3.
    pub fn new(bus: &mut Bus<Lower>) -> Result<Self, SetupError> {
        let wheels = [1, 2, 3].map(|id| Config::<M3508>::new(id).speed_loop(SPEED));
        let wheels = bus.attach_all(wheels)?;
        let mut chassis = Chassis::new(Omni::three(RADIUS_M, DISTANCE_M)?);
        let limits = ChassisLimits::new()
            .with_acceleration(3.0, 15.0) // m/s², rad/s²
            .with_wheel_speed(AngularVelocity::from_rpm(450.0));
        chassis.set_limits(limits)?;
        Ok(Self { wheels, chassis })
    }

    /// Sets the targets of the wheels: m/s forward and to the left, rad/s counter-clockwise.
    pub fn drive(&mut self, bus: &mut Bus<Lower>, twist: Twist<Body>, tick: Tick) {
        self.chassis.set_body(twist);
        self.chassis.drive(bus, self.wheels, tick);
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use drivetrain::geometry::Vec2;
    use drivetrain::motor::{ArmingSwitch, SwitchOrder};
    use drivetrain::runner::{Nb, Runner};
    use drivetrain::sim::{ChassisConfig, MotorConfig, MotorKey, SimError, Simulation, Wheel};
    use drivetrain::time::Duration;
    use drivetrain::units::Angle;

    /// Puts the three wheels under a body of 15 kg.
    pub fn floor(world: &Simulation) -> Result<[MotorKey; 3], SimError> {
        let place = |id, degrees: f32| {
            let motor = world.attach(MotorConfig::m3508(id))?;
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let place = Vec2::new(cosine, sine) * DISTANCE_M;
            let direction = Angle::from_degrees(degrees + 90.0); // counter-clockwise round the centre
            Ok((motor, Wheel::omni(motor, RADIUS_M, place, direction)))
        };
        let wheels = [place(1, 60.0)?, place(2, -60.0)?, place(3, 180.0)?];
        let body = ChassisConfig::new(&wheels.map(|(_, wheel)| wheel)).with_mass_kg(15.0);
        world.attach_chassis(body)?;
        Ok(wheels.map(|(motor, _)| motor))
    }

    #[test]
    fn the_base_drives_a_metre_to_the_left_and_knows_it() {
        let world = Simulation::new(1);
        floor(&world).unwrap();
        let mut bus = Bus::branded();
        let mut base = Base::new(&mut bus).unwrap();
        let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
        let mut switch = ArmingSwitch::new();
        for ms in 0..3_500 {
            world.advance(Duration::from_millis(1));
            runner.poll(16);
            let Some(tick) = runner.due() else { continue };
            match switch.read(Some(ms >= 100), true, tick) {
                SwitchOrder::Arm => runner.arm(tick).unwrap(),
                SwitchOrder::Keep | SwitchOrder::Brake => {}
                SwitchOrder::Disarm => runner.device_mut().disarm(),
            }
            let left = if (500..2_500).contains(&ms) { 0.5 } else { 0.0 };
            base.drive(runner.device_mut(), Twist::new(0.0, left, 0.0), tick);
            runner.tick(tick);
        }
        let ((truth, _), pose) = (world.chassis().unwrap(), base.chassis.pose());
        assert!((truth.y_m - 1.01).abs() < 0.01 && truth.x_m.abs() < 0.01, "{truth:?}");
        assert!((pose.y_m - truth.y_m).abs() < 0.02, "{pose:?}");
    }
}
