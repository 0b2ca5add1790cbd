//! Finds gains: a relay makes the motor swing, a rule turns the swing into gains, a step shows what they are worth.

use crate::outcome::{Next, Outcome, TomlRow};
use crate::robot::Target;
use drivetrain::control::{PidConfig, RelayTuner, StepResponse, TuningRule};
use serde_json::{Value, json};

/// The rule that turns a swing into gains.
const RULE: TuningRule = TuningRule::TyreusLuybenPi;

/// How long a step is measured, in s, and the share within which it counts as settled.
const STEP_S: f32 = 1.0;
const SETTLED: f32 = 0.05;

/// The time in which the motor gets to its speed by its present gains, before the relay takes over.
const RUN_UP_S: f32 = 1.0;

/// The time in which it comes to rest between two steps.
const PAUSE_S: f32 = 1.0;

/// Targets and efforts of a motor while it is tuned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plan {
    /// The speed in rad/s about which it swings, away from zero, where dry friction would hold it.
    pub(crate) about: f32,
    /// The effort to either side.
    pub(crate) amplitude: f32,
    /// How far the speed must pass in rad/s before the relay switches: more than its noise.
    pub(crate) hysteresis: f32,
}

/// What a step showed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step {
    pub(crate) gains: (f32, f32, f32),
    pub(crate) rise_s: Option<f32>,
    pub(crate) overshoot: f32,
    pub(crate) settled_s: Option<f32>,
    pub(crate) steady_error: f32,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tuned {
    pub(crate) motor: String,
    pub(crate) unit: &'static str,
    pub(crate) limit: f32,
    pub(crate) ultimate_gain: f32,
    pub(crate) ultimate_period_s: f32,
    pub(crate) before: Step,
    pub(crate) after: Step,
}

#[derive(Debug)]
enum Stage {
    /// From any motion to rest.
    Rest {
        left_s: f32,
    },
    /// By the present gains.
    Before(StepResponse),
    RunUp {
        left_s: f32,
        efforts: (f32, u32),
    },
    Swing(RelayTuner),
    Pause {
        left_s: f32,
    },
    After(StepResponse),
}

/// A motor that is being tuned.
#[derive(Debug)]
pub(crate) struct Tuning {
    plan: Plan,
    stage: Stage,
    outcome: Tuned,
}

impl Tuning {
    /// Begins at rest, with a step by the present gains.
    ///
    /// # Errors
    /// Names the value of the plan that is none.
    pub(crate) fn new(
        plan: Plan,
        motor: String,
        unit: &'static str,
        limit: f32,
        gains: (f32, f32, f32),
    ) -> Result<Self, String> {
        // A relay that is cut off would have swung by less than its gain is reckoned with.
        let plan = Plan { amplitude: plan.amplitude.min(limit), ..plan };
        RelayTuner::new(plan.amplitude, plan.hysteresis).map_err(|error| error.to_string())?;
        let before =
            Step { gains, rise_s: None, overshoot: 0.0, settled_s: None, steady_error: 0.0 };
        let after = before;
        let (ultimate_gain, ultimate_period_s) = (0.0, 0.0);
        let outcome = Tuned { motor, unit, limit, ultimate_gain, ultimate_period_s, before, after };
        response(&plan)?;
        Ok(Self { plan, stage: Stage::Rest { left_s: PAUSE_S }, outcome })
    }

    /// The name of the present stage, for a person who waits.
    pub(crate) fn stage(&self) -> &'static str {
        match self.stage {
            Stage::Rest { .. } => "rest",
            Stage::Before(_) => "step with the present gains",
            Stage::RunUp { .. } => "run-up",
            Stage::Swing(_) => "relay",
            Stage::Pause { .. } => "pause",
            Stage::After(_) => "step with the gains found",
        }
    }

    /// Takes the measured speed, the effort that the motor reports in the unit of its efforts, and the time step.
    pub(crate) fn step(&mut self, speed: f32, effort: Option<f32>, dt_s: f32) -> Next {
        let about = self.plan.about;
        match &mut self.stage {
            Stage::Rest { left_s } => {
                *left_s -= dt_s;
                if *left_s <= 0.0 {
                    match response(&self.plan) {
                        Ok(response) => self.stage = Stage::Before(response),
                        Err(error) => return Next::Done(Err(error)),
                    }
                }
                Next::Ask(Target::Velocity(0.0))
            }
            Stage::Before(response) => {
                response.record(speed, dt_s);
                if response.is_complete() {
                    self.outcome.before = measured(self.outcome.before.gains, response);
                    self.stage = Stage::RunUp { left_s: RUN_UP_S, efforts: (0.0, 0) };
                }
                Next::Ask(Target::Velocity(about))
            }
            Stage::RunUp { left_s, efforts } => {
                *left_s -= dt_s;
                if let (Some(effort), true) = (effort, *left_s < 0.5 * RUN_UP_S) {
                    *efforts = (efforts.0 + effort, efforts.1 + 1);
                }
                if *left_s > 0.0 {
                    return Next::Ask(Target::Velocity(about));
                }
                // The relay swings about what holds the speed.
                let bias = if efforts.1 > 0 { efforts.0 / efforts.1 as f32 } else { 0.0 };
                let Plan { amplitude, hysteresis, .. } = self.plan;
                let amplitude = amplitude.min(self.outcome.limit - bias.abs());
                if amplitude <= 0.0 {
                    let error = "its limit is used up by the speed: lower --rpm";
                    return Next::Done(Err(error.into()));
                }
                match RelayTuner::new(amplitude, hysteresis).and_then(|tuner| tuner.with_bias(bias))
                {
                    Ok(tuner) => self.stage = Stage::Swing(tuner),
                    Err(error) => return Next::Done(Err(error.to_string())),
                }
                Next::Ask(Target::Effort(bias))
            }
            Stage::Swing(tuner) => {
                let effort = tuner.update(about, speed, dt_s);
                if let Some(failure) = tuner.failure() {
                    return Next::Done(Err(failure.to_string()));
                }
                let Some((gain, period_s)) = tuner.ultimate() else {
                    return Next::Ask(Target::Effort(effort));
                };
                (self.outcome.ultimate_gain, self.outcome.ultimate_period_s) = (gain, period_s);
                self.outcome.after.gains = RULE.pid(gain, period_s).gains();
                self.stage = Stage::Pause { left_s: PAUSE_S };
                Next::Set(self.outcome.after.gains)
            }
            Stage::Pause { left_s } => {
                *left_s -= dt_s;
                if *left_s <= 0.0 {
                    match response(&self.plan) {
                        Ok(response) => self.stage = Stage::After(response),
                        Err(error) => return Next::Done(Err(error)),
                    }
                }
                Next::Ask(Target::Velocity(0.0))
            }
            Stage::After(response) => {
                response.record(speed, dt_s);
                if response.is_complete() {
                    self.outcome.after = measured(self.outcome.after.gains, response);
                    return Next::Done(Ok(Outcome::Tuned(self.outcome.clone())));
                }
                Next::Ask(Target::Velocity(about))
            }
        }
    }
}

fn response(plan: &Plan) -> Result<StepResponse, String> {
    StepResponse::new(0.0, plan.about, STEP_S, SETTLED).map_err(|error| error.to_string())
}

fn measured(gains: (f32, f32, f32), response: &StepResponse) -> Step {
    Step {
        gains,
        rise_s: response.rise_time_s(),
        overshoot: response.overshoot(),
        settled_s: response.settling_time_s(),
        steady_error: response.steady_error(),
    }
}

impl Tuned {
    /// The loop with the gains found.
    pub(crate) fn config(&self) -> PidConfig {
        let (kp, ki, kd) = self.after.gains;
        PidConfig::new(kp, ki, kd).with_output_limit(self.limit)
    }

    pub(crate) fn rows(&self) -> Vec<TomlRow> {
        let ((kp, ki, kd), unit) = (self.after.gains, self.unit);
        vec![
            ("kp", kp, format!("{unit} per rad/s")),
            ("ki", ki, format!("{unit} per rad")),
            ("kd", kd, format!("{unit} per rad/s²")),
            ("output_limit", self.limit, unit.to_owned()),
            ("ultimate_gain", self.ultimate_gain, format!("{unit} per rad/s")),
            ("ultimate_period_s", self.ultimate_period_s, String::new()),
        ]
    }

    pub(crate) fn json(&self) -> Value {
        json!({
            "motor": self.motor,
            "unit": self.unit,
            "ultimate_gain": self.ultimate_gain,
            "ultimate_period_s": self.ultimate_period_s,
            "before": self.before.json(),
            "after": self.after.json(),
        })
    }

    /// A line for each step.
    pub(crate) fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "{}: ultimate gain {:.3} {} per rad/s, ultimate period {:.1} ms",
            self.motor,
            self.ultimate_gain,
            self.unit,
            1e3 * self.ultimate_period_s
        )];
        lines.push(format!("  before {}", self.before.text()));
        lines.push(format!("  after  {}", self.after.text()));
        lines
    }
}

impl Step {
    fn json(&self) -> Value {
        let (kp, ki, kd) = self.gains;
        json!({
            "kp": kp, "ki": ki, "kd": kd, "rise_s": self.rise_s, "overshoot": self.overshoot,
            "settled_s": self.settled_s, "steady_error_rad_per_s": self.steady_error,
        })
    }

    fn text(&self) -> String {
        let ms =
            |time_s: Option<f32>| time_s.map_or("never".into(), |s| format!("{:.0} ms", 1e3 * s));
        let (kp, ki, _) = self.gains;
        format!(
            "kp {kp:.3}  ki {ki:.2}  rise {}, overshoot {:.1} %, settled {}, error {:+.3} rad/s",
            ms(self.rise_s),
            100.0 * self.overshoot,
            ms(self.settled_s),
            self.steady_error
        )
    }
}
