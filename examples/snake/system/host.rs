//! The computer: sends the gait at 20 Hz, and reads what comes back.

use super::{JOINTS, at, degrees, gait, pulses, seconds};
use drivetrain::math::sin_cos;
use drivetrain::time::{Duration, Instant};
use drivetrain::wire::host_link::{
    COMMAND_LENGTH, HostCommand, Reset, TELEMETRY_LENGTH, Telemetry, TelemetryFormat,
};
use drivetrain::wire::{Counts, Deframer};
use std::f32::consts::TAU;

const PERIOD: Duration = Duration::from_millis(50);
/// A command takes so long until a joint acts on it: 7 ms on the line, then speed and position in turn, 12 ms each.
const LATENCY_S: f32 = 0.025;
/// A position is so old when its telemetry has arrived: 11 ms on the line, and polled each 12 or 24 ms.
const AGE_S: f32 = 0.02;
/// The lag that a joint may keep; a joint makes up for more. After a damaged command, 50 ms pass without a new target.
const LAG_DEG: f32 = 1.0;
/// Speed with which the joints go to the straight body.
const HOMING_RPM: u8 = 15;
/// However far behind.
const FASTEST_RPM: f32 = 40.0;
/// A reset is held for some frames: one may be damaged.
const HELD_S: f32 = 0.25;
/// How far the gripper swings, in degrees, and how fast.
const GRIPPER_DEG: f32 = 40.0;
const GRIPPER_HZ: f32 = 0.25;

/// An action of the operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Action {
    /// Sends a reset for a while; the joints are to be straight.
    Reset(Reset),
    /// Begins the gait.
    Gait,
    /// Enables while the gait goes on.
    Enable,
}

/// The one who decides when the robot may move: it does not by itself.
#[derive(Debug, Clone)]
pub(crate) struct Operator(pub(crate) Vec<(f32, Action)>);

impl Operator {
    /// Zeroes, enables, and lets go at one second.
    pub(crate) fn start() -> Self {
        Self(vec![
            (0.3, Action::Reset(Reset::Rezero)),
            (0.7, Action::Reset(Reset::Enable)),
            (1.0, Action::Gait),
        ])
    }

    /// Does the same again, some time after a fault.
    pub(crate) fn and_again(mut self, from_s: f32, rezero: bool) -> Self {
        let first = if rezero { Reset::Rezero } else { Reset::Disable };
        self.0.extend([
            (from_s, Action::Reset(first)),
            (from_s + 0.4, Action::Reset(Reset::Enable)),
            (from_s + 1.2, Action::Gait),
        ]);
        self
    }

    fn latest(&self, time_s: f32, wanted: impl Fn(Action) -> bool) -> Option<(f32, Action)> {
        self.0.iter().rev().find(|(from_s, action)| *from_s <= time_s && wanted(*action)).copied()
    }

    fn reset(&self, time_s: f32) -> Reset {
        match self.latest(time_s, |action| action != Action::Gait) {
            Some((from_s, _)) if time_s >= from_s + HELD_S => Reset::None,
            Some((_, Action::Reset(reset))) => reset,
            Some((_, Action::Enable)) => Reset::Enable,
            _ => Reset::None,
        }
    }

    /// Returns when the present gait began; `None` while the body is to be straight.
    pub(crate) fn gait_since(&self, time_s: f32) -> Option<f32> {
        let (since_s, action) = self.latest(time_s, |action| action != Action::Enable)?;
        (action == Action::Gait).then_some(since_s)
    }

    /// Returns the time since the gait has had its full swing.
    pub(crate) fn swings_for(&self, time_s: f32) -> Option<f32> {
        Some(time_s - self.gait_since(time_s)? - gait::FADE_S).filter(|time_s| *time_s > 0.0)
    }

    /// Returns where a joint is to be, in degrees.
    pub(crate) fn wanted_deg(&self, joint: usize, time_s: f32) -> f32 {
        self.gait_since(time_s).map_or(0.0, |since_s| gait::angle_deg(joint, time_s - since_s))
    }
}

pub(crate) struct Host {
    pub(crate) operator: Operator,
    due: Instant,
    telemetry: Deframer<Telemetry, TELEMETRY_LENGTH>,
    pub(crate) latest: Option<Telemetry>,
    received_s: f32,
    /// All that was sent.
    pub(crate) sent: Vec<HostCommand>,
    pub(crate) sent_bytes: u32,
    /// The largest angle of a joint that came back during the gait, in degrees.
    pub(crate) furthest_deg: f32,
}

impl Host {
    pub(crate) fn new(operator: Operator) -> Self {
        Self {
            operator,
            due: Instant::START,
            telemetry: Deframer::with_options(TelemetryFormat::new()),
            latest: None,
            received_s: 0.0,
            sent: Vec::new(),
            sent_bytes: 0,
            furthest_deg: 0.0,
        }
    }

    /// Writes the command that is due, if any.
    pub(crate) fn command<'a>(
        &mut self,
        now: Instant,
        buffer: &'a mut [u8; COMMAND_LENGTH],
    ) -> Option<&'a [u8]> {
        if now < self.due {
            return None;
        }
        // A computer that was away sends no frames for the past.
        self.due = (self.due + PERIOD).max(at(seconds(now) - 0.02) + PERIOD);
        let command = self.plan(seconds(now));
        self.sent.push(command);
        self.sent_bytes += u32::try_from(COMMAND_LENGTH).unwrap_or(0);
        command.encode(buffer).ok()
    }

    fn plan(&self, time_s: f32) -> HostCommand {
        let from_s = time_s + LATENCY_S;
        let until_s = from_s + PERIOD.as_secs_f32();
        // What the operator will do is not known yet.
        let since_s = self.operator.gait_since(time_s);
        let moving_s = since_s.map_or(0.0, |since_s| time_s - since_s);
        let wanted = |joint, at_s: f32| {
            since_s.map_or(0.0, |since_s| gait::angle_deg(joint, at_s - since_s))
        };
        let swing = GRIPPER_DEG * sin_cos(TAU * GRIPPER_HZ * moving_s).0;
        HostCommand {
            positions_pulses: std::array::from_fn(|joint| pulses(wanted(joint, until_s))),
            speeds_rpm: std::array::from_fn(|joint| {
                let way =
                    wanted(joint, until_s) - wanted(joint, from_s) + self.lag_deg(joint, time_s);
                if since_s.is_some() { rpm(way / PERIOD.as_secs_f32()) } else { HOMING_RPM }
            }),
            gm6020_position: whole(swing),
            c610_position: whole(-swing),
            sts3032_degrees: whole(180.0 + swing),
            reset: self.operator.reset(time_s),
        }
    }

    /// Returns how far a joint was behind, as far as it matters; 0 without fresh telemetry.
    fn lag_deg(&self, joint: usize, time_s: f32) -> f32 {
        let Some(telemetry) = &self.latest else { return 0.0 };
        if time_s - self.received_s > 2.0 * PERIOD.as_secs_f32() {
            return 0.0;
        }
        let measured = telemetry.positions_pulses.get(joint).map_or(0.0, |p| degrees(*p));
        let lag = self.operator.wanted_deg(joint, self.received_s - AGE_S) - measured;
        lag - lag.clamp(-LAG_DEG, LAG_DEG)
    }

    /// Takes bytes of the line.
    pub(crate) fn receive(&mut self, mut bytes: &[u8], now: Instant) {
        while let Some(telemetry) = self.telemetry.read(&mut bytes) {
            let is_moving = self.operator.gait_since(seconds(now)).is_some();
            let shown = telemetry.positions_pulses.iter().filter(|_| is_moving);
            let angles = shown.map(|pulses| degrees(*pulses).abs());
            self.furthest_deg = angles.fold(self.furthest_deg, f32::max);
            self.latest = Some(telemetry);
            self.received_s = seconds(now);
        }
    }

    pub(crate) fn counts(&self) -> Counts {
        self.telemetry.counts()
    }
}

/// The next whole rpm that is not too slow.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn rpm(degrees_per_s: f32) -> u8 {
    (degrees_per_s.abs() / 6.0).ceil().clamp(1.0, FASTEST_RPM) as u8
}

#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn whole(degrees: f32) -> i16 {
    degrees.round() as i16
}

const _: () = assert!(JOINTS == drivetrain::wire::host_link::JOINTS);
