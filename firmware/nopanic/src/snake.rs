//! Joints that hold their own position loop.

use crate::functions::{device, family};
use crate::opaque::{Function, any};
use core::hint::black_box;
use drivetrain::snake::*;

pub fn call_all() {
    Register::from_raw.call();
    Register::as_raw.call();
    Register::is_writable.call();
    Command::frame.call();
    decode_command.call();
    Command::is_safe.call();
    decode_reply.call();
    Register::reply.call();
    Config::new.call();
    Config::reversed.call();
    Config::with_speed.call();
    Config::with_stall.call();
    Config::with_current.call();
    Config::with_acceleration.call();
    Config::with_deceleration.call();
    Config::with_mode.call();
    Config::current.call();
    Config::acceleration.call();
    Config::deceleration.call();
    Config::mode.call();
    Config::id.call();
    Joints::new.call();
    Joints::with_timeouts.call();
    Joints::with_reply_timeout.call();
    Joints::with_frames_per_update.call();
    Joints::with_bit_rate.call();
    Joints::with_tick_rate.call();
    Joints::load.call();
    Joints::with_loopback.call();
    Joints::health.call();
    Joints::capabilities.call();
    Joints::conditions.call();
    Joints::next_edge.call();
    Joints::attach.call();
    Joints::detach.call();
    Joints::ingest.call();
    Joints::update.call();
    Joints::next_frame.call();
    Joints::requeue.call();
    Joints::state.call();
    Joints::link.call();
    Joints::is_joint_armed.call();
    Joints::awaited.call();
    joints.call();
    Joints::counters.call();
    Joints::set_position.call();
    Joints::set_pulses.call();
    Joints::set_speed.call();
    Joints::set_settings.call();
    Joints::relax.call();
    Joints::zero.call();
    Joints::set_offset.call();
    Joints::offset.call();
    Joints::read.call();
    Joints::answer.call();
    family::<Joints>();
    device::<Joints>();
}

/// `Command::decode` borrows its argument.
fn decode_command() -> Option<Command> {
    Command::decode(&any::<[u8; 8]>()[..any::<usize>() & 7])
}

/// `Register::from_reply` borrows its argument.
fn decode_reply() -> Option<(Register, i32)> {
    Register::from_reply(&any::<[u8; 8]>()[..any::<usize>() & 7])
}

/// `Joints::joints` returns a borrowing iterator.
fn joints(all: &Joints) {
    for joint in all.joints() {
        black_box(joint);
    }
}
