use super::{
    CanDevice, Capabilities, Capability, Claim, Devices, Edge, Guard, Health, HealthConfig, Ingest,
    Malformed, MotorName, Role, TargetError, Timeouts, VelocityDrive, Visitor, Vitals, Watch,
};
use crate::control::TimeStep;
use crate::frame::CanFrame;
use crate::time::{Instant, Tick};
use crate::units::AngularVelocity;
use embedded_can::{Frame, Id};

/// Above this step integrals and derivatives rest: 20 periods of 1 kHz.
const LONGEST_STEP_S: f32 = 0.02;

/// What is special about a motor of your own: its ids, its frames and its loop.
///
/// [`Own`] makes a device of it, with everything that all motors have in common. The example `custom_motor` is a whole one.
pub trait OwnMotor {
    /// Returns how the motor is called in errors.
    fn name(&self) -> MotorName;

    /// Returns the id of its command frame.
    fn command_id(&self) -> Id;

    /// Returns the id of its feedback frame.
    fn feedback_id(&self) -> Id;

    /// Takes a data frame with its feedback id.
    ///
    /// # Errors
    /// Says why it is not its feedback; it must have changed nothing then.
    fn decode(&mut self, frame: &CanFrame) -> Result<(), Malformed>;

    /// Returns the measured velocity of the output shaft.
    fn velocity(&self) -> AngularVelocity;

    /// Runs the loop for one step and returns the data of the command frame. The target is finite, and the step is
    /// never on hold.
    fn control(&mut self, target: AngularVelocity, step: &TimeStep) -> [u8; 8];

    /// Brings the loop to rest: called before the motor is driven, and when it stops.
    fn reset(&mut self);

    /// Returns what the motor offers: velocities and feedback, unless said otherwise.
    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Velocity, Capability::Feedback])
    }

    /// Returns what else it knows of itself. Nothing unless said otherwise.
    fn vitals(&self) -> Vitals {
        Vitals::default()
    }

    /// Keeps its output within this share of its full command, 0 to 1, from now on: it is warm, or stalled. Without
    /// effect unless said otherwise; a motor that is too hot gets zero anyway.
    fn limit(&mut self, _share: f32) {}
}

/// A motor of your own as a device of the runner, beside all others.
///
/// Disarmed at start; late and lost feedback, an old target, one that is not finite, a bad time step and an emergency
/// stop give a command of eight zero bytes: [`Guard`] has the rules. The command goes out with every update.
///
/// # Examples
/// ```
/// use drivetrain::control::{Pid, PidConfig, TimeStep};
/// use drivetrain::motor::*;
/// use drivetrain::time::{Instant, Tick};
/// use drivetrain::units::AngularVelocity;
/// use drivetrain::frame::CanFrame;
/// use embedded_can::{Frame, Id, StandardId};
///
/// struct Mine { rpm: i16, speed: Pid }
///
/// impl OwnMotor for Mine {
///     fn name(&self) -> MotorName { MotorName::new("mine", 1) }
///     fn command_id(&self) -> Id { StandardId::new(0x123).unwrap_or(StandardId::ZERO).into() }
///     fn feedback_id(&self) -> Id { StandardId::new(0x124).unwrap_or(StandardId::ZERO).into() }
///     fn decode(&mut self, frame: &CanFrame) -> Result<(), Malformed> {
///         let [high, low] = *frame.data() else { return Err(Malformed::Length(frame.length())) };
///         self.rpm = i16::from_be_bytes([high, low]);
///         Ok(())
///     }
///     fn velocity(&self) -> AngularVelocity { AngularVelocity::from_rpm(self.rpm.into()) }
///     fn control(&mut self, target: AngularVelocity, step: &TimeStep) -> [u8; 8] {
///         let output = self.speed.step(target.as_rpm(), self.velocity().as_rpm(), step);
///         let [high, low] = (output as i16).to_be_bytes();
///         [high, low, 0, 0, 0, 0, 0, 0]
///     }
///     fn reset(&mut self) { self.speed.reset() }
/// }
///
/// let mut motor = Own::new(Mine { rpm: 0, speed: Pid::new(PidConfig::new(2.0, 0.0, 0.0))? });
/// let now = Instant::from_micros(1_000);
/// let feedback = CanFrame::new(motor.motor().feedback_id(), &[0, 50]).ok_or("length")?; // 50 rpm
/// assert_eq!(motor.ingest(&feedback, now), Ingest::Taken);
/// motor.arm(now)?;
/// motor.set_velocity((), AngularVelocity::from_rpm(150.0))?;
/// motor.update(Tick::new(now, 0.001));
/// let frame = motor.next_frame(0).ok_or("nothing to send")?;
/// assert_eq!(format!("{frame:?}"), "123 [8] 00 C8 00 00 00 00 00 00"); // 2 * (150 - 50)
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Own<M> {
    motor: M,
    guard: Guard,
    target: AngularVelocity,
    output: [u8; 8],
    resting: bool,
    /// An update without a step may send the output once more.
    may_hold: bool,
    waits: bool,
    superseded: u32,
    watch: Watch,
}

impl<M: OwnMotor> Own<M> {
    /// Takes the motor: disarmed.
    #[must_use]
    pub const fn new(motor: M) -> Self {
        Self {
            motor,
            guard: Guard::new(),
            target: AngularVelocity::ZERO,
            output: [0; 8],
            resting: true,
            may_hold: false,
            waits: false,
            superseded: 0,
            watch: Watch::new(),
        }
    }

    /// Sets what is looked for and what follows, as far as the motor's [`vitals`](OwnMotor::vitals) tell.
    ///
    /// # Errors
    /// Names the parameter that makes no sense.
    pub fn with_health(self, config: &'static HealthConfig) -> Result<Self, &'static str> {
        let watch = self.watch.with_config(config)?;
        Ok(Self { watch, ..self })
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

    /// Returns the motor.
    #[must_use]
    pub const fn motor(&self) -> &M {
        &self.motor
    }

    /// Returns what decides whether it may be driven.
    #[must_use]
    pub const fn guard(&self) -> &Guard {
        &self.guard
    }

    /// Looks after the motor: it may be relaxed for what is found, or left with less.
    fn look(&mut self, now: Instant) {
        let share = self.watch.look(&mut self.guard, &self.motor.vitals(), now);
        self.motor.limit(share);
        if share <= 0.0 {
            self.guard.relax();
        }
    }

    /// Returns the command that this step asks for.
    fn command(&mut self, tick: Tick) -> [u8; 8] {
        let drives = self.guard.drives(tick.now());
        let step = TimeStep::new(tick.dt_s(), LONGEST_STEP_S);
        if !drives {
            // A late motor keeps its integral, one without a target starts afresh.
            if !self.guard.has_target() {
                self.rest();
            }
            return [0; 8];
        }
        if step.is_hold() {
            return if core::mem::take(&mut self.may_hold) { self.output } else { [0; 8] };
        }
        self.may_hold = true;
        self.resting = false;
        self.motor.control(self.target, &step)
    }

    fn rest(&mut self) {
        if !self.resting {
            self.motor.reset();
            self.resting = true;
        }
    }

    fn stop(&mut self) {
        self.rest();
        self.offer([0; 8]);
    }

    fn offer(&mut self, output: [u8; 8]) {
        self.output = output;
        self.superseded = self.superseded.wrapping_add(u32::from(self.waits));
        self.waits = true;
    }
}

impl<M: OwnMotor> CanDevice for Own<M> {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        if frame.id() != self.motor.feedback_id() || frame.is_remote_frame() {
            if frame.id() == self.motor.command_id() && frame.is_data_frame() {
                self.watch.hear_rival(now);
            }
            return Ingest::Unrelated;
        }
        match self.motor.decode(frame) {
            Ok(()) => {
                self.watch.hear(now);
                self.guard.hear(now);
                Ingest::Taken
            }
            Err(why) => Ingest::Malformed(why),
        }
    }

    fn update(&mut self, tick: Tick) {
        self.look(tick.now());
        let output = self.command(tick);
        self.offer(output);
    }

    fn next_frame(&mut self) -> Option<CanFrame> {
        if !core::mem::take(&mut self.waits) {
            return None;
        }
        CanFrame::new(self.motor.command_id(), &self.output)
    }

    /// Each update offers the newest command anyway.
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        frame.id() == self.motor.command_id() && !frame.is_remote_frame()
    }

    fn superseded(&self) -> u32 {
        self.superseded
    }

    fn claims(&self) -> impl Iterator<Item = Claim> {
        let name = self.motor.name();
        [
            Claim::new(self.motor.feedback_id(), Role::Feedback, name),
            Claim::new(self.motor.command_id(), Role::Command, name),
        ]
        .into_iter()
    }

    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.guard.is_missing(now).then(|| self.motor.name()).into_iter()
    }

    fn faulty(&self) -> impl Iterator<Item = MotorName> {
        self.watch.is_faulty(&self.guard).then(|| self.motor.name()).into_iter()
    }

    fn second_master(&self) -> Option<Claim> {
        let claim = || Claim::new(self.motor.command_id(), Role::Command, self.motor.name());
        self.watch.has_rival().then(claim)
    }

    fn next_edge(&mut self) -> Option<Edge> {
        self.guard.next_edge(self.motor.name())
    }

    fn engage(&mut self, now: Instant) {
        if !self.watch.is_faulty(&self.guard) && self.guard.engage(now) {
            self.watch.start(&mut self.guard, now);
            self.rest();
        }
    }

    fn ask(&mut self, now: Instant) -> bool {
        self.guard.ask(now)
    }

    fn disarm(&mut self) {
        self.guard.disarm();
        self.stop();
    }

    fn trip(&mut self) {
        self.guard.trip();
        self.stop();
    }

    fn is_armed(&self) -> bool {
        self.guard.is_armed()
    }

    fn emergency_stop(&mut self) {
        self.guard.emergency_stop();
        self.stop();
    }

    fn clear_emergency_stop(&mut self) {
        self.guard.clear_emergency_stop();
    }

    fn is_stopped(&self) -> bool {
        self.guard.is_stopped()
    }
}

/// There is one motor, so its handle is `()`.
impl<M: OwnMotor> Devices for Own<M> {
    #[inline]
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }
}

impl<M: OwnMotor> VelocityDrive<()> for Own<M> {
    fn velocity(&self, (): ()) -> Option<AngularVelocity> {
        (self.guard.link() == super::Link::Online).then(|| self.motor.velocity())
    }

    fn capabilities(&self, (): ()) -> Capabilities {
        self.motor.capabilities()
    }

    fn set_velocity(&mut self, (): (), target: AngularVelocity) -> Result<(), TargetError> {
        // Where there was no target, the output is of one before.
        self.may_hold &= self.guard.has_target();
        self.guard.admit(target.as_rad_per_s().is_finite())?;
        self.target = target;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::Malformed;
    use embedded_can::StandardId;

    /// Sends its target in rad/s.
    struct Plain;

    impl OwnMotor for Plain {
        fn name(&self) -> MotorName {
            MotorName::new("plain", 1)
        }
        fn command_id(&self) -> Id {
            StandardId::MAX.into()
        }
        fn feedback_id(&self) -> Id {
            StandardId::ZERO.into()
        }
        fn decode(&mut self, _: &CanFrame) -> Result<(), Malformed> {
            Ok(())
        }
        fn velocity(&self) -> AngularVelocity {
            AngularVelocity::ZERO
        }
        fn control(&mut self, target: AngularVelocity, _: &TimeStep) -> [u8; 8] {
            let [a, b, c, d] = target.as_rad_per_s().to_le_bytes();
            [a, b, c, d, 0, 0, 0, 0]
        }
        fn reset(&mut self) {}
    }

    /// What is held for an update without a step is the output of the target in force, not one from before a rest.
    #[test]
    fn an_update_without_a_step_holds_no_output_from_before_a_rest() {
        let at_ms = |ms: u64| Instant::from_micros(ms * 1_000);
        let rad_per_s = AngularVelocity::from_rad_per_s;
        let resting: [fn(&mut Own<Plain>); 2] = [
            |motor| CanDevice::disarm(motor),
            |motor| {
                let nowhere = AngularVelocity::from_rad_per_s(f32::NAN);
                assert_eq!(motor.set_velocity((), nowhere), Err(TargetError::NotFinite));
            },
        ];
        for rest in resting {
            let mut motor = Own::new(Plain);
            let feedback = CanFrame::new(StandardId::ZERO, &[]).unwrap();
            assert_eq!(Devices::ingest(&mut motor, &feedback, at_ms(1)), Ingest::Taken);
            motor.arm(at_ms(1)).unwrap();
            motor.set_velocity((), rad_per_s(200.0)).unwrap();
            let sent = |motor: &mut Own<Plain>, ms: u64, dt_s| {
                Devices::update(motor, Tick::new(at_ms(ms), dt_s));
                let [a, b, c, d, ..] = *Devices::next_frame(motor, 0).unwrap().bytes();
                [a, b, c, d]
            };
            assert_eq!(sent(&mut motor, 2, 0.001), 200.0_f32.to_le_bytes());
            rest(&mut motor);
            CanDevice::engage(&mut motor, at_ms(2));
            let driven = 1.0_f32.to_le_bytes();
            motor.set_velocity((), rad_per_s(1.0)).unwrap();
            assert_eq!([3, 4].map(|ms| sent(&mut motor, ms, 0.0)), [[0; 4]; 2]);
            assert_eq!(sent(&mut motor, 5, 0.001), driven);
            assert_eq!([6, 7].map(|ms| sent(&mut motor, ms, 0.0)), [driven, [0; 4]], "once");
        }
    }
}
