//! Host and robot as two processes: the same code with a TCP connection for the serial line, and real time.

use super::host::{Action, Host, Operator};
use super::plant::Plant;
use super::robot::{Event, Output, Robot};
use super::{at, seconds};
use drivetrain::sim::Simulation;
use drivetrain::time::Instant;
use drivetrain::wire::Counts;
use drivetrain::wire::host_link::{COMMAND_LENGTH, TELEMETRY_LENGTH};
use std::error::Error;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time;

const NAP: time::Duration = time::Duration::from_micros(500);
/// How long one side waits for the other, to appear and to go on.
const PATIENCE: time::Duration = time::Duration::from_secs(20);
/// Simulated time does not make up for more than this: a machine that is busy makes it slower, not jumpy.
const LARGEST_DELAY_S: f32 = 0.02;
/// Nor does it go on for longer than this when the host is busy, which has 160 ms for the next frame.
const LONGEST_SILENCE_S: f32 = 0.12;
/// The period of the telemetry. The host is at most a frame and a half ahead of it, however slowly the robot is simulated.
const TELEMETRY_PERIOD_S: f32 = 0.05;
const LARGEST_LEAD_S: f32 = 0.08;
/// A frame in so many has to arrive, whatever the machine does besides.
const LEAST_SHARE: f32 = 0.5;

/// What one side saw.
#[derive(Debug)]
pub(crate) struct Report {
    pub(crate) sent: u32,
    pub(crate) counts: Counts,
    pub(crate) bytes: usize,
    pub(crate) losses: u32,
    /// The largest angle of a joint that was measured (robot) or reported (host), in degrees.
    pub(crate) furthest_deg: f32,
    pub(crate) seconds: f32,
    pub(crate) armed: bool,
}

impl Report {
    /// Says what is not as it has to be; `period_s` is that of the other side's frames.
    pub(crate) fn verdict(&self, period_s: f32) -> Result<(), String> {
        let expected = self.seconds / period_s * LEAST_SHARE;
        let Counts { frames, checksum_errors, length_errors, skipped_bytes, .. } = self.counts;
        if (frames as f32) < expected {
            return Err(format!("{frames} frames came, at least {expected:.0} were expected"));
        }
        if checksum_errors + length_errors + skipped_bytes > 0 {
            return Err(format!("TCP damages nothing, but: {:?}", self.counts));
        }
        if !self.armed || !(20.0..40.0).contains(&self.furthest_deg) {
            return Err(format!("it did not swing by 30 degrees, but {:.1}", self.furthest_deg));
        }
        Ok(())
    }
}

/// Plays the robot for a connection of the host; calls `hitch` in each turn of its loops, where a test holds it up.
pub(crate) fn robot(
    listener: &TcpListener,
    run_s: f32,
    seed: u64,
    mut hitch: impl FnMut(),
) -> Result<Report, Box<dyn Error>> {
    let mut stream = accept(listener)?;
    let world = Simulation::new(seed);
    let mut plant = Plant::new(&world, seed)?;
    let mut robot = Robot::new(&world)?;
    let mut output = Output::default();
    let mut buffer = [0; 1024];
    let mut wall = Wall::start();
    let mut heard_s = 0.0;
    let mut report = Report::new(run_s);
    while seconds(world.now()) < run_s {
        std::thread::sleep(NAP);
        let Some(received) = read(&mut stream, &mut buffer)? else { break };
        report.bytes += received.len();
        robot.hear_host(received, world.now());
        if !received.is_empty() {
            heard_s = seconds(world.now());
            wall.hear();
        }
        wall.wait_at(seconds(world.now()) + LARGEST_DELAY_S);
        wall.wait_for_the_other_at(heard_s + LONGEST_SILENCE_S);
        // Read once: a machine that simulates slower than real time would never come to an end.
        let until = wall.now();
        while world.now() < until {
            hitch();
            plant.step(|_| {});
            let now = world.now();
            let mut bytes = [0; 128];
            for (index, imu) in plant.imus.iter_mut().enumerate() {
                robot.hear_imu(index, imu.line.receive(now, &mut bytes), now);
            }
            robot.hear_servo(plant.servo.from.receive(now, &mut bytes));
            robot.poll();
            let Some(tick) = robot.due() else { continue };
            robot.tick(tick, &mut output);
            plant.servo.to.send(&output.servo, now);
            output.servo.clear();
        }
        if !output.host.is_empty() {
            report.sent += u32::try_from(output.host.len() / TELEMETRY_LENGTH)?;
            if !write(&mut stream, &output.host)? {
                break;
            }
            output.host.clear();
        }
        if !robot.runner.is_armed() {
            continue; // not zeroed yet, or not moving
        }
        let states = plant.states();
        let angles = robot.joints.iter().zip(states).filter_map(|(joint, state)| {
            let offset = robot.runner.device().0.offset(*joint)?;
            Some(super::degrees(state?.drive_counts.wrapping_sub(offset)).abs())
        });
        report.furthest_deg = angles.fold(report.furthest_deg, f32::max);
    }
    report.counts = robot.host_counts();
    report.losses = robot.host_losses();
    report.armed = robot.events.iter().any(|(_, event)| *event == Event::Armed);
    Ok(report)
}

/// Plays the host against a robot on this machine; calls `hitch` in each turn of its loop.
pub(crate) fn host(
    port: u16,
    run_s: f32,
    mut hitch: impl FnMut(),
) -> Result<Report, Box<dyn Error>> {
    let mut stream = connect(port)?;
    let mut host = Host::new(watchful(run_s));
    let mut buffer = [0; 1024];
    let mut wall = Wall::start();
    let mut report = Report::new(run_s);
    while seconds(wall.now()) < run_s {
        hitch();
        let Some(received) = read(&mut stream, &mut buffer)? else { break };
        report.bytes += received.len();
        if !received.is_empty() {
            wall.hear();
        }
        let told_s = report.bytes as f32 / TELEMETRY_LENGTH as f32 * TELEMETRY_PERIOD_S;
        wall.wait_for_the_other_at(told_s + LARGEST_LEAD_S);
        host.receive(received, wall.now());
        let mut frame = [0; COMMAND_LENGTH];
        if let Some(bytes) = host.command(wall.now(), &mut frame) {
            report.sent += 1;
            if !write(&mut stream, bytes)? {
                break;
            }
        }
        std::thread::sleep(NAP);
    }
    report.counts = host.counts();
    report.furthest_deg = host.furthest_deg;
    report.armed = true; // the frame does not say
    Ok(report)
}

/// Enables again every two seconds: on a busy machine the robot may have missed the host for a moment.
fn watchful(run_s: f32) -> Operator {
    let Operator(mut steps) = Operator::start();
    let mut next_s = 3.0;
    while next_s < run_s {
        steps.push((next_s, Action::Enable));
        next_s += 2.0;
    }
    Operator(steps)
}

impl Report {
    fn new(seconds: f32) -> Self {
        Self {
            sent: 0,
            counts: Counts::default(),
            bytes: 0,
            losses: 0,
            furthest_deg: 0.0,
            seconds,
            armed: false,
        }
    }
}

/// The time on the wall, from which delays are taken off.
struct Wall {
    start: time::Instant,
    behind_s: f32,
    /// When the other side was heard.
    heard: time::Instant,
}

impl Wall {
    fn start() -> Self {
        let now = time::Instant::now();
        Self { start: now, behind_s: 0.0, heard: now }
    }

    fn now(&self) -> Instant {
        at(self.start.elapsed().as_secs_f32() - self.behind_s)
    }

    fn hear(&mut self) {
        self.heard = time::Instant::now();
    }

    /// Takes off what is later than this.
    fn wait_at(&mut self, limit_s: f32) {
        self.behind_s += (seconds(self.now()) - limit_s).max(0.0);
    }

    /// The same, unless the other side hangs.
    fn wait_for_the_other_at(&mut self, limit_s: f32) {
        if self.heard.elapsed() < PATIENCE {
            self.wait_at(limit_s);
        }
    }
}

fn accept(listener: &TcpListener) -> Result<TcpStream, Box<dyn Error>> {
    listener.set_nonblocking(true)?;
    let start = time::Instant::now();
    loop {
        match listener.accept() {
            Ok((stream, _)) => return ready(stream),
            Err(error) if error.kind() == ErrorKind::WouldBlock && start.elapsed() < PATIENCE => {
                std::thread::sleep(time::Duration::from_millis(10));
            }
            Err(error) => return Err(format!("no host came: {error}").into()),
        }
    }
}

fn connect(port: u16) -> Result<TcpStream, Box<dyn Error>> {
    let start = time::Instant::now();
    loop {
        match TcpStream::connect(("127.0.0.1", port)) {
            Ok(stream) => return ready(stream),
            Err(_) if start.elapsed() < PATIENCE => {
                std::thread::sleep(time::Duration::from_millis(50));
            }
            Err(error) => return Err(format!("no robot on port {port}: {error}").into()),
        }
    }
}

fn ready(stream: TcpStream) -> Result<TcpStream, Box<dyn Error>> {
    stream.set_nonblocking(true)?;
    stream.set_nodelay(true)?;
    Ok(stream)
}

/// Returns what came, nothing perhaps; `None` when the other side has gone.
fn read<'a>(
    stream: &mut TcpStream,
    buffer: &'a mut [u8],
) -> Result<Option<&'a [u8]>, Box<dyn Error>> {
    match stream.read(buffer) {
        Ok(0) => Ok(None),
        Ok(length) => Ok(Some(buffer.get(..length).unwrap_or(&[]))),
        Err(error) => match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::Interrupted => Ok(Some(&[])),
            ErrorKind::ConnectionReset | ErrorKind::BrokenPipe => Ok(None),
            _ => Err(error.into()),
        },
    }
}

/// Sends all of it; `false` when the other side has gone.
fn write(stream: &mut TcpStream, mut bytes: &[u8]) -> Result<bool, Box<dyn Error>> {
    while !bytes.is_empty() {
        match stream.write(bytes) {
            Ok(length) => bytes = bytes.get(length..).unwrap_or(&[]),
            Err(error) => match error.kind() {
                ErrorKind::WouldBlock | ErrorKind::Interrupted => std::thread::sleep(NAP),
                ErrorKind::ConnectionReset | ErrorKind::BrokenPipe => return Ok(false),
                _ => return Err(error.into()),
            },
        }
    }
    Ok(true)
}
