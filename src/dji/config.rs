//! Configuration of a motor, and gains in words of a drive.

use super::{Facts, Gm6020Voltage, Model};
use crate::control::PidConfig;
use crate::encoder::GearRatio;
use crate::motor::{HealthConfig, OPENING};
use crate::time::Duration;
use crate::units::{Current, Voltage};
use core::f32::consts::TAU;
use core::marker::PhantomData;

/// Configuration of a motor for [`Bus::attach`](super::Bus::attach).
///
/// # Examples
/// ```
/// use drivetrain::control::PidConfig;
/// use drivetrain::dji::{Config, M3508};
/// use drivetrain::units::Current;
///
/// const SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0); // A per rad/s, A per rad: a wheel under 20 kg
/// const WHEEL: Config<M3508> = Config::new(1)
///     .reversed()
///     .speed_loop(SPEED)
///     .with_current_limit(Current::from_amperes(10.0));
/// assert_eq!(WHEEL.id(), 1);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config<M: Model> {
    pub(super) plain: PlainConfig,
    model: PhantomData<fn() -> M>,
}

/// The configuration without the model as a type, for the body of the bus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlainConfig {
    pub(super) id: u8,
    pub(super) reversed: bool,
    pub(super) gear: GearRatio,
    pub(super) command_raw: i16,
    pub(super) command_full_scale: f32,
    /// Full scale if `None`.
    pub(super) limit: Option<f32>,
    /// Torque constant of the model behind the gearbox if `None`.
    pub(super) torque_constant_nm_per_a: Option<f32>,
    pub(super) speed: Option<PidConfig>,
    pub(super) position: Option<PidConfig>,
    pub(super) resumes: bool,
    pub(super) opening: Duration,
    pub(super) health: &'static HealthConfig,
}

/// The default checks.
pub(super) static USUAL: HealthConfig = HealthConfig::new();

impl<M: Model> Config<M> {
    /// Takes the id set on the ESC: 1..=8 for C610 and C620, 1..=7 for GM6020.
    ///
    /// All other settings are those of the motor as sold: its gearbox, its full scale as the limit, not reversed, no loops.
    #[must_use]
    pub const fn new(id: u8) -> Self {
        let facts: &Facts = M::FACTS;
        Self {
            plain: PlainConfig {
                id,
                reversed: false,
                gear: facts.gear,
                command_raw: facts.command_raw,
                command_full_scale: facts.command_full_scale,
                limit: None,
                torque_constant_nm_per_a: None,
                speed: None,
                position: None,
                resumes: false,
                opening: OPENING,
                health: &USUAL,
            },
            model: PhantomData,
        }
    }

    /// Reverses the positive direction of angle, velocity, current and command, for example for a motor on the right side of a chassis.
    #[must_use]
    pub const fn reversed(mut self) -> Self {
        self.plain.reversed = !self.plain.reversed;
        self
    }

    /// Adds a speed loop: rad/s of the output shaft in; amperes, or volts for a motor in voltage mode, out.
    ///
    /// The loop is limited to the motor's limit unless it has a lower output limit of its own. `attach` refuses a `kp` if the command for
    /// an error of one rpm of the rotor, the resolution of the feedback, exceeds the model's whole range: above 3667 A per rad/s for an
    /// M3508, 3438 for an M2006, 28.6 for a GM6020 in current mode, and 229 V per rad/s in voltage mode, each with its own gearbox.
    /// [`WheelTuning`](crate::control::WheelTuning) computes gains for a wheel, [`WordGains`] converts gains. Every
    /// option of a [`PidConfig`] works here, including the incremental form and a tracked setpoint.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::PidConfig;
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// let speed = PidConfig::new(1.9, 2.4, 0.0).with_incremental_form().with_tracking(30.0);
    /// let mut bus = Bus::new();
    /// assert!(bus.attach(Config::<M3508>::new(1).speed_loop(speed)).is_ok());
    /// ```
    #[must_use]
    pub const fn speed_loop(mut self, speed: PidConfig) -> Self {
        self.plain.speed = Some(speed);
        self
    }

    /// Adds a position loop over a speed loop: rad of the output shaft in, rad/s out to the speed loop.
    ///
    /// The derivative works on the measured velocity. The position loop is limited to the motor's no-load speed unless it has a lower
    /// output limit of its own. `attach` refuses a `kp` if the command for an error of one count of the encoder exceeds that speed.
    /// The loop works on the error of the position: `attach` also refuses the options of a setpoint, which are feed-forward,
    /// period, tracking and the derivative of the error. The speed loop takes every option.
    #[must_use]
    pub const fn position_loop(mut self, position: PidConfig, speed: PidConfig) -> Self {
        self.plain.position = Some(position);
        self.speed_loop(speed)
    }

    /// Replaces the gearbox. The torque constant follows, unless set by `with_torque_constant`.
    #[must_use]
    pub const fn with_gear(mut self, gear: GearRatio) -> Self {
        self.plain.gear = gear;
        self
    }

    /// Sets the torque at the output shaft for each ampere, gearbox included. Used for [`State::torque_nm`] only.
    ///
    /// [`State::torque_nm`]: super::State::torque_nm
    #[must_use]
    pub const fn with_torque_constant(mut self, nm_per_a: f32) -> Self {
        self.plain.torque_constant_nm_per_a = Some(nm_per_a);
        self
    }

    /// Makes an armed motor take targets again after a recovery from offline; its output range then opens from zero as after arming.
    /// Without this, the motor stays relaxed until armed again.
    #[must_use]
    pub const fn with_resume(mut self) -> Self {
        self.plain.resumes = true;
        self
    }

    /// Sets the time in which the output range opens after arming and after a recovery, from zero to the whole: 0.2 s by default, at most
    /// 65 s. Below 1 ms, the range opens at once.
    ///
    /// Meanwhile a position loop is limited to the same share of its velocity, so the motion begins at the present angle of the shaft.
    #[must_use]
    pub const fn with_opening(mut self, time: Duration) -> Self {
        self.plain.opening = time;
        self
    }

    /// Sets the checks of the motor and the reactions. `attach` refuses an unusable parameter.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Config, M2006};
    /// use drivetrain::motor::{Condition, HealthConfig, Reaction};
    ///
    /// static FEEDER: HealthConfig = HealthConfig::new()
    ///     .with_stall_hold(0.2)
    ///     .with_reaction(Condition::Fault, Reaction::Report);
    /// let feeder = Config::<M2006>::new(7).with_health(&FEEDER);
    /// assert_eq!(feeder.id(), 7);
    /// ```
    #[must_use]
    pub const fn with_health(mut self, health: &'static HealthConfig) -> Self {
        self.plain.health = health;
        self
    }

    /// Returns the id.
    #[must_use]
    pub const fn id(&self) -> u8 {
        self.plain.id
    }
}

impl<M: Model<Command = Current>> Config<M> {
    /// Lowers the largest current, for loops and direct commands alike. `attach` refuses more than the ESC's full scale.
    #[must_use]
    pub const fn with_current_limit(mut self, limit: Current) -> Self {
        self.plain.limit = Some(limit.as_amperes());
        self
    }
}

impl<M: Model<Command = Voltage>> Config<M> {
    /// Lowers the largest voltage, for loops and direct commands alike. `attach` refuses more than full scale.
    #[must_use]
    pub const fn with_voltage_limit(mut self, limit: Voltage) -> Self {
        self.plain.limit = Some(limit.as_volts());
        self
    }

    /// Sets the voltage of full scale; sources state 24 V or 25.2 V.
    #[must_use]
    pub const fn with_nominal_voltage(mut self, full_scale: Voltage) -> Self {
        self.plain.command_full_scale = full_scale.as_volts();
        self
    }
}

impl Config<Gm6020Voltage> {
    /// Sets full scale to ±30000, for motors of 2020 and before; current motors have ±25000.
    #[must_use]
    pub const fn with_legacy_full_scale(mut self) -> Self {
        self.plain.command_raw = 30_000;
        self
    }
}

/// Gains of a speed loop of another program: command words per rpm.
///
/// Programs for these motors work in the numbers of the frames. [`speed_loop`](Self::speed_loop) converts their gains to A, or V in voltage
/// mode, per rad/s of the output shaft. By hand, with the gearbox and the full scale of the motor as sold:
///
/// | `kp`, `ki`, `kd` of a speed loop, in command words per | M2006 | M3508 | GM6020 (voltage) | GM6020 (current) |
/// |---|--:|--:|--:|--:|
/// | rpm of the rotor | 0.3438 | 0.2238 | 0.009167 | 0.001749 |
/// | rpm of the output shaft | 0.009549 | 0.01166 | 0.009167 | 0.001749 |
///
/// | of any loop | multiply by |
/// |---|--:|
/// | limit of output or integral, in command words | full scale / full word: 20 A / 16384 for an M3508 |
/// | `ki` of a program that sums the errors without the time between them | steps a second |
/// | `kd` of such a program | seconds a step |
/// | position loop over a speed loop, rpm of the rotor per count of its encoder | 136.5 (8192 / 60) |
/// | position loop over a speed loop, rpm per degree, both of one shaft | 6 |
///
/// Unconverted gains are seldom refused. A `kp` of 10 words per rpm of the output shaft is 0.117 A per rad/s for an M3508. The same number
/// in A per rad/s is 86 times as much, yet a possible loop: an error of one rpm of the rotor then commands 0.055 A. `attach` refuses a `kp`
/// above 3667 A per rad/s, for which this error would command more than the full 20 A, and names both numbers.
///
/// # Examples
/// A wheel whose loop had `kp` 10 and `ki` 0.5, in words per rpm of the output shaft, with the time in seconds:
/// ```
/// use drivetrain::dji::{Bus, Config, M3508, WordGains};
///
/// let wheel = Config::<M3508>::new(1);
/// let speed = WordGains::per_output_rpm(10.0, 0.5, 0.0).speed_loop(&wheel);
/// let (kp, ki, _) = speed.gains();
/// assert!((kp - 0.1166).abs() < 1e-4); // 10 * 20 A / 16384 * 60 / (2 pi), in A per rad/s
/// assert!((ki - 0.00583).abs() < 1e-5); // A per rad
/// let limits = speed.with_output_limit(16_000.0 * 20.0 / 16_384.0); // 16000 words: 19.5 A
/// Bus::new().attach(wheel.speed_loop(limits))?;
///
/// // The same numbers per rpm of the rotor, which turns 3591/187 times as often.
/// let (kp, ..) = WordGains::per_rotor_rpm(10.0, 0.5, 0.0).speed_loop(&wheel).gains();
/// assert!((kp - 2.238).abs() < 1e-3);
/// # Ok::<(), drivetrain::dji::AttachError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WordGains {
    kp: f32,
    ki: f32,
    kd: f32,
    of_rotor: bool,
}

impl WordGains {
    /// Takes gains in command words per rpm of the rotor, as in the feedback frame: `ki` a second, `kd` in seconds.
    #[must_use]
    pub const fn per_rotor_rpm(kp: f32, ki: f32, kd: f32) -> Self {
        Self { kp, ki, kd, of_rotor: true }
    }

    /// Takes gains in command words per rpm of the output shaft, behind the gearbox: `ki` a second, `kd` in seconds.
    #[must_use]
    pub const fn per_output_rpm(kp: f32, ki: f32, kd: f32) -> Self {
        Self { kp, ki, kd, of_rotor: false }
    }

    /// Takes gains in command words per degree/s of the rotor, as in `basic_framework` and its descendants: `ki` a second, `kd` in seconds.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Config, M3508, WordGains};
    ///
    /// let wheel = Config::<M3508>::new(1);
    /// let (kp, ..) = WordGains::per_rotor_degree_per_s(1.5, 0.0, 0.0).speed_loop(&wheel).gains();
    /// assert!((kp - 2.0148).abs() < 1e-3); // 9 words per rpm of the rotor
    /// ```
    #[must_use]
    pub const fn per_rotor_degree_per_s(kp: f32, ki: f32, kd: f32) -> Self {
        let degree_per_s_per_rpm = 6.0;
        Self::per_rotor_rpm(
            kp * degree_per_s_per_rpm,
            ki * degree_per_s_per_rpm,
            kd * degree_per_s_per_rpm,
        )
    }

    /// Takes `ki` and `kd` as those of a program that runs every `dt_s` seconds without a measure of time: such a program sums the error,
    /// and uses the difference to the previous step.
    ///
    /// `dt_s` must be finite and above zero; otherwise `attach` refuses the loop.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Config, M2006, WordGains};
    ///
    /// let at_1_khz = WordGains::per_rotor_rpm(2.0, 0.01, 0.5).each_step(0.001);
    /// let (kp, ki, kd) = at_1_khz.speed_loop(&Config::<M2006>::new(1)).gains();
    /// assert!((kp - 0.6875).abs() < 1e-4); // A per rad/s
    /// assert!((ki - 3.438).abs() < 1e-3); // 10 a second: A per rad
    /// assert!((kd - 0.000_171_9).abs() < 1e-6); // 0.0005 s: A per rad/s²
    /// ```
    #[must_use]
    pub const fn each_step(self, dt_s: f32) -> Self {
        Self { ki: self.ki / dt_s, kd: self.kd * dt_s, ..self }
    }

    /// Returns the speed loop with these gains for a motor with the gearbox and the full scale of `config`: A, or V in voltage
    /// mode, per rad/s of the output shaft.
    pub const fn speed_loop<M: Model>(self, config: &Config<M>) -> PidConfig {
        let plain = &config.plain;
        let rpm_per_rad_per_s = 60.0 / TAU;
        let rpm = if self.of_rotor { plain.gear.as_f32() } else { 1.0 } * rpm_per_rad_per_s;
        let factor = rpm * plain.command_full_scale / plain.command_raw as f32;
        PidConfig::new(self.kp * factor, self.ki * factor, self.kd * factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Bus, Gm6020Current, Gm6020Voltage, M2006, M3508};
    use crate::encoder::GearRatio;
    use crate::frame::CanFrame;
    use crate::time::{Instant, Tick};
    use crate::units::{AngularVelocity, Voltage};
    use embedded_can::Frame;

    fn factors<M: Model>() -> [f32; 2] {
        let config = Config::<M>::new(1);
        [WordGains::per_rotor_rpm, WordGains::per_output_rpm]
            .map(|gains| gains(1.0, 0.0, 0.0).speed_loop(&config).gains().0)
    }

    #[test]
    fn the_table_has_the_factors_of_each_model() {
        let text = include_str!("config.rs");
        let columns = [
            factors::<M2006>(),
            factors::<M3508>(),
            factors::<Gm6020Voltage>(),
            factors::<Gm6020Current>(),
        ];
        for (row, name) in ["rpm of the rotor", "rpm of the output shaft"].into_iter().enumerate() {
            let start = std::format!("/// | {name} |");
            let line = text.lines().find_map(|line| line.strip_prefix(&start)).unwrap();
            let figures =
                line.trim_end_matches('|').split('|').map(|figure| figure.trim().parse::<f32>());
            for (figure, factor) in figures.zip(columns.map(|factors| factors[row])) {
                let figure = figure.unwrap();
                assert!((figure / factor - 1.0).abs() < 5e-4, "{name}: {figure} and not {factor}");
            }
        }
    }

    #[test]
    fn each_gain_has_its_own_factor() {
        let wheel = Config::<M3508>::new(1);
        let (kp, ki, kd) = WordGains::per_rotor_rpm(9.0, 12.0, 0.6).speed_loop(&wheel).gains();
        let degrees = WordGains::per_rotor_degree_per_s(1.5, 0.01, 20.0).each_step(0.005);
        let found = degrees.speed_loop(&wheel).gains();
        for (found, expected) in [(found.0, kp), (found.1, ki), (found.2, kd)] {
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} and not {expected}");
        }
        assert!((ki / kp - 12.0 / 9.0).abs() < 1e-6 && (kd / kp - 0.6 / 9.0).abs() < 1e-7);
    }

    #[test]
    fn a_full_scale_or_gearbox_of_its_own_counts() {
        let (kp, ..) = WordGains::per_rotor_rpm(1.0, 0.0, 0.0)
            .speed_loop(&Config::<M3508>::new(1).with_gear(GearRatio::DIRECT))
            .gains();
        assert!((kp - 0.011_657).abs() < 1e-5, "{kp}");
        let old = Config::<Gm6020Voltage>::new(1)
            .with_legacy_full_scale()
            .with_nominal_voltage(Voltage::from_volts(25.2));
        let (kp, ..) = WordGains::per_output_rpm(1.0, 0.0, 0.0).speed_loop(&old).gains();
        assert!((kp - 9.5493 * 25.2 / 30_000.0).abs() < 1e-6, "{kp}");
    }

    /// The other program: `word = kp * (target - measured)`, both in rpm of the rotor.
    #[test]
    fn the_word_on_the_wire_is_that_of_the_other_program() {
        let mut bus: Bus = Bus::new();
        let wheel = Config::<M3508>::new(1);
        let speed = WordGains::per_rotor_rpm(10.0, 0.0, 0.0).speed_loop(&wheel);
        let wheel = bus.attach(wheel.speed_loop(speed)).unwrap();
        let turning = CanFrame::standard(0x201, [0, 0, 0x01, 0x2C, 0, 0, 25, 0]).unwrap(); // 300 rpm
        let target = AngularVelocity::from_rpm(500.0 * 187.0 / 3591.0);
        let mut last = [0; 2];
        for ms in 1..500 {
            let now = Instant::from_micros(1_000 * ms);
            _ = bus.ingest(&turning, now);
            if ms == 1 {
                bus.arm(now).unwrap();
            }
            bus.set_velocity(wheel, target).unwrap();
            bus.update(Tick::new(now, 0.001));
            while let Some(frame) = bus.next_frame() {
                last = [frame.data()[0], frame.data()[1]];
            }
        }
        assert_eq!(i16::from_be_bytes(last), 2_000); // 10 * (500 - 300)
    }

    #[test]
    fn a_step_without_time_gives_a_loop_that_is_refused() {
        for dt_s in [0.0, -0.001, f32::NAN, f32::INFINITY] {
            let wheel = Config::<M3508>::new(1);
            let gains = WordGains::per_rotor_rpm(1.0, 1.0, 1.0).each_step(dt_s);
            let attached = Bus::<()>::branded().attach(wheel.speed_loop(gains.speed_loop(&wheel)));
            assert!(attached.is_err(), "{dt_s}");
        }
    }
}
