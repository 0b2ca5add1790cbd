use super::{Facts, Gm6020Voltage, Model};
use crate::control::PidConfig;
use crate::encoder::GearRatio;
use crate::motor::{HealthConfig, OPENING};
use crate::time::Duration;
use crate::units::{Current, Voltage};
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
    /// [`WheelTuning`](crate::control::WheelTuning) computes gains for a wheel, [`WordGains`](super::WordGains) converts gains. Every
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
