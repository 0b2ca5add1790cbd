//! The robot of the example `socketcan` on a simulated bus: drives of every family turn, and are at rest in the end.

#![cfg(test)]

#[path = "../examples/motors/mod.rs"]
#[expect(dead_code, reason = "the help of the program names the models")]
mod motors;
#[path = "../examples/motors/own.rs"]
mod own;
#[path = "../examples/socketcan/robot.rs"]
mod robot;

use drivetrain::encoder::GearRatio;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{
    DamiaoDrive, Drive, DriveShaft, Line, LkDrive, MotorConfig, MotorKey, OdriveDrive, RmdDrive,
    RobStrideDrive, Simulation, VescDrive,
};
use drivetrain::time::Duration;
use drivetrain::units::AngularVelocity;
use drivetrain::{damiao, lk, rmd, robstride};
use robot::Robot;

const BUS: Line = Line::Can1;
/// The time that the world moves on between two polls.
const PAUSE: Duration = Duration::from_micros(250);

/// A drive whose shaft is looked at.
trait Shown: Drive {
    fn look(&self) -> &DriveShaft;
}

macro_rules! shown {
    ($($drive:ident)+) => { $(
        impl Shown for $drive {
            fn look(&self) -> &DriveShaft { self.shaft() }
        }
    )+ };
}

shown! { DamiaoDrive RobStrideDrive LkDrive RmdDrive OdriveDrive VescDrive }

/// An unloaded shaft that 1 Nm brings to 60 rad/s in a second.
fn shaft() -> DriveShaft {
    DriveShaft::new(1.0 / 60.0, 0.003)
}

fn damiao(id: u8) -> DamiaoDrive {
    DamiaoDrive::of(damiao::Model::J4310, id).with_shaft(shaft())
}

fn robstride(id: u8) -> RobStrideDrive {
    RobStrideDrive::of(robstride::Model::RS02, id).with_shaft(shaft())
}

fn vesc(id: u8) -> VescDrive {
    let model = drivetrain::vesc::Model {
        name: "VESC",
        pole_pairs: 7,
        gear: GearRatio::DIRECT,
        torque_constant_nm_per_a: 0.035,
        current_limit_a: 60.0,
        max_velocity: AngularVelocity::from_rad_per_s(600.0),
    };
    VescDrive::of(model, id).with_timeout(0.1, 0.0).with_status_hz(500.0)
}

fn odrive(node: u8, is_0_6: bool) -> OdriveDrive {
    OdriveDrive::new(node, is_0_6, 0.035, 1.0).with_periods(0.1, 0.002)
}

/// The bus with the motors of DJI and the drives on it, and what happens to them, in ms.
struct World {
    dji: Vec<MotorConfig>,
    drives: Vec<Box<dyn Shown>>,
    signal: Option<u64>,
    /// A drive that is cut off.
    silent: Option<(u64, usize)>,
}

/// What the example returns, and the velocity in rpm and the effort of each motor in each ms, DJI first.
struct Run {
    said: Result<String, String>,
    shafts: Vec<Vec<(f32, f32)>>,
}

impl World {
    fn new<const N: usize>(dji: [MotorConfig; N], drives: Vec<Box<dyn Shown>>) -> Self {
        let dji = dji.map(|motor| motor.with_line(BUS)).to_vec();
        Self { dji, drives, signal: None, silent: None }
    }

    fn run(mut self, list: &str) -> Run {
        let world = Simulation::new(1);
        let dji: Vec<_> = self.dji.iter().map(|motor| world.attach(*motor).unwrap()).collect();
        let robot = Robot::new(&motors::parse(list).unwrap()).unwrap();
        let period = robot.period();
        let port = Nb(world.controller_on(BUS));
        let mut runner = Runner::new(port, world.clock(), robot).with_period(period);
        let mut shafts = Vec::new();
        let said = robot::drive(&mut runner, || {
            let ms = world.now().as_micros() / 1_000;
            self.advance(&world, ms);
            if ms + 1 == world.now().as_micros() / 1_000 {
                shafts.push(self.shafts(&world, &dji));
            }
            self.signal.is_some_and(|signal| ms >= signal)
        });
        Run { said, shafts }
    }

    fn advance(&mut self, world: &Simulation, ms: u64) {
        let silent = self.silent.filter(|(since, _)| ms >= *since).map(|(_, index)| index);
        let mut on_bus: Vec<(Line, &mut dyn Drive)> = Vec::new();
        for (index, drive) in self.drives.iter_mut().enumerate() {
            if Some(index) == silent {
                drive.step(PAUSE.as_secs_f32());
            } else {
                on_bus.push((BUS, drive.as_mut()));
            }
        }
        world.advance_drives(PAUSE, &mut on_bus).unwrap();
    }

    fn shafts(&self, world: &Simulation, dji: &[MotorKey]) -> Vec<(f32, f32)> {
        let motors = dji.iter().map(|key| world.motor(*key).unwrap());
        let motors = motors.map(|motor| (motor.velocity, motor.command as f32));
        let own = self.drives.iter().map(|drive| {
            let shaft = drive.look();
            (AngularVelocity::from_rad_per_s(shaft.velocity_rad_per_s()), shaft.torque_nm())
        });
        motors.chain(own).map(|(velocity, effort)| (velocity.as_rpm(), effort)).collect()
    }
}

impl Run {
    fn rpm(&self, ms: usize) -> Vec<f32> {
        self.shafts[ms].iter().map(|(rpm, _)| *rpm).collect()
    }

    /// No motor has an effort in the last 0.2 s.
    fn ends_at_rest(&self) {
        for shafts in self.shafts.iter().rev().take(200) {
            assert!(shafts.iter().all(|(_, effort)| *effort == 0.0), "{shafts:?}");
        }
    }

    /// No motor had an effort at any time.
    fn never_moved(&self) {
        assert!(self.shafts.iter().flatten().all(|(_, effort)| *effort == 0.0));
    }
}

#[test]
fn motors_of_dji_turn_for_5_s_and_are_left_at_zero() {
    let dji = [
        MotorConfig::m3508(1),
        MotorConfig::m2006(2),
        MotorConfig::gm6020_voltage(5).with_load_inertia_kg_m2(0.03),
        MotorConfig::gm6020_current(6),
    ];
    let run = World::new(dji, vec![]).run("m3508:1,m2006:2,gm6020:5,gm6020-current:6");
    let rpm = run.rpm(4_000);
    assert!(rpm.iter().all(|rpm| (rpm - 30.0).abs() < 1.5), "{rpm:?}");
    let said = run.said.as_ref().unwrap();
    for name in ["M3508 #1", "M2006 #2", "GM6020 (voltage) #5", "GM6020 (current) #6"] {
        let line = said.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        let rpm = line.strip_prefix(": ").unwrap().strip_suffix(" rpm").unwrap();
        assert!((rpm.parse::<f32>().unwrap() - 30.0).abs() < 1.5, "{said}");
    }
    run.ends_at_rest();
    assert!((5_300..5_400).contains(&run.shafts.len()), "{} ms", run.shafts.len());
}

#[test]
fn a_drive_of_every_family_turns_on_one_bus_with_an_m3508() {
    let drives: Vec<Box<dyn Shown>> = vec![
        Box::new(damiao(1)),
        Box::new(damiao(2).with_register(7, 33.0)),
        Box::new(robstride(7)),
        Box::new(LkDrive::of(lk::Model::MG5010E_I10, 3)),
        Box::new(RmdDrive::new(9, rmd::Model::X8_90.torque_constant())),
        Box::new(odrive(20, false)),
        Box::new(odrive(21, true)),
        Box::new(vesc(23)),
    ];
    let list = "m3508:1,damiao4310:1,damiao4310:2:33,rs02:7,mg5010e-i10:3,rmd-x8-90:9,odrive0.5:20,odrive0.6:21,vesc7:23";
    let run = World::new([MotorConfig::m3508(1)], drives).run(list);
    let rpm = run.rpm(4_000);
    let (vesc_rpm, others) = rpm.split_last().unwrap();
    assert!(others.iter().all(|rpm| (rpm - 30.0).abs() < 1.5), "{rpm:?}");
    // 2000 electrical rpm: 30 rpm are too slow for the loop of a VESC.
    assert!((vesc_rpm - 2_000.0 / 7.0).abs() < 10.0, "{rpm:?}");
    assert_eq!(run.said.as_ref().unwrap().lines().count(), 9);
    run.ends_at_rest();
}

/// 30 rpm from the start, and never more than the share of the torque that is gentle.
#[test]
fn the_torque_of_a_blocked_joint_stays_gentle() {
    let blocked = DriveShaft::new(1e6, 0.0);
    let drives: Vec<Box<dyn Shown>> = vec![
        Box::new(damiao(1).with_shaft(blocked)),
        Box::new(robstride(7).with_shaft(blocked)),
        Box::new(LkDrive::of(lk::Model::MG5010E_I10, 3).with_shaft(blocked)),
    ];
    let run = World::new([], drives).run("damiao4310:1,rs02:7,mg5010e-i10:3");
    let most = |motor: usize| run.shafts.iter().map(|s| s[motor].1).fold(0.0, f32::max);
    for (motor, nm) in [1.0, 1.7, 3.3].into_iter().enumerate() {
        assert!((0.9 * nm..1.02 * nm).contains(&most(motor)), "{motor}: {} Nm", most(motor));
    }
    run.ends_at_rest();
}

#[test]
fn a_signal_leaves_all_at_rest() {
    let mut world = World::new([MotorConfig::m3508(1)], vec![Box::new(damiao(1))]);
    world.signal = Some(1_500);
    let run = world.run("m3508:1,damiao4310:1");
    assert!(run.rpm(1_400).iter().all(|rpm| *rpm > 25.0), "{:?}", run.rpm(1_400));
    assert!(run.said.is_ok() && run.shafts.len() < 1_900, "{:?}", run.said);
    run.ends_at_rest();
}

#[test]
fn a_drive_that_is_cut_off_ends_the_run_and_is_named() {
    let mut world = World::new(
        [MotorConfig::m3508(1)],
        vec![Box::new(damiao(1).with_register(9, 2_000.0)), Box::new(vesc(23))],
    );
    world.silent = Some((2_000, 0));
    let run = world.run("m3508:1,damiao4310:1,vesc7:23");
    let said = run.said.as_ref().unwrap_err();
    assert!(
        said.starts_with("no longer armed\n") && said.contains("DM-J4310 #1: offline"),
        "{said}"
    );
    assert!(run.shafts.len() < 2_800, "{}", run.shafts.len());
    let [m3508, _, vesc] = run.shafts.last().unwrap()[..] else { panic!() };
    assert_eq!((m3508.1, vesc.1), (0.0, 0.0));
}

#[test]
fn a_refusal_is_said_and_nothing_moves() {
    let run = World::new([MotorConfig::m3508(1)], vec![]).run("m3508:1-2");
    let said = run.said.as_ref().unwrap_err();
    assert!(said.starts_with("not armed: no feedback from M3508 #2\n"), "{said}");
    run.never_moved();

    // CTRL_MODE is the velocity mode.
    let drive = damiao(1).with_register(10, 3.0);
    let run =
        World::new([MotorConfig::m3508(1)], vec![Box::new(drive)]).run("m3508:1,damiao4310:1");
    let said = run.said.as_ref().unwrap_err();
    assert!(
        said.starts_with("not armed: DM-J4310 #1 has CTRL_MODE 3, the program needs 1: write it"),
        "{said}"
    );
    run.never_moved();

    // The first heartbeat with the error comes 0.1 s after the estimates.
    let mut drive = odrive(20, false);
    drive.fail(1 << 6);
    let run = World::new([], vec![Box::new(drive)]).run("odrive0.5:20");
    let said = run.said.as_ref().unwrap_err();
    assert!(said.contains("\nODrive #20: ESC fault began") && said.contains("error 7;"), "{said}");
    run.never_moved();
}

#[test]
fn a_list_with_an_id_twice_or_an_id_that_a_motor_cannot_have_makes_no_robot() {
    for (list, message) in [
        ("m3508:1,m2006:1", "M2006 #1 collides with M3508 #1"),
        ("m3508:5,gm6020:1", "GM6020 (voltage) #1 collides with M3508 #5"),
        (
            "damiao4310:1,damiao8009:1",
            "command of DM-J4310 #1 on 0x1, which is command of DM-J8009 #1",
        ),
        ("m3508:9", "M3508 #9: the id is not within 1..=8"),
        ("damiao4310:1:0x800", "master id"),
        ("rs02:7:0x1FD", "a host id is a byte"),
        ("mg5010e-i10:33", "id 33: 1 to 32 are allowed"),
        ("vesc0:1", "pole_pairs 0"),
        ("odrive0.5:63", "node id 63"),
    ] {
        let robot = motors::parse(list).map_err(Into::into).and_then(|specs| Robot::new(&specs));
        let error = robot.err().unwrap().to_string();
        assert!(error.contains(message), "{list}: {error}");
    }
}
