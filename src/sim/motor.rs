use super::Line;
use crate::dji::{self, Facts};
use crate::encoder::Position;
use crate::time::Duration;
use crate::units::{Angle, AngularVelocity, Current};

/// A motor with its ESC to attach to a [`Simulation`](super::Simulation).
///
/// All values at the output shaft, at 24 V. Torque constant, gear and no-load speed are those of the driver's table
/// ([`facts`](Self::facts)); the M3508's resistance follows from its rated point, 469 rpm at 10 A and 3 Nm.
/// **Everything else is an estimate** of the right order, chosen without a source.
///
/// | | M2006 | M3508 | GM6020 |
/// |---|---|---|---|
/// | torque constant, Nm/A | 0.18 | 0.3 | 0.741 |
/// | speed without load, rpm | 500 | 482 | 320 |
/// | largest current, A | 10 | 20 | 3 |
/// | back-EMF (follows), V s/rad | 0.454 | 0.475 | 0.710 |
/// | resistance, Ω | 0.46 (estimate) | 0.065 (rated point) | 1.8 (estimate) |
/// | inertia, kg m² (estimate) | 0.002 | 0.008 | 0.0008 |
/// | dry friction, Nm (estimate) | 0.05 | 0.12 | 0.05 |
/// | viscous friction, mNm s/rad (estimate) | 0.8 | 2.2 | 1.0 |
/// | time constant of the current, ms (estimate) | 0.5 | 0.5 | 0.5, in voltage mode 3.2 |
/// | final heat, K/A² (estimate) | 4 | 0.6 | 15 |
/// | time constant of heat, s (estimate) | 200 | 300 | 400 |
///
/// The reaction of a real ESC when commands stop is not documented, so the default is the worst case: the ESC continues with
/// the last command for ever ([`with_command_timeout`](Self::with_command_timeout)).
///
/// # Examples
/// ```
/// use drivetrain::sim::{MotorConfig, Simulation};
/// use drivetrain::time::Duration;
///
/// let world = Simulation::new(1);
/// let wheel = world.attach(MotorConfig::m3508(2).with_rotor_angle(8000))?;
/// world.advance(Duration::from_millis(3)); // nothing commands it, so it stands
/// assert_eq!(world.motor(wheel).map(|motor| motor.encoder_counts), Some(8000));
/// # Ok::<(), drivetrain::sim::SimError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorConfig {
    pub(crate) model: Model,
    pub(crate) id: u8,
    pub(crate) line: Line,
    pub(crate) command_timeout: Option<Duration>,
    pub(crate) supply_v: f32,
    pub(crate) load_inertia_kg_m2: f32,
    pub(crate) load_friction_nm: f32,
    /// Of the output shaft, in radians from the start.
    pub(crate) stops: Option<(f32, f32)>,
    pub(crate) rotor_angle: Option<u16>,
    pub(crate) clock_ppm: Option<i16>,
    pub(crate) legacy_full_scale: bool,
    pub(crate) period: Duration,
    pub(crate) jitter: Duration,
    pub(crate) speed_noise_rpm: f32,
}

impl MotorConfig {
    /// Takes the id of an M2006 on its C610: 1 to 8.
    #[must_use]
    pub const fn m2006(id: u8) -> Self {
        Self::new(Model::M2006, id)
    }

    /// Takes the id of an M3508 on its C620: 1 to 8.
    #[must_use]
    pub const fn m3508(id: u8) -> Self {
        Self::new(Model::M3508, id)
    }

    /// Takes the id of a GM6020 as delivered, commanded in volts: 1 to 7.
    #[must_use]
    pub const fn gm6020_voltage(id: u8) -> Self {
        Self::new(Model::Gm6020Voltage, id)
    }

    /// Takes the id of a GM6020 with current control switched on: 1 to 7.
    #[must_use]
    pub const fn gm6020_current(id: u8) -> Self {
        Self::new(Model::Gm6020Current, id)
    }

    pub(crate) const fn new(model: Model, id: u8) -> Self {
        Self {
            model,
            id,
            line: Line::Can1,
            command_timeout: None,
            supply_v: 24.0,
            load_inertia_kg_m2: 0.0,
            load_friction_nm: 0.0,
            stops: None,
            rotor_angle: None,
            clock_ppm: None,
            legacy_full_scale: false,
            period: Duration::from_millis(1),
            jitter: Duration::from_micros(10),
            speed_noise_rpm: 0.0,
        }
    }

    /// Returns the facts of the motor from the wire and the data sheets.
    #[must_use]
    pub const fn facts(&self) -> &'static Facts {
        self.model.facts()
    }

    /// Puts the motor on a bus other than the first.
    #[must_use]
    pub const fn with_line(self, line: Line) -> Self {
        Self { line, ..self }
    }

    /// Sets the time after the last command at which the ESC goes to zero; by default the ESC continues with the
    /// command for ever.
    #[must_use]
    pub const fn with_command_timeout(self, timeout: Duration) -> Self {
        Self { command_timeout: Some(timeout), ..self }
    }

    /// Sets the supply in volts, 24 by default; a value that is not a positive number counts as 24.
    #[must_use]
    pub const fn with_supply_v(self, supply_v: f32) -> Self {
        let supply_v = if supply_v > 0.0 && supply_v < 1e3 { supply_v } else { 24.0 };
        Self { supply_v, ..self }
    }

    /// Fixes an inertia to the output shaft, in kg m²; a value that is not a positive number counts as none.
    #[must_use]
    pub const fn with_load_inertia_kg_m2(self, inertia: f32) -> Self {
        let inertia = if inertia > 0.0 && inertia < 1e3 { inertia } else { 0.0 };
        Self { load_inertia_kg_m2: inertia, ..self }
    }

    /// Adds dry friction at the output shaft to the motor's own, in Nm; a value that is not a positive number counts as
    /// none.
    #[must_use]
    pub const fn with_load_friction_nm(self, friction: f32) -> Self {
        let friction = if friction > 0.0 && friction < 1e3 { friction } else { 0.0 };
        Self { load_friction_nm: friction, ..self }
    }

    /// Puts the output shaft between two hard stops without bounce, as angles from its start: at most zero, and at least
    /// zero. NaN counts as zero.
    #[must_use]
    pub const fn with_stops(self, lower: Angle, upper: Angle) -> Self {
        let (lower, upper) = (lower.as_radians(), upper.as_radians());
        let lower = if lower < 0.0 { lower } else { 0.0 };
        let upper = if upper > 0.0 { upper } else { 0.0 };
        Self { stops: Some((lower, upper)), ..self }
    }

    /// Sets the rotor's angle at the start, in counts of 8192 a turn; by default the seed chooses.
    #[must_use]
    pub const fn with_rotor_angle(self, counts: u16) -> Self {
        Self { rotor_angle: Some(counts & 0x1FFF), ..self }
    }

    /// Makes full scale ±30000, as in a GM6020 of 2020 and before; other models have no such past.
    #[must_use]
    pub const fn with_legacy_full_scale(self) -> Self {
        Self { legacy_full_scale: matches!(self.model, Model::Gm6020Voltage), ..self }
    }

    /// Sets the time between two feedback frames, 1 ms by default, at least 100 µs and at most 1 s. Real ESCs are
    /// set with RoboMaster Assistant.
    #[must_use]
    pub const fn with_feedback_period(self, period: Duration) -> Self {
        let micros = period.as_micros();
        let micros = if micros < 100 { 100 } else { micros };
        let micros = if micros > 1_000_000 { 1_000_000 } else { micros };
        Self { period: Duration::from_micros(micros), ..self }
    }

    /// Sets by how much a feedback frame is late at most, 10 µs by default (an estimate) and at most 10 ms. The time is drawn anew for
    /// each frame, and does not add up.
    #[must_use]
    pub const fn with_feedback_jitter(self, most: Duration) -> Self {
        let micros = if most.as_micros() > 10_000 { 10_000 } else { most.as_micros() };
        Self { jitter: Duration::from_micros(micros), ..self }
    }

    /// Adds noise of at most so many rpm, evenly distributed, to the rotor speed of the feedback; what is not a positive number
    /// counts as none. The true speed stays as it is.
    #[must_use]
    pub const fn with_speed_noise_rpm(self, most: f32) -> Self {
        let most = if most > 0.0 && most < 1e4 { most } else { 0.0 };
        Self { speed_noise_rpm: most, ..self }
    }

    /// Sets by how many millionths the ESC's period is too long; by default the seed chooses within ±50.
    #[must_use]
    pub const fn with_clock_ppm(self, ppm: i16) -> Self {
        Self { clock_ppm: Some(ppm), ..self }
    }
}

/// A motor of a [`Simulation`](super::Simulation): a motor with an ESC, or a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorKey(u8);

/// The number of motors with ESCs in a world.
pub(crate) const MOTORS: usize = 16;
/// The number of joints in a world, whose keys follow.
pub(crate) const JOINTS: usize = 12;

impl MotorKey {
    /// Returns the key of a motor with an ESC.
    pub(crate) fn new(index: usize) -> Option<Self> {
        u8::try_from(index).ok().filter(|_| index < MOTORS).map(Self)
    }

    /// Returns the key of a joint.
    pub(crate) fn of_joint(index: usize) -> Option<Self> {
        u8::try_from(index + MOTORS).ok().filter(|_| index < JOINTS).map(Self)
    }

    /// Returns the place among the motors with ESCs; the place of a joint is beyond all of them.
    pub(crate) const fn index(self) -> usize {
        self.0 as usize
    }

    pub(crate) const fn is_joint(self) -> bool {
        self.joint_index().is_some()
    }

    /// Returns the place among the joints.
    pub(crate) const fn joint_index(self) -> Option<usize> {
        self.index().checked_sub(MOTORS)
    }
}

/// The true state of a simulated motor, before anything is rounded for the wire. Counter-clockwise is positive.
///
/// Quantities not simulated for a joint (its drive moves to its target at any load) are NaN: current, torque, power and
/// temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct MotorState {
    /// Turns and angle of the output shaft, from where [`encoder_counts`](Self::encoder_counts) is 0.
    pub position: Position,
    /// The velocity of the output shaft.
    pub velocity: AngularVelocity,
    /// The torque current.
    pub current: Current,
    /// The torque of the motor at the output shaft, friction not taken off, in Nm.
    pub torque_nm: f32,
    /// The electric power taken from the supply, in W: the mechanical power and the heat in its winding. Below zero while
    /// the motor feeds back.
    pub power_w: f32,
    /// The temperature measured by the ESC, in °C.
    pub temperature_c: f32,
    /// The angle of its encoder since the start, regardless of the memory of its drive: 8192 a turn of an ESC's rotor, whose
    /// first turn begins at 0; 65536 a turn of a joint.
    pub encoder_counts: i64,
    /// The same as counted by its drive, from the zero of its last start, in 32 bits with wrap. An ESC sends the angle
    /// within a turn.
    pub drive_counts: i32,
    /// The acting command of the drive, as on the wire: the word of an ESC, the target of a joint in pulses.
    pub command: i32,
    /// Whether the drive moves or holds the shaft: an ESC does while it has its supply, a joint while it is enabled.
    pub is_enabled: bool,
    /// Answers to requests of a joint, feedback frames of an ESC; frames without room in its mailboxes included.
    pub replies: u32,
    /// Number of frames of the controller with its id that began in the same bit as its reply: on a real bus both would
    /// have been destroyed. Here the controller goes first. Only a joint has one id for both.
    pub collisions: u32,
}

/// A motor of the driver's family [`dji`] with its ESC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum Model {
    M2006,
    M3508,
    Gm6020Voltage,
    Gm6020Current,
}

impl Model {
    /// Returns the facts from the wire and the data sheets.
    pub(crate) const fn facts(self) -> &'static Facts {
        match self {
            Self::M2006 => <dji::M2006 as dji::Model>::FACTS,
            Self::M3508 => <dji::M3508 as dji::Model>::FACTS,
            Self::Gm6020Voltage => <dji::Gm6020Voltage as dji::Model>::FACTS,
            Self::Gm6020Current => <dji::Gm6020Current as dji::Model>::FACTS,
        }
    }
}

/// A counter of 32 bits wraps.
#[expect(clippy::cast_possible_truncation, reason = "wraps")]
pub(crate) const fn wrapped(counts: i64) -> i32 {
    counts as i32
}

/// Returns the position at this number of turns.
#[expect(clippy::cast_possible_truncation, reason = "an angle within a turn")]
pub(crate) fn position(turns: f64) -> Position {
    let whole = turns as i64;
    Position::new(whole, Angle::from_turns((turns - whole as f64) as f32))
}

/// The physical constants of a model, at the output shaft. Units are SI.
///
/// Torque constant, gear and no-load speed are documented (see [`Facts`]). The M3508's resistance follows from
/// its documented rated point, 469 rpm at 10 A and 3 Nm. **Everything else is an estimate** of the right order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Constants {
    /// Rotor and gearbox, kg m².
    pub(crate) inertia: f32,
    /// Nm
    pub(crate) coulomb: f32,
    /// Nm s/rad
    pub(crate) viscous: f32,
    /// Ω, of the supply's loss of speed under load.
    pub(crate) resistance: f32,
    /// s: of the ESC's closed current loop; in voltage mode the winding's own, inductance over resistance.
    pub(crate) current_time_constant: f32,
    /// K/A², final rise of temperature.
    pub(crate) heating: f32,
    /// s
    pub(crate) thermal_time_constant: f32,
}

/// About 0.5 A without load, at speed. All estimates.
const M2006: Constants = Constants {
    inertia: 2.0e-3,
    coulomb: 0.05,
    viscous: 0.8e-3,
    resistance: 0.46,
    current_time_constant: 0.5e-3,
    heating: 4.0,
    thermal_time_constant: 200.0,
};

/// About 0.8 A without load, at speed. Resistance from the rated point, the rest estimates.
const M3508: Constants = Constants {
    inertia: 8.0e-3,
    coulomb: 0.12,
    viscous: 2.2e-3,
    resistance: 0.065,
    current_time_constant: 0.5e-3,
    heating: 0.6,
    thermal_time_constant: 300.0,
};

/// About 0.1 A without load, at speed. All estimates.
const GM6020_CURRENT: Constants = Constants {
    inertia: 0.8e-3,
    coulomb: 0.05,
    viscous: 1.0e-3,
    resistance: 1.8,
    current_time_constant: 0.5e-3,
    heating: 15.0,
    thermal_time_constant: 400.0,
};

/// The same motor with its winding's time constant: 5.7 mH over 1.8 Ω, estimates.
const GM6020_VOLTAGE: Constants = Constants { current_time_constant: 3.2e-3, ..GM6020_CURRENT };

impl Constants {
    pub(crate) const fn of(model: Model) -> Self {
        match model {
            Model::M2006 => M2006,
            Model::M3508 => M3508,
            Model::Gm6020Voltage => GM6020_VOLTAGE,
            Model::Gm6020Current => GM6020_CURRENT,
        }
    }

    /// Returns the back-EMF constant in V s/rad for the documented no-load speed at 24 V.
    pub(crate) const fn back_emf(&self, facts: &Facts) -> f32 {
        let no_load = facts.no_load_rpm * (core::f32::consts::TAU / 60.0);
        let friction = self.coulomb + self.viscous * no_load;
        (24.0 - self.resistance * friction / facts.torque_constant_nm_per_a) / no_load
    }
}
