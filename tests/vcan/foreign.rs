//! A master that nobody here wrote drives the simulated drives over SocketCAN: they are what others take a drive to be.

use super::BUS;
use drivetrain::frame::CanFrame;
use drivetrain::sim::{self, DamiaoDrive, DriveShaft, RobStrideDrive};
use drivetrain::{damiao, robstride};
use socketcan::{CanSocket, Socket};
use std::process::{Command, Stdio};
use std::time::Instant;

/// 2 rad/s by 0.5 Nm s/rad against the friction of 0.01 Nm s/rad.
const SPEED: f32 = 2.0 * 0.5 / 0.51;

/// A drive on the bus: its shaft, and whether it is enabled.
trait Drive: sim::Drive {
    fn shaft(&self) -> &DriveShaft;
    fn is_enabled(&self) -> bool;
}

macro_rules! drive {
    ($($drive:ident)+) => { $(
        impl Drive for $drive {
            fn shaft(&self) -> &DriveShaft { Self::shaft(self) }
            fn is_enabled(&self) -> bool { Self::is_enabled(self) }
        }
    )+ };
}

drive! { DamiaoDrive RobStrideDrive }

/// Has the master drive it, by the clock, and returns the words of each line that it said, with the largest speed of the shaft.
fn driven(drive: &mut impl Drive, family: &str) -> (Vec<Vec<String>>, f32) {
    let socket = CanSocket::open(BUS).unwrap();
    socket.set_nonblocking(true).unwrap();
    let mut master = Command::new("python3")
        .args(["-S", "/master.py", BUS, family])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut fastest, mut was_enabled, mut before) = (0.0_f32, false, Instant::now());
    while master.try_wait().unwrap().is_none() {
        while let Ok(frame) = socket.read_frame() {
            let frame = CanFrame::copy_of(&frame).unwrap();
            if let Some(answer) = drive.hear(&frame) {
                socket.write_frame(&answer.convert::<socketcan::CanFrame>().unwrap()).unwrap();
            }
        }
        let now = Instant::now();
        drive.step(now.duration_since(before).as_secs_f32());
        before = now;
        fastest = fastest.max(drive.shaft().velocity_rad_per_s());
        was_enabled |= drive.is_enabled();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let said = master.wait_with_output().unwrap();
    assert!(said.status.success() && was_enabled, "{said:?}, enabled: {was_enabled}");
    let lines = String::from_utf8(said.stdout).unwrap();
    let words = lines.lines().map(|line| line.split(' ').map(str::to_owned).collect());
    (words.collect(), fastest)
}

fn is_as_driven(said: &[Vec<String>], fastest: f32) {
    assert_eq!(said[0], ["timeout", "2000"]);
    let [word, _, speed] = &said[1][..] else { panic!("{said:?}") };
    let speed: f32 = speed.parse().unwrap();
    assert!(word == "driven" && (speed - SPEED).abs() < 0.1, "{said:?}");
    assert!((fastest - SPEED).abs() < 0.1, "{fastest} rad/s");
}

#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn a_foreign_master_drives_the_simulated_damiao_and_sees_its_time_out() {
    let mut drive = DamiaoDrive::of(damiao::Model::J4310, 1);
    let (said, fastest) = driven(&mut drive, "damiao");
    is_as_driven(&said, fastest);
    assert_eq!(said[1][1], "1", "enabled");
    // No command came within the register TIMEOUT.
    assert_eq!(said[2][..2], ["silent", "13"], "{said:?}");
    assert!(!drive.is_enabled() && drive.error() == 13);
}

#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn a_foreign_master_drives_the_simulated_robstride_until_its_time_out() {
    let mut drive = RobStrideDrive::of(robstride::Model::RS02, 1);
    let (said, fastest) = driven(&mut drive, "robstride");
    is_as_driven(&said, fastest);
    assert_eq!(said[2][0], "silent", "{said:?}");
    assert!(!drive.is_enabled(), "the master was silent for longer than the time-out");
}
