//! Identifies a motor on its mechanism: efforts swing the shaft within limits, and its plant gives a speed loop.

use crate::outcome::{Next, Outcome, TomlRow};
use crate::robot::Target;
use drivetrain::control::{Excitation, Identification, IdentificationError, PidConfig, Plant};
use drivetrain::units::Angle;
use serde_json::{Value, json};

/// The phase margin of the speed loop, in degrees.
const MARGIN_DEGREES: f32 = 60.0;

/// The time in which the motor comes to rest before it swings.
const PAUSE_S: f32 = 1.0;

/// The speed in rad/s below which a shaft may be at rest.
const STANDSTILL: f32 = 0.2;

/// The limits of the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Limits {
    /// In the unit of the motor's efforts.
    pub(crate) effort: f32,
    /// In rad/s.
    pub(crate) speed: f32,
    /// To either side, in rad.
    pub(crate) way: f32,
}

/// The names and numbers of a motor that stand in its result.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Subject {
    pub(crate) motor: String,
    /// Of an effort.
    pub(crate) unit: &'static str,
    /// The largest effort of the speed loop.
    pub(crate) limit: f32,
    /// Nm for a unit of effort, if it is known.
    pub(crate) torque_constant_nm: Option<f32>,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Identified {
    pub(crate) motor: String,
    unit: &'static str,
    torque_constant_nm: Option<f32>,
    pub(crate) plant: Plant,
    bandwidth: f32,
    /// The speed loop that follows from the plant.
    pub(crate) speed: PidConfig,
}

/// A motor that is being identified.
#[derive(Debug)]
pub(crate) struct Identifying {
    subject: Subject,
    rest_s: f32,
    excitation: Excitation,
    identification: Identification,
}

impl Identifying {
    /// Begins at rest.
    ///
    /// # Errors
    /// Names the limit that is none.
    pub(crate) fn new(limits: Limits, subject: Subject) -> Result<Self, String> {
        let Limits { effort, speed, way } = limits;
        // No effort beyond the limit of the motor is sent, and none is taken for sent.
        let effort = effort.min(subject.limit);
        Ok(Self {
            rest_s: PAUSE_S,
            excitation: Excitation::new(effort, speed, way).map_err(text)?,
            identification: Identification::new(subject.limit, STANDSTILL).map_err(text)?,
            subject,
        })
    }

    /// The name of the present stage, for a person who waits.
    pub(crate) fn stage(&self) -> &'static str {
        if self.rest_s > 0.0 { "rest" } else { "swings within its limits" }
    }

    /// Takes the measured speed in rad/s, NaN if there is none, and the time step in s.
    pub(crate) fn step(&mut self, speed: f32, dt_s: f32) -> Next {
        if self.rest_s > 0.0 {
            self.rest_s -= dt_s;
            return Next::Ask(Target::Velocity(0.0));
        }
        let effort = self.excitation.update(speed, dt_s);
        if !self.excitation.is_complete() {
            self.identification.sample(effort, speed, dt_s);
            return Next::Ask(Target::Effort(effort));
        }
        Next::Done(match self.excitation.failure() {
            Some(failure) => Err(failure.to_string()),
            None => self.result().map(Outcome::Identified),
        })
    }

    fn result(&self) -> Result<Identified, String> {
        let plant = self.identification.result().map_err(|error| {
            let is_fast = self.subject.unit == "V" && error == IdentificationError::NotExcited;
            let advice =
                "; without load a shaft follows a voltage too fast: load it, or command a current";
            format!("{error}{}", if is_fast { advice } else { "" })
        })?;
        let margin = Angle::from_degrees(MARGIN_DEGREES);
        let bandwidth = plant.bandwidth(margin).map_err(text)?;
        let speed = plant.speed_loop(bandwidth, margin).map_err(text)?;
        let Subject { motor, unit, limit, torque_constant_nm } = self.subject.clone();
        let speed = speed.with_output_limit(limit);
        Ok(Identified { motor, unit, torque_constant_nm, plant, bandwidth, speed })
    }
}

fn text(error: impl ToString) -> String {
    error.to_string()
}

impl Identified {
    /// Inertia in kg m² and dry friction in Nm.
    pub(crate) fn mechanism(&self) -> Option<(f32, f32)> {
        let constant = self.torque_constant_nm?;
        Some((self.plant.inertia_kg_m2(constant), self.plant.friction_nm(constant)))
    }

    pub(crate) fn lines(&self) -> Vec<String> {
        let (plant, unit) = (&self.plant, self.unit);
        let mut lines = vec![format!(
            "{}: kS {:.3} ± {:.3} {unit}, kV {:.4} ± {:.4} {unit} s/rad, kA {:.5} ± {:.5} {unit} s²/rad",
            self.motor,
            plant.ks,
            plant.ks_deviation,
            plant.kv,
            plant.kv_deviation,
            plant.ka,
            plant.ka_deviation
        )];
        let mechanism = self.mechanism().map_or(String::new(), |(inertia, friction)| {
            format!("inertia {inertia:.5} kg m², dry friction {friction:.3} Nm, ")
        });
        lines.push(format!(
            "  {mechanism}delay {:.2} ms, noise {:.3} rad/s",
            1e3 * plant.delay_s,
            plant.noise
        ));
        let (kp, ki, _) = self.speed.gains();
        lines.push(format!(
            "  kp {kp:.3}  ki {ki:.2}  by {MARGIN_DEGREES:.0} degrees of phase margin at {:.0} rad/s",
            self.bandwidth
        ));
        lines
    }

    pub(crate) fn rows(&self) -> Vec<TomlRow> {
        let (plant, unit) = (&self.plant, self.unit);
        let of = |per: &str| format!("{unit} {per}");
        let ((kp, ki, kd), (_, limit)) = (self.speed.gains(), self.speed.output_range());
        let mut rows = vec![
            ("kp", kp, of("per rad/s")),
            ("ki", ki, of("per rad")),
            ("kd", kd, of("per rad/s²")),
            ("output_limit", limit, unit.to_owned()),
            ("ks", plant.ks, unit.to_owned()),
            ("kv", plant.kv, of("s/rad")),
            ("ka", plant.ka, of("s²/rad")),
            ("ks_deviation", plant.ks_deviation, unit.to_owned()),
            ("kv_deviation", plant.kv_deviation, of("s/rad")),
            ("ka_deviation", plant.ka_deviation, of("s²/rad")),
            ("delay_s", plant.delay_s, String::new()),
            ("tick_s", plant.tick_s, String::new()),
            ("bandwidth_rad_per_s", self.bandwidth, String::new()),
            ("phase_margin_degrees", MARGIN_DEGREES, String::new()),
        ];
        if let Some((inertia, friction)) = self.mechanism() {
            rows.push(("inertia_kg_m2", inertia, String::new()));
            rows.push(("friction_nm", friction, String::new()));
        }
        rows
    }

    pub(crate) fn json(&self) -> Value {
        let (plant, mechanism) = (&self.plant, self.mechanism());
        let (kp, ki, kd) = self.speed.gains();
        json!({
            "motor": self.motor, "unit": self.unit,
            "ks": plant.ks, "kv": plant.kv, "ka": plant.ka,
            "ks_deviation": plant.ks_deviation, "kv_deviation": plant.kv_deviation, "ka_deviation": plant.ka_deviation,
            "delay_s": plant.delay_s, "noise_rad_per_s": plant.noise,
            "inertia_kg_m2": mechanism.map(|(inertia, _)| inertia), "friction_nm": mechanism.map(|(_, friction)| friction),
            "bandwidth_rad_per_s": self.bandwidth, "phase_margin_degrees": MARGIN_DEGREES,
            "kp": kp, "ki": ki, "kd": kd,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motor by voltage, whose speed follows with a time constant of `kA / kV`.
    fn identify(ka: f32) -> Result<Identified, String> {
        let (limits, limit) = (Limits { effort: 8.0, speed: 14.0, way: 100.0 }, 10.0);
        let (motor, unit) = ("GM6020".to_owned(), "V");
        let subject = Subject { motor, unit, limit, torque_constant_nm: None };
        let mut identifying = Identifying::new(limits, subject).unwrap();
        let (mut speed, mut late) = (0.0_f32, [0.0_f32; 2]);
        loop {
            let effort = match identifying.step(speed, 0.001) {
                Next::Ask(Target::Effort(effort)) => effort,
                Next::Ask(Target::Velocity(_)) => 0.0,
                Next::Done(Ok(Outcome::Identified(identified))) => return Ok(identified),
                Next::Done(Err(error)) => return Err(error),
                next => panic!("{next:?}"),
            };
            late = [effort, late[0]];
            for _ in 0..10 {
                let push = late[1] - 0.72 * speed;
                let friction =
                    if speed == 0.0 { push.clamp(-0.4, 0.4) } else { 0.4 * speed.signum() };
                speed += (push - friction) / ka * 1e-4;
            }
        }
    }

    #[test]
    fn a_motor_by_voltage_is_identified_with_its_load_and_not_where_it_follows_at_once() {
        let found = identify(0.072).unwrap(); // 100 ms
        let plant = found.plant;
        assert!((plant.ka / 0.072 - 1.0).abs() < 0.05, "{plant:?}");
        assert!((plant.kv / 0.72 - 1.0).abs() < 0.05 && (plant.ks - 0.4).abs() < 0.05, "{plant:?}");
        let error = identify(0.72e-3).unwrap_err(); // 1 ms
        assert!(error.contains("load it, or command a current"), "{error}");
    }
}
