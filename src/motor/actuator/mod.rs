//! An actuator: one motor with its drive, as a device.

mod device;
mod impedance;
mod joint;
mod mode;
mod power;
mod protocol;
mod registers;
mod settings;
mod update;

pub use crate::wire::mit::impedance::Impedance;
pub use impedance::ImpedanceControl;
pub(crate) use impedance::{Shaft, TorqueLoops};
pub use protocol::{DriveProtocol, Order, Target};

pub(crate) use mode::{ControlMode, Goal, Questions, Told, inside};
pub(crate) use protocol::ingest_eight;
pub(crate) use registers::{
    Form, code_from, lowest_bit, mit_model, models, register_questions, registers,
};
pub(crate) use settings::{Inquiry, Preparation, Settings, TimeoutUnits};

use super::{
    BusLoad, Capability, Claim, Condition, Guard, Health, HealthConfig, Link, Route, TargetError,
    Timeouts, Watch,
};
use crate::control::PidConfig;
use crate::error::{ConfigError, finite};
use crate::frame::CanFrame;
use crate::time::{Duration, Instant};
use crate::units::Angle;
use core::f32::consts::TAU;
use joint::{Inside, Joint, Start, Zero};
use power::Power;

/// The most frames a second for the power of a drive, each beside a command or rest.
const POWER_HZ: u32 = 100;
/// The time between two questions for a setting.
const INQUIRY: Duration = Duration::from_millis(10);

/// One motor with its drive as a device of the runner, beside all others: of a family of this crate, or of your own.
///
/// Disarmed at start. Late and lost feedback, an old target, a target that is not finite, a second bad time step, a clock that
/// does not move on and an emergency stop send the [frame of rest](DriveProtocol::rest) in the same cycle: [`Guard`] has the rules.
/// Each update offers a command or the frame of rest. If the drive is to be enabled or disabled, the frame for that comes first.
/// [`DriveProtocol`] has an example.
#[derive(Debug, Clone, Copy)]
// In the order of use, so that one tick reads neighbours.
#[repr(C)]
pub struct Actuator<M> {
    guard: Guard,
    power: Power,
    /// The last update drove the motor, and as long as its rules have nothing to change, the next one is to do the same.
    is_steady: bool,
    is_resting: bool,
    /// The share of the output that is left.
    share: f32,
    /// In the direction of the drive, as all below.
    target: Target,
    /// The kind of the target, among the capabilities of the motor when it was set.
    kind: Capability,
    offered: Offered,
    /// The last frame taken, but for the drive's power.
    last: Option<CanFrame>,
    /// A frame for the drive's power, waiting to be sent before the other.
    switching: Option<CanFrame>,
    route: Route,
    motor: M,
    joint: Joint,
    watch: Watch,
    /// The target as far as an update with a decision tells the drive: reduced while the output range opens, and at a soft limit.
    goal: Target,
    start: Start,
    /// This update offers a frame for the drive's power.
    has_posted: bool,
    was_online: bool,
    /// The time of the last question.
    inquired: Instant,
    /// The last frame for the drive's power, sent or not.
    switched: Option<CanFrame>,
    /// How many frames were sent to enable the drive since the order to disable the drive.
    enabling: u8,
    /// The drive has no frame of its own for disabling.
    rest_disables: bool,
    superseded: u32,
    /// The last command of another node.
    rival: Option<Claim>,
}

impl<M: DriveProtocol> Actuator<M> {
    /// Takes the motor: disarmed.
    #[must_use]
    pub const fn new(motor: M) -> Self {
        Self {
            motor,
            joint: Joint::DIRECT,
            route: Route::UNKNOWN,
            guard: Guard::new(),
            watch: Watch::new(),
            power: Power::NEW,
            target: Target::Torque(0.0),
            kind: Capability::Torque,
            goal: Target::Torque(0.0),
            share: 0.0,
            start: Start::NONE,
            is_steady: false,
            is_resting: true,
            offered: Offered::NOTHING,
            last: None,
            switching: None,
            has_posted: false,
            was_online: false,
            inquired: Instant::START,
            switched: None,
            enabling: 0,
            rest_disables: false,
            superseded: 0,
            rival: None,
        }
    }

    /// Sets the checks of health and their reactions, as far as the motor's [`vitals`](DriveProtocol::vitals) tell.
    ///
    /// # Errors
    /// Names the parameter without a sensible value. Soft limits of a turn and more need a [zero](Self::with_zero) before, for a drive with
    /// [`Capability::AbsoluteAngle`]: such a drive may report another turn than that of the joint.
    pub fn with_health(mut self, config: &'static HealthConfig) -> Result<Self, &'static str> {
        self.is_steady = false;
        self.watch = self.watch.with_config(config)?;
        self.start.lead = None;
        if self.is_absolute() && self.joint.has_zero_of_drive() {
            match config.soft_limits {
                Some((lower, upper)) if upper - lower >= TAU => {
                    return Err("soft limits of a turn and more, without a zero");
                }
                Some(_) => self.joint.zero = Zero::Given(Angle::ZERO),
                None => {}
            }
        }
        Ok(self)
    }

    /// Returns how the motor is.
    #[must_use]
    pub fn health(&self) -> Health {
        self.watch.health(self.motor.name(), &self.guard, &self.motor.vitals())
    }

    /// Sets when feedback and commands count as lost.
    #[must_use]
    pub fn with_timeouts(self, timeouts: Timeouts) -> Self {
        Self { guard: self.guard.with_timeouts(timeouts), ..self }
    }

    /// Sets the time in which the [share](Order::share) of the output rises from 0 to 1 after arming, and after each rest without a target;
    /// 0.2 s at first. With targets slower than the deadline, or feedback slower than *late*, the share stays near 0.
    #[must_use]
    pub fn with_opening(self, time: Duration) -> Self {
        Self { guard: self.guard.with_opening(time), ..self }
    }

    /// Turns the positive direction round, of targets and of measurements: for a wheel or a joint on the other side of a robot.
    #[must_use]
    pub fn reversed(mut self) -> Self {
        self.joint.sign = -self.joint.sign;
        self.start.lead = None;
        self
    }

    /// Takes the angle of the drive at which the joint is at zero, by a calibration. No drive keeps its turns without supply: the joint is
    /// within half a turn of its zero, or of the middle of its soft limits, when it is heard first, and turns by less than half a turn while its drive has no supply.
    ///
    /// The zero is lost, as told for [`set_present_angle`](Self::set_present_angle), if the angle jumps by no whole turn without a silence: an
    /// encoder slipped, a tool or the program set the zero of the drive, or another drive answers.
    ///
    /// # Errors
    /// [`ConfigError::NotFinite`]; [`ConfigError::Unsupported`] for a drive without [`Capability::AbsoluteAngle`].
    pub fn with_zero(mut self, angle: Angle) -> Result<Self, ConfigError> {
        finite("zero", angle.as_radians())?;
        ConfigError::check_support(self.is_absolute(), "zero")?;
        self.joint.zero = Zero::Given(angle);
        self.is_steady = false;
        Ok(self)
    }

    /// Makes the present angle of the joint so much; the shaft follows its target as before, unless the angle is beyond a soft limit: the joint
    /// then moves back as after arming.
    ///
    /// A drive without [`Capability::AbsoluteAngle`] counts from another angle when it has lost its supply. Its zero is lost after a silence of
    /// 100 ms, and when an angle is further away than the shaft can have turned since the feedback before. A shorter silence
    /// counts if the motor is offline in it, and a longer silence does not count if feedback is not late in it. A drive with [`Capability::AbsoluteAngle`]
    /// loses its zero by an angle alone that jumps by no whole turn without such a silence.
    ///
    /// Without its zero, the motor trips, the joint has no angle, and targets with an angle are refused as [`TargetError::NotHomed`], until
    /// this is called again. A joint that was never given a zero counts as its drive, and has none to lose.
    ///
    /// # Errors
    /// [`TargetError::NoFeedback`] without fresh feedback with an angle, [`TargetError::NotFinite`] for an angle beyond 10 000 rad.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::damiao::{Model, Motor};
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::motor::{AngleDrive, CanDevice, ImpedanceControl, Ingest, Actuator};
    /// use drivetrain::time::Instant;
    /// use drivetrain::units::Angle;
    ///
    /// let mut knee = Actuator::new(Motor::new(Model::J4310, 1, ImpedanceControl::new(3.0)?)?).reversed();
    /// let feedback = [0x11, 0x94, 0x7A, 0x7F, 0xF7, 0xFF, 30, 35]; // 2 rad of 12.5
    /// let feedback = CanFrame::standard(0x011, feedback).ok_or("id")?;
    /// assert_eq!(knee.ingest(&feedback, Instant::from_micros(1_000)), Ingest::Taken);
    /// assert!((knee.angle(()).ok_or("no angle")?.as_radians() + 2.0).abs() < 1e-3);
    /// knee.set_present_angle(Angle::from_radians(0.5))?;
    /// assert!((knee.angle(()).ok_or("no angle")?.as_radians() - 0.5).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_present_angle(&mut self, angle: Angle) -> Result<(), TargetError> {
        let measured = self.measured_angle().ok_or(TargetError::NoFeedback)?;
        if angle.as_radians().abs() > 1e4 || !angle.is_finite() {
            return Err(TargetError::NotFinite);
        }
        let zero = measured - angle * self.joint.sign;
        self.joint.zero = if self.is_absolute() { Zero::Placed(zero) } else { Zero::Found(zero) };
        // From now on each frame is compared with the one before.
        self.guard.trust(0);
        self.guard.note(Condition::PositionUncertain, false, self.guard.device.updated());
        self.start.lead = None;
        if self.shaft().1.is_some_and(|inside| inside.is_outside()) {
            self.reopen();
        }
        Ok(())
    }

    /// Forgets the zero of the joint and its target, to look for the zero again. Until [`set_present_angle`](Self::set_present_angle), the joint has no angle, takes
    /// no angle as a target, and has no soft limits.
    pub const fn forget_zero(&mut self) {
        self.joint.forget_zero();
        self.guard.relax();
    }

    /// Changes the motor's loops of this crate, from rad to rad/s and from rad/s to Nm, also while the motor is driven: each goes on as
    /// after [`Pid::set_gains`](crate::control::Pid::set_gains), so a larger gain of the position asks for more velocity at once.
    ///
    /// # Errors
    /// As [`DriveProtocol::set_loops`].
    pub fn set_loops(&mut self, position: PidConfig, speed: PidConfig) -> Result<(), ConfigError> {
        self.motor.set_loops(position, speed)
    }

    /// Returns the motor, whose values are in the direction and from the zero of the drive.
    #[must_use]
    pub const fn motor(&self) -> &M {
        &self.motor
    }

    /// Returns the motor, to ask for a setting of its drive, say. Frames to be sent are unchanged until the next update.
    #[must_use]
    pub const fn motor_mut(&mut self) -> &mut M {
        self.route = Route::UNKNOWN;
        self.is_steady = false;
        &mut self.motor
    }

    /// Returns the guard, which decides whether the motor may be driven.
    #[must_use]
    pub const fn guard(&self) -> &Guard {
        &self.guard
    }

    /// Returns the largest load of a bus by this motor, for a bit rate in bits a second and a number of updates a second.
    ///
    /// Counts a frame with each update, one more each 10 ms for the power of the drive, and the answers to both. Questions take the
    /// place of commands or of rest, so polled feedback costs nothing more. A drive may send further frames by itself, at rates that are
    /// set in the drive: [add them](BusLoad::with_frames).
    ///
    /// # Examples
    /// Four drives with answers do not fit a bus of 1 Mbit/s at 1 kHz, and do at 500 Hz:
    /// ```
    /// use drivetrain::damiao::{Model, Motor};
    /// use drivetrain::motor::{BusLoad, ImpedanceControl, Actuator};
    ///
    /// let joint = |id| Motor::new(Model::J4310, id, ImpedanceControl::new(3.0)?).map(Actuator::new);
    /// let joints = [joint(1)?, joint(2)?, joint(3)?, joint(4)?];
    /// let load = |hz| joints.iter().fold(BusLoad::new(1_000_000), |sum, joint| sum.and(&joint.load(1_000_000, hz)));
    /// assert_eq!(load(1_000).to_string(), "98 % to 119 %");
    /// assert_eq!(load(500).to_string(), "54 % to 65 %");
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    #[must_use]
    pub fn load(&self, bit_rate: u32, updates_hz: u32) -> BusLoad {
        let sent_hz = updates_hz.saturating_add(updates_hz.min(POWER_HZ));
        let answered_hz = sent_hz.checked_div(self.motor.frames_per_answer()).unwrap_or(0);
        let mut load = BusLoad::new(bit_rate);
        for (is_feedback, hz) in [(false, sent_hz), (true, answered_hz)] {
            let mut claims = self.motor.claims().into_iter();
            if let Some(claim) = claims.find(|claim| claim.is_feedback() == is_feedback) {
                load = load.with_each(&CanFrame::of(claim.id(), [0; 8]), hz);
            }
        }
        load
    }

    fn is_absolute(&self) -> bool {
        self.motor.capabilities().has(Capability::AbsoluteAngle)
    }

    fn measured_angle(&self) -> Option<Angle> {
        self.motor.angle().filter(|_| self.is_online())
    }

    fn is_online(&self) -> bool {
        self.guard.link() == Link::Online
    }

    fn shaft(&self) -> (Shaft, Option<Inside>) {
        let shaft = (self.motor.angle(), self.motor.velocity());
        let limits = self.watch.soft_limits();
        (shaft, limits.and_then(|limits| self.joint.inside(limits, shaft)))
    }

    #[inline]
    fn place_zero(&mut self) {
        if !self.joint.awaits_zero() {
            return;
        }
        let (lower, upper) = self.watch.soft_limits().unwrap_or((0.0, 0.0));
        let middle = Angle::from_radians(0.5 * (lower + upper));
        self.joint.place_zero(self.measured_angle(), middle);
        // From now on each frame is compared with the one before.
        self.guard.trust(0);
    }

    /// Offers a frame for the drive's power.
    const fn post(&mut self, frame: Option<CanFrame>) {
        (self.switched, self.switching) = (frame, frame);
        self.has_posted = frame.is_some();
        self.offered.may_wait = true;
    }

    fn offer(&mut self, command: Option<CanFrame>) {
        self.withdraw();
        let (frame, waits) = (command.or(self.offered.frame), command.is_some());
        self.offered = Offered { frame, waits, may_wait: true, ..Offered::NOTHING };
    }

    /// Takes back a frame still waiting for the bus.
    fn withdraw(&mut self) {
        if let (true, Some(frame)) = (core::mem::take(&mut self.offered.waits), self.offered.frame)
        {
            self.leave_out(&frame);
        }
    }

    fn withdraw_switching(&mut self) {
        if let Some(frame) = self.switching.take() {
            self.leave_out(&frame);
        }
    }

    fn leave_out(&mut self, frame: &CanFrame) {
        self.superseded = self.superseded.wrapping_add(1);
        self.motor.unsent(frame);
    }

    /// The drive did not follow before: its output opens from zero, and its angle starts from where the shaft is.
    fn reopen(&mut self) {
        self.guard.reopen();
        self.is_steady = false;
        self.start = Start::NONE;
    }
}

/// The frame of the last update: a command, rest, or a frame in the place of either.
#[derive(Debug, Clone, Copy)]
struct Offered {
    /// `None` before the first.
    frame: Option<CanFrame>,
    /// The frame is still to be taken.
    waits: bool,
    /// This frame may wait, or one for the drive's power.
    may_wait: bool,
    /// Rest, not given back by the driver.
    is_rest: bool,
}

impl Offered {
    const NOTHING: Self = Self { frame: None, waits: false, may_wait: false, is_rest: false };
}
