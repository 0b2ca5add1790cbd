//! Three processes over the network of this machine: the robot, a driver that is killed, and this judge.

use ros2_client::Subscription;
use ros2_robot::messages::{JointState, Odometry};
use ros2_robot::node::{node, subscription};
use ros2_robot::robot::{ACCELERATION_M_S2, EXPIRY};
use std::error::Error;
use std::net::{Ipv4Addr, UdpSocket};
use std::process::{Child, Command};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// The group in which RTPS announces participants (RTPS 2.3, 9.6.1.4).
const GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
const SPEED_M_S: f64 = 0.5;
/// Of a distance or a speed: 3 %.
const TOLERANCE: f64 = 0.03;

struct Process(Child);

impl Process {
    fn start(arguments: &[&str], domain: u16) -> Result<Self, Box<dyn Error>> {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ros2-robot"));
        Ok(Self(command.args(arguments).env("ROS_DOMAIN_ID", domain.to_string()).spawn()?))
    }
}

impl Drop for Process {
    /// By SIGKILL: the process says farewell to nobody.
    fn drop(&mut self) {
        _ = self.0.kill();
        _ = self.0.wait();
    }
}

/// Says in one line why DDS cannot work on this machine.
fn multicast() -> Result<(), String> {
    let heard = || -> std::io::Result<bool> {
        let hears = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        hears.join_multicast_v4(&GROUP, &Ipv4Addr::UNSPECIFIED)?;
        hears.set_read_timeout(Some(Duration::from_secs(2)))?;
        let says = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        says.send_to(b"heard", (GROUP, hears.local_addr()?.port()))?;
        let mut bytes = [0; 8];
        Ok(hears.recv(&mut bytes)? == 5)
    };
    match heard() {
        Ok(true) => Ok(()),
        other => Err(format!(
            "this machine carries no UDP multicast to {GROUP}, by which DDS processes find each other ({other:?}): \
             give it a network with a route, or `ip link set lo multicast on` and `ip route add 224.0.0.0/4 dev lo`"
        )),
    }
}

/// Waits for the next odometry that `is_wanted`; the last one that was heard says why there is none.
fn next(
    odom: &Subscription<Odometry>,
    what: &str,
    is_wanted: impl Fn(&Odometry) -> bool,
) -> Result<Odometry, Box<dyn Error>> {
    let begin = Instant::now();
    let mut last = None;
    while begin.elapsed() < Duration::from_secs(60) {
        while let Some((message, _)) = odom.take()? {
            if is_wanted(&message) {
                return Ok(message);
            }
            last = Some((stamp_s(&message), message.pose.pose.position, speed(&message)));
        }
        sleep(Duration::from_millis(2));
    }
    Err(format!("{what}: not within 60 s, heard at last: {last:?}").into())
}

fn stamp_s(message: &Odometry) -> f64 {
    f64::from(message.header.stamp.sec) + 1e-9 * f64::from(message.header.stamp.nanosec)
}

fn x(message: &Odometry) -> f64 {
    message.pose.pose.position.x
}

fn speed(message: &Odometry) -> f64 {
    message.twist.twist.linear.x
}

fn is_near(measured: f64, expected: f64) -> bool {
    (measured - expected).abs() <= TOLERANCE * expected
}

#[test]
fn this_machine_carries_multicast() -> Result<(), String> {
    multicast()
}

#[test]
fn the_robot_drives_by_cmd_vel_and_stops_when_the_driver_is_killed() -> Result<(), Box<dyn Error>> {
    multicast()?;
    // A domain of its own: a second run on this machine, or a robot in this network, is not heard.
    let domain = u16::try_from(1 + std::process::id() % 100)?;
    let _robot = Process::start(&["robot"], domain)?;
    let mut node = node("judge", domain)?;
    let odom = subscription::<Odometry>(&mut node, "odom")?;
    let truth = subscription::<Odometry>(&mut node, "ground_truth")?;
    let joints = subscription::<JointState>(&mut node, "joint_states")?;

    // Nobody commands it: it stands.
    let first = next(&odom, "the robot is heard", |_| true)?;
    assert!(x(&first).abs() < 0.01 && speed(&first).abs() < 0.01, "{first:?}");
    assert_eq!([&*first.header.frame_id, &*first.child_frame_id], ["odom", "base_link"]);

    let driver = Process::start(&["drive", &SPEED_M_S.to_string()], domain)?;
    let begin = next(&odom, "the robot drives", |message| x(message) > 0.25)?;
    let end = next(&odom, "the robot drives on", |message| x(message) > x(&begin) + 1.0)?;
    let (way, took) = (x(&end) - x(&begin), stamp_s(&end) - stamp_s(&begin));
    println!("{way:.3} m in {took:.3} s, {:.3} m/s at the end", speed(&end));
    assert!(is_near(way / took, SPEED_M_S), "{way} m in {took} s");
    assert!(is_near(speed(&end), SPEED_M_S), "{} m/s", speed(&end));
    assert!(end.pose.pose.position.y.abs() < 0.02, "it drives aside: {:?}", end.pose.pose);

    let mut wheels = None;
    while let Some((message, _)) = joints.take()? {
        wheels = Some(message);
    }
    let wheels = wheels.ok_or("no joint states")?;
    assert_eq!(wheels.name, ["front_left", "front_right", "rear_left", "rear_right"]);
    // A wheel of 76 mm: 6.6 rad/s.
    assert!(wheels.velocity.iter().all(|speed| is_near(*speed, SPEED_M_S / 0.076)), "{wheels:?}");
    assert_eq!([wheels.position.len(), wheels.effort.len()], [4, 4]);

    drop(driver);
    let killed = next(&odom, "the robot is heard", |_| true)?;
    let stopped = next(&odom, "the robot stops", |message| speed(message).abs() < 0.01)?;
    let took = stamp_s(&stopped) - stamp_s(&killed);
    println!(
        "it stops {took:.2} s after its driver was killed, after {:.3} m",
        x(&stopped) - x(&killed)
    );
    // Expiry, then the ramp, then 0.25 s for the loop and for messages that were on their way.
    let expiry_s = 1e-6 * f64::from(u32::try_from(EXPIRY.as_micros())?);
    let ramp_s = SPEED_M_S / f64::from(ACCELERATION_M_S2);
    assert!(took < expiry_s + ramp_s + 0.25, "{took} s");
    assert!(
        took > 0.5 * expiry_s,
        "stops {took} s after the driver: by something else than the expiry"
    );
    let rested =
        next(&odom, "a second later", |message| stamp_s(message) > stamp_s(&stopped) + 1.0)?;
    assert!((x(&rested) - x(&stopped)).abs() < 0.01 && speed(&rested).abs() < 0.01, "{rested:?}");

    // The whole way, against the simulated body.
    let body = next(&truth, "the body is heard", |message| stamp_s(message) >= stamp_s(&rested))?;
    println!("{:.3} m by odometry, {:.3} m by the body", x(&rested), x(&body));
    assert!(x(&body) > 1.2 && is_near(x(&rested), x(&body)), "{} m, {} m", x(&rested), x(&body));
    Ok(())
}
