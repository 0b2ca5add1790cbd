//! The rows of the table: each measured function once, out of line, with arguments the optimiser cannot see.

use crate::meter::instructions;
use crate::paint;
use crate::report::row;
use crate::wiring::{Drive, START, Targets, feedback, row_tick};
use core::hint::black_box;
use cortex_m_semihosting::hprintln;
use drivetrain::chassis::{Mecanum, MecanumWheels};
use drivetrain::control::{Pid, PidConfig};
use drivetrain::dji::{Bus, Config, Feedback, Handle, M3508, State};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::geometry::{
    Body, Gimbal, Point2, Point3, Rotation2, Rotation3, Transform2, Transform3, Twist, Vec2, Vec3,
    World,
};
use drivetrain::math as maths;
use drivetrain::motor::Ingest;
use drivetrain::time::TimeStep;
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};

#[unsafe(no_mangle)]
#[inline(never)]
pub fn row_decode(bus: &mut Bus, frame: &CanFrame, now: Instant) -> Ingest {
    bus.ingest(frame, now)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn row_update(bus: &mut Bus, tick: Tick) {
    bus.update(tick);
}

#[unsafe(no_mangle)]
#[inline(never)]
fn row_pack(bus: &mut Bus) {
    while let Some(frame) = bus.next_frame() {
        black_box(&frame);
    }
}

#[unsafe(no_mangle)]
#[inline(never)]
fn row_pid_step(pid: &mut Pid, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
    pid.step(setpoint, measurement, step)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn row_pid_update(pid: &mut Pid, setpoint: f32, measurement: f32, dt_s: f32) -> f32 {
    pid.step(setpoint, measurement, &TimeStep::of(dt_s))
}

#[unsafe(no_mangle)]
#[inline(never)]
fn row_sin_cos(x: f32) -> (f32, f32) {
    maths::sin_cos(x)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn row_atan2(y: f32, x: f32) -> f32 {
    maths::atan2(y, x)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn row_sqrt(x: f32) -> f32 {
    maths::sqrt(x)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn row_wrap_pi(x: f32) -> f32 {
    maths::wrap_pi(x)
}

/// Functions of one line, out of line.
macro_rules! rows {
    ($($name:ident($($argument:ident: $kind:ty),*) -> $result:ty = $body:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            #[inline(never)]
            fn $name($($argument: $kind),*) -> $result {
                $body
            }
        )*
    };
}

type Place2 = Transform2<Body, World>;
type Place3 = Transform3<Body, World>;

rows! {
    row_mecanum_inverse(m: &Mecanum, twist: &Twist<Body>) -> MecanumWheels<AngularVelocity> = m.inverse(*twist);
    row_mecanum_forward(m: &Mecanum, wheels: &MecanumWheels<AngularVelocity>) -> Twist<Body> = m.forward(*wheels);
    row_apply_2d(place: &Place2, point: &Point2<Body>) -> Point2<World> = place.apply(*point);
    row_compose_2d(place: &Place2, first: &Transform2<Gimbal, Body>) -> Transform2<Gimbal, World> = place.compose(*first);
    row_inverse_2d(place: &Place2) -> Transform2<World, Body> = place.inverse();
    row_apply_3d(place: &Place3, point: &Point3<Body>) -> Point3<World> = place.apply(*point);
    row_compose_3d(place: &Place3, first: &Transform3<Gimbal, Body>) -> Transform3<Gimbal, World> = place.compose(*first);
    row_inverse_3d(place: &Place3) -> Transform3<World, Body> = place.inverse();
}

/// Kinematics and transforms.
pub fn space() {
    let mecanum = black_box(Mecanum::new(0.076, Vec2::new(0.2, 0.18)).unwrap());
    let twist = black_box(Twist::<Body>::new(1.0, 0.5, 0.25));
    let wheels = black_box(mecanum.inverse(twist));
    let angle = black_box(Angle::from_degrees(30.0));
    let place2 = black_box(Place2::new(Rotation2::new(angle), Vec2::new(1.0, 2.0)));
    let first2 = black_box(Transform2::new(Rotation2::new(angle), Vec2::new(0.1, 0.2)));
    let turn = Rotation3::from_quaternion(0.9, 0.1, 0.3, 0.2).unwrap();
    let place3 = black_box(Place3::new(turn, Vec3::new(1.0, 2.0, 3.0)));
    let first3 = black_box(Transform3::new(turn, Vec3::new(0.1, 0.2, 0.3)));
    let (point2, point3) = (Point2::new(1.0, 2.0), Point3::new(1.0, 2.0, 3.0));
    macro_rules! space {
        ($($name:literal $function:ident($($argument:expr),*): $kind:ty;)*) => {
            $(
                row($name, &[instructions($function as $kind, |function, _| {
                    _ = function($($argument),*);
                })]);
            )*
        };
    }
    space! {
        "mecanum_inverse" row_mecanum_inverse(&mecanum, &twist): fn(&Mecanum, &Twist<Body>) -> _;
        "mecanum_forward" row_mecanum_forward(&mecanum, &wheels): fn(&Mecanum, &MecanumWheels<AngularVelocity>) -> _;
        "apply_2d" row_apply_2d(&place2, &point2): fn(&Place2, &Point2<Body>) -> _;
        "compose_2d" row_compose_2d(&place2, &first2): fn(&Place2, &Transform2<Gimbal, Body>) -> _;
        "inverse_2d" row_inverse_2d(&place2): fn(&Place2) -> _;
        "apply_3d" row_apply_3d(&place3, &point3): fn(&Place3, &Point3<Body>) -> _;
        "compose_3d" row_compose_3d(&place3, &first3): fn(&Place3, &Transform3<Gimbal, Body>) -> _;
        "inverse_3d" row_inverse_3d(&place3): fn(&Place3) -> _;
    }
}

/// Feedback, command frames and whole ticks.
pub fn motors() {
    row("decode", &core::array::from_fn::<u32, 8, _>(|index| decode(index as u16 + 1)));
    row("decode_wrap", &[decode_wrap()]);
    let mut bus = Drive::new(Targets::Speed, 0, START).bus;
    let unknown = feedback(0x100, 0, 0);
    row(
        "unknown",
        &[instructions(row_decode as fn(&mut Bus, &CanFrame, Instant) -> Ingest, |decode, _| {
            _ = decode(&mut bus, black_box(&unknown), START);
        })],
    );
    row("pack", &[pack()]);
    row("update_speed", &[update(Targets::Speed)]);
    row("update_cascade", &[update(Targets::Position)]);
    row("tick_speed", &[tick(Targets::Speed, 0, START)]);
    row("tick_speed_limit", &[tick(Targets::HighSpeed, 0, START)]);
    row("tick_speed_checks", &[dearest_tick(Targets::Speed)]);
    row("tick_cascade", &[tick(Targets::Position, 0, START)]);
    row("tick_cascade_limit", &[tick(Targets::FarPosition, 0, START)]);
    row("tick_cascade_checks", &[dearest_tick(Targets::Position)]);
}

/// One frame of motor `id`.
fn decode(id: u16) -> u32 {
    let Drive { mut bus, mut now, .. } = Drive::new(Targets::Speed, 0, START);
    let mut angle = 126;
    instructions(row_decode as fn(&mut Bus, &CanFrame, Instant) -> Ingest, |decode, _| {
        angle += 3;
        now = now + Duration::from_micros(1_000);
        _ = decode(&mut bus, &feedback(id, angle % 8192, 191), now);
    })
}

/// Every frame takes the output shaft across its zero.
fn decode_wrap() -> u32 {
    let Drive { mut bus, now, .. } = Drive::new(Targets::Speed, 0, START);
    instructions(row_decode as fn(&mut Bus, &CanFrame, Instant) -> Ingest, |decode, call| {
        _ = decode(&mut bus, &feedback(1, 126 - (call as u16 + 1) % 2, 0), now);
    })
}

/// One update of a bus that has heard its motors.
fn update(targets: Targets) -> u32 {
    let (bus, tick) = heard(targets);
    instructions(row_update as fn(&mut Bus, Tick), |update, _| update(&mut copy(&bus), tick))
}

/// The command frames of one update.
fn pack() -> u32 {
    let (mut bus, tick) = heard(Targets::Speed);
    bus.update(tick);
    instructions(row_pack as fn(&mut Bus), |pack, _| pack(&mut copy(&bus)))
}

/// Runs for 5 ms, up to an update that has its feedback and its targets and nothing to do but that.
fn heard(targets: Targets) -> (Bus, Tick) {
    let mut drive = Drive::new(targets, 0, START);
    for _ in 0..5 {
        let (bus, frames, tick) = drive.parts();
        row_tick(bus, frames, tick);
        drive.advance();
    }
    drive.hear();
    (drive.bus, Tick::new(drive.now, 0.001))
}

/// Copies a bus, so that every call finds the same one.
fn copy(bus: &Bus) -> Bus {
    // SAFETY: a bus owns nothing but its bytes.
    black_box(unsafe { core::ptr::read(bus) })
}

pub fn tick(targets: Targets, turns: i64, start: Instant) -> u32 {
    let mut drive = Drive::new(targets, turns, start);
    instructions(row_tick as fn(&mut Bus, &[CanFrame; 8], Tick), |whole_tick, _| {
        drive.advance();
        let (bus, frames, tick) = drive.parts();
        whole_tick(bus, frames, tick);
    })
}

/// The dearest ticks of a bus without a fault: each looks at all ages, and has another time step than the one before.
fn dearest_tick(targets: Targets) -> u32 {
    let mut drive = Drive::new(targets, 0, START);
    // A keep-alive is due in each of them, which takes a look around.
    drive.bus = drive.bus.with_keep_alive(Duration::from_micros(1));
    instructions(row_tick as fn(&mut Bus, &[CanFrame; 8], Tick), |whole_tick, call| {
        drive.advance();
        let (bus, frames, tick) = drive.parts();
        let dt_s = if call % 2 == 0 { 0.001 } else { 0.000_999 };
        whole_tick(bus, frames, Tick::new(tick.now(), dt_s));
    })
}

/// Controllers on their own.
pub fn control() {
    let plain = PidConfig::new(0.8, 4.0, 0.001).with_output_limit(20.0).with_integral_limit(10.0);
    let all = plain
        .with_output_range(-20.0, 19.0)
        .with_integral_separation(50.0)
        .with_variable_integral(0.1, 40.0)
        .with_dead_band(0.01)
        .with_feed_forward(0.1, 0.01)
        .with_slew_limit(1e5)
        .with_derivative_filter(100.0);
    let (conditional, all) = (all, all.with_back_calculation(0.1));
    row("pid_step", &[pid_step(plain)]);
    row("pid_update", &[pid_update(plain)]);
    row("pid_limit", &[pid_step(plain.with_output_limit(0.1))]);
    row("pid_options_step", &[pid_step(all)]);
    row("pid_options_update", &[pid_update(all)]);
    // In the dead band; with D of the error; at a limit, with back-calculation and with conditional integration; at the slew
    // limit; at both.
    row("pid_options_band", &[pid_step(all.with_dead_band(1.0))]);
    row("pid_options_on_error", &[pid_step(all.with_derivative_on_error())]);
    row("pid_options_limit", &[pid_step(all.with_output_range(-0.01, 0.02))]);
    row("pid_options_held", &[pid_step(conditional.with_output_range(-0.01, 0.02))]);
    row("pid_options_slew", &[pid_step(all.with_slew_limit(10.0))]);
    let both = all.with_slew_limit(10.0).with_output_range(-0.02, 0.01);
    row("pid_options_both", &[pid_step(both)]);
    row("pid_options_worst", &[pid_step(both.with_period(0.375))]);
    row("pid_circle_step", &[pid_step(all.with_period(360.0))]);
    row("pid_circle_update", &[pid_update(all.with_period(360.0))]);
    row("pid_circle_across", &[pid_step_to(361.0, all.with_period(360.0))]);
    // The measurement passes the end of the circle in every step, and the setpoint is on the other side of it.
    let across = |call| if call % 2 == 0 { (0.1, 1.9) } else { (1.9, 0.1) };
    row("pid_circle_wrap", &[pid_step_through(all.with_period(2.0), across)]);
    // Errors and changes of the measurement of up to three turns.
    row("pid_circle_turns", &[pid_step(all.with_period(0.375))]);
}

pub fn swinging(call: u32) -> f32 {
    [0.5, 1.25, 0.75, 1.5][call as usize % 4]
}

fn pid_step(config: PidConfig) -> u32 {
    pid_step_to(1.0, config)
}

fn pid_step_to(setpoint: f32, config: PidConfig) -> u32 {
    pid_step_through(config, |call| (setpoint, swinging(call)))
}

fn pid_step_through(config: PidConfig, way: impl Fn(u32) -> (f32, f32)) -> u32 {
    let mut pid = Pid::new(black_box(config)).unwrap();
    let step = TimeStep::new(0.001, 0.1);
    let (setpoint, measurement) = way(3);
    pid.step(setpoint, measurement, &step);
    instructions(row_pid_step as fn(&mut Pid, f32, f32, &TimeStep) -> f32, |pid_step, call| {
        let (setpoint, measurement) = way(call);
        pid_step(&mut pid, setpoint, measurement, &step);
    })
}

fn pid_update(config: PidConfig) -> u32 {
    let mut pid = Pid::new(black_box(config)).unwrap();
    pid.step(1.0, 0.5, &TimeStep::of(0.001));
    instructions(row_pid_update as fn(&mut Pid, f32, f32, f32) -> f32, |pid_update, call| {
        pid_update(&mut pid, 1.0, swinging(call), 0.001);
    })
}

/// Elementary functions, over the turn.
pub fn math() {
    let angle = |call: u32| (call as f32 - 500.0) * (core::f32::consts::PI / 500.0);
    row(
        "sin_cos",
        &[instructions(row_sin_cos as fn(f32) -> (f32, f32), |sin_cos, call| {
            _ = sin_cos(angle(call));
        })],
    );
    row(
        "atan2",
        &[instructions(row_atan2 as fn(f32, f32) -> f32, |atan2, call| {
            _ = atan2(angle(call), 1.0);
        })],
    );
    row(
        "sqrt",
        &[instructions(row_sqrt as fn(f32) -> f32, |sqrt, call| {
            _ = sqrt(call as f32);
        })],
    );
    row(
        "wrap_pi",
        &[instructions(row_wrap_pi as fn(f32) -> f32, |wrap, call| {
            _ = wrap(angle(call) * 10.0);
        })],
    );
}

/// Bytes of stack, by paint.
pub fn stack() {
    let mut drive = Drive::new(Targets::Position, 0, START);
    let frame = feedback(1, 200, 0);
    let (bus, _, tick) = drive.parts();
    let decode = paint::stack(|| {
        _ = row_decode(bus, &frame, tick.now());
    });
    drive.advance();
    let (bus, _, tick) = drive.parts();
    let update = paint::stack(|| row_update(bus, tick));
    drive.advance();
    let (bus, frames, tick) = drive.parts();
    let whole = paint::stack(|| row_tick(bus, frames, tick));
    let mut drive = Drive::new(Targets::FarPosition, 0, START);
    drive.advance();
    let (bus, frames, tick) = drive.parts();
    let limited = paint::stack(|| row_tick(bus, frames, tick));
    hprintln!("stack row_decode {}", decode);
    hprintln!("stack row_update {}", update);
    hprintln!("stack row_tick {}", whole.max(limited));
}

/// Bytes of the public types.
pub fn sizes() {
    macro_rules! sizes {
        ($($name:literal $type:ty),* $(,)?) => {
            $(hprintln!("size {} {}", $name, size_of::<$type>());)*
        };
    }
    sizes!(
        "Bus" Bus, "Bus8" Bus<(), 8>, "Bus1" Bus<(), 1>, "Config" Config<M3508>, "Handle" Handle<M3508>, "State" State, "Feedback" Feedback,
        "Pid" Pid, "PidConfig" PidConfig,
        "Mecanum" Mecanum, "Transform2" Place2, "Transform3" Place3, "Position" Position, "CanFrame" CanFrame, "Instant" Instant, "Tick" Tick,
    );
}
