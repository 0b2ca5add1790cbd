use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::AngularVelocity;

#[test]
fn a_motor_outlives_its_program_unless_a_watchdog_resets_the_board() {
    let world = Simulation::new(1);
    let motor = world.attach(MotorConfig::m3508(1)).unwrap();
    let mut bus = Bus::new();
    let speed = PidConfig::new(1.9, 2.4, 0.0);
    let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(speed)).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut fed = 0; // the watchdog
    let mut beat = runner.heartbeat();
    for ms in 0..2_000 {
        world.advance(Duration::from_millis(1));
        if ms >= 1_500 {
            continue; // the program hangs
        }
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        if ms == 100 {
            runner.arm(tick).unwrap();
        }
        if ms < 1_000 {
            _ = runner.device_mut().set_velocity(wheel, AngularVelocity::from_rpm(100.0));
        }
        if ms == 1_200 {
            // 100 ms after the last target, the motor rests.
            assert_eq!(world.motor(motor).unwrap().command, 0);
        }
        if ms >= 1_300 {
            _ = runner.device_mut().set_velocity(wheel, AngularVelocity::from_rpm(100.0));
        }
        runner.tick(tick);
        if runner.heartbeat() != beat {
            beat = runner.heartbeat();
            fed = ms;
        }
    }
    // The ESC goes on with the last current. Half a second without food: a watchdog of 20 ms has bitten.
    assert!(world.motor(motor).unwrap().command != 0);
    assert_eq!(fed, 1_499);
}
