//! A shooter on the simulator: shots, bursts, a jam, the heat limit of the referee system, a lost wheel, and being disarmed.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M2006, M3508};
use drivetrain::encoder::Position;
use drivetrain::runner::{Nb, Runner};
use drivetrain::shooter::{Shooter, ShooterFeedback, ShooterOrder, ShooterState, ShooterTargets};
use drivetrain::sim::{Controller, Fault, Line, MotorConfig, MotorKey, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::referee::{BarrelHeat, Referee, encode};

const CHAMBERS: u8 = 8;
const WHEEL_RPM: f32 = 400.0;
const HEAT_OF_SHOT: f32 = 10.0;

/// What the referee system knows: the true heat of the barrel, which it reports ten times a second.
#[derive(Debug, Clone, Copy)]
struct Barrel {
    limit: u16,
    cooling_per_s: u16,
}

struct Range<'w> {
    world: &'w Simulation,
    runner: Runner<Nb<Controller<'w>>, &'w Simulation, Bus>,
    wheels: [Handle<M3508>; 2],
    loader: Handle<M2006>,
    keys: [MotorKey; 3],
    shooter: Shooter,
    referee: Referee,
    barrel: Option<Barrel>,
    /// True heat, and its largest value.
    heat: f32,
    hottest: f32,
    /// Balls that left, by the true angle of the loader.
    balls: i64,
    /// The largest deviation of a true wheel from its speed: when a ball left, and in a tick of [`ShooterState::Ready`].
    off_at_shot: f32,
    off_when_ready: f32,
    brake_until_ms: u64,
    ms: u64,
    /// Of the loader's encoder.
    start: i64,
    targets: ShooterTargets,
}

fn at_ms(ms: u64) -> Instant {
    Instant::from_micros(1_000 * ms)
}

impl<'w> Range<'w> {
    fn new(world: &'w Simulation, barrel: Option<Barrel>) -> Self {
        let shooter = Shooter::new(AngularVelocity::from_rpm(WHEEL_RPM), CHAMBERS, 10.0);
        Self::with(world, barrel, shooter.unwrap())
    }

    fn with(world: &'w Simulation, barrel: Option<Barrel>, shooter: Shooter) -> Self {
        let wheel = |id| world.attach(MotorConfig::m3508(id)).unwrap();
        let loader = MotorConfig::m2006(3).with_load_friction_nm(0.1);
        let keys = [wheel(1), wheel(2), world.attach(loader).unwrap()];
        let mut bus = Bus::new();
        let wheel = |id| Config::<M3508>::new(id).speed_loop(PidConfig::new(2.0, 20.0, 0.0));
        // The second turns the other way round.
        let wheels = [bus.attach(wheel(1)).unwrap(), bus.attach(wheel(2).reversed()).unwrap()];
        let loader = Config::<M2006>::new(3).speed_loop(PidConfig::new(1.0, 10.0, 0.0));
        let loader = bus.attach(loader).unwrap();
        Self {
            world,
            runner: Runner::new(Nb(world.controller()), world.clock(), bus),
            wheels,
            loader,
            keys,
            shooter,
            referee: Referee::new(45),
            barrel,
            heat: 0.0,
            hottest: 0.0,
            balls: 0,
            off_at_shot: 0.0,
            off_when_ready: 0.0,
            brake_until_ms: 0,
            ms: 0,
            start: world.motor(keys[2]).unwrap().encoder_counts,
            targets: ShooterTargets::REST,
        }
    }

    /// A ball leaves when the loader has turned by a whole chamber, and brakes both wheels for 5 ms.
    fn shoot(&mut self) {
        let counts = self.world.motor(self.keys[2]).unwrap().encoder_counts;
        let chamber = 36 * 8_192 / i64::from(CHAMBERS);
        // Just before the shooter counts it; the way back of a jam takes none back.
        let balls = (counts - self.start + chamber * 11 / 100).div_euclid(chamber);
        if balls > self.balls {
            self.heat += HEAT_OF_SHOT * (balls - self.balls) as f32;
            self.balls = balls;
            self.off_at_shot = self.off_at_shot.max(self.deviation());
            self.brake_until_ms = self.ms + 5;
        }
        let brakes = if self.ms < self.brake_until_ms { 1.5 } else { 0.0 };
        self.world.set_load_nm(self.keys[0], -brakes);
        self.world.set_load_nm(self.keys[1], brakes);
    }

    /// The speeds of both wheels, in truth.
    fn wheels_rpm(&self) -> [f32; 2] {
        let [left, right, _] =
            self.keys.map(|key| self.world.motor(key).unwrap().velocity.as_rpm());
        [left, -right]
    }

    /// The deviation of the worse wheel, as a share of the speed.
    fn deviation(&self) -> f32 {
        let [left, right] = self.wheels_rpm().map(|rpm| (rpm / WHEEL_RPM - 1.0).abs());
        left.max(right)
    }

    fn report(&mut self) {
        let Some(barrel) = self.barrel else { return };
        let [limit, cooling] = [barrel.limit, barrel.cooling_per_s].map(u16::to_le_bytes);
        let state = [3, 1, 200, 0, 200, 0, cooling[0], cooling[1], limit[0], limit[1], 80, 0, 7];
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 600")]
        let heat = (self.heat as u16).to_le_bytes();
        let power = [0, 0, 0, 0, 0, 0, 0, 0, 60, 0, heat[0], heat[1], 0, 0];
        for (command, data) in [(0x0201, &state[..]), (0x0202, &power)] {
            let mut frame = [0; 32];
            let mut received = encode(command, 0, data, &mut frame).unwrap();
            assert!(self.referee.read(&mut received, at_ms(self.ms)).is_some());
        }
    }

    /// Runs for so long under one order; arms when `arms` says so.
    fn run(&mut self, order: ShooterOrder, millis: u64, arms: bool) {
        let end = self.ms + millis;
        while self.ms < end {
            self.world.advance(Duration::from_micros(100));
            self.runner.poll(16);
            let Some(tick) = self.runner.due() else { continue };
            self.ms += 1;
            if self.ms.is_multiple_of(100) {
                self.report();
            }
            if let Some(barrel) = self.barrel {
                self.heat = (self.heat - 0.001 * f32::from(barrel.cooling_per_s)).max(0.0);
            }
            self.shoot();
            self.hottest = self.hottest.max(self.heat);
            if arms {
                _ = self.runner.arm(tick);
            } else {
                self.runner.device_mut().disarm();
            }
            let is_armed = self.runner.is_armed();
            let bus = self.runner.device_mut();
            use drivetrain::motor::VelocityDrive;
            let loader = bus.state(self.loader).filter(|_| bus.velocity(self.loader).is_some());
            let feedback = ShooterFeedback {
                is_armed,
                wheels: self.wheels.map(|wheel| bus.velocity(wheel)),
                loader: loader.map(|state| (state.position, state.velocity)),
                heat: self.referee.heat_17mm(at_ms(self.ms)),
            };
            self.targets = self.shooter.update(order, &feedback, tick);
            for wheel in self.wheels {
                _ = bus.set_velocity(wheel, self.targets.wheels);
            }
            _ = bus.set_velocity(self.loader, self.targets.loader);
            self.runner.tick(tick);
            if self.shooter.state() == ShooterState::Ready {
                self.off_when_ready = self.off_when_ready.max(self.deviation());
            }
        }
    }

    fn loader_rpm(&self) -> f32 {
        self.world.motor(self.keys[2]).unwrap().velocity.as_rpm()
    }
}

const COOL: Option<Barrel> = Some(Barrel { limit: 400, cooling_per_s: 80 });

#[test]
fn single_shots_and_a_burst_are_counted_and_each_leaves_at_the_speed_within_1_percent() {
    let world = Simulation::new(3);
    let mut range = Range::new(&world, COOL);
    range.run(ShooterOrder::Rest, 300, true);
    assert_eq!((range.shooter.state(), range.wheels_rpm()), (ShooterState::Rest, [0.0, -0.0]));
    range.run(ShooterOrder::Spin, 1_500, true);
    assert_eq!((range.shooter.state(), range.balls), (ShooterState::Ready, 0));
    for single in 1..=3 {
        range.run(ShooterOrder::Fire(1), 400, true); // held, and one shot all the same
        assert_eq!((range.shooter.shots(), range.balls), (single, i64::from(single)));
        range.run(ShooterOrder::Spin, 20, true);
    }
    range.run(ShooterOrder::Fire(5), 1_000, true);
    assert_eq!((range.shooter.shots(), range.balls), (8, 8));
    assert!(range.off_at_shot <= 0.01, "{}", range.off_at_shot);
    assert!(range.off_when_ready <= 0.01, "{}", range.off_when_ready);
    // Released in the middle of a burst: what is on its way leaves, the rest is dropped.
    range.run(ShooterOrder::Spin, 20, true);
    range.run(ShooterOrder::Fire(20), 350, true);
    let until = range.balls;
    range.run(ShooterOrder::Spin, 500, true);
    assert!((until..=until + 2).contains(&range.balls) && range.balls < 14, "{}", range.balls);
    assert_eq!(i64::from(range.shooter.shots()), range.balls);
    range.run(ShooterOrder::Rest, 2_000, true);
    assert!(range.wheels_rpm().iter().all(|rpm| rpm.abs() < 1.0) && range.loader_rpm() == 0.0);
}

#[test]
fn a_jam_that_gives_way_is_cleared_and_one_that_does_not_stops_the_shooter() {
    let world = Simulation::new(4);
    let mut range = Range::new(&world, COOL);
    range.run(ShooterOrder::Spin, 1_500, true);
    // It blocks for 250 ms in the middle of the first shot.
    let from = range.ms + 40;
    world.fault(Fault::BlockedShaft(range.keys[2]), at_ms(from)..at_ms(from + 250)).unwrap();
    range.run(ShooterOrder::Fire(3), 200, true);
    assert_eq!((range.shooter.state(), range.shooter.tries()), (ShooterState::Clearing, 1));
    range.run(ShooterOrder::Fire(3), 1_300, true);
    assert_eq!((range.shooter.shots(), range.balls, range.shooter.tries()), (3, 3, 0));

    world.fault(Fault::BlockedShaft(range.keys[2]), at_ms(range.ms)..).unwrap();
    range.run(ShooterOrder::Spin, 20, true);
    range.run(ShooterOrder::Fire(3), 2_000, true);
    assert_eq!(range.shooter.state(), ShooterState::Jammed);
    assert_eq!((range.targets, range.balls), (ShooterTargets::REST, 3));
    // Neither a new trigger nor a spin clears it: rest does.
    range.run(ShooterOrder::Spin, 50, true);
    range.run(ShooterOrder::Fire(1), 50, true);
    assert_eq!(range.shooter.state(), ShooterState::Jammed);
    range.run(ShooterOrder::Rest, 5, true);
    assert_eq!(range.shooter.state(), ShooterState::Rest);
}

#[test]
fn the_true_heat_never_exceeds_the_limit_and_the_rate_is_that_of_the_cooling() {
    let world = Simulation::new(5);
    let mut range = Range::new(&world, Some(Barrel { limit: 100, cooling_per_s: 40 }));
    range.run(ShooterOrder::Spin, 1_500, true);
    range.run(ShooterOrder::Fire(255), 5_000, true);
    assert!(range.hottest <= 100.0, "{}", range.hottest);
    assert!(range.hottest > 75.0, "the limit is not used: {}", range.hottest);
    // 8 to 9 shots at once, then 4 in 1 s.
    assert!((24..=30).contains(&range.balls), "{}", range.balls);
    assert!(matches!(range.shooter.state(), ShooterState::Cooling | ShooterState::Feeding));

    // The referee system falls silent: nothing is shot, and the wheels go on.
    range.barrel = None;
    range.run(ShooterOrder::Fire(255), 1_000, true);
    let balls = range.balls;
    range.run(ShooterOrder::Fire(255), 1_000, true);
    assert_eq!((range.balls, range.shooter.state()), (balls, ShooterState::Cooling));
    assert!(range.wheels_rpm().iter().all(|rpm| *rpm > 390.0));
}

#[test]
fn a_wheel_that_is_lost_stops_wheels_and_loader_and_comes_back_only_after_rest() {
    for fault_of_wheel in [true, false] {
        let world = Simulation::new(6);
        let mut range = Range::new(&world, COOL);
        range.run(ShooterOrder::Spin, 1_500, true);
        let lost = range.keys[if fault_of_wheel { 1 } else { 2 }];
        let (from, until) = (range.ms + 250, range.ms + 330);
        world.fault(Fault::Silent(lost), at_ms(from)..at_ms(until)).unwrap();
        range.run(ShooterOrder::Fire(50), 300, true);
        let fault = if fault_of_wheel { ShooterState::WheelLost } else { ShooterState::LoaderLost };
        assert_eq!(range.shooter.state(), fault);
        assert_eq!(range.targets, ShooterTargets::REST);
        // A loader that is silent is not braked: it coasts, and a ball may drop.
        let balls = range.balls;
        range.run(ShooterOrder::Fire(50), 100, true);
        assert!(range.balls <= balls + 1);
        let balls = range.balls;
        range.run(ShooterOrder::Fire(50), 1_000, true); // it is heard again since long
        assert_eq!((range.balls, range.targets), (balls, ShooterTargets::REST));
        assert!(range.wheels_rpm().iter().all(|rpm| *rpm < 40.0) && range.loader_rpm() == 0.0);
        range.run(ShooterOrder::Rest, 100, true);
        range.run(ShooterOrder::Spin, 2_000, true);
        assert_eq!(range.shooter.state(), ShooterState::Ready);
        let shots = range.shooter.shots();
        range.run(ShooterOrder::Fire(1), 400, true);
        assert_eq!(range.shooter.shots(), shots + 1);
        // A gap of 80 ms leaves the rotor turns of a coasting loader in doubt, and with them the place of its chambers.
        if fault_of_wheel {
            assert_eq!(range.balls, balls + 1);
        }
    }
}

#[test]
fn disarmed_everything_is_at_rest_and_a_held_trigger_shoots_nothing_when_armed_again() {
    let world = Simulation::new(7);
    let mut range = Range::new(&world, COOL);
    range.run(ShooterOrder::Fire(5), 500, false);
    assert_eq!((range.shooter.state(), range.balls), (ShooterState::Rest, 0));
    range.run(ShooterOrder::Fire(5), 2_000, true); // held since before
    assert_eq!((range.shooter.state(), range.balls), (ShooterState::Ready, 0));
    range.run(ShooterOrder::Spin, 10, true);
    range.run(ShooterOrder::Fire(50), 250, true);
    let balls = range.balls;
    assert!(balls > 0);
    range.run(ShooterOrder::Fire(50), 200, false);
    assert_eq!((range.shooter.state(), range.targets), (ShooterState::Rest, ShooterTargets::REST));
    assert!(range.balls <= balls + 1, "the loader stops by its friction");
    let balls = range.balls;
    let commands = world.traffic(Line::Can1);
    assert!(commands.load() > 0.0);
    for key in range.keys {
        assert_eq!(world.motor(key).unwrap().command, 0);
    }
    range.run(ShooterOrder::Fire(50), 2_000, true);
    assert_eq!(range.balls, balls);
}

#[test]
fn a_wheel_that_does_not_reach_its_speed_is_a_fault_after_3_s() {
    let world = Simulation::new(8);
    let mut range = Range::new(&world, COOL);
    world.fault(Fault::BlockedShaft(range.keys[0]), ..).unwrap();
    range.run(ShooterOrder::Fire(1), 2_900, true);
    assert_eq!((range.shooter.state(), range.balls), (ShooterState::SpinningUp, 0));
    range.run(ShooterOrder::Fire(1), 400, true);
    assert_eq!(range.shooter.state(), ShooterState::WheelSlow);
}

#[test]
fn for_practice_a_heat_limit_without_the_referee_system_holds() {
    use drivetrain::wire::referee::BarrelHeat;
    let world = Simulation::new(9);
    let shooter = Shooter::new(AngularVelocity::from_rpm(WHEEL_RPM), CHAMBERS, 10.0)
        .unwrap()
        .with_heat_without_referee(BarrelHeat { heat: 0, limit: 50, cooling_per_s: 10 });
    let mut range = Range::with(&world, None, shooter);
    range.run(ShooterOrder::Spin, 1_500, true);
    range.run(ShooterOrder::Fire(255), 3_000, true);
    // 4 at once, then 1 in 1 s.
    assert!((6..=8).contains(&range.balls), "{}", range.balls);
}

/// The true way of a loader in chambers in 20 s of [`ShooterOrder::Fire`] with 1 shot, by the position that it reports at an angle.
fn fired_once(reported: impl Fn(u64, f32) -> Position) -> (f32, Shooter) {
    let mut shooter = Shooter::new(AngularVelocity::from_rpm(WHEEL_RPM), CHAMBERS, 10.0).unwrap();
    let (mut targets, mut angle_rad) = (ShooterTargets::REST, 0.0);
    for ms in 1..=20_000 {
        let feedback = ShooterFeedback {
            is_armed: true,
            wheels: [Some(targets.wheels); 2],
            loader: Some((reported(ms, angle_rad), targets.loader)),
            heat: Some(BarrelHeat { heat: 0, limit: 100, cooling_per_s: 10 }),
        };
        let order = if ms < 100 { ShooterOrder::Spin } else { ShooterOrder::Fire(1) };
        targets = shooter.update(order, &feedback, Tick::new(at_ms(ms), 0.001));
        angle_rad += 0.001 * targets.loader.as_rad_per_s();
    }
    (angle_rad.to_degrees() * f32::from(CHAMBERS) / 360.0, shooter)
}

#[test]
fn one_shot_is_at_most_one_chamber_when_the_loader_counts_anew_or_has_no_number() {
    let at = |angle_rad| Position::from_angle(Angle::from_radians(angle_rad));
    let (chambers, shooter) = fired_once(|_, angle_rad| at(angle_rad));
    assert!((0.9..1.1).contains(&chambers) && shooter.shots() == 1, "{chambers}");

    let nan = |ms, angle_rad| at(if ms > 150 { f32::NAN } else { angle_rad });
    let (chambers, shooter) = fired_once(nan);
    assert!(chambers < 1.0, "{chambers} chambers of a position that is NaN");
    assert_eq!((shooter.state(), shooter.shots()), (ShooterState::LoaderLost, 0));

    for turns in [-20, -1, 1, 20] {
        let (chambers, shooter) = fired_once(|ms, angle_rad| {
            let position = at(angle_rad);
            Position::new(position.turns() + if ms > 150 { turns } else { 0 }, position.angle())
        });
        assert!(chambers < 1.0, "{chambers} chambers of a position {turns} turns further");
        // A jump forward passes the chamber of the shot.
        let shots = u32::from(turns > 0);
        assert_eq!((shooter.state(), shooter.shots()), (ShooterState::LoaderLost, shots));
    }
}

#[test]
fn a_rest_of_a_tick_in_mid_fire_is_no_fault_of_the_loader() {
    for rate in [10.0, 20.0] {
        for cut in (1_000..1_200).step_by(8) {
            let world = Simulation::new(1);
            let speed = AngularVelocity::from_rpm(WHEEL_RPM);
            let shooter = Shooter::new(speed, CHAMBERS, rate).unwrap();
            let barrel = Barrel { limit: 600, cooling_per_s: 300 };
            let mut range = Range::with(&world, Some(barrel), shooter);
            range.run(ShooterOrder::Spin, 900, true);
            range.run(ShooterOrder::Fire(20), cut - 900, true);
            range.run(ShooterOrder::Rest, 1, true);
            range.run(ShooterOrder::Spin, 400, true);
            assert_ne!(range.shooter.state(), ShooterState::LoaderLost, "{rate}, {cut}");
        }
    }
}
