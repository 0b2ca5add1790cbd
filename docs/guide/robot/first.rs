use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::motor::{ArmingSwitch, SwitchOrder};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::AngularVelocity;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let world = Simulation::new(1); // the seed: the same seed repeats the same run
    let motor = world.attach(MotorConfig::m3508(1))?; // a C620 with id 1, and nothing on the shaft

    let mut bus = Bus::new();
    let speed = PidConfig::new(1.9, 2.4, 0.0); // A per rad/s, A per rad
    let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(speed))?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);

    let mut switch = ArmingSwitch::new(); // on at power-on, it arms nothing
    let mut fastest_rpm = 0.0_f32;
    for ms in 0..2_000 {
        world.advance(Duration::from_millis(1)); // on a board, time passes by itself
        runner.poll(16); // takes received frames
        let Some(tick) = runner.due() else { continue }; // once a millisecond

        let mut rpm = 100.0;
        match switch.read(Some((100..1_500).contains(&ms)), true, tick) {
            SwitchOrder::Arm => runner.arm(tick)?, // turned on just now
            SwitchOrder::Keep => {}
            SwitchOrder::Brake => rpm = 0.0, // the switch is not heard: disarmed in a second
            SwitchOrder::Disarm => runner.device_mut().disarm(),
        }

        // Refused without harm unless the motor is armed.
        _ = runner.device_mut().set_velocity(wheel, AngularVelocity::from_rpm(rpm));
        runner.tick(tick); // runs the loop and sends the command

        let state = runner.device().state(wheel).ok_or("detached")?;
        let (rpm, amperes) = (state.velocity.as_rpm(), state.current.as_amperes());
        fastest_rpm = fastest_rpm.max(rpm);
        if ms % 250 == 0 {
            println!("{ms} ms: {rpm:.1} rpm, {amperes:.2} A");
        }
    }
    assert!((fastest_rpm - 100.0).abs() < 15.0, "{fastest_rpm} rpm");
    let truth = world.motor(motor).ok_or("no motor")?;
    assert_eq!(truth.command, 0); // the switch is off: no current
    Ok(())
}
