//! The devices that are held to the reference.

use super::custom_motor::MyMotor;
use super::reference::{BadStep, Rules};
use drivetrain::damiao::{Mode, Model, Motor};
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::encoder::{GearRatio, Position};
use drivetrain::frame::CanFrame;
use drivetrain::lk;
use drivetrain::motor::{
    AngleDrive, ArmError, Condition, Devices, HealthConfig, ImpedanceControl, Link, Own, OwnMotor,
    Reaction, TargetError, VelocityDrive,
};
use drivetrain::rmd;
use drivetrain::robstride;
use drivetrain::sim::{DamiaoDrive, LkDrive, RmdDrive, RobStrideDrive};
use drivetrain::snake::{self, Command, Joint, Joints, Register, Reply};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity, Current};
use drivetrain::vesc;
use embedded_can::Frame;

/// A device of `N` motors that all hear, and are set, together.
pub(super) trait Subject<const N: usize> {
    const RULES: [Rules; N];

    fn hear(&mut self, now: Instant);
    fn link(&self) -> [Link; N];
    fn arm(&mut self, now: Instant) -> Result<(), ArmError>;
    fn is_armed(&self) -> [bool; N];
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; N];
    /// Tells for which motors there is such a call.
    fn relax(&mut self) -> [bool; N];
    fn disarm(&mut self);
    fn stop(&mut self);
    fn clear_stop(&mut self);
    /// Runs an update and takes every frame; tells which motor is driven by one of them, or by an output.
    fn drives(&mut self, tick: Tick) -> [bool; N];
}

const BUS: Rules = Rules {
    late_us: Some(10_000),
    resumes: false,
    bad_step: BadStep::Repeats,
    arms_later: false,
    arms_again: true,
    is_prepared: false,
};
const OWN: Rules = Rules { bad_step: BadStep::Ages, arms_again: false, ..BUS };

/// No motor here turns: that one stands in spite of its output is not looked for.
static STANDS: HealthConfig =
    HealthConfig::new().with_reaction(Condition::Stalled, Reaction::Ignore);

macro_rules! stops {
    ($self:ident => $device:expr) => {
        fn arm(&mut $self, now: Instant) -> Result<(), ArmError> {
            Devices::arm(&mut $device, now)
        }
        fn disarm(&mut $self) {
            Devices::disarm(&mut $device);
        }
        fn stop(&mut $self) {
            Devices::emergency_stop(&mut $device);
        }
        fn clear_stop(&mut $self) {
            Devices::clear_emergency_stop(&mut $device);
        }
    };
}

fn is_driving(frame: &CanFrame) -> bool {
    frame.data().iter().any(|byte| *byte != 0)
}

/// One that takes targets again after a recovery, or not.
pub(super) struct Wheel<const RESUMES: bool>(Bus, Handle<M3508>);

impl<const RESUMES: bool> Wheel<RESUMES> {
    pub(super) fn new() -> Self {
        let config = Config::<M3508>::new(1).with_health(&STANDS).with_opening(Duration::ZERO);
        let config = if RESUMES { config.with_resume() } else { config };
        let mut bus = Bus::new();
        let wheel = bus.attach(config).unwrap();
        Self(bus, wheel)
    }
}

impl<const RESUMES: bool> Subject<1> for Wheel<RESUMES> {
    const RULES: [Rules; 1] = [Rules { resumes: RESUMES, ..BUS }];

    stops!(self => self.0);

    fn hear(&mut self, now: Instant) {
        _ = self.0.ingest(&CanFrame::standard(0x201, [0; 8]).unwrap(), now);
    }
    fn link(&self) -> [Link; 1] {
        [self.0.link(self.1).unwrap()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.0.is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.0.set_current(self.1, Current::from_amperes(5.0 * value))]
    }
    fn relax(&mut self) -> [bool; 1] {
        self.0.relax(self.1);
        [true]
    }
    fn drives(&mut self, tick: Tick) -> [bool; 1] {
        self.0.update(tick);
        [core::iter::from_fn(|| self.0.next_frame()).filter(is_driving).count() > 0]
    }
}

/// A bus and a motor of one's own, as one device.
pub(super) struct Both(Wheel<false>, Own<MyMotor>);

impl Both {
    pub(super) fn new() -> Self {
        let own = Own::new(MyMotor::new(3).unwrap()).with_health(&STANDS).unwrap();
        Self(Wheel::new(), own.with_opening(Duration::ZERO))
    }
}

impl Subject<2> for Both {
    const RULES: [Rules; 2] = [BUS, OWN];

    stops!(self => (&mut self.0.0, &mut self.1));

    fn hear(&mut self, now: Instant) {
        let own = embedded_can::StandardId::new(0x143).unwrap();
        for frame in
            [CanFrame::standard(0x201, [0; 8]).unwrap(), CanFrame::new(own, &[0, 0, 30]).unwrap()]
        {
            _ = (&mut self.0.0, &mut self.1).ingest(&frame, now);
        }
    }
    fn link(&self) -> [Link; 2] {
        let [wheel] = self.0.link();
        [wheel, self.1.guard().link()]
    }
    fn is_armed(&self) -> [bool; 2] {
        let [wheel] = self.0.is_armed();
        [wheel, self.1.guard().is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 2] {
        let [wheel] = self.0.set(value);
        [wheel, self.1.set_velocity((), AngularVelocity::from_rpm(100.0 * value))]
    }
    fn relax(&mut self) -> [bool; 2] {
        let [wheel] = self.0.relax();
        [wheel, false]
    }
    fn drives(&mut self, tick: Tick) -> [bool; 2] {
        let mut both = (&mut self.0.0, &mut self.1);
        both.update(tick);
        let mut driven = [false; 2];
        while let Some(frame) = both.next_frame(0) {
            driven[usize::from(frame.header() != 0x200)] |= is_driving(&frame);
        }
        driven
    }
}

/// A drive that is asked for its settings, and enabled, before it is driven.
pub(super) struct Damiao {
    motor: Own<Motor>,
    drive: DamiaoDrive,
    value: f32,
    set: fn(&mut Own<Motor>, f32) -> Result<(), TargetError>,
}

impl Damiao {
    pub(super) fn mit() -> Self {
        let mode = ImpedanceControl::new(3.0).unwrap();
        Self::new(mode, 1.0, |motor, value| motor.set_torque(3.0 * value))
    }
}

impl Damiao {
    pub(super) fn position() -> Self {
        let mode = Mode::position_velocity(AngularVelocity::from_rad_per_s(10.0));
        Self::new(mode, 2.0, |motor, value| motor.set_angle((), Angle::from_radians(value)))
    }
}

impl Damiao {
    fn new(
        mode: impl Into<Mode>,
        number: f32,
        set: fn(&mut Own<Motor>, f32) -> Result<(), TargetError>,
    ) -> Self {
        let motor = Own::new(Motor::new(Model::J4310, 1, mode).unwrap());
        let drive = DamiaoDrive::new(1, 0x11, [12.5, 30.0, 10.0]).with_register(10, number);
        let motor = motor.with_health(&STANDS).unwrap().with_opening(Duration::ZERO);
        Self { motor, drive, value: 0.0, set }
    }

    /// Gives the drive a frame, and the motor an answer about a register.
    fn tell(&mut self, frame: &CanFrame) {
        let answer = self.drive.hear(frame);
        if let Some(answer) = answer.filter(|_| frame.header() == 0x7FF) {
            self.motor.motor_mut().decode_answer(&answer);
        }
    }
}

impl Subject<1> for Damiao {
    const RULES: [Rules; 1] = [Rules { is_prepared: true, ..OWN }];

    stops!(self => self.motor);

    fn hear(&mut self, now: Instant) {
        let refresh = CanFrame::standard(0x7FF, [1, 0, 0xCC, 0, 0, 0, 0, 0]).unwrap();
        let feedback = self.drive.hear(&refresh).unwrap();
        _ = Devices::ingest(&mut self.motor, &feedback, now);
    }
    fn link(&self) -> [Link; 1] {
        [self.motor.guard().link()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.motor.guard().is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        self.value = value;
        [(self.set)(&mut self.motor, value)]
    }
    fn relax(&mut self) -> [bool; 1] {
        [false]
    }
    /// The drive takes each frame; it is driven by one that leaves it enabled and with a torque.
    fn drives(&mut self, tick: Tick) -> [bool; 1] {
        Devices::update(&mut self.motor, tick);
        let mut is_driven = false;
        while let Some(frame) = Devices::next_frame(&mut self.motor, 0) {
            self.tell(&frame);
            let mut turned = self.drive;
            turned.step(1e-6);
            is_driven |= frame.header() != 0x7FF
                && turned.is_enabled()
                && turned.shaft().torque_nm().abs() > 10.0 / 4095.0;
        }
        [is_driven]
    }
}

/// A drive that is asked for its state, switched on, and asked for its angle, before it is driven.
pub(super) struct Lk {
    motor: Own<lk::Motor>,
    drive: LkDrive,
    set: fn(&mut Own<lk::Motor>, f32) -> Result<(), TargetError>,
}

impl Lk {
    pub(super) fn torque() -> Self {
        let mode = ImpedanceControl::new(2.0).unwrap();
        Self::new(mode, |motor, value| motor.set_torque(2.0 * value))
    }
}

impl Lk {
    pub(super) fn velocity() -> Self {
        let mode = lk::Mode::velocity(AngularVelocity::from_rad_per_s(10.0));
        Self::new(mode, |motor, value| {
            motor.set_velocity((), AngularVelocity::from_rad_per_s(5.0 * value))
        })
    }
}

impl Lk {
    pub(super) fn position() -> Self {
        let mode = lk::Mode::position_velocity(AngularVelocity::from_rad_per_s(10.0));
        Self::new(mode, |motor, value| motor.set_angle((), Angle::from_radians(value)))
    }
}

impl Lk {
    fn new(
        mode: impl Into<lk::Mode>,
        set: fn(&mut Own<lk::Motor>, f32) -> Result<(), TargetError>,
    ) -> Self {
        let motor = Own::new(lk::Motor::new(lk::Model::MF9025_16T, 1, mode).unwrap());
        let drive = LkDrive::new(1, 33.0 / 4096.0, 0.32, 1.0, 16);
        let motor = motor.with_health(&STANDS).unwrap().with_opening(Duration::ZERO);
        Self { motor, drive, set }
    }
}

impl Subject<1> for Lk {
    const RULES: [Rules; 1] = [Rules { is_prepared: true, ..OWN }];

    stops!(self => self.motor);

    fn hear(&mut self, now: Instant) {
        let question = CanFrame::standard(0x141, [0x9C, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        let feedback = self.drive.hear(&question).unwrap();
        _ = Devices::ingest(&mut self.motor, &feedback, now);
    }
    fn link(&self) -> [Link; 1] {
        [self.motor.guard().link()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.motor.guard().is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [(self.set)(&mut self.motor, value)]
    }
    fn relax(&mut self) -> [bool; 1] {
        [false]
    }
    /// The drive takes each frame, and the motor each answer that is no feedback; it is driven by one that leaves it on and with a torque.
    fn drives(&mut self, tick: Tick) -> [bool; 1] {
        Devices::update(&mut self.motor, tick);
        let mut is_driven = false;
        while let Some(frame) = Devices::next_frame(&mut self.motor, 0) {
            let answer = self.drive.hear(&frame);
            let is_feedback = matches!(frame.bytes()[0], 0xA1 | 0xA2 | 0xA4);
            if let Some(answer) = answer.filter(|_| !is_feedback) {
                self.motor.motor_mut().decode_answer(&answer);
            }
            let mut turned = self.drive;
            turned.step(1e-6);
            is_driven |= turned.is_on() && turned.shaft().torque_nm() != 0.0;
        }
        [is_driven]
    }
}

/// A drive that is asked for its state, confirms its time-out, and releases its brake or tells its angle, before it is driven.
pub(super) struct Rmd {
    motor: Own<rmd::Motor>,
    drive: RmdDrive,
    set: fn(&mut Own<rmd::Motor>, f32) -> Result<(), TargetError>,
}

impl Rmd {
    pub(super) fn torque() -> Self {
        let mode = ImpedanceControl::new(2.0).unwrap();
        Self::new(mode, |motor, value| motor.set_torque(2.0 * value))
    }

    pub(super) fn velocity() -> Self {
        let mode = rmd::Mode::velocity(AngularVelocity::from_rad_per_s(10.0));
        Self::new(mode, |motor, value| {
            motor.set_velocity((), AngularVelocity::from_rad_per_s(5.0 * value))
        })
    }

    pub(super) fn position() -> Self {
        let mode = rmd::Mode::position_velocity(AngularVelocity::from_rad_per_s(10.0));
        Self::new(mode, |motor, value| motor.set_angle((), Angle::from_radians(value)))
    }

    fn new(
        mode: impl Into<rmd::Mode>,
        set: fn(&mut Own<rmd::Motor>, f32) -> Result<(), TargetError>,
    ) -> Self {
        let motor = Own::new(rmd::Motor::new(rmd::Model::X8_120, 1, mode).unwrap());
        let drive = RmdDrive::new(1, 2.4);
        let motor = motor.with_health(&STANDS).unwrap().with_opening(Duration::ZERO);
        Self { motor, drive, set }
    }
}

impl Subject<1> for Rmd {
    const RULES: [Rules; 1] = [Rules { is_prepared: true, ..OWN }];

    stops!(self => self.motor);

    fn hear(&mut self, now: Instant) {
        let question = CanFrame::standard(0x141, [0x9C, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        let feedback = self.drive.hear(&question).unwrap();
        _ = Devices::ingest(&mut self.motor, &feedback, now);
    }
    fn link(&self) -> [Link; 1] {
        [self.motor.guard().link()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.motor.guard().is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [(self.set)(&mut self.motor, value)]
    }
    fn relax(&mut self) -> [bool; 1] {
        [false]
    }
    /// The drive takes each frame, and the motor each answer that is no feedback; it is driven by one that leaves it with a torque.
    fn drives(&mut self, tick: Tick) -> [bool; 1] {
        Devices::update(&mut self.motor, tick);
        let mut is_driven = false;
        while let Some(frame) = Devices::next_frame(&mut self.motor, 0) {
            let answer = self.drive.hear(&frame);
            let is_feedback = matches!(frame.bytes()[0], 0xA1 | 0xA2 | 0xA4);
            if let Some(answer) = answer.filter(|_| !is_feedback) {
                self.motor.motor_mut().decode_answer(&answer);
            }
            let mut turned = self.drive;
            turned.step(1e-6);
            is_driven |= turned.shaft().torque_nm() != 0.0;
        }
        [is_driven]
    }
}

pub(super) struct Snake(Joints, Joint);

impl Snake {
    pub(super) fn new() -> Self {
        let mut joints = Joints::new();
        let joint = joints.attach(snake::Config::new(5)).unwrap();
        Self(joints, joint)
    }
}

impl Subject<1> for Snake {
    const RULES: [Rules; 1] =
        [Rules { late_us: Some(40_000), bad_step: BadStep::RepeatsThenRelaxes, ..OWN }];

    stops!(self => self.0);

    fn hear(&mut self, now: Instant) {
        let id = embedded_can::StandardId::new(5).unwrap();
        let reply = Reply::new(Register::ActualPosition, 0).encode();
        _ = self.0.ingest(&CanFrame::new(id, &reply).unwrap(), now);
    }
    fn link(&self) -> [Link; 1] {
        [self.0.link(self.1).unwrap()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.0.is_joint_armed(self.1)]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.0.set_position(self.1, Position::from_angle(Angle::from_degrees(5.0 * value)))]
    }
    fn relax(&mut self) -> [bool; 1] {
        self.0.relax(self.1);
        [true]
    }
    fn drives(&mut self, tick: Tick) -> [bool; 1] {
        self.0.update(tick);
        let is_safe =
            |frame: &CanFrame| Command::decode(frame.data()).is_some_and(Command::is_safe);
        let unsafe_frames =
            core::iter::from_fn(|| self.0.next_frame()).filter(|frame| !is_safe(frame));
        let asks = unsafe_frames.count() > 0;
        [asks || self.0.state(self.1).is_some_and(|state| state.is_driven)]
    }
}

#[cfg(feature = "hal")]
pub(super) mod pins {
    use super::*;
    use drivetrain::pwm::{Brushed, BrushedConfig, RcConfig, RcPwm};
    use embedded_hal::{digital, pwm};
    use std::convert::Infallible;

    pub(crate) struct Pin(u16);

    impl digital::ErrorType for Pin {
        type Error = Infallible;
    }
    impl digital::OutputPin for Pin {
        fn set_low(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }
    impl pwm::ErrorType for Pin {
        type Error = Infallible;
    }
    impl pwm::SetDutyCycle for Pin {
        fn max_duty_cycle(&self) -> u16 {
            20_000
        }
        fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
            self.0 = duty;
            Ok(())
        }
    }

    macro_rules! stops {
        () => {
            fn link(&self) -> [Link; 1] {
                [self.guard().link()]
            }
            fn is_armed(&self) -> [bool; 1] {
                [Self::is_armed(self)]
            }
            fn relax(&mut self) -> [bool; 1] {
                [false]
            }
            fn disarm(&mut self) {
                Self::disarm(self);
            }
            fn stop(&mut self) {
                self.emergency_stop();
            }
            fn clear_stop(&mut self) {
                self.clear_emergency_stop();
            }
        };
    }

    /// The ESC takes no time to arm.
    pub(crate) fn esc() -> RcPwm<Pin> {
        let config = RcConfig::new().with_arming_time(Duration::ZERO).with_opening(Duration::ZERO);
        RcPwm::new(Pin(0), config).unwrap()
    }

    impl Subject<1> for RcPwm<Pin> {
        const RULES: [Rules; 1] =
            [Rules { late_us: None, bad_step: BadStep::OpenLoop, arms_later: true, ..OWN }];

        stops!();

        fn hear(&mut self, _now: Instant) {}
        fn arm(&mut self, _now: Instant) -> Result<(), ArmError> {
            Self::arm(self)
        }
        fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
            [self.set_throttle(value)]
        }
        fn drives(&mut self, tick: Tick) -> [bool; 1] {
            self.update(tick).unwrap();
            [self.channel().0 != 1_500]
        }
    }

    pub(crate) fn brushed() -> Brushed<Pin, [Pin; 1]> {
        let config = BrushedConfig::new(1)
            .with_encoder(2_000.0, 16)
            .with_health(&STANDS)
            .with_opening(Duration::ZERO);
        Brushed::new(Pin(0), [Pin(0)], config).unwrap()
    }

    impl Subject<1> for Brushed<Pin, [Pin; 1]> {
        const RULES: [Rules; 1] = [OWN];

        stops!();

        fn hear(&mut self, now: Instant) {
            self.ingest_counts(0, now);
        }
        fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
            Self::arm(self, now)
        }
        fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
            [self.set_duty(value)]
        }
        fn drives(&mut self, tick: Tick) -> [bool; 1] {
            self.update(tick).unwrap();
            [self.channel().0 != 0]
        }
    }
}

/// A wheel on a VESC that turns by torque, without a question for the fault code, which has a time of its own.
pub(super) struct Vesc(Own<vesc::Motor>);

impl Vesc {
    pub(super) fn new() -> Self {
        let model = vesc::Model {
            name: "wheel",
            pole_pairs: 7,
            gear: GearRatio::DIRECT,
            torque_constant_nm_per_a: 0.05,
            current_limit_a: 20.0,
            max_velocity: AngularVelocity::from_rad_per_s(300.0),
            is_reversed: false,
        };
        let motor = vesc::Motor::new(model, 23, vesc::Mode::current()).unwrap();
        Self(
            Own::new(motor.without_fault_code())
                .with_health(&STANDS)
                .unwrap()
                .with_opening(Duration::ZERO),
        )
    }
}

impl Subject<1> for Vesc {
    const RULES: [Rules; 1] = [OWN];

    stops!(self => self.0);

    fn hear(&mut self, now: Instant) {
        let id = embedded_can::ExtendedId::new(0x917).unwrap();
        let status = CanFrame::new(id, &[0; 8]).unwrap();
        _ = Devices::ingest(&mut self.0, &status, now);
    }
    fn link(&self) -> [Link; 1] {
        [self.0.guard().link()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.0.guard().is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.0.set_torque(value)]
    }
    fn relax(&mut self) -> [bool; 1] {
        [false]
    }
    /// Any other value than 0 in the four bytes of a current.
    fn drives(&mut self, tick: Tick) -> [bool; 1] {
        Devices::update(&mut self.0, tick);
        let mut is_driven = false;
        while let Some(frame) = Devices::next_frame(&mut self.0, 0) {
            is_driven |= is_driving(&frame);
        }
        [is_driven]
    }
}

pub(super) struct RobStride {
    motor: Own<robstride::Motor>,
    drive: RobStrideDrive,
    set: fn(&mut Own<robstride::Motor>, f32) -> Result<(), TargetError>,
}

impl RobStride {
    pub(super) fn operation() -> Self {
        let mode = ImpedanceControl::new(3.0).unwrap();
        Self::new(mode, |motor, value| motor.set_torque(3.0 * value))
    }
}

impl RobStride {
    pub(super) fn current() -> Self {
        let mode = robstride::Mode::current(4.0, 1.0);
        Self::new(mode, |motor, value| motor.set_torque(3.0 * value))
    }
}

impl RobStride {
    fn new(
        mode: impl Into<robstride::Mode>,
        set: fn(&mut Own<robstride::Motor>, f32) -> Result<(), TargetError>,
    ) -> Self {
        let motor = Own::new(robstride::Motor::new(robstride::Model::RS02, 1, mode).unwrap());
        let drive = RobStrideDrive::new(1, [12.566, 44.0, 17.0, 500.0, 5.0]);
        let motor = motor.with_health(&STANDS).unwrap().with_opening(Duration::ZERO);
        Self { motor, drive, set }
    }

    /// Gives the drive a frame, and the motor an answer about a parameter.
    fn tell(&mut self, frame: &CanFrame) {
        if let Some(answer) = self.drive.hear(frame) {
            self.motor.motor_mut().decode_answer(&answer);
        }
    }
}

impl Subject<1> for RobStride {
    const RULES: [Rules; 1] = [Rules { is_prepared: true, ..OWN }];

    stops!(self => self.motor);

    /// A write of a parameter that no mode uses is answered with feedback.
    fn hear(&mut self, now: Instant) {
        let id = embedded_can::ExtendedId::new(0x1200_FD01).unwrap();
        let refresh = CanFrame::of(id, [0x1E, 0x70, 0, 0, 0, 0, 0xF0, 0x41]);
        let feedback = self.drive.hear(&refresh).unwrap();
        _ = Devices::ingest(&mut self.motor, &feedback, now);
    }
    fn link(&self) -> [Link; 1] {
        [self.motor.guard().link()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.motor.guard().is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [(self.set)(&mut self.motor, value)]
    }
    fn relax(&mut self) -> [bool; 1] {
        [false]
    }
    /// The drive takes each frame; it is driven by one that leaves it enabled and with a torque.
    fn drives(&mut self, tick: Tick) -> [bool; 1] {
        Devices::update(&mut self.motor, tick);
        let mut is_driven = false;
        while let Some(frame) = Devices::next_frame(&mut self.motor, 0) {
            self.tell(&frame);
            let mut turned = self.drive;
            turned.step(1e-6);
            is_driven |= frame.header() >> 24 & 0x1F != 17
                && turned.is_enabled()
                && turned.shaft().torque_nm().abs() > 17.0 / 65_535.0;
        }
        [is_driven]
    }
}
