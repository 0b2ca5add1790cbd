//! Finding gains and judging them.
//!
//! 1. [`RelayTuner`] swings the plant between two output values and measures the response: [`RelayTuner::ultimate`].
//! 2. [`RelayTuner::pid`] calculates gains from the response by a [`TuningRule`] with a name and a source.
//! 3. [`StepResponse`] measures the loop with these gains.
//!
//! Where mass and wheels of a robot are known, [`WheelTuning`] reckons gains to begin with. Where the mechanism may be swung
//! through its range, an [`Identification`](crate::control::Identification) finds the plant, and with it gains of a stated margin.

mod relay;
mod step_response;

pub use relay::{RelayTuner, TuningRule};
pub use step_response::StepResponse;

use crate::control::error::{check, positive};
use crate::control::pid::PidConfig;
use crate::error::ConfigError;

/// A driven wheel of a robot, for the gains of its speed loop.
///
/// A wheel carries the inertia `J = mass_kg wheel_radius_m² / driven_wheels` of the robot driving straight ahead. With the
/// torque `k` at the shaft for 1 A, a PI loop over `J` crosses over at [`BANDWIDTH_RAD_PER_S`](Self::BANDWIDTH_RAD_PER_S)
/// `= w`, and is damped by [`DAMPING`](Self::DAMPING) `= d`:
///
/// ```text
/// kp = w J / k               in A per rad/s
/// ki = kp w / (4 d²)         in A per rad
/// ```
///
/// A step of the speed then overshoots by 5 %. `J` leaves out wheel, gearbox and rotor, whose inertia is seldom known. The
/// damping makes room for these: on three times the inertia a step overshoots by 12 % without friction, and by less with
/// friction.
///
/// A loop at 1 kHz acts about 3 ms after the measurement, at a cost of 3 degrees of phase at `w`. A lifted or slipping wheel
/// carries its own inertia alone, and the crossover rises by the ratio of both inertias. The loop stays stable up to a ratio
/// of 20: 400 rad/s and 69 degrees.
///
/// A [`RelayTuner`] measures the motor, and finds faster gains.
///
/// # Examples
/// A robot of 20 kg on four mecanum wheels, each on an M3508:
/// ```
/// use drivetrain::control::{PidConfig, WheelTuning};
///
/// const WHEEL: WheelTuning = WheelTuning {
///     mass_kg: 20.0,
///     wheel_radius_m: 0.076,
///     driven_wheels: 4.0,
///     torque_constant_nm_per_a: 0.3, // that of the model is in `dji::Facts`
///     current_limit_a: 10.0,
/// };
/// // In a constant, a bad parameter does not compile.
/// const SPEED: PidConfig = match WHEEL.speed_loop() {
///     Ok(speed) => speed,
///     Err(_) => panic!("not a wheel"),
/// };
/// let (kp, ki, kd) = SPEED.gains();
/// assert!((kp - 1.925).abs() < 1e-3); // 20 rad/s * 0.02888 kg m² / 0.3 Nm/A
/// assert!((ki - 2.407).abs() < 1e-3); // 1.925 A per rad/s * 20 rad/s / 16
/// assert_eq!((kd, SPEED.output_range()), (0.0, (-10.0, 10.0)));
///
/// let weightless = WheelTuning { mass_kg: 0.0, ..WHEEL };
/// assert_eq!(weightless.speed_loop().unwrap_err().to_string(), "mass_kg: must be more than zero, and finite");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct WheelTuning {
    /// Mass of the whole robot in kg.
    pub mass_kg: f32,
    /// Radius of the wheels in m.
    pub wheel_radius_m: f32,
    /// Number of wheels that share the mass.
    ///
    /// Mecanum, steered and plain wheels with a motor count 1 each: 4.0 for a mecanum chassis, 2.0 for a differential drive. Omni
    /// wheels pull in one direction only and count one half each: 1.5 for three.
    pub driven_wheels: f32,
    /// Torque at the wheel, gearbox included, in Nm for each ampere.
    pub torque_constant_nm_per_a: f32,
    /// Largest current in A: the output limit of the loop.
    pub current_limit_a: f32,
}

impl WheelTuning {
    /// The angular frequency in rad/s of the loop's crossover: `w`.
    pub const BANDWIDTH_RAD_PER_S: f32 = 20.0;

    /// The damping ratio of the loop: `d`. A PI loop over an inertia overshoots by 13.5 % at 1, and by 4.8 % at 2.
    pub const DAMPING: f32 = 2.0;

    /// Returns the speed loop: rad/s of the wheel in, A out, with the current limit as its output limit.
    ///
    /// # Errors
    /// Names the first field that is not more than zero, or not finite; `kp` or `ki` if the gain lies outside of `f32`.
    pub const fn speed_loop(&self) -> Result<PidConfig, ConfigError> {
        check!(positive("mass_kg", self.mass_kg));
        check!(positive("wheel_radius_m", self.wheel_radius_m));
        check!(positive("driven_wheels", self.driven_wheels));
        check!(positive("torque_constant_nm_per_a", self.torque_constant_nm_per_a));
        check!(positive("current_limit_a", self.current_limit_a));
        let radius_m = self.wheel_radius_m;
        let inertia_kg_m2 = self.mass_kg * radius_m * radius_m / self.driven_wheels;
        let kp = Self::BANDWIDTH_RAD_PER_S * inertia_kg_m2 / self.torque_constant_nm_per_a;
        let ki = kp * Self::BANDWIDTH_RAD_PER_S / (4.0 * Self::DAMPING * Self::DAMPING);
        check!(positive("kp", kp));
        check!(positive("ki", ki));
        Ok(PidConfig::new(kp, ki, 0.0).with_output_limit(self.current_limit_a))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Pid;
    use crate::time::TimeStep;

    const WHEEL: WheelTuning = WheelTuning {
        mass_kg: 20.0,
        wheel_radius_m: 0.076,
        driven_wheels: 4.0,
        torque_constant_nm_per_a: 0.3,
        current_limit_a: 20.0,
    };

    /// Steps the loop of `WHEEL` to 1 rad/s on an inertia of so many times its own, `late` milliseconds behind.
    fn highest(inertias: f32, late: usize) -> f32 {
        let inertia = inertias * WHEEL.mass_kg * WHEEL.wheel_radius_m.powi(2) / WHEEL.driven_wheels;
        let mut pid = Pid::new(WHEEL.speed_loop().unwrap()).unwrap();
        let step = TimeStep::of(0.001);
        let (mut speed, mut highest) = (0.0, 0.0_f32);
        let mut waiting = std::collections::VecDeque::from(std::vec![0.0; late]);
        for _ in 0..10_000 {
            waiting.push_back(pid.step(1.0, speed, &step));
            let amperes = waiting.pop_front().unwrap();
            speed += amperes * WHEEL.torque_constant_nm_per_a / inertia * 0.001;
            highest = highest.max(speed);
        }
        assert!((speed - 1.0).abs() < 0.01, "{inertias}, {late} ms: it ends at {speed}");
        highest
    }

    #[test]
    fn a_step_overshoots_as_the_damping_predicts_and_little_more_at_three_times_the_inertia() {
        for (inertias, expected) in [(1.0, 1.048), (3.0, 1.12), (0.5, 1.03)] {
            let highest = highest(inertias, 0);
            assert!((highest - expected).abs() < 0.01, "{inertias}: {highest}");
        }
    }

    #[test]
    fn a_loop_three_milliseconds_late_is_stable_on_a_twentieth_of_the_inertia() {
        // Another half of a millisecond is in the step itself.
        for inertias in [1.0, 0.2, 0.05] {
            assert!(highest(inertias, 3) < 2.0, "{inertias}");
        }
    }

    #[test]
    fn the_first_invalid_field_is_named() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            for (wheel, name) in [
                (WheelTuning { mass_kg: bad, ..WHEEL }, "mass_kg"),
                (WheelTuning { wheel_radius_m: bad, ..WHEEL }, "wheel_radius_m"),
                (WheelTuning { driven_wheels: bad, ..WHEEL }, "driven_wheels"),
                (
                    WheelTuning { torque_constant_nm_per_a: bad, ..WHEEL },
                    "torque_constant_nm_per_a",
                ),
                (WheelTuning { current_limit_a: bad, ..WHEEL }, "current_limit_a"),
            ] {
                let error = wheel.speed_loop().unwrap_err();
                assert_eq!(error, ConfigError::NotPositive(name));
            }
        }
        for wheel in [
            WheelTuning { wheel_radius_m: 1e-30, ..WHEEL },
            WheelTuning { wheel_radius_m: 1e30, ..WHEEL },
        ] {
            assert_eq!(wheel.speed_loop().unwrap_err().parameter(), "kp");
        }
    }
}
