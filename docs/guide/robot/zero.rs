use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M2006};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::Angle;

#[test]
fn a_geared_motor_takes_an_angle_after_its_zero_was_set() {
    let world = Simulation::new(1);
    let motor = world.attach(MotorConfig::m2006(3)).unwrap();
    let mut bus = Bus::new();
    let angle = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(6.0); // rad/s per rad
    let speed = PidConfig::new(1.0, 10.0, 0.0); // A per rad/s, A per rad
    let loader = bus.attach(Config::<M2006>::new(3).position_loop(angle, speed)).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut start = 0;
    for ms in 0..2_000 {
        world.advance(Duration::from_millis(1));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        let bus = runner.device_mut();
        let refused = bus.set_angle(loader, Angle::from_degrees(45.0));
        match ms {
            100 => runner.arm(tick).unwrap(),
            300 => {
                assert!(refused.is_err()); // 36 angles are possible
                start = world.motor(motor).unwrap().encoder_counts;
                bus.zero(loader).unwrap(); // the mark of the loader is at its pointer
            }
            _ => {}
        }
        runner.tick(tick);
    }
    let counts = world.motor(motor).unwrap().encoder_counts - start;
    let degrees = counts as f32 * 360.0 / (36.0 * 8_192.0); // the gear is 36
    assert!((degrees - 45.0).abs() < 1.0, "{degrees}");
}

#[test]
fn a_loader_moves_on_by_a_chamber_without_a_zero() {
    let world = Simulation::new(1);
    let motor = world.attach(MotorConfig::m2006(3)).unwrap();
    let mut bus = Bus::new();
    let angle = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(6.0); // rad/s per rad
    let speed = PidConfig::new(1.0, 10.0, 0.0); // A per rad/s, A per rad
    let loader = bus.attach(Config::<M2006>::new(3).position_loop(angle, speed)).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let (mut start, mut goal) = (0, None);
    for ms in 0..1_500 {
        world.advance(Duration::from_millis(1));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        if ms == 100 {
            runner.arm(tick).unwrap();
        }
        if ms == 300 {
            start = world.motor(motor).unwrap().encoder_counts;
            let position = runner.device().state(loader).unwrap().position;
            goal = Some(position + Angle::from_degrees(60.0)); // one of six chambers
        }
        if let Some(goal) = goal {
            runner.device_mut().set_position(loader, goal).unwrap();
        }
        runner.tick(tick);
    }
    let counts = world.motor(motor).unwrap().encoder_counts - start;
    let degrees = counts as f32 * 360.0 / (36.0 * 8_192.0);
    assert!((degrees - 60.0).abs() < 1.0, "{degrees}");
}
