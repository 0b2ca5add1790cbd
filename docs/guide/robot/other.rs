use crate::turret::Upper;
use crate::yaw::yaw;
use drivetrain::damiao::{Model, Motor};
use drivetrain::dji::Bus;
use drivetrain::encoder::Position;
use drivetrain::motor::{AngleDrive, ImpedanceControl, Actuator};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{DamiaoDrive, DriveShaft, Line, MotorConfig, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::Angle;

#[test]
fn a_damiao_joint_tilts_beside_the_yaw_motor() {
    let world = Simulation::new(1);
    let motor = MotorConfig::gm6020_voltage(1).with_line(Line::Can2).with_rotor_angle(4_096);
    let key = world.attach(motor.with_load_inertia_kg_m2(0.005)).unwrap();
    // The drive on the other end of the wire: id 1, answers with 0x11, its ranges as delivered.
    let mut drive = DamiaoDrive::of(Model::J4310, 1).with_shaft(DriveShaft::new(0.02, 0.02));

    let mut bus = Bus::<Upper>::branded();
    let yaw = bus.attach(yaw()).unwrap();
    let mode = ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 1.0).unwrap(); // Nm, Nm/rad, Nm s/rad
    let pitch = Actuator::new(Motor::new(Model::J4310, 1, mode).unwrap());
    // A tuple of devices is a device: armed, stopped and watched together.
    let controller = Nb(world.controller_on(Line::Can2));
    let mut runner = Runner::new(controller, world.clock(), (bus, pitch));
    for ms in 0..2_000 {
        let tick = Duration::from_millis(1);
        world.advance_drives(tick, &mut [(Line::Can2, &mut drive)]).unwrap();
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        if ms == 300 {
            runner.arm(tick).unwrap(); // the settings of the drive are read and agree
        }
        let (bus, pitch) = runner.device_mut();
        _ = bus.set_position(yaw, Position::from_angle(Angle::from_degrees(90.0)));
        _ = pitch.set_angle((), Angle::from_degrees(15.0));
        runner.tick(tick);
    }
    let degrees = world.motor(key).unwrap().position.angle().as_degrees();
    assert!((degrees - 90.0).abs() < 1.0, "{degrees}");
    let degrees = drive.shaft().angle_rad().to_degrees();
    assert!((degrees - 15.0).abs() < 0.5, "{degrees}");
}
