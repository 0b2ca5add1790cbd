//! Byte protocols.

use crate::opaque::Function;
use drivetrain::motor::Impedance;
use drivetrain::wire::candump::*;
use drivetrain::wire::dbus::*;
use drivetrain::wire::feetech::*;
use drivetrain::wire::hipnuc::*;
use drivetrain::wire::host_link::*;
use drivetrain::wire::mit;
use drivetrain::wire::parameters::{Parameter, Parameters};
use drivetrain::wire::referee::{self, Referee, RefereeMessage};
use drivetrain::wire::supercap::{hkust, pacific_spirit};
use drivetrain::wire::vofa::*;
use drivetrain::wire::vt13::VideoRemote;
use drivetrain::wire::{Deframer, Receiver};

pub fn call_all() {
    Record::parse.call();
    ParseError::column.call();
    Parameter::setting.call();
    Parameter::target.call();
    Parameter::name.call();
    Parameter::range.call();
    Parameters::<4>::new.call();
    Parameters::<4>::with_expiry.call();
    (|parameters: &mut Parameters<4>, input: &mut &'static [u8], now| {
        Parameters::read(parameters, input, now)
    })
    .call();
    Parameters::<4>::value.call();
    Parameters::<4>::counts.call();
    Dbus::new.call();
    Dbus::with_pause.call();
    Dbus::with_deadline.call();
    Dbus::with_dead_band.call();
    Dbus::note_pause.call();
    Dbus::remote.call();
    Dbus::is_live.call();
    Dbus::edge.call();
    Dbus::counts.call();
    Switch::is_at.call();
    (|dbus: &mut Dbus, input: &mut &'static [u8], now| Dbus::read(dbus, input, now)).call();
    Keys::contains.call();
    Deframer::<Status, 64>::new.call();
    Deframer::<Telemetry, 128>::with_options.call();
    Deframer::<Status, 64>::abandon.call();
    Deframer::<Status, 64>::counts.call();
    Deframer::<Status, 64>::options.call();
    Deframer::<Status, 64>::read.call();
    ping.call();
    read.call();
    write.call();
    reg_write.call();
    action.call();
    reset.call();
    sync_read.call();
    sync_write::<7>.call();
    ServoId::new.call();
    ServoId::as_raw.call();
    Status::id.call();
    Status::errors.call();
    Status::parameters.call();
    Status::has_voltage_error.call();
    Status::has_sensor_error.call();
    Status::is_overheated.call();
    Status::has_overcurrent.call();
    Status::is_overloaded.call();
    to_sign_magnitude.call();
    from_sign_magnitude.call();
    Goal::to_bytes.call();
    Present::from_status.call();
    Present::angle.call();
    Present::voltage_v.call();
    Imu::euler_roll_x.call();
    Imu::euler_pitch_x.call();
    HostCommand::speeds_pulses_per_s.call();
    Reset::from_raw.call();
    Reset::as_raw.call();
    HostCommand::encode.call();
    TelemetryFormat::new.call();
    TelemetryFormat::with_document_header.call();
    TelemetryFormat::with_big_endian_floats.call();
    TelemetryFormat::encode.call();
    Receiver::<Status, 64>::new.call();
    Receiver::<Telemetry, 128>::with_options.call();
    Receiver::<Status, 64>::abandon.call();
    Receiver::<Status, 64>::latest.call();
    Receiver::<Status, 64>::edge.call();
    Receiver::<Status, 64>::losses.call();
    Receiver::<Status, 64>::frozen_frames.call();
    Receiver::<Status, 64>::counts.call();
    Receiver::<Status, 64>::read.call();
    justfloat.call();
    mit::Ranges::new.call();
    mit::Ranges::with_gains.call();
    mit::Ranges::gains.call();
    mit::Ranges::position_rad.call();
    mit::Ranges::torque_nm.call();
    mit::Ranges::velocity_rad_per_s.call();
    (|ranges: &mit::Ranges, command: &Impedance| mit::Ranges::encode(ranges, command)).call();
    (|ranges: &mit::Ranges, data: &[u8; 8]| mit::Ranges::decode(ranges, data)).call();
    (|ranges: &mit::Ranges, data: &[u8; 5]| mit::Ranges::decode_feedback(ranges, data)).call();
    (|ranges: &mit::Ranges, feedback: &mit::Feedback| {
        mit::Ranges::encode_feedback(ranges, feedback)
    })
    .call();
    Impedance::torque.call();
    referee_system();
}

fn referee_system() {
    Referee::new.call();
    Referee::with_highest_limit_w.call();
    Referee::with_deadlines.call();
    Referee::abandon.call();
    Referee::power_limit_w.call();
    Referee::heat_17mm.call();
    Referee::buffer_energy_j.call();
    Referee::is_live.call();
    Referee::edge.call();
    Referee::counts.call();
    (|referee: &mut Referee, input: &mut &'static [u8], now| Referee::read(referee, input, now))
        .call();
    Deframer::<RefereeMessage, { referee::MAX_FRAME }>::read.call();
    (|message: &RefereeMessage| RefereeMessage::as_raw(message).map(|(_, data)| data.len())).call();
    referee::encode.call();
    Deframer::<VideoRemote, 21>::with_options.call();
    Deframer::<VideoRemote, 21>::read.call();
    hkust::command.call();
    hkust::decode.call();
    hkust::HkustState::energy.call();
    pacific_spirit::command.call();
    pacific_spirit::decode.call();
    pacific_spirit::PacificSpiritState::energy.call();
}
