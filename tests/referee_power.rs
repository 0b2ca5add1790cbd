//! From the bytes of the referee system to the power that four motors draw on the simulator, with and without a super-capacitor.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::chassis::{CapacitorPlan, Mecanum, MecanumWheels, PowerBuffer, PowerModel};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::geometry::{Twist, Vec2};
use drivetrain::motor::VelocityDrive;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, Controller, MotorConfig, MotorKey, Simulation, Wheel};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use drivetrain::wire::referee::{Referee, encode};
use drivetrain::wire::supercap::hkust;

const RADIUS_M: f32 = 0.076;
const FRONT_LEFT_M: Vec2 = Vec2::new(0.2, 0.18);
const SPEED: PidConfig = PidConfig::new(4.0, 20.0, 0.0);
const SAFE_W: u16 = 45;
const RESERVE_J: f32 = 20.0;
/// Of the capacitor, and what to keep of it.
const FULL_J: f32 = 1_500.0;
const KEPT_J: f32 = 400.0;
const ON_THE_RIGHT: MecanumWheels<bool> =
    MecanumWheels { front_left: false, front_right: true, rear_left: false, rear_right: true };

/// The referee system: it measures what is taken from its supply, and tells limit and buffer at 10 Hz.
struct Judge {
    limit_w: u16,
    buffer_j: f32,
    sequence: u8,
}

impl Judge {
    /// Takes the power from the supply in a millisecond.
    fn measure(&mut self, supply_w: f32) {
        let left_w = f32::from(self.limit_w) - supply_w;
        self.buffer_j = (self.buffer_j + left_w * 0.001).clamp(0.0, 60.0);
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 60")]
    fn tell(&mut self) -> Vec<u8> {
        let [low, high] = self.limit_w.to_le_bytes();
        let state = [3, 1, 200, 0, 200, 0, 40, 0, 100, 0, low, high, 7];
        let mut power = [0; 14];
        power[8] = self.buffer_j as u8;
        let mut bytes = Vec::new();
        for (command, data) in [(0x0201, &state[..]), (0x0202, &power)] {
            self.sequence = self.sequence.wrapping_add(1);
            bytes.extend(encode(command, self.sequence, data, &mut [0; 32]).unwrap());
        }
        bytes
    }
}

/// A capacitor whose controller takes from the supply what it is told, as long as there is charge and room.
struct Capacitor {
    energy_j: f32,
    supply_w: f32,
}

impl Capacitor {
    /// Returns what is taken from the supply in a millisecond in which the chassis takes so much.
    fn step(&mut self, chassis_w: f32) -> f32 {
        let before_j = self.energy_j;
        self.energy_j = (before_j + (self.supply_w - chassis_w) * 0.001).clamp(0.0, FULL_J);
        chassis_w + (self.energy_j - before_j) * 1_000.0
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    fn tell(&self, chassis_w: f32) -> CanFrame {
        let [a, b, c, d] = chassis_w.to_le_bytes();
        let share = (self.energy_j / FULL_J * 255.0) as u8;
        CanFrame::standard(hkust::STATE_ID, [0, a, b, c, d, 200, 0, share]).unwrap()
    }
}

/// Four wheels that drive against a force which takes more power than any limit allows.
struct Car<'a> {
    world: &'a Simulation,
    robot: Runner<Nb<Controller<'a>>, &'a Simulation, Bus>,
    wheels: MecanumWheels<Handle<M3508>>,
    motors: MecanumWheels<MotorKey>,
    mecanum: Mecanum,
    model: PowerModel,
    buffer: PowerBuffer,
    referee: Referee,
    judge: Judge,
    plan: CapacitorPlan,
    capacitor: Option<Capacitor>,
    heard: Option<(hkust::HkustState, Instant)>,
}

/// What a stretch of time was like.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    mean_chassis_w: f32,
    mean_supply_w: f32,
    lowest_buffer_j: f32,
    highest_chassis_w: f32,
}

impl<'a> Car<'a> {
    fn new(world: &'a Simulation) -> Self {
        let ids = MecanumWheels { front_left: 2, front_right: 1, rear_left: 3, rear_right: 4 };
        let motors = ids.map(|id| world.attach(MotorConfig::m3508(id)).unwrap());
        let Vec2 { x, y } = FRONT_LEFT_M;
        let wheel = |motor, x, y| Wheel::mecanum(motor, RADIUS_M, Vec2::new(x, y));
        let wheels = [
            wheel(motors.front_left, x, y),
            wheel(motors.front_right, x, -y).reversed(),
            wheel(motors.rear_left, -x, y),
            wheel(motors.rear_right, -x, -y).reversed(),
        ];
        world.attach_chassis(ChassisConfig::new(&wheels).with_mass_kg(20.0)).unwrap();
        world.push_chassis(-90.0, 0.0, 0.0);
        let mut bus = Bus::new();
        let wheels = ids.zip(ON_THE_RIGHT).map(|(id, on_the_right)| {
            let config = Config::<M3508>::new(id).speed_loop(SPEED);
            bus.attach(if on_the_right { config.reversed() } else { config }).unwrap()
        });
        let pid = PidConfig::new(2.0, 0.5, 0.0).with_output_limit(120.0);
        Self {
            world,
            robot: Runner::new(Nb(world.controller()), world.clock(), bus),
            wheels,
            motors,
            mecanum: Mecanum::new(RADIUS_M, FRONT_LEFT_M).unwrap(),
            // By the current: 24 V at 482 rpm without load, and the resistance of the winding.
            model: PowerModel::new(0.0, 0.475, 0.065, 0.0).unwrap(),
            buffer: PowerBuffer::new(RESERVE_J, pid).unwrap(),
            referee: Referee::new(SAFE_W),
            judge: Judge { limit_w: 60, buffer_j: 60.0, sequence: 0 },
            plan: CapacitorPlan::new(FULL_J, KEPT_J).unwrap().with_most_w(150.0).unwrap(),
            capacitor: None,
            heard: None,
        }
    }

    /// Drives ahead for so long. `tell` changes or drops what the referee system sends.
    fn drive(&mut self, millis: u32, burst: bool, tell: impl Fn(Vec<u8>) -> Vec<u8>) -> Stretch {
        let (mut chassis_sum, mut supply_sum) = (0.0, 0.0);
        let (mut lowest_buffer_j, mut highest_chassis_w) = (60.0_f32, 0.0_f32);
        for ms in 0..millis {
            self.world.advance(Duration::from_millis(1));
            let now = self.world.now();
            let motors = self.motors.into_array();
            let chassis_w: f32 =
                motors.map(|motor| self.world.motor(motor).unwrap().power_w).iter().sum();
            let supply_w = match &mut self.capacitor {
                Some(capacitor) => capacitor.step(chassis_w),
                None => chassis_w,
            };
            self.judge.measure(supply_w);
            if ms % 100 == 0 {
                let bytes = tell(self.judge.tell());
                for mut piece in bytes.chunks(16) {
                    while self.referee.read(&mut piece, now).is_some() {}
                }
            }
            if let Some(state) =
                self.capacitor.as_ref().and_then(|cap| hkust::decode(&cap.tell(chassis_w)))
            {
                self.heard = Some((state, now));
            }
            self.tick(burst, now);
            chassis_sum += chassis_w;
            supply_sum += supply_w;
            lowest_buffer_j = lowest_buffer_j.min(self.judge.buffer_j);
            highest_chassis_w = highest_chassis_w.max(chassis_w);
        }
        let millis = millis as f32;
        Stretch {
            mean_chassis_w: chassis_sum / millis,
            mean_supply_w: supply_sum / millis,
            lowest_buffer_j,
            highest_chassis_w,
        }
    }

    /// What runs on the microcontroller, each millisecond.
    fn tick(&mut self, burst: bool, now: Instant) {
        self.robot.poll(16);
        let Some(tick) = self.robot.due() else { return };
        let _missing = self.robot.is_armed() || self.robot.arm(tick).is_ok();
        let targets = self.mecanum.inverse(Twist::new(2.2, 0.0, 0.0));
        let limit_w = self.referee.power_limit_w(now);
        let charge_j = self.referee.buffer_energy_j(now);
        let mut supply_w = self.buffer.allowance_w(limit_w, charge_j, tick.dt_s());
        if let Some(capacitor) = &mut self.capacitor {
            supply_w = supply_w.min(limit_w);
            capacitor.supply_w = supply_w;
        }
        let fresh = self.heard.filter(|(_, at)| now.since(*at) <= Duration::from_millis(100));
        let share = fresh.and_then(|(state, _)| state.energy());
        let allowed_w = self.plan.allowance_w(supply_w, share, burst);
        let (wheels, model) = (self.wheels.into_array(), self.model);
        _ = self.robot.device_mut().drive(self.wheels.zip(targets).into_array());
        self.robot.tick_limited(tick, |bus| {
            let loads = wheels.map(|wheel| {
                (
                    bus.commanded_current(wheel).map_or(0.0, |current| current.as_amperes()),
                    bus.state(wheel).map_or(AngularVelocity::ZERO, |state| state.velocity),
                )
            });
            bus.scale_outputs(wheels, model.cut(loads, allowed_w).0);
        });
    }
}

fn as_it_is(bytes: Vec<u8>) -> Vec<u8> {
    bytes
}

fn near(watts: f32, expected_w: f32) -> bool {
    (watts / expected_w - 1.0).abs() < 0.05
}

#[test]
fn the_drawn_power_follows_the_limit_that_the_referee_tells() {
    let world = Simulation::new(1);
    let mut car = Car::new(&world);
    car.drive(3_000, false, as_it_is);
    for limit_w in [60, 100, 75] {
        car.judge.limit_w = limit_w;
        car.drive(2_500, false, as_it_is); // the buffer comes to its reserve
        let kept = car.drive(2_000, false, as_it_is);
        assert!(near(kept.mean_chassis_w, f32::from(limit_w)), "{limit_w} W: {kept:?}");
        assert!(kept.lowest_buffer_j > 10.0, "{limit_w} W: {kept:?}");
    }
}

#[test]
fn a_silent_referee_gives_the_safe_limit_and_a_heard_one_gives_it_back() {
    let world = Simulation::new(1);
    let mut car = Car::new(&world);
    car.judge.limit_w = 100;
    car.drive(5_000, false, as_it_is);
    let silent = |_| Vec::new();
    car.drive(1_000, false, silent);
    // Without a charge, nine tenths of the safe limit.
    let kept = car.drive(2_000, false, silent);
    assert!(near(kept.mean_chassis_w, 0.9 * f32::from(SAFE_W)), "{kept:?}");
    car.judge.buffer_j = RESERVE_J;
    car.drive(1_500, false, as_it_is);
    let again = car.drive(2_000, false, as_it_is);
    assert!(near(again.mean_chassis_w, 100.0), "{again:?}");
}

#[test]
fn damaged_frames_that_say_more_draw_no_more() {
    let world = Simulation::new(1);
    let mut car = Car::new(&world);
    car.drive(5_000, false, as_it_is);
    let more = |mut bytes: Vec<u8>| {
        bytes[17] = 240; // the limit of `0201`, with the checksum of 60 W
        bytes
    };
    let kept = car.drive(2_000, false, more);
    assert!(kept.mean_chassis_w < 62.0 && kept.lowest_buffer_j > 10.0, "{kept:?}");
}

#[test]
fn a_burst_takes_the_capacitor_to_its_reserve_and_leaves_the_buffer_alone() {
    let world = Simulation::new(1);
    let mut car = Car::new(&world);
    car.capacitor = Some(Capacitor { energy_j: FULL_J, supply_w: 0.0 });
    car.drive(3_000, false, as_it_is);
    let burst = car.drive(3_000, true, as_it_is);
    let left_j = car.capacitor.as_ref().unwrap().energy_j;
    assert!(burst.mean_chassis_w > 130.0 && burst.highest_chassis_w > 180.0, "{burst:?}");
    assert!(burst.mean_supply_w < 61.0 && burst.lowest_buffer_j > RESERVE_J, "{burst:?}");
    // It goes on until nothing is left above the reserve, and then only the supply is left.
    car.drive(12_000, true, as_it_is);
    let spent = car.drive(2_000, true, as_it_is);
    let end_j = car.capacitor.as_ref().unwrap().energy_j;
    assert!(left_j > end_j && (KEPT_J - 10.0..KEPT_J + 20.0).contains(&end_j), "{left_j} {end_j}");
    assert!(spent.lowest_buffer_j > RESERVE_J - 1.0, "{spent:?}");
    assert!(spent.mean_supply_w < 62.0, "{spent:?}");
}

#[test]
fn a_controller_that_falls_silent_ends_the_burst() {
    let world = Simulation::new(1);
    let mut car = Car::new(&world);
    car.capacitor = Some(Capacitor { energy_j: FULL_J, supply_w: 0.0 });
    car.drive(3_000, false, as_it_is);
    let burst = car.drive(1_000, true, as_it_is);
    car.capacitor = None; // nothing is heard of it, nor is it there
    car.drive(110, true, as_it_is);
    car.drive(4_000, true, as_it_is);
    let kept = car.drive(2_000, true, as_it_is);
    assert!(burst.mean_chassis_w > 130.0 && near(kept.mean_chassis_w, 60.0), "{burst:?} {kept:?}");
    assert!(kept.lowest_buffer_j > 10.0, "{kept:?}");
}
