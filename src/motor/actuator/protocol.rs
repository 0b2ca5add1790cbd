//! The protocol of a drive: its ids, its frames and its loop.

use crate::control::PidConfig;
use crate::error::ConfigError;
use crate::frame::CanFrame;
use crate::motor::{Capabilities, Capability, Claim, Ingest, MotorName, Vitals, WrongSetting};
use crate::time::TimeStep;
use crate::units::{Angle, AngularVelocity};
use crate::wire::mit::Ranges;
use crate::wire::mit::impedance::Impedance;

/// The protocol of a motor with its drive: ids, frames and loop. Each family has one; write one for a motor of your own.
///
/// [`Actuator`](super::Actuator) makes a device of the motor, with everything in common to all motors. The example `custom_motor` is a
/// whole motor. The family [`damiao`](crate::damiao) has drives to be enabled and asked for settings first.
///
/// # Examples
/// ```
/// use drivetrain::control::{Pid, PidConfig};
/// use drivetrain::frame::CanFrame;
/// use drivetrain::motor::{
///     Claim, Devices, Ingest, MotorName, Order, Actuator, DriveProtocol, Target, VelocityDrive,
/// };
/// use drivetrain::time::{Duration, Instant, Tick};
/// use drivetrain::units::AngularVelocity;
/// use embedded_can::{Frame, Id, StandardId};
///
/// struct Mine { rpm: i16, speed: Pid }
///
/// fn id(raw: u16) -> Id { StandardId::new(raw).unwrap_or(StandardId::ZERO).into() }
///
/// impl DriveProtocol for Mine {
///     fn name(&self) -> MotorName { MotorName::new("mine", 1) }
///     fn claims(&self) -> impl IntoIterator<Item = Claim> {
///         [Claim::command(id(0x123), self.name()), Claim::feedback(id(0x124), self.name())]
///     }
///     fn decode(&mut self, frame: &CanFrame) -> Ingest {
///         let [high, low] = *frame.data() else {
///             return Ingest::WrongLength(frame.length());
///         };
///         self.rpm = i16::from_be_bytes([high, low]);
///         Ingest::Taken
///     }
///     fn velocity(&self) -> AngularVelocity { AngularVelocity::from_rpm(self.rpm.into()) }
///     fn rest(&mut self) -> CanFrame { CanFrame::of(id(0x123), [0, 0]) }
///     fn control(&mut self, order: Order) -> CanFrame {
///         let Order { target: Target::Velocity(target), share, step } = order else {
///             return self.rest();
///         };
///         let output = self.speed.step(target.as_rpm(), self.velocity().as_rpm(), &step);
///         let limit = 1_000.0 * share;
///         CanFrame::of(id(0x123), (output.clamp(-limit, limit) as i16).to_be_bytes())
///     }
///     fn reset(&mut self) { self.speed.reset() }
/// }
///
/// let mine = Mine { rpm: 0, speed: Pid::new(PidConfig::new(2.0, 0.0, 0.0))? };
/// let mut motor = Actuator::new(mine).with_opening(Duration::ZERO); // all of the output at once
/// let now = Instant::from_micros(1_000);
/// let feedback = CanFrame::of(id(0x124), [0, 50]); // 50 rpm
/// assert_eq!(motor.ingest(&feedback, now), Ingest::Taken);
/// motor.arm(now)?;
/// motor.set_velocity((), AngularVelocity::from_rpm(150.0))?;
/// motor.update(Tick::new(now, 0.001));
/// let frame = motor.next_frame(0).ok_or("nothing to send")?;
/// assert_eq!(format!("{frame:?}"), "123 [2] 00 C8"); // 2 * (150 - 50)
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait DriveProtocol {
    /// Returns how the motor is called in errors.
    fn name(&self) -> MotorName;

    /// Lists the CAN ids of the motor's commands and of its feedback: any number of each. The first feedback is found fastest.
    ///
    /// An id with the feedback of several motors is [shared](Claim::shared), and [`decode`](Self::decode) tells them apart.
    fn claims(&self) -> impl IntoIterator<Item = Claim>;

    /// Takes a data frame with an id of the motor's feedback.
    ///
    /// Returns [`Ingest::Unrelated`] if the frame is another motor's or no feedback: other devices are asked then. Returns
    /// [`Ingest::WrongLength`] or [`Ingest::WrongField`] if the frame is this motor's and damaged. In both cases the call must change nothing.
    fn decode(&mut self, frame: &CanFrame) -> Ingest;

    /// Returns the measured velocity of the output shaft.
    fn velocity(&self) -> AngularVelocity;

    /// Returns the measured angle of the output shaft; `None` if unknown, the default.
    fn angle(&self) -> Option<Angle> {
        None
    }

    /// Returns the frame of rest: no torque, for any motion of the shaft.
    ///
    /// Each update without a command sends this frame. The manual of the drive names the frame: eight zero bytes
    /// are the full negative torque of a drive in MIT mode, and a velocity of zero is a brake. A drive without such a command
    /// rests when disabled: return the disabling frame here, and `None` from [`disable`](Self::disable).
    ///
    /// A remote frame, a question for feedback, may take its turn between frames of rest. If no rest was sent before,
    /// [`Actuator`](super::Actuator) leaves the question out and calls this again.
    fn rest(&mut self) -> CanFrame;

    /// Runs the loop for one step and returns the command: a data frame of up to 8 bytes with an id of its commands.
    ///
    /// If the motor does not offer the kind of order, return [`rest`](Self::rest).
    fn control(&mut self, order: Order) -> CanFrame;

    /// Brings the loop to rest: called before the motor is driven, and on a stop.
    fn reset(&mut self);

    /// Changes the loops that this crate runs, from rad to rad/s and from rad/s to Nm, also while the motor is driven: see
    /// [`Actuator::set_loops`](super::Actuator::set_loops).
    ///
    /// # Errors
    /// Names the parameter without a sensible value; [`ConfigError::Unsupported`], unless said otherwise, for a motor without such loops.
    /// Nothing is changed then.
    fn set_loops(&mut self, position: PidConfig, speed: PidConfig) -> Result<(), ConfigError> {
        _ = (position, speed);
        Err(ConfigError::Unsupported("loops"))
    }

    /// Returns the next frame to enable the drive; `None`, the default, for a drive without such frames.
    ///
    /// [`Actuator`](super::Actuator) calls this when the motor may be driven and was not before. If [`is_enabled`](Self::is_enabled)
    /// reports, the call is repeated each 10 ms until the drive is enabled. Until then the drive gets [`rest`](Self::rest)
    /// only, or [`poll`](Self::poll) if `rest` would disable the drive. The output [opens](Order::share) from zero afterwards.
    ///
    /// `sent` is how many of these frames were sent since the drive was to be disabled, up to 255. If a drive needs several frames,
    /// return the frame next in order. If a drive goes on to its last target when enabled, replace that target first. If a drive
    /// resets while driven, the motor trips and the drive is not enabled again.
    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        _ = sent;
        None
    }

    /// Returns the next frame to disable the drive; `None`, the default, for a drive without such frames, or if
    /// [`rest`](Self::rest) disables.
    ///
    /// [`Actuator`](super::Actuator) calls this at the start, on disarm, trip and emergency stop, and when the motor has no target. The
    /// call is repeated each 100 ms, or each 10 ms while the drive reports the state "enabled".
    fn disable(&mut self) -> Option<CanFrame> {
        None
    }

    /// Returns a frame that asks the drive for its feedback and changes nothing; `None`, the default, for a drive that
    /// reports by itself. A remote frame has an id of the motor's feedback.
    fn poll(&mut self) -> Option<CanFrame> {
        None
    }

    /// Takes back a frame of this motor: refused or given back by the driver, or replaced by a newer frame. Nothing
    /// is done unless said otherwise.
    ///
    /// [`Actuator`](super::Actuator) calls this before asking for the next frame of the same kind. Commands and frames of rest come again
    /// anyway; a motor with frames only now and then, or frames in an order, takes the turn back here.
    fn unsent(&mut self, frame: &CanFrame) {
        _ = frame;
    }

    /// Returns whether the drive is enabled, by its last feedback; `None`, the default, for a drive without this report.
    fn is_enabled(&self) -> Option<bool> {
        None
    }

    /// Returns the next frame to read or write a setting of the drive; `None`, the default, for a
    /// drive without settings.
    ///
    /// [`Actuator`](super::Actuator) calls this each 10 ms while the drive is disabled, in the place of a frame of [rest](Self::rest) between
    /// two others, so a setting is read before each arming of the motor. The answer comes to [`decode_answer`](Self::decode_answer).
    fn inquire(&mut self) -> Option<CanFrame> {
        None
    }

    /// Takes the answer to an [inquiry](Self::inquire), a frame with an id of the motor's feedback; `false`, unless said
    /// otherwise, for any other frame. An answer tells nothing of the shaft and does not count as feedback.
    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        _ = frame;
        false
    }

    /// Returns a setting of the drive with another value than expected, or not known yet: the motor is not armed then.
    /// `None` unless said otherwise.
    fn wrong_setting(&self) -> Option<WrongSetting> {
        None
    }

    /// Forgets the settings of the drive: its feedback is late or lost, or the drive has reset, so the drive may have lost its supply
    /// or be another drive.
    fn forget_settings(&mut self) {}

    /// Returns the number of frames to the drive for one answer, for the largest [load](super::Actuator::load) of the bus: 0, the default, if
    /// the drive sends its feedback by itself; 1 if the drive answers each frame; 2 if the drive answers questions alone, since a
    /// question stands between two other frames.
    ///
    /// With 1, more feedback than one and a quarter times the frames comes from two drives with one id: such a motor is not armed, nor is any
    /// before 64 frames were answered by one drive.
    fn frames_per_answer(&self) -> u32 {
        0
    }

    /// Returns the capabilities of the motor: velocities and feedback, unless said otherwise.
    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Velocity, Capability::Feedback])
    }

    /// Returns temperature, errors and efforts as far as known. Nothing unless said otherwise.
    fn vitals(&self) -> Vitals {
        Vitals::default()
    }
}

/// A target of the output shaft. The target is finite, and of a kind among the motor's capabilities.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Target {
    /// A torque in Nm; positive is counter-clockwise.
    Torque(f32),
    /// A velocity.
    Velocity(AngularVelocity),
    /// An angle, by the shortest way; the number of turns does not matter.
    Angle(Angle),
    /// A spring and a damper.
    Impedance(Impedance),
}

impl Target {
    /// The same target where the angles are so much larger.
    pub(super) fn moved(self, way: Angle) -> Self {
        match self {
            Self::Angle(angle) => Self::Angle(angle + way),
            Self::Impedance(impedance) => {
                Self::Impedance(Impedance { angle: impedance.angle + way, ..impedance })
            }
            Self::Torque(_) | Self::Velocity(_) => self,
        }
    }
}

/// A target with its limits, for one step: see [`DriveProtocol::control`](super::DriveProtocol::control).
///
/// Destructure it, `let Order { target, share, step } = order;`: the compiler then warns if a field is not used.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Order {
    /// The target. While the output range opens, the angle of a position or of a spring moves from the measured angle to the
    /// requested one.
    pub target: Target,
    /// The share of the full output that is allowed, 0 to 1: the share rises from 0 after arming, and falls while the motor is warm
    /// or stalled. Keep the command within this share of its range, or multiply the gains of the drive by the share.
    pub share: f32,
    /// The time since the step before. Never on hold.
    pub step: TimeStep,
}

impl Impedance {
    /// Returns the largest value of each field of a frame.
    pub(crate) const fn most(ranges: &Ranges) -> Self {
        Self::of(ranges, 1.0, 1.0, 1.0)
    }

    /// Returns the value of a count of each field, for fields up to `top`; the field of the angle goes to 65535.
    pub(crate) const fn count(ranges: &Ranges, top: u16) -> Self {
        let top = top as f32;
        Self::of(ranges, 2.0 / 65_535.0, 2.0 / top, 1.0 / top)
    }

    const fn of(ranges: &Ranges, angle: f32, signed: f32, gain: f32) -> Self {
        let (stiffness, damping) = ranges.gains();
        Self {
            angle: Angle::from_radians(ranges.position_rad() * angle),
            velocity: AngularVelocity::from_rad_per_s(ranges.velocity_rad_per_s() * signed),
            stiffness: stiffness * gain,
            damping: damping * gain,
            torque_nm: ranges.torque_nm() * signed,
        }
    }
}

/// Takes feedback of exactly 8 bytes. If `take` returns `None`, a field has an impossible value, and nothing has changed.
pub(crate) fn ingest_eight(frame: &CanFrame, take: impl FnOnce(&[u8; 8]) -> Option<()>) -> Ingest {
    if frame.length() != 8 {
        return Ingest::WrongLength(frame.length());
    }
    take(frame.bytes()).map_or(Ingest::WrongField, |()| Ingest::Taken)
}
