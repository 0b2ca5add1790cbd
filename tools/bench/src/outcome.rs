//! The results of tuning and of identification: lines for a person, a line of Rust, TOML and JSON.

use crate::identifying::Identified;
use crate::robot::Target;
use crate::tuning::Tuned;
use drivetrain::control::PidConfig;
use serde_json::Value;
use std::fmt::Write;

/// The result of a program that measures.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Outcome {
    Tuned(Tuned),
    Identified(Identified),
}

/// The request of a program that measures, in a tick.
#[derive(Debug)]
pub(crate) enum Next {
    Ask(Target),
    /// Set these gains, and go on.
    Set((f32, f32, f32)),
    Done(Result<Outcome, String>),
}

impl Outcome {
    pub(crate) fn lines(&self) -> Vec<String> {
        match self {
            Self::Tuned(tuned) => tuned.lines(),
            Self::Identified(identified) => identified.lines(),
        }
    }

    /// The speed loop as a line of Rust.
    pub(crate) fn rust(&self) -> String {
        match self {
            Self::Tuned(tuned) => rust(&tuned.config(), None),
            Self::Identified(Identified { plant, speed, .. }) => {
                rust(speed, Some((plant.ks, plant.kv)))
            }
        }
    }

    pub(crate) fn toml(&self) -> String {
        match self {
            Self::Tuned(tuned) => toml(&tuned.motor, &tuned.rows()),
            Self::Identified(identified) => toml(&identified.motor, &identified.rows()),
        }
    }

    pub(crate) fn json(&self) -> Value {
        let mut value = match self {
            Self::Tuned(tuned) => tuned.json(),
            Self::Identified(identified) => identified.json(),
        };
        if let Some(object) = value.as_object_mut() {
            object.insert("rust".into(), self.rust().into());
            object.insert("toml".into(), self.toml().into());
        }
        value
    }
}

/// A row of TOML: key, value, and unit where it has one.
pub(crate) type TomlRow = (&'static str, f32, String);

fn rust(config: &PidConfig, feed_forward: Option<(f32, f32)>) -> String {
    let (kp, ki, kd) = config.gains();
    let feed_forward = feed_forward
        .map_or(String::new(), |(ks, kv)| format!(".with_feed_forward({ks:?}, {kv:?})"));
    let (_, limit) = config.output_range();
    format!("PidConfig::new({kp:?}, {ki:?}, {kd:?}){feed_forward}.with_output_limit({limit:?})")
}

fn toml(motor: &str, rows: &[TomlRow]) -> String {
    let mut text = format!("[\"{motor}\"]\n");
    for (key, value, unit) in rows {
        let comment = if unit.is_empty() { String::new() } else { format!(" # {unit}") };
        _ = writeln!(text, "{key} = {value:?}{comment}");
    }
    text
}
