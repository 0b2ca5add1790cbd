//! The list: one line a public function. `link.py` says which are missing.

use crate::opaque::{Function, any};
use core::hint::black_box;
use drivetrain::control::{Differentiator, Pid, PidConfig, WheelTuning, fhan};
use drivetrain::dji::{
    AnyHandle, AttachError, Bus, Config, Facts, Feedback, Gm6020Current, Gm6020Voltage, Handle,
    M2006, M3508, WordGains,
};
use drivetrain::encoder::{GearRatio, Homing, Position, resolve_gap, shortest};
use drivetrain::error::ConfigError;
use drivetrain::frame::CanFrame;
use drivetrain::math::{atan2, sin_cos, sqrt, wrap, wrap_pi, wrap_positive, wrap_tau};
use drivetrain::motor::{
    Actuator, AngleDrive, ArmingSwitch, BusLoad, CanDevice, Capabilities, Capability, Claim,
    Devices, DriveProtocol, Guard, Ingest, Measured, Missing, MotorName, Order, StopHoming,
    Timeouts, VelocityDrive, Visitor, Vitals, WrongSetting,
};
use drivetrain::runner::{
    BlockingTx, EmergencyStop, FrameQueue, FrameReceiver, FrameSender, Nb, Runner, Statistics,
};
use drivetrain::time::TimeStep;
use drivetrain::time::{Clock, Duration, ExtendedCounter, Instant, Tick, Ticker};
use drivetrain::units::{Angle, AngularVelocity, Current, Voltage};
use embedded_can::{ErrorKind, Frame, Id};

pub fn call_all() {
    units();
    time();
    math();
    frame();
    control();
    encoder();
    motor();
    dji();
    runner();
    crate::geometry::call_all();
    crate::manipulator::call_all();
    crate::health::call_all();
    crate::chassis::call_all();
    crate::pwm::call_all();
    crate::damiao::call_all();
    crate::lk::call_all();
    crate::vesc::call_all();
    crate::odrive::call_all();
    crate::rmd::call_all();
    crate::robstride::call_all();
    crate::snake::call_all();
    crate::shaping::call_all();
    crate::shooter::call_all();
    crate::wire::call_all();
    #[cfg(feature = "panics")]
    f32::clamp.call();
}

/// The linear functions that `units` gives to each quantity by a macro.
macro_rules! linear {
    ($($quantity:ident)*) => {
        $(
            $quantity::abs.call();
            $quantity::is_finite.call();
            (|a: $quantity, b: $quantity| a + b - -a).call();
            (|a: $quantity, b: f32| a * b / b).call();
            (|a: $quantity, b: $quantity| a / b).call();
        )*
    };
}

fn units() {
    linear!(Angle AngularVelocity Current Voltage);
    Angle::from_radians.call();
    Angle::from_degrees.call();
    Angle::from_turns.call();
    Angle::from_counts.call();
    Angle::as_radians.call();
    Angle::as_degrees.call();
    Angle::as_turns.call();
    Angle::wrapped.call();
    Angle::wrapped_positive.call();
    AngularVelocity::from_rad_per_s.call();
    AngularVelocity::from_rpm.call();
    AngularVelocity::from_degrees_per_s.call();
    AngularVelocity::as_rad_per_s.call();
    AngularVelocity::as_rpm.call();
    AngularVelocity::as_degrees_per_s.call();
    Current::from_amperes.call();
    Current::from_milliamperes.call();
    Current::as_amperes.call();
    Current::as_milliamperes.call();
    Voltage::from_volts.call();
    Voltage::from_millivolts.call();
    Voltage::as_volts.call();
    Voltage::as_millivolts.call();
}

fn time() {
    Instant::from_micros.call();
    Instant::as_micros.call();
    Instant::since.call();
    (|a: Instant, b: Duration| a + b).call();
    (|a: Instant, b: Instant| a - b).call();
    Duration::from_micros.call();
    Duration::from_millis.call();
    Duration::from_secs.call();
    Duration::from_secs_f32.call();
    Duration::as_micros.call();
    Duration::as_secs_f32.call();
    Duration::saturating_add.call();
    (|a: Duration, b: Duration| a + b).call();
    (|a: core::time::Duration| Duration::from(a)).call();
    ExtendedCounter::new_16_bit.call();
    ExtendedCounter::new_32_bit.call();
    ExtendedCounter::extend.call();
    Tick::new.call();
    Tick::now.call();
    Tick::dt_s.call();
    Ticker::new.call();
    Ticker::due.call();
    Ticker::overruns.call();
    Ticker::period.call();
}

fn math() {
    sin_cos.call();
    atan2.call();
    sqrt.call();
    wrap.call();
    wrap_pi.call();
    wrap_positive.call();
    wrap_tau.call();
}

fn frame() {
    CanFrame::standard.call();
    (|id: Id, data: [u8; 3]| CanFrame::of(id, data)).call();
    (|frame: &CanFrame| CanFrame::copy_of(frame)).call();
    (|frame: &CanFrame| CanFrame::convert::<CanFrame>(frame)).call();
    CanFrame::header.call();
    CanFrame::bytes.call();
    CanFrame::length.call();
    (|id: Id, data: &[u8]| <CanFrame as Frame>::new(id, data)).call();
    (|id: Id, dlc: usize| <CanFrame as Frame>::new_remote(id, dlc)).call();
    (|frame: &CanFrame| (frame.id(), frame.dlc(), frame.is_extended())).call();
    (|frame: &CanFrame| frame.data().len()).call();
}

fn control() {
    TimeStep::new.call();
    TimeStep::of.call();
    TimeStep::dt_s.call();
    TimeStep::is_hold.call();
    TimeStep::is_frozen.call();
    ConfigError::parameter.call();
    PidConfig::new.call();
    PidConfig::with_output_limit.call();
    PidConfig::with_output_range.call();
    PidConfig::with_integral_limit.call();
    PidConfig::with_integral_separation.call();
    PidConfig::with_variable_integral.call();
    PidConfig::with_back_calculation.call();
    PidConfig::without_anti_windup.call();
    PidConfig::with_dead_band.call();
    PidConfig::with_feed_forward.call();
    PidConfig::with_slew_limit.call();
    PidConfig::with_period.call();
    PidConfig::with_derivative_filter.call();
    PidConfig::with_derivative_on_error.call();
    PidConfig::with_tracking.call();
    PidConfig::with_incremental_form.call();
    PidConfig::with_gains.call();
    PidConfig::gains.call();
    PidConfig::output_range.call();
    PidConfig::validate.call();
    PidConfig::period.call();
    Pid::new.call();
    Pid::step.call();
    Pid::step_error.call();
    Pid::reset.call();
    Pid::reset_to.call();
    Pid::set_gains.call();
    Pid::set_config.call();
    Pid::proportional.call();
    Pid::integral.call();
    Pid::derivative.call();
    Pid::feed_forward.call();
    Pid::output.call();
    Pid::config.call();
    Pid::rejected.call();
    Differentiator::linear.call();
    Differentiator::optimal.call();
    Differentiator::<false>::update.call();
    Differentiator::<true>::update.call();
    Differentiator::<false>::reset_to.call();
    Differentiator::<false>::value.call();
    Differentiator::<false>::rate.call();
    fhan.call();
    WheelTuning::speed_loop.call();
}

fn encoder() {
    shortest.call();
    resolve_gap.call();
    GearRatio::new.call();
    GearRatio::rotor.call();
    GearRatio::output.call();
    GearRatio::as_f32.call();
    Position::new.call();
    Position::from_turns.call();
    Position::from_angle.call();
    Position::turns.call();
    Position::angle.call();
    Position::as_turns.call();
    Position::as_angle.call();
    Position::is_finite.call();
    (|a: Position, b: Angle| a + b).call();
    (|a: Position, b: Position| a - b).call();
    Homing::is_known.call();
}

fn motor() {
    (|names: [MotorName; 20]| Missing::collect(names.into_iter())).call();
    (|missing: &Missing| Missing::names(missing).count()).call();
    Missing::total.call();
    Ingest::is_malformed.call();
    ArmingSwitch::new.call();
    ArmingSwitch::read.call();
    Missing::full_bus.call();
    (|id: Id, motor: MotorName| Claim::command(id, motor)).call();
    (|id: Id, motor: MotorName| Claim::feedback(id, motor)).call();
    Claim::with_mask.call();
    Claim::clashes_with.call();
    Claim::id.call();
    Claim::is_feedback.call();
    Claim::motor.call();
    Claim::shared.call();
    (|claim: &Claim, id: Id| Claim::covers(claim, id)).call();
    Timeouts::new.call();
    Timeouts::with_feedback.call();
    Timeouts::with_command.call();
    Timeouts::with_measured.call();
    Timeouts::measured.call();
    Timeouts::with_good_frames.call();
    Timeouts::late.call();
    Timeouts::offline.call();
    Timeouts::command.call();
    Timeouts::good_frames.call();
    BusLoad::new.call();
    BusLoad::with_frames.call();
    BusLoad::with_frames_of.call();
    BusLoad::and.call();
    BusLoad::frames_per_s.call();
    BusLoad::bit_rate.call();
    BusLoad::nominal.call();
    BusLoad::worst_case.call();
    BusLoad::frames_within.call();
    BusLoad::frame_bits.call();
    Guard::new.call();
    Guard::without_feedback.call();
    Guard::with_timeouts.call();
    Guard::with_opening.call();
    Guard::hear.call();
    Guard::admit.call();
    Guard::drives.call();
    Guard::has_target.call();
    Guard::relax.call();
    Guard::is_missing.call();
    Guard::ask.call();
    Guard::engage.call();
    Guard::share.call();
    Guard::disarm.call();
    Guard::trip.call();
    Guard::emergency_stop.call();
    Guard::clear_emergency_stop.call();
    Guard::is_armed.call();
    Guard::is_stopped.call();
    Guard::link.call();
    Guard::refused_targets.call();
    Guard::forgotten_targets.call();
    Capability::is_target.call();
    (|list: &[Capability]| Capabilities::of(list)).call();
    Capabilities::with.call();
    Capabilities::has.call();
    (|set: Capabilities| Capabilities::iter(set).count()).call();
    StopHoming::with_standing_below.call();
    StopHoming::with_window.call();
    StopHoming::with_timeout.call();
    StopHoming::with_travel.call();
    StopHoming::with_stop_at.call();
    StopHoming::with_back_off.call();
    StopHoming::new.call();
    StopHoming::step.call();
    StopHoming::is_done.call();
    Actuator::<AnyMotor>::new.call();
    Actuator::<AnyMotor>::with_timeouts.call();
    Actuator::<AnyMotor>::motor.call();
    Actuator::<AnyMotor>::guard.call();
    Actuator::<AnyMotor>::with_health.call();
    Actuator::<AnyMotor>::health.call();
    Actuator::<AnyMotor>::with_opening.call();
    Actuator::<AnyMotor>::reversed.call();
    Actuator::<AnyMotor>::with_zero.call();
    Actuator::<AnyMotor>::set_present_angle.call();
    Actuator::<AnyMotor>::forget_zero.call();
    Actuator::<AnyMotor>::set_loops.call();
    Actuator::<AnyMotor>::load.call();
    (|own: &Actuator<AnyMotor>| (own.velocity(()), own.angle(()))).call();
    actuator::<AnyMotor>();
    MotorName::new.call();
    MotorName::model.call();
    MotorName::id.call();
    device::<[Bus; 3]>();
    device::<(Bus, Bus)>();
    device::<(Bus, Bus, Bus)>();
    device::<(Bus, Bus, Bus, Bus)>();
    device::<&'static mut Bus>();
    device::<Robot>();
}

/// Devices of a user that name their parts.
struct Robot {
    chassis: [Bus; 2],
    arm: Actuator<AnyMotor>,
}

impl Devices for Robot {
    fn visit(&mut self, visitor: &mut impl Visitor) {
        self.chassis.visit(visitor);
        self.arm.visit(visitor);
    }
}

/// The calls of each family of actuators, for its protocol and its device.
pub fn actuator<M: DriveProtocol + 'static>() {
    (|motor: &mut M, sent: u8| motor.enable(sent)).call();
    (|motor: &mut M| motor.disable()).call();
    (|motor: &mut M| motor.poll()).call();
    (|motor: &mut M| motor.inquire()).call();
    (|motor: &mut M, frame: &CanFrame| motor.decode_answer(frame)).call();
    (|motor: &M| motor.wrong_setting()).call();
    (|motor: &mut M| motor.forget_settings()).call();
    Actuator::<M>::motor_mut.call();
    Actuator::<M>::set_torque.call();
    Actuator::<M>::set_impedance.call();
    (|own: &mut Actuator<M>, target| own.set_velocity((), target)).call();
    (|own: &mut Actuator<M>, target| own.set_angle((), target)).call();
    family::<Actuator<M>>();
    device::<Actuator<M>>();
}

/// The trait of each family.
pub fn family<D: CanDevice + 'static>() {
    (|device: &mut D, frame: &CanFrame, now: Instant| device.ingest(frame, now)).call();
    (|device: &mut D, tick: Tick| device.update(tick)).call();
    (|device: &mut D| device.next_frame()).call();
    (|device: &mut D, frame: &CanFrame| device.requeue(frame)).call();
    (|device: &mut D, frame: &CanFrame| device.put_back(frame)).call();
    (|device: &D| device.superseded()).call();
    (|device: &D| device.claims().count()).call();
    (|device: &D, now: Instant| device.missing(now).count()).call();
    (|device: &D| (device.faulty().count(), device.second_master())).call();
    (|device: &D| device.wrong_setting()).call();
    (|device: &mut D| device.next_edge()).call();
    (|device: &mut D| device.ask()).call();
    (|device: &mut D, now: Instant| device.engage(now)).call();
    (|device: &mut D| device.disarm()).call();
    (|device: &mut D| device.trip()).call();
    (|device: &D| (device.is_armed(), device.is_stopped())).call();
    (|device: &mut D| device.emergency_stop()).call();
    (|device: &mut D| device.clear_emergency_stop()).call();
}

/// Functions of devices and their combinations.
pub fn device<D: Devices + 'static>() {
    (|device: &mut D, frame: &CanFrame, now: Instant| device.ingest(frame, now)).call();
    (|device: &mut D, frame: &CanFrame, now: Instant| device.ingest_any(frame, now)).call();
    (|device: &D| device.usual_feedback()).call();
    (|device: &mut D, tick: Tick| device.update(tick)).call();
    (|device: &mut D, turn: u32| device.next_frame(turn)).call();
    (|device: &mut D, frame: &CanFrame| device.requeue(frame)).call();
    (|device: &mut D, frame: &CanFrame| device.put_back(frame)).call();
    (|device: &mut D| device.superseded()).call();
    (|device: &mut D| device.claims().count()).call();
    (|device: &mut D| device.next_edge()).call();
    (|device: &mut D, now: Instant| device.arm(now).is_ok()).call();
    (|device: &mut D| device.clash()).call();
    (|device: &mut D| device.disarm()).call();
    (|device: &mut D| (device.is_armed(), device.is_stopped())).call();
    (|device: &mut D| device.trip()).call();
    (|device: &mut D| device.emergency_stop()).call();
    (|device: &mut D| device.clear_emergency_stop()).call();
}

fn dji() {
    Feedback::decode.call();
    Feedback::encode.call();
    Feedback::angle.call();
    Feedback::rpm.call();
    Feedback::current.call();
    Feedback::temperature.call();
    Feedback::error.call();
    Facts::command_ids.call();
    Facts::rotor_no_load_rpm.call();
    Facts::to_word.call();
    Facts::of_word.call();
    Facts::place.call();
    AttachError::message.call();
    Config::<M3508>::new.call();
    Config::<M3508>::reversed.call();
    Config::<M3508>::speed_loop.call();
    Config::<M3508>::position_loop.call();
    Config::<M3508>::with_gear.call();
    Config::<M3508>::with_torque_constant.call();
    Config::<M3508>::with_resume.call();
    Config::<M3508>::with_opening.call();
    Config::<M3508>::id.call();
    Config::<M2006>::with_current_limit.call();
    Config::<Gm6020Voltage>::with_voltage_limit.call();
    Config::<Gm6020Voltage>::with_nominal_voltage.call();
    Config::<Gm6020Voltage>::with_legacy_full_scale.call();
    Handle::<M3508>::erase.call();
    Bus::new.call();
    Bus::<u8>::branded.call();
    Bus::<u8, 2>::sized.call();
    Bus::<(), 11>::attach::<M3508>.call();
    Bus::<(), 11>::ingest.call();
    Bus::<(), 11>::update.call();
    Bus::<(), 2>::with_timeouts.call();
    Bus::<(), 2>::with_keep_alive.call();
    Bus::<(), 2>::attach::<M3508>.call();
    Bus::<(), 2>::attach::<Gm6020Current>.call();
    Bus::<(), 2>::attach_all::<M3508, 4>.call();
    (|bus: &mut Bus, motor: AnyHandle| Bus::detach(bus, motor)).call();
    Bus::<(), 2>::load.call();
    Bus::<(), 2>::with_bit_rate.call();
    Bus::<(), 2>::with_feedback_rate.call();
    Bus::<(), 2>::with_load_ceiling.call();
    Bus::<(), 2>::with_tick_rate.call();
    (|bus: &mut Bus, motors: &[AnyHandle], now: Instant| Bus::arm_only(bus, motors, now).is_ok())
        .call();
    (|bus: &mut Bus, now: Instant| Bus::arm(bus, now).is_ok()).call();
    Bus::<(), 2>::disarm.call();
    Bus::<(), 2>::is_armed.call();
    Bus::<(), 2>::emergency_stop.call();
    Bus::<(), 2>::clear_emergency_stop.call();
    Bus::<(), 2>::is_stopped.call();
    Bus::<(), 2>::ingest.call();
    Bus::<(), 2>::ingest_raw.call();
    Bus::<(), 2>::update.call();
    Bus::<(), 2>::next_frame.call();
    Bus::<(), 2>::requeue.call();
    (|bus: &Bus, motor: AnyHandle| Bus::state(bus, motor)).call();
    (|bus: &Bus, motor: AnyHandle| Bus::link(bus, motor)).call();
    (|bus: &Bus, motor: AnyHandle| Bus::is_motor_armed(bus, motor)).call();
    (|bus: &Bus| Bus::motors(bus).for_each(|motor| _ = black_box(motor))).call();
    Bus::<(), 2>::counters.call();
    Bus::<(), 2>::acceptance_filter.call();
    Bus::<(), 2>::set_current::<M3508>.call();
    Bus::<(), 2>::set_voltage::<Gm6020Voltage>.call();
    (|bus: &mut Bus, motor: AnyHandle, raw: i16| Bus::set_raw(bus, motor, raw)).call();
    (|bus: &mut Bus, motor: AnyHandle, to: AngularVelocity| Bus::set_velocity(bus, motor, to))
        .call();
    (|bus: &mut Bus, motor: AnyHandle, to: Angle| Bus::set_angle(bus, motor, to)).call();
    (|bus: &mut Bus, motor: AnyHandle, to: Position| Bus::set_position(bus, motor, to)).call();
    (|bus: &mut Bus, motor: AnyHandle| Bus::relax(bus, motor)).call();
    Bus::<(), 2>::commanded_current::<M3508>.call();
    (|bus: &mut Bus, motors: [AnyHandle; 4], factor: f32| {
        Bus::scale_outputs(bus, motors, factor);
    })
    .call();
    (|bus: &mut Bus, motor: AnyHandle| Bus::zero(bus, motor)).call();
    (|bus: &mut Bus, motor: AnyHandle, to: Position| Bus::set_present_position(bus, motor, to))
        .call();
    (|bus: &mut Bus, motor: AnyHandle, pid: PidConfig| Bus::set_speed_loop(bus, motor, pid)).call();
    (|bus: &mut Bus, motor: AnyHandle, pid: PidConfig| Bus::set_position_loop(bus, motor, pid))
        .call();
    (|bus: &Bus, motor: AnyHandle| VelocityDrive::velocity(bus, motor)).call();
    (|bus: &Bus, motor: AnyHandle| VelocityDrive::capabilities(bus, motor)).call();
    (|bus: &Bus, motor: AnyHandle| Bus::capabilities(bus, motor)).call();
    (|bus: &mut Bus, motor: AnyHandle, to: Angle, measured: Measured| {
        Bus::set_angle_measured(bus, motor, to, measured)
    })
    .call();
    (|bus: &mut Bus, motor: AnyHandle, to: Position, measured: Measured<Position>| {
        Bus::set_position_measured(bus, motor, to, measured)
    })
    .call();
    Measured::<Angle>::way_to.call();
    Measured::<Position>::way_to.call();
    WordGains::per_rotor_rpm.call();
    WordGains::per_output_rpm.call();
    WordGains::per_rotor_degree_per_s.call();
    WordGains::each_step.call();
    WordGains::speed_loop::<M3508>.call();
    family::<Bus>();
    device::<Bus>();
}

/// A motor of a user that may do anything.
struct AnyMotor;

impl DriveProtocol for AnyMotor {
    fn name(&self) -> MotorName {
        any()
    }
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        any::<[Claim; 3]>()
    }
    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        black_box(frame);
        any()
    }
    fn velocity(&self) -> AngularVelocity {
        any()
    }
    fn angle(&self) -> Option<Angle> {
        any()
    }
    fn rest(&mut self) -> CanFrame {
        any()
    }
    fn control(&mut self, order: Order) -> CanFrame {
        black_box(order);
        any()
    }
    fn reset(&mut self) {}
    fn enable(&mut self, _sent: u8) -> Option<CanFrame> {
        any()
    }
    fn disable(&mut self) -> Option<CanFrame> {
        any()
    }
    fn poll(&mut self) -> Option<CanFrame> {
        any()
    }
    fn is_enabled(&self) -> Option<bool> {
        any()
    }
    fn inquire(&mut self) -> Option<CanFrame> {
        any()
    }
    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        black_box(frame);
        any()
    }
    fn wrong_setting(&self) -> Option<WrongSetting> {
        any()
    }
    fn capabilities(&self) -> Capabilities {
        any()
    }
    fn vitals(&self) -> Vitals {
        any()
    }
}

/// A driver that may answer anything.
struct Can;

impl embedded_can::nb::Can for Can {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        black_box(frame);
        any()
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        any()
    }
}

impl embedded_can::blocking::Can for Can {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> Result<(), ErrorKind> {
        black_box(frame);
        any()
    }

    fn receive(&mut self) -> Result<CanFrame, ErrorKind> {
        any()
    }
}

struct AnyClock;

impl Clock for AnyClock {
    fn now(&mut self) -> Instant {
        any()
    }
}

fn runner() {
    type Shell = Runner<Nb<Can>, AnyClock, Bus>;
    type Sender = Runner<BlockingTx<Can>, AnyClock, Bus>;
    (|bus: Bus| Runner::new(Nb(Can), AnyClock, bus)).call();
    Shell::with_period.call();
    Shell::with_emergency_stop.call();
    Shell::with_standstill_after.call();
    Shell::poll.call();
    (|runner: &mut Shell, budget: usize| {
        Runner::poll_with(runner, budget, |frame| {
            black_box(frame);
        })
    })
    .call();
    Shell::ingest.call();
    Shell::due.call();
    Shell::arm.call();
    Shell::is_armed.call();
    Shell::clear_emergency_stop.call();
    Shell::tick.call();
    Sender::tick.call();
    (|runner: &mut Shell, tick: Tick| {
        Runner::tick_with(runner, tick, |frame| {
            black_box(frame);
        })
    })
    .call();
    (|runner: &mut Shell, tick: Tick, motors: [AnyHandle; 4], factor: f32| {
        Runner::tick_limited(runner, tick, |bus| bus.scale_outputs(motors, factor));
    })
    .call();
    Shell::statistics.call();
    Shell::is_bus_down.call();
    Shell::has.call();
    Shell::next_edge.call();
    (|runner: &mut Shell| Shell::edges(runner).count()).call();
    Shell::heartbeat.call();
    Shell::with_bit_rate.call();
    Shell::measured_load.call();
    Shell::note_lost.call();
    Shell::poll_queue.call();
    (|runner: &mut Shell, queue: &mut FrameReceiver<'_>, budget: usize| {
        Shell::poll_queue_with(runner, queue, budget, |frame| {
            black_box(frame);
        })
    })
    .call();
    Shell::device.call();
    Shell::device_mut.call();
    Shell::port_mut.call();
    (|runner: Shell| Runner::into_parts(runner).2).call();
    Statistics::receive_errors.call();
    Statistics::receive_errors_of.call();
    Statistics::send_errors.call();
    Statistics::send_errors_of.call();
    EmergencyStop::new.call();
    EmergencyStop::set.call();
    EmergencyStop::clear.call();
    EmergencyStop::is_set.call();
    FrameQueue::<8>::new.call();
    (|queue: &mut FrameQueue<8>| _ = black_box(FrameQueue::split(queue))).call();
    (|sender: &mut FrameSender<'_>, frame: &CanFrame, now: Instant| {
        FrameSender::push(sender, frame, now)
    })
    .call();
    FrameReceiver::pop.call();
    FrameReceiver::dropped.call();
}
