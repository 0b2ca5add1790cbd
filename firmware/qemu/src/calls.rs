//! What a program calls in its loop beside the tick: reads of the state, targets, edges; and ticks of a bus at rest.

use crate::meter::instructions;
use crate::report::row;
use crate::wiring::{Drive, START, Targets, row_tick};
use drivetrain::dji::{Bus, Handle, M3508, State};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Condition, MotorName, TargetError};
use drivetrain::time::{Edge, Tick};
use drivetrain::units::{Angle, AngularVelocity, Current};

type Wheel = Handle<M3508>;

#[unsafe(no_mangle)]
#[inline(never)]
fn call_state(bus: &Bus, wheel: Wheel) -> Option<State> {
    bus.state(wheel)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn call_velocity(bus: &Bus, wheel: Wheel) -> f32 {
    bus.state(wheel).map_or(0.0, |state| state.velocity.as_rad_per_s())
}

#[unsafe(no_mangle)]
#[inline(never)]
fn call_set_velocity(bus: &mut Bus, wheel: Wheel, rad_per_s: f32) -> Result<(), TargetError> {
    bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(rad_per_s))
}

#[unsafe(no_mangle)]
#[inline(never)]
fn call_set_position(bus: &mut Bus, wheel: Wheel, position: &Position) -> Result<(), TargetError> {
    bus.set_position(wheel, *position)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn call_set_angle(bus: &mut Bus, wheel: Wheel, angle: Angle) -> Result<(), TargetError> {
    bus.set_angle(wheel, angle)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn call_set_current(bus: &mut Bus, wheel: Wheel, amperes: f32) -> Result<(), TargetError> {
    bus.set_current(wheel, Current::from_amperes(amperes))
}

#[unsafe(no_mangle)]
#[inline(never)]
fn call_set_raw(bus: &mut Bus, wheel: Wheel, word: i16) -> Result<(), TargetError> {
    bus.set_raw(wheel, word)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn call_next_edge(bus: &mut Bus) -> Option<Edge<Condition, MotorName>> {
    bus.next_edge()
}

/// Reads and targets, each a mean over the eight motors.
fn calls() {
    let mut drive = Drive::new(Targets::Position, 0, START);
    let motors = drive.motors();
    let bus = &mut drive.bus;
    while bus.next_edge().is_some() {}
    row(
        "state",
        &motors.map(|wheel| {
            instructions(call_state as fn(&Bus, Wheel) -> _, |f, _| {
                _ = f(bus, wheel);
            })
        }),
    );
    row(
        "state_velocity",
        &motors.map(|wheel| {
            instructions(call_velocity as fn(&Bus, Wheel) -> _, |f, _| {
                _ = f(bus, wheel);
            })
        }),
    );
    let position = Position::from_turns(3);
    row(
        "set_position",
        &motors.map(|wheel| {
            instructions(call_set_position as fn(&mut Bus, Wheel, &Position) -> _, |f, _| {
                _ = f(bus, wheel, &position);
            })
        }),
    );
    let all = motors.map(|wheel| {
        bus.set_velocity(wheel, AngularVelocity::ZERO).unwrap();
        instructions(call_set_velocity as fn(&mut Bus, Wheel, f32) -> _, |f, _| {
            _ = f(bus, wheel, 1.0)
        })
    });
    row("set_velocity", &all);
    let wheel = motors[0];
    let angle = instructions(call_set_angle as fn(&mut Bus, Wheel, Angle) -> _, |f, _| {
        _ = f(bus, wheel, Angle::from_radians(0.5));
    });
    row("set_angle", &[angle]);
    let current = instructions(call_set_current as fn(&mut Bus, Wheel, f32) -> _, |f, _| {
        _ = f(bus, wheel, 1.0);
    });
    row("set_current", &[current]);
    let raw = instructions(call_set_raw as fn(&mut Bus, Wheel, i16) -> _, |f, _| {
        _ = f(bus, wheel, 100);
    });
    row("set_raw", &[raw]);
    row("next_edge", &[instructions(call_next_edge as fn(&mut Bus) -> _, |f, _| _ = f(bus))]);
}

/// A whole tick of eight motors that are heard and not armed.
fn disarmed() -> u32 {
    let mut drive = Drive::new(Targets::Speed, 0, START);
    drive.bus.disarm();
    instructions(row_tick as fn(&mut Bus, &[CanFrame; 8], Tick), |tick, _| {
        drive.advance();
        let (bus, frames, now) = drive.parts();
        tick(bus, frames, now);
    })
}

/// A whole tick whose step is never the one before: it jitters by microseconds, as a `Ticker` measures it.
fn jitter() -> u32 {
    let mut drive = Drive::new(Targets::Speed, 0, START);
    instructions(row_tick as fn(&mut Bus, &[CanFrame; 8], Tick), |tick, call| {
        drive.advance();
        let (bus, frames, now) = drive.parts();
        let dt_s = 0.001 + 1e-6 * (call % 7) as f32;
        tick(bus, frames, Tick::new(now.now(), dt_s));
    })
}

pub fn rows() {
    calls();
    row("tick_disarmed", &[disarmed()]);
    row("tick_jitter", &[jitter()]);
}
