//! Gains that the documentation tells people to begin with, on simulated robots of 5 to 30 kg: a step of the speed, and a stop.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::chassis::{Chassis, Differential, Kinematics, Mecanum, MecanumWheels, Omni};
use drivetrain::control::{PidConfig, WheelTuning};
use drivetrain::damiao;
use drivetrain::dji::{Bus, Config, Gm6020Voltage, Handle, M2006, M3508, Model};
use drivetrain::geometry::{Twist, Vec2};
use drivetrain::motor::{Actuator, AngleDrive, ImpedanceControl};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{
    ChassisConfig, DamiaoDrive, DriveShaft, Line, MotorConfig, Simulation, Wheel,
};
use drivetrain::time::Duration;
use drivetrain::units::{Angle, AngularVelocity};
use std::fs;
use std::path::Path;

const RADIUS_M: f32 = 0.076;
const MASSES_KG: [f32; 4] = [5.0, 10.0, 20.0, 30.0];
/// Steps of the forward speed: at the lowest no current is at its limit, at the highest wheels slip.
const SPEEDS_M_S: [f32; 4] = [0.2, 0.5, 1.0, 2.0];
/// Overshoot and undershoot, as a share of the step.
const MOST: f32 = 0.1;
/// The robot stands, moves and stands again for these times.
const PHASES_MS: [u32; 3] = [500, 2_000, 2_000];

#[derive(Debug, Clone, Copy, PartialEq)]
enum Layout {
    Mecanum,
    OmniThree,
}

/// Result of a step of the forward speed and of a stop, as shares of the step.
#[derive(Debug, Clone, Copy)]
struct Settling {
    overshoot: f32,
    undershoot: f32,
    /// A second after the step.
    excess: f32,
    /// A second and a half after the step.
    error: f32,
}

impl Layout {
    const ALL: [Self; 2] = [Self::Mecanum, Self::OmniThree];

    fn tuning(self, mass_kg: f32) -> WheelTuning {
        WheelTuning {
            mass_kg,
            wheel_radius_m: RADIUS_M,
            driven_wheels: match self {
                Self::Mecanum => 4.0,
                Self::OmniThree => 1.5,
            },
            torque_constant_nm_per_a: M3508::FACTS.torque_constant_nm_per_a,
            current_limit_a: M3508::FACTS.command_full_scale,
        }
    }

    /// The row of this layout in the tables of the documents.
    fn rows(self) -> [&'static str; 2] {
        match self {
            Self::Mecanum => ["four mecanum wheels", "四个麦克纳姆轮"],
            Self::OmniThree => ["three omni wheels", "三个全向轮"],
        }
    }

    /// Drives a robot with these gains; without a mass its wheels are lifted, and the speed is theirs.
    fn step(self, mass_kg: Option<f32>, speed: PidConfig, m_s: f32) -> Settling {
        let world = Simulation::new(1);
        let mut robot = Robot { world: &world, bus: Bus::new(), floor: Vec::new(), speed };
        match self {
            Self::Mecanum => {
                let (x, y) = (0.2, 0.18);
                let wheels = MecanumWheels {
                    front_left: robot.mecanum(2, Vec2::new(x, y)),
                    front_right: robot.mecanum(1, Vec2::new(x, -y)),
                    rear_left: robot.mecanum(3, Vec2::new(-x, y)),
                    rear_right: robot.mecanum(4, Vec2::new(-x, -y)),
                };
                robot.run(mecanum(), wheels, mass_kg, m_s)
            }
            Self::OmniThree => {
                let places = [(1, 60.0), (2, -60.0), (3, 180.0)];
                let wheels = places.map(|(id, degrees)| robot.omni(id, degrees));
                robot.run(Omni::three(RADIUS_M, 0.22).unwrap(), wheels, mass_kg, m_s)
            }
        }
    }

    fn assert_settles(self, mass_kg: f32, (kp, ki): (f32, f32)) {
        for m_s in SPEEDS_M_S {
            let settling = self.step(Some(mass_kg), PidConfig::new(kp, ki, 0.0), m_s);
            let robot = format!("{self:?}, {mass_kg} kg, {kp}, {ki}, {m_s} m/s: {settling:?}");
            assert!(settling.overshoot < MOST && settling.undershoot < MOST, "{robot}");
            assert!(settling.error.abs() < MOST, "{robot}");
        }
    }
}

fn mecanum() -> Mecanum {
    Mecanum::new(RADIUS_M, Vec2::new(0.2, 0.18)).unwrap()
}

struct Robot<'w> {
    world: &'w Simulation,
    bus: Bus,
    floor: Vec<Wheel>,
    speed: PidConfig,
}

impl Robot<'_> {
    fn mecanum(&mut self, id: u8, place: Vec2) -> Handle<M3508> {
        let motor = self.world.attach(MotorConfig::m3508(id)).unwrap();
        let (wheel, config) = (Wheel::mecanum(motor, RADIUS_M, place), self.config(id));
        let right = place.y < 0.0;
        self.floor.push(if right { wheel.reversed() } else { wheel });
        self.bus.attach(if right { config.reversed() } else { config }).unwrap()
    }

    fn omni(&mut self, id: u8, degrees: f32) -> Handle<M3508> {
        let motor = self.world.attach(MotorConfig::m3508(id)).unwrap();
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let (place, along) = (Vec2::new(cosine, sine) * 0.22, Angle::from_degrees(degrees + 90.0));
        self.floor.push(Wheel::omni(motor, RADIUS_M, place, along));
        self.bus.attach(self.config(id)).unwrap()
    }

    fn config(&self, id: u8) -> Config<M3508> {
        Config::new(id).speed_loop(self.speed)
    }

    /// No limit of the acceleration is set: the wheels are asked for the whole step at once.
    fn run<K: Kinematics<Speed = AngularVelocity>>(
        self,
        layout: K,
        wheels: K::Wheels<Handle<M3508>>,
        mass_kg: Option<f32>,
        m_s: f32,
    ) -> Settling {
        let Self { world, bus, floor, .. } = self;
        if let Some(mass_kg) = mass_kg {
            let chassis = ChassisConfig::new(&floor).with_mass_kg(mass_kg);
            world.attach_chassis(chassis.with_yaw_inertia_kg_m2(0.04 * mass_kg)).unwrap();
        }
        let mut chassis = Chassis::new(layout);
        let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
        let mut settling =
            Settling { overshoot: 0.0, undershoot: 0.0, excess: f32::NAN, error: f32::NAN };
        let [rest, _, _] = PHASES_MS;
        let stop = rest + PHASES_MS[1];
        let mut ticks = 0;
        while ticks < PHASES_MS.iter().sum() {
            world.advance(Duration::from_micros(100));
            runner.poll(16);
            let Some(tick) = runner.due() else { continue };
            ticks += 1;
            let _missing = runner.is_armed() || runner.arm(tick).is_ok();
            let moves = (rest..stop).contains(&ticks);
            chassis.set_body(Twist::new(if moves { m_s } else { 0.0 }, 0.0, 0.0));
            chassis.drive(runner.device_mut(), wheels, tick);
            runner.tick(tick);
            // Of lifted wheels the odometry tells the speed.
            let twist = world.chassis().map_or(chassis.measured(), |(_, twist)| twist);
            let share = twist.vx_m_s / m_s;
            match ticks {
                _ if ticks < rest => {}
                _ if moves => settling.overshoot = settling.overshoot.max(share - 1.0),
                _ => settling.undershoot = settling.undershoot.max(-share),
            }
            match ticks - rest.min(ticks) {
                1_000 => settling.excess = share - 1.0,
                1_500 => settling.error = share - 1.0,
                _ => {}
            }
        }
        settling
    }
}

fn text(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// The gains of the wheels' speed loops in a program, as numbers.
fn gains(program: &str) -> Vec<(f32, f32)> {
    let mut found = Vec::new();
    for line in program.lines() {
        let Some((name, arguments)) = line.split_once("= PidConfig::new(") else { continue };
        if name.to_lowercase().contains("speed") {
            let mut numbers = arguments.split([',', ')']).map(|number| number.trim().parse());
            let mut next = || numbers.next().unwrap().unwrap();
            found.push((next(), next()));
        }
    }
    found
}

/// The cells of a row, `kp, ki` each.
fn row(table: &str, name: &str) -> Vec<(f32, f32)> {
    let start = format!("| {name} |");
    let line = table.lines().find_map(|line| line.strip_prefix(&start)).unwrap();
    let cell = |cell: &str| {
        let (kp, ki) = cell.split_once(',').unwrap();
        (kp.trim().parse().unwrap(), ki.trim().parse().unwrap())
    };
    line.trim_end_matches('|').split('|').map(cell).collect()
}

#[test]
fn the_tables_of_the_documents_are_what_the_rule_gives() {
    for (document, path) in ["docs/gains.md", "docs/guide.zh-CN.md"].into_iter().enumerate() {
        let text = text(path);
        for layout in Layout::ALL {
            let cells = row(&text, layout.rows()[document]);
            assert_eq!(cells.len(), MASSES_KG.len());
            for (mass_kg, (kp, ki)) in MASSES_KG.into_iter().zip(cells) {
                let (exact_kp, exact_ki, _) = layout.tuning(mass_kg).speed_loop().unwrap().gains();
                // Two figures.
                for (written, exact) in [(kp, exact_kp), (ki, exact_ki)] {
                    let is_near = (written / exact - 1.0).abs() < 0.04;
                    assert!(is_near, "{path}, {layout:?}, {mass_kg} kg: {written} for {exact}");
                }
            }
        }
    }
}

#[test]
fn with_the_gains_of_the_table_a_step_overshoots_and_runs_back_by_less_than_a_tenth() {
    let page = text("docs/gains.md");
    for layout in Layout::ALL {
        for (mass_kg, gains) in MASSES_KG.into_iter().zip(row(&page, layout.rows()[0])) {
            layout.assert_settles(mass_kg, gains);
        }
    }
}

/// The slow pole of the rule: w/2d (d - root of d² - 1), with w = 20 rad/s and d = 2.
#[test]
fn the_excess_of_a_step_decays_with_a_time_constant_of_three_quarters_of_a_second() {
    for layout in Layout::ALL {
        for mass_kg in MASSES_KG {
            let settling =
                layout.step(Some(mass_kg), layout.tuning(mass_kg).speed_loop().unwrap(), 0.5);
            let time_constant_s = 0.5 / (settling.excess / settling.error).ln();
            let robot = format!("{layout:?}, {mass_kg} kg: {time_constant_s} s, {settling:?}");
            assert!((time_constant_s - 0.75).abs() < 0.1, "{robot}");
            assert!((0.002..0.02).contains(&settling.excess), "{robot}");
        }
    }
}

/// A step of the angle: the farthest beyond the goal in degrees, and after how many ms the shaft stays within 1 degree.
fn turn<M: Model>(motor: MotorConfig, config: Config<M>, degrees: f32) -> (f32, u32) {
    let world = Simulation::new(1);
    let key = world.attach(motor).unwrap();
    let mut bus = Bus::new();
    let shaft = bus.attach(config).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut goal = None;
    let (mut beyond, mut outside_ms) = (0.0_f32, 0);
    for ms in 0..3_000 {
        world.advance(Duration::from_millis(1));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        if ms == 100 {
            runner.arm(tick).unwrap();
        }
        if ms == 500 {
            let start = runner.device().state(shaft).unwrap().position;
            goal = Some(start + Angle::from_degrees(degrees));
        }
        if let Some(goal) = goal {
            runner.device_mut().set_position(shaft, goal).unwrap();
            let error = (world.motor(key).unwrap().position - goal).as_degrees();
            beyond = beyond.max(error);
            if error.abs() > 1.0 {
                outside_ms = ms - 500;
            }
        }
        runner.tick(tick);
    }
    (beyond, outside_ms)
}

#[test]
fn the_gains_of_the_guide_turn_a_gimbal_and_a_loader_and_scale_with_the_inertia() {
    let page = text("docs/gains.md");
    let (yaw, zero) = (text("docs/guide/robot/yaw.rs"), text("docs/guide/robot/zero.rs"));
    let has = |text: &str, parts: [&str; 2]| parts.iter().all(|part| text.contains(part));
    assert!(has(&yaw, ["new(15.0, 0.0, 0.0).with_output_limit(4.0)", "new(1.0, 5.0, 0.0)"]));
    assert!(has(&zero, ["new(10.0, 0.0, 0.0).with_output_limit(6.0)", "new(1.0, 10.0, 0.0)"]));
    let gimbal_row = [
        "15 rad/s per rad, at most 4 rad/s | 1.0 V per rad/s, 5.0 V",
        "0.02 kg m² | 90° | 5° | 1.2 s",
    ];
    let loader_row = [
        "10 rad/s per rad, at most 6 rad/s | 1.0 A per rad/s, 10.0 A",
        "0.004 kg m² | 45° | 0.1° | 0.5 s",
    ];
    assert!(has(&page, gimbal_row) && has(&page, loader_row));

    let gimbal = |load: f32, times: f32, most: f32| {
        let motor = MotorConfig::gm6020_voltage(1).with_load_inertia_kg_m2(load);
        let angle = PidConfig::new(15.0, 0.0, 0.0).with_output_limit(most);
        let rate = PidConfig::new(times, 5.0 * times, 0.0);
        turn(motor, Config::<Gm6020Voltage>::new(1).position_loop(angle, rate), 90.0)
    };
    let loader = |load: f32, times: f32| {
        let motor = MotorConfig::m2006(1).with_load_inertia_kg_m2(load);
        let angle = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(6.0);
        let rate = PidConfig::new(times, 10.0 * times, 0.0);
        turn(motor, Config::<M2006>::new(1).position_loop(angle, rate), 45.0)
    };
    for (load, load_of_loader) in [(0.0, 0.0), (0.005, 0.002), (0.02, 0.004), (0.05, 0.05)] {
        let times = ((load + 0.0008) / 0.0208_f32).max(1.0);
        let (beyond, outside_ms) = gimbal(load, times, 4.0);
        assert!(
            beyond < 5.0 && outside_ms < 1_200,
            "{load} kg m²: {beyond} degrees, {outside_ms} ms"
        );
        let times = ((load_of_loader + 0.002) / 0.006_f32).max(1.0);
        let (beyond, outside_ms) = loader(load_of_loader, times);
        let limit_ms = if times > 1.0 { 600 } else { 500 };
        let shaft = format!("{load_of_loader} kg m²: {beyond} degrees, {outside_ms} ms");
        assert!(beyond < 0.1 && outside_ms < limit_ms, "{shaft}");
    }
    // Without the rule, and beyond it.
    assert!(gimbal(0.05, 1.0, 4.0).0 > 9.0 && loader(0.05, 1.0).0 > 30.0);
    let (fast, slow) = (gimbal(0.1, 4.85, 4.0), gimbal(0.1, 4.85, 2.0));
    assert!(fast.0 > 10.0 && slow.0 < 5.0, "{fast:?}, {slow:?}");
}

/// A step of 90° of a joint whose inertia is so many times the stated one: the farthest beyond the goal in degrees, and after how many ms the
/// joint stays within 1 degree.
fn swing(control: ImpedanceControl, inertia: f32) -> (f32, u32) {
    let joint = Actuator::new(damiao::Motor::new(damiao::Model::J4340, 1, control).unwrap());
    let world = Simulation::new(1);
    let mut drive =
        DamiaoDrive::of(damiao::Model::J4340, 1).with_shaft(DriveShaft::new(inertia, 0.01));
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), joint);
    let (mut beyond, mut outside_ms) = (0.0_f32, 0);
    for ms in 0..5_000 {
        world.advance_drives(Duration::from_millis(1), &mut [(Line::Can1, &mut drive)]).unwrap();
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        if ms == 300 {
            runner.arm(tick).unwrap();
        }
        let goal = if ms < 1_000 { 0.0 } else { 90.0 };
        _ = runner.device_mut().set_angle((), Angle::from_degrees(goal));
        if ms >= 1_000 {
            let error = drive.shaft().angle_rad().to_degrees() - goal;
            beyond = beyond.max(error);
            if error.abs() > 1.0 {
                outside_ms = ms - 1_000;
            }
        }
        runner.tick(tick);
    }
    (beyond, outside_ms)
}

#[test]
fn the_gains_of_a_joint_follow_from_its_inertia() {
    let page = text("docs/gains.md");
    assert!(page.contains("speed 30 `J` Nm per rad/s, 112 `J` Nm per rad |"));
    assert!(page.contains("stiffness 225 `J` Nm/rad, damping 30 `J` Nm s/rad"));
    let control = ImpedanceControl::new(25.0).unwrap();
    let position = PidConfig::new(5.0, 0.0, 0.0).with_output_limit(4.0);
    for inertia in [0.005, 0.02, 0.1] {
        let speed = PidConfig::new(30.0 * inertia, 112.0 * inertia, 0.0);
        let loops = control.with_loops(position, speed).unwrap();
        let gains = control.with_gains(225.0 * inertia, 30.0 * inertia).unwrap();
        for (control, times, most_degrees, most_ms) in [
            (loops, 1.0, 0.1, 1_200),
            (loops, 3.0, 2.5, 1_400),
            (gains, 1.0, 0.1, 600),
            (gains, 2.0, 4.0, 700),
        ] {
            let (beyond, outside_ms) = swing(control, inertia * times);
            let found = format!("{inertia} kg m² x {times}: {beyond} degrees, {outside_ms} ms");
            assert!(beyond < most_degrees && outside_ms < most_ms, "{found}");
        }
    }
}

/// Also on three omni wheels, of which each carries nearly three times as much.
#[test]
fn the_programs_of_the_readme_drive_20_kg_without_swinging() {
    let (readme, page) = (text("README.md"), text("docs/robot.md"));
    let [one_motor, robot] = gains(&readme)[..] else { panic!("one motor, and a robot") };
    assert_eq!(gains(&page), [robot]);
    for layout in Layout::ALL {
        layout.assert_settles(20.0, robot);
    }
    assert_eq!(one_motor, robot);
    assert_eq!(robot, row(&text("docs/gains.md"), "four mecanum wheels")[2]);
}

/// The integral rests while the current is at its limit, so a lower limit adds no swing.
#[test]
fn with_half_the_current_a_robot_does_not_swing_either() {
    for layout in Layout::ALL {
        let tuning = WheelTuning { current_limit_a: 10.0, ..layout.tuning(20.0) };
        for m_s in SPEEDS_M_S {
            let settling = layout.step(Some(20.0), tuning.speed_loop().unwrap(), m_s);
            assert!(settling.overshoot < MOST && settling.undershoot < MOST, "{settling:?}");
        }
    }
}

#[test]
fn the_robots_of_the_examples_do_not_swing() {
    for (example, layout, mass_kg) in [
        ("examples/chassis/scenario.rs", Layout::Mecanum, 20.0),
        ("examples/two_buses.rs", Layout::Mecanum, 20.0),
        ("examples/omni.rs", Layout::OmniThree, 15.0),
    ] {
        let [gains] = gains(&text(example))[..] else { panic!("{example}") };
        layout.assert_settles(mass_kg, gains);
    }
}

/// Gains of an earlier README: the measure sees that they swing.
#[test]
fn the_gains_of_before_swing() {
    for layout in Layout::ALL {
        let swing = layout.step(Some(20.0), PidConfig::new(0.6, 6.0, 0.0), 1.0);
        assert!(swing.overshoot > 0.35 && swing.undershoot > 0.15, "{layout:?}: {swing:?}");
    }
}

/// A wheel alone carries a fourteenth of what it carries under 30 kg on three omni wheels.
#[test]
fn lifted_wheels_do_not_swing_with_the_gains_of_the_heaviest_robot() {
    let speed = Layout::OmniThree.tuning(30.0).speed_loop().unwrap();
    for layout in Layout::ALL {
        for m_s in SPEEDS_M_S {
            let settling = layout.step(None, speed, m_s);
            assert!(settling.overshoot < MOST && settling.undershoot < MOST, "{settling:?}");
            assert!(settling.error.abs() < 0.02, "{settling:?}");
        }
    }
}

/// How many wheels share the mass: 1 m/s of the robot in wheel speeds, squared and added up, is that many times one plain wheel's.
#[test]
fn the_wheels_that_count_are_those_that_turn() {
    fn count<K: Kinematics<Speed = AngularVelocity>>(
        layout: &K,
        array: impl Fn(K::Wheels<AngularVelocity>) -> Vec<AngularVelocity>,
    ) -> f32 {
        let speeds = array(layout.inverse(Twist::new(1.0, 0.0, 0.0)));
        speeds.iter().map(|speed| (speed.as_rad_per_s() * RADIUS_M).powi(2)).sum()
    }
    let differential = Differential::new(RADIUS_M, 0.18).unwrap();
    let three = Omni::three(RADIUS_M, 0.22).unwrap();
    let four = Omni::four(RADIUS_M, 0.25).unwrap();
    let of = |layout: Layout| layout.tuning(20.0).driven_wheels;
    for (counted, expected) in [
        (count(&mecanum(), |w| MecanumWheels::into_array(w).to_vec()), of(Layout::Mecanum)),
        (count(&three, |w| w.to_vec()), of(Layout::OmniThree)),
        (count(&four, |w| w.to_vec()), 2.0),
        (count(&differential, |w| w.to_vec()), 2.0),
    ] {
        assert!((counted - expected).abs() < 1e-4, "{counted} and not {expected}");
    }
}
