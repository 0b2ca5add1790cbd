//! Speeds for the motors, and their gains.

use super::{Out, Task};
use crate::identifying::Limits;
use crate::options::{Command, Options};
use crate::outcome::Outcome;
use crate::program::Program;
use crate::session::{Session, Stage};
use crate::snapshot;
use crate::tuning::Plan;
use drivetrain::chassis::{Mecanum, MecanumWheels};
use drivetrain::geometry::Twist;
use drivetrain::units::AngularVelocity;
use serde_json::json;
use std::f32::consts::TAU;

/// How often the state is said, in ticks.
const REPORT: u64 = 500;

/// Shows the motors, and with `--arm` drives them.
#[derive(Debug)]
pub(super) struct Spin {
    arm: bool,
    was_armed: bool,
    refusal: Option<String>,
    asks_for_motion: bool,
    speeds: Vec<AngularVelocity>,
    is_lock_step: bool,
}

impl Spin {
    /// # Errors
    /// Names the option that makes no sense.
    pub(super) fn new(options: &Options) -> Result<Self, String> {
        let is_spin = options.command == Command::Spin;
        Ok(Self {
            arm: options.arm && is_spin,
            was_armed: false,
            refusal: None,
            asks_for_motion: options.rpm.is_some() || options.twist.is_some(),
            speeds: speeds(options)?,
            is_lock_step: options.lock_step,
        })
    }
}

/// The speed of every motor.
fn speeds(options: &Options) -> Result<Vec<AngularVelocity>, String> {
    let Some([x, y, w]) = options.twist else {
        let rpm = options.rpm.unwrap_or(0.0);
        return Ok(vec![AngularVelocity::from_rpm(rpm); options.motors.len()]);
    };
    if crate::motors::parse("m3508:1-4").as_ref() != Ok(&options.motors) {
        return Err("--mecanum needs --motors m3508:1-4".into());
    }
    let (wheel_radius_m, front_left_m) = options.geometry;
    let mecanum = Mecanum::new(wheel_radius_m, front_left_m).map_err(|error| error.to_string())?;
    let speeds = mecanum.inverse(Twist::new(x, y, w));
    let MecanumWheels { front_left, front_right, rear_left, rear_right } = speeds;
    // Ids 1 to 4, as DJI counts them: from the front right, counter-clockwise.
    Ok(vec![front_right, front_left, rear_left, rear_right])
}

impl Task for Spin {
    fn begin(&mut self, session: &mut Session) {
        if self.arm {
            for (motor, speed) in self.speeds.iter().enumerate() {
                let top = session.robot().top_speed(motor);
                let speed = speed.as_rad_per_s().clamp(-top, top);
                session.start_program(motor, Program::Speed(speed));
            }
            session.arm(None);
        }
    }

    fn ticked(&mut self, session: &mut Session, ticks: u64, out: &mut Out) -> bool {
        self.was_armed |= session.stage() == Stage::Armed;
        if !self.is_lock_step && ticks.is_multiple_of(REPORT) {
            let text = self.state(session, out.is_json);
            out.say(text);
        }
        true
    }

    fn report(&mut self, session: &mut Session, out: &mut Out) -> String {
        let state = self.state(session, out.is_json);
        self.refusal = session.refusal().map(|refusal| refusal.to_string());
        let unread = [("unread", u64::from(out.lost()))];
        let counts = session.counts().into_iter().chain(session.errors()).chain(unread);
        if out.is_json {
            let counts: serde_json::Map<_, _> =
                counts.map(|(name, count)| (name.to_owned(), json!(count))).collect();
            return format!("{state}{}\n", json!({ "counts": counts }));
        }
        counts.fold(state, |text, (name, count)| text + &format!("{name} {count}\n"))
    }

    fn is_missed(&self) -> bool {
        self.arm && !self.was_armed
    }

    fn failures(&self) -> Vec<String> {
        let refusals = self.refusal.iter().filter(|_| self.is_missed());
        refusals.map(|refusal| format!("not armed: {refusal}")).collect()
    }
}

impl Spin {
    fn state(&self, session: &mut Session, is_json: bool) -> String {
        if is_json {
            return format!("{}\n", snapshot::of(session).json());
        }
        let mut text = snapshot::of(session).text();
        match session.refusal() {
            Some(refusal) => text += &format!("not armed: {refusal}\n"),
            None if self.asks_for_motion && !self.arm => text += "nothing is sent without --arm\n",
            None => {}
        }
        text
    }
}

/// Tunes or identifies each motor, one after the other.
#[derive(Debug)]
pub(super) struct Tune {
    options: Options,
    motor: usize,
    is_busy: bool,
    outcomes: Vec<Outcome>,
    failures: Vec<String>,
}

impl Tune {
    pub(super) fn new(options: &Options) -> Self {
        let (outcomes, failures) = (Vec::new(), Vec::new());
        Self { options: options.clone(), motor: 0, is_busy: false, outcomes, failures }
    }
}

/// Gentle values for a motor that is tuned, where the options name none.
pub(crate) fn plan(session: &Session, motor: usize, options: &Options) -> Plan {
    let robot = session.robot();
    let (about, hysteresis, share) =
        if robot.unit(motor) == "V" { (8.0, 4.0, 0.4) } else { (15.0, 0.5, 0.5) };
    Plan {
        about: options.rpm.map_or(about, |rpm| AngularVelocity::from_rpm(rpm).as_rad_per_s()),
        amplitude: options.amplitude.unwrap_or(share * robot.limit(motor)),
        hysteresis: options.hysteresis.unwrap_or(hysteresis),
    }
}

/// Gentle limits for a motor that is identified, where the options name none.
pub(crate) fn limits(session: &Session, motor: usize, options: &Options) -> Limits {
    let robot = session.robot();
    // A voltage of 0.8 of the limit turns a GM6020 without load at some 10 rad/s.
    let (speed, share) = if robot.unit(motor) == "V" { (14.0, 0.8) } else { (30.0, 0.5) };
    Limits {
        effort: options.amplitude.unwrap_or(share * robot.limit(motor)),
        speed: options.rpm.map_or(speed, |rpm| AngularVelocity::from_rpm(rpm).as_rad_per_s()),
        way: TAU * options.turns.unwrap_or(16.0),
    }
}

impl Task for Tune {
    fn begin(&mut self, session: &mut Session) {
        session.arm(Some(drivetrain::time::Duration::from_secs(3)));
    }

    fn ticked(&mut self, session: &mut Session, ticks: u64, out: &mut Out) -> bool {
        for outcome in session.outcomes() {
            match outcome {
                Ok(outcome) => {
                    let text =
                        if out.is_json { format!("{}\n", outcome.json()) } else { text(&outcome) };
                    out.say(text);
                    self.outcomes.push(outcome);
                }
                Err(error) => self.failures.push(format!("motor {}: {error}", self.motor + 1)),
            }
            (self.motor, self.is_busy) = (self.motor + 1, false);
        }
        let is_armed = session.stage() == Stage::Armed;
        if is_armed && !self.is_busy && self.motor < session.robot().len() {
            self.is_busy = true;
            let begun = if self.options.command == Command::Identify {
                let limits = limits(session, self.motor, &self.options);
                session.start_identifying(self.motor, limits)
            } else {
                let plan = plan(session, self.motor, &self.options);
                session.start_tuning(self.motor, plan)
            };
            if let Err(error) = begun {
                self.failures.push(error);
                return false;
            }
        }
        // Progress, for a person who waits.
        if is_armed && !out.is_json && ticks.is_multiple_of(1_000) {
            let stage = session.program(self.motor).map(Program::name).unwrap_or_default();
            out.say(format!("{:>3} s  motor {}: {stage}\n", ticks / 1_000, self.motor + 1));
        }
        let is_refused = session.stage() == Stage::Listening;
        self.motor < session.robot().len() && !is_refused
    }

    fn report(&mut self, _: &mut Session, _: &mut Out) -> String {
        String::new()
    }

    fn is_missed(&self) -> bool {
        self.outcomes.len() < self.options.motors.len()
    }

    fn failures(&self) -> Vec<String> {
        self.failures.clone()
    }
}

fn text(outcome: &Outcome) -> String {
    let lines = outcome.lines().join("\n");
    format!("{lines}\n{}\n\n{}", outcome.rust(), outcome.toml())
}
