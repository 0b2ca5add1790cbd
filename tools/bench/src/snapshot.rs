//! A session at one moment: what the window draws and the commands print.

use crate::robot::Target;
use crate::session::{Session, Stage, is_silence};
use crate::text;
use crate::traffic::Row;
use drivetrain::time::Instant;
use drivetrain::units::AngularVelocity;
use serde_json::{Value, json};
use std::fmt::Write;

/// A motor at one moment.
#[derive(Debug, Clone)]
pub(crate) struct Motor {
    pub(crate) name: String,
    /// "Idle": it reports when it is asked, and nobody asks.
    pub(crate) link: String,
    pub(crate) is_armed: bool,
    pub(crate) is_heard: bool,
    pub(crate) rpm: f32,
    pub(crate) turns: Option<f64>,
    pub(crate) effort: Option<f32>,
    pub(crate) measured_unit: &'static str,
    pub(crate) temperature_c: Option<i16>,
    pub(crate) error: Option<String>,
    pub(crate) conditions: Vec<&'static str>,
    pub(crate) feedback_hz: u16,
    pub(crate) target_rpm: Option<f32>,
    pub(crate) program: String,
    pub(crate) gains: (f32, f32, f32),
    pub(crate) unit: &'static str,
}

/// A session at one moment.
#[derive(Debug, Clone)]
pub(crate) struct Snapshot {
    pub(crate) seconds: f32,
    pub(crate) link: String,
    pub(crate) stage: &'static str,
    pub(crate) is_sending: bool,
    pub(crate) refusal: Option<String>,
    pub(crate) load: f32,
    pub(crate) counts: Vec<(&'static str, u64)>,
    /// By kind.
    pub(crate) errors: Vec<(&'static str, u64)>,
    pub(crate) rows: Vec<Row>,
    pub(crate) motors: Vec<Motor>,
    pub(crate) is_recording: bool,
}

/// Takes a snapshot.
pub(crate) fn of(session: &mut Session) -> Snapshot {
    let motors = (0..session.robot().len()).map(|motor| motor_of(session, motor)).collect();
    let (stage, is_sending) = match session.stage() {
        Stage::Listening => ("listening, nothing is sent", false),
        Stage::Talking => ("sends rest and questions", true),
        Stage::Asking { .. } => ("asks to be armed", true),
        Stage::Armed => ("ARMED", true),
        Stage::Resting { .. } => ("stops: zeros are sent", true),
    };
    let tap = session.tap();
    Snapshot {
        link: tap.link.name().to_owned(),
        load: tap.traffic.load(),
        rows: tap.traffic.rows().cloned().collect(),
        is_recording: !tap.recorders.is_empty(),
        seconds: session.elapsed().as_secs_f32(),
        stage,
        is_sending,
        refusal: session.refusal().map(|refusal| refusal.to_string()),
        counts: session.counts(),
        errors: session.errors(),
        motors,
    }
}

fn motor_of(session: &Session, motor: usize) -> Motor {
    let robot = session.robot();
    let reading = robot.reading(motor);
    let reading = reading.as_ref();
    let health = reading.map(|reading| &reading.health);
    let is_idle = session.is_idle(motor);
    let link = match health.map(|health| health.link) {
        None => "not heard".to_owned(),
        Some(_) if is_idle => "Idle".to_owned(),
        Some(link) => format!("{link:?}"),
    };
    let conditions = health.into_iter().flat_map(|health| health.conditions.iter());
    let conditions = conditions.filter(|condition| !(is_idle && is_silence(*condition)));
    let target_rpm = match session.target(motor) {
        Some(Target::Velocity(rad_per_s)) => {
            Some(AngularVelocity::from_rad_per_s(rad_per_s).as_rpm())
        }
        Some(Target::Effort(_)) | None => None,
    };
    Motor {
        name: robot.names().nth(motor).map(|name| name.to_string()).unwrap_or_default(),
        link,
        is_armed: robot.is_motor_armed(motor),
        is_heard: reading.is_some(),
        rpm: reading
            .map_or(0.0, |reading| AngularVelocity::from_rad_per_s(reading.rad_per_s).as_rpm()),
        turns: reading.and_then(|reading| reading.turns),
        effort: reading.and_then(|reading| reading.effort),
        measured_unit: robot.measured_unit(motor),
        temperature_c: health.and_then(|health| health.temperature_c),
        error: reading.and_then(|reading| reading.error.clone()),
        conditions: conditions.map(|condition| condition.as_str()).collect(),
        feedback_hz: health.map_or(0, |health| health.feedback_hz),
        target_rpm,
        program: session.program(motor).map(|program| program.name()).unwrap_or_default(),
        gains: robot.gains(motor),
        unit: robot.unit(motor),
    }
}

impl Snapshot {
    /// A line for each motor.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        for motor in &self.motors {
            if !motor.is_heard {
                _ = writeln!(text, "{} is not heard", motor.name);
                continue;
            }
            let effort = motor.effort.map_or("     -".into(), |effort| format!("{effort:6.2}"));
            let turns = motor.turns.map_or("-".into(), |turns| format!("{turns:.3}"));
            _ = writeln!(
                text,
                "{} {}: {:8.1} rpm, {effort} {}, position {turns} turns, {}",
                motor.name,
                motor.link,
                motor.rpm,
                motor.measured_unit,
                motor.error.as_deref().unwrap_or("no error")
            );
        }
        text
    }

    /// All of it in one object.
    pub(crate) fn json(&self) -> Value {
        let motors: Vec<Value> = self.motors.iter().map(Motor::json).collect();
        json!({
            "seconds": self.seconds, "link": self.link, "stage": self.stage, "refusal": self.refusal,
            "load": self.load, "motors": motors,
        })
    }
}

impl Motor {
    pub(crate) fn json(&self) -> Value {
        json!({
            "motor": self.name, "link": self.link, "armed": self.is_armed, "rpm": self.rpm,
            "target_rpm": self.target_rpm, "turns": self.turns, "effort": self.effort,
            "unit": self.measured_unit, "temperature_c": self.temperature_c, "error": self.error,
            "conditions": self.conditions, "feedback_hz": self.feedback_hz,
        })
    }
}

/// Edges, a line for each with its time.
pub(crate) fn edges(edges: &[(Instant, String)]) -> String {
    let line = |(at, text): &(Instant, String)| {
        format!("{:10.3} s  {text}\n", at.as_micros() as f64 / 1e6)
    };
    edges.iter().map(line).collect()
}

/// A row of the bus as text.
pub(crate) fn row(row: &Row) -> String {
    let frame = text::of(&row.last);
    let (id, data) = frame.split_once('#').unwrap_or((&frame, ""));
    format!("{id:>8} {:>8} {:>6.0} Hz  {data:<16}  {}", row.frames, row.rate_hz, row.owner)
}
