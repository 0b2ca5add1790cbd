use drivetrain::control::PidConfig;
use drivetrain::dji::{Config, Gm6020Voltage};
use drivetrain::motor::HealthConfig;
use drivetrain::units::Angle;

/// rad/s per rad, and at most 4 rad/s.
const ANGLE: PidConfig = PidConfig::new(15.0, 0.0, 0.0).with_output_limit(4.0);
/// V per rad/s, V per rad.
const RATE: PidConfig = PidConfig::new(1.0, 5.0, 0.0);
/// The cable allows no more.
static LIMITS: HealthConfig =
    HealthConfig::new().with_soft_limits(Angle::from_degrees(30.0), Angle::from_degrees(330.0));

/// The motor that turns the gimbal, with id 1.
pub const fn yaw() -> Config<Gm6020Voltage> {
    Config::new(1).position_loop(ANGLE, RATE).with_health(&LIMITS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivetrain::dji::Bus;
    use drivetrain::encoder::Position;
    use drivetrain::motor::{ArmingSwitch, SwitchOrder};
    use drivetrain::runner::{Nb, Runner};
    use drivetrain::sim::{MotorConfig, Simulation};
    use drivetrain::time::Duration;

    #[test]
    fn the_gimbal_holds_90_degrees_and_stays_within_its_limits() {
        let world = Simulation::new(1);
        let config = MotorConfig::gm6020_voltage(1).with_rotor_angle(4_096); // half a turn
        let motor = world.attach(config.with_load_inertia_kg_m2(0.005)).unwrap();
        let mut bus = Bus::new();
        let yaw = bus.attach(yaw()).unwrap();
        let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
        let mut switch = ArmingSwitch::new();
        for ms in 0..4_000 {
            world.advance(Duration::from_millis(1));
            runner.poll(16);
            let Some(tick) = runner.due() else { continue };
            match switch.read(Some(ms >= 100), true, tick) {
                SwitchOrder::Arm => runner.arm(tick).unwrap(),
                SwitchOrder::Keep | SwitchOrder::Brake => {}
                SwitchOrder::Disarm => runner.device_mut().disarm(),
            }
            let degrees = if ms < 2_000 { 90.0 } else { 350.0 };
            let target = Position::from_angle(Angle::from_degrees(degrees));
            _ = runner.device_mut().set_position(yaw, target);
            runner.tick(tick);
            let truth = world.motor(motor).unwrap().position.angle().as_degrees();
            match ms {
                1_999 => assert!((truth - 90.0).abs() < 1.0, "{truth}"),
                3_999 => assert!((truth - 330.0).abs() < 1.0, "{truth}"),
                _ => {}
            }
        }
    }
}
