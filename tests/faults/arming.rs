//! F68 and F69: who may arm, and how a motor starts then.
//!
//! Neither compiles at 330c201; each comment says what was seen there.

use crate::case::{Case, cases, saw};
use crate::rig::{SPEED, at_ms, at_once, feedback, rpm, step, words};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage, Handle, M3508};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{ArmError, Devices, TargetError};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Fault, Line, MotorConfig, Sender, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::Angle;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f68_a_program_that_arms_in_each_tick_never_rearms_what_ran_away,
    f68_after_any_trip_arming_is_granted_when_nobody_asked_for_100_ms,
    f69_arming_opens_the_output_from_zero_whatever_target_stands,
    f69_a_position_loop_starts_from_where_the_shaft_is,
];

/// At 330c201: driven in 3792 of the 3795 ticks after the first trip.
#[cfg_attr(test, test)]
fn f68_a_program_that_arms_in_each_tick_never_rearms_what_ran_away() {
    let world = Simulation::new(1);
    let key = world.attach(MotorConfig::m3508(1)).unwrap();
    world.fault(Fault::ReversedTorque(key), ..).unwrap();
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(SPEED)).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let (mut word, mut ticks, mut driven, mut tripped) = (0, 0, 0, None);
    let mut turn = |runner: &mut Runner<_, _, Bus>, asks: bool| {
        world.advance_with(Duration::from_millis(1), |record| {
            if record.sender == Sender::Controller && record.line == Line::Can1 {
                word = words(&record.frame)[0];
            }
        });
        runner.poll(16);
        let tick = runner.due().unwrap();
        let was_armed = runner.is_armed();
        let outcome = if asks { runner.arm(tick) } else { Ok(()) };
        _ = runner.device_mut().set_velocity(wheel, rpm(200.0));
        runner.tick(tick);
        (was_armed, outcome, word != 0)
    };
    for _ in 0..4_000 {
        let (was_armed, outcome, drives) = turn(&mut runner, true);
        if tripped.is_none() {
            tripped = (ticks > 50 && !was_armed).then_some(ticks);
        }
        ticks += 1;
        if let Some(since) = tripped {
            assert_eq!(outcome, Err(ArmError::NotReleased), "tick {ticks}");
            // What the tick before sent is on its way.
            driven += u32::from(drives && ticks > since + 2);
        }
    }
    let tripped = tripped.unwrap();
    assert!(tripped < 400 && driven == 0, "tripped in tick {tripped}, driven in {driven} more");
    // Released for 100 ms it is armed, and runs away again.
    for _ in 0..100 {
        _ = turn(&mut runner, false);
    }
    assert_eq!(turn(&mut runner, true).1, Ok(()));
    let again = (0..400).filter(|_| turn(&mut runner, true).2).count();
    assert!((50..350).contains(&again), "{again}");
    saw(format!("runs away, tripped in tick {tripped}; asked in each of 4000: driven in {driven}"));
}

/// Two buses as one device.
type Robot = [Bus; 2];

/// A way to ask for arming, with the refusal, and something that trips the motor of the first bus in a tick that begins at `ms`.
type Ask = fn(&mut Robot, Handle<M3508>, Instant) -> Option<ArmError>;
type Trip = fn(&mut Robot, u64);

/// At 330c201: granted in the tick after each of them.
#[cfg_attr(test, test)]
fn f68_after_any_trip_arming_is_granted_when_nobody_asked_for_100_ms() {
    let asks: [(&str, Ask); 3] = [
        ("all devices", |robot, _, now| robot.arm(now).err()),
        ("one device", |robot, _, now| robot[0].arm(now).err()),
        ("one motor", |robot, wheel, now| robot[0].arm_only(&[wheel.erase()], now).err()),
    ];
    let trips: [(&str, u64, Trip); 5] = [
        ("a fault that is over", 30, |robot, ms| {
            let fault = CanFrame::standard(0x201, [0, 0, 0, 0, 0, 0, 25, 3]).unwrap();
            _ = robot.ingest(&fault, at_ms(ms));
        }),
        ("an emergency stop that is cleared", 0, |robot, _| {
            robot.emergency_stop();
            robot.clear_emergency_stop();
        }),
        ("feedback that was lost", 150, |_, _| {}),
        ("time that stood", 0, |robot, ms| robot.update(Tick::new(at_ms(ms - 1), 0.001))),
        ("time that went back", 0, |robot, ms| robot.update(Tick::new(at_ms(ms - 9), 0.001))),
    ];
    for (way, ask) in asks {
        for (what, lasts_ms, trip) in trips {
            let what = format!("{what}, {way}");
            let mut robot: Robot = [Bus::new(), Bus::new()];
            let wheel = robot[0].attach(at_once::<M3508>(1)).unwrap();
            robot[1].attach(at_once::<M3508>(5)).unwrap();
            let (mut ms, mut word) = (0, 0);
            // One tick: feedback, or none of the first motor; a request; a target; the word.
            let mut tick = |robot: &mut Robot, hears: bool, asks: bool| {
                ms += 1;
                _ = robot.ingest(&feedback(0x205, 0, 0), at_ms(ms));
                if hears {
                    _ = robot.ingest(&feedback(0x201, 0, 0), at_ms(ms));
                }
                let refused = asks.then(|| ask(robot, wheel, at_ms(ms))).flatten();
                _ = robot[0].set_raw(wheel, 700);
                robot.update(Tick::new(at_ms(ms), 0.001));
                while let Some(frame) = robot.next_frame(0) {
                    word = if frame.header() == 0x200 { words(&frame)[0] } else { word };
                }
                (refused, word)
            };
            for _ in 0..100 {
                assert_eq!(
                    tick(&mut robot, true, true),
                    (None, 700),
                    "{what}: a switch that is on"
                );
            }
            // The application disarms, and arms again without a pause.
            robot[0].disarm();
            assert_eq!(tick(&mut robot, true, true), (None, 700), "{what}");
            trip(&mut robot, 102);
            let is_lost = what.starts_with("feedback");
            for _ in 0..lasts_ms {
                _ = tick(&mut robot, !is_lost, true);
            }
            for _ in 0..1_000 {
                let (refused, word) = tick(&mut robot, true, true);
                let lasts = matches!(refused, Some(ArmError::Missing(_) | ArmError::Faulty(_)));
                assert!(lasts || refused == Some(ArmError::NotReleased), "{what}: {refused:?}");
                assert_eq!(word, 0, "{what}: driven by a switch that stays on");
            }
            assert!(robot[0].set_raw(wheel, 700).is_err(), "{what}");
            // 99 ms without a request are one too few, and the request that is refused counts.
            for (released, refused) in [(98, Some(ArmError::NotReleased)), (99, None)] {
                for _ in 0..released {
                    assert_eq!(tick(&mut robot, true, false), (None, 0), "{what}");
                }
                assert_eq!(tick(&mut robot, true, true).0, refused, "{what}: {released} ms");
            }
            assert_eq!(tick(&mut robot, true, true), (None, 700), "{what}");
        }
    }
    saw("faults, stops, losses, time: refused for as long as somebody asks, granted after 100 ms");
}

/// What the output may be after so long: the share of the range that is open, counted in units of 1.024 ms, half a word more
/// for rounding.
fn open_raw(since_us: u64, opening_us: u64, limit: i16) -> i16 {
    let share = (since_us + 2 * 1_024) as f32 / opening_us as f32;
    #[expect(clippy::cast_possible_truncation, reason = "at most the limit")]
    let open = (share.min(1.0) * f32::from(limit)).ceil() as i16;
    open
}

/// A motor that is asked for 450 rpm, or for an angle 90 degrees away, in each tick, before it is armed and after. At 330c201:
/// 0, 0, then 16384 of 16384.
#[cfg_attr(test, test)]
fn f69_arming_opens_the_output_from_zero_whatever_target_stands() {
    const QUARTER: Angle = Angle::from_radians(core::f32::consts::FRAC_PI_2);
    type Set = fn(&mut Bus, Handle<M3508>) -> Result<(), TargetError>;
    let goals: [(&str, Set); 4] = [
        ("450 rpm", |bus, wheel| bus.set_velocity(wheel, rpm(450.0))),
        ("-450 rpm", |bus, wheel| bus.set_velocity(wheel, rpm(-450.0))),
        ("90 degrees", |bus, wheel| bus.set_position(wheel, Position::from_angle(QUARTER))),
        ("a word", |bus, wheel| bus.set_raw(wheel, 16_384)),
    ];
    let position = PidConfig::new(40.0, 0.0, 0.0);
    let config = Config::<M3508>::new(1).position_loop(position, PidConfig::new(2.0, 40.0, 0.0));
    let (usual, slow) = (Duration::from_millis(200), Duration::from_secs(1));
    for (opening, config) in [
        (usual, config),
        (usual, config.reversed()),
        (slow, config.with_opening(slow)),
        (Duration::ZERO, config.with_opening(Duration::ZERO)),
    ] {
        for (what, set) in goals {
            let mut bus = Bus::new();
            let wheel = bus.attach(config).unwrap();
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(1));
            let (mut ms, mut word) = (1, 0_i16);
            // The shaft is blocked, so the loops ask for all there is.
            let mut tick = |bus: &mut Bus, hears: bool| {
                ms += 1;
                if hears {
                    _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
                }
                _ = set(bus, wheel);
                bus.update(Tick::new(at_ms(ms), 0.001));
                let frames = std::iter::from_fn(|| bus.next_frame());
                word = frames.last().map_or(word, |frame| words(&frame)[0]);
                (ms, word)
            };
            let mut now = tick(&mut bus, true).0;
            // Armed, armed again after it was disarmed, and lost and armed again.
            for round in 0..3 {
                assert_eq!(bus.arm(at_ms(now)), Ok(()), "{what}: round {round}");
                let armed = now;
                let (mut most, mut last) = (0, 0);
                for _ in 0..opening.as_micros() / 1_000 + 20 {
                    let (ms, word) = tick(&mut bus, true);
                    now = ms;
                    let open = open_raw((ms - armed) * 1_000, opening.as_micros(), 16_384);
                    assert!(word.abs() <= open, "{what}: {word} of {open} after {} ms", ms - armed);
                    assert!(word.abs() >= last || word.abs() >= most, "{what}: it goes on opening");
                    (last, most) = (word.abs(), most.max(word.abs()));
                }
                assert_eq!(most, 16_384, "{what}: in the end, all of it");
                if round == 0 {
                    bus.disarm();
                } else {
                    (0..150).for_each(|_| _ = tick(&mut bus, false));
                    (0..120).for_each(|_| now = tick(&mut bus, true).0);
                }
            }
        }
    }
    saw(
        "0.2 s after arming, again and after a loss: no word beyond the open share, then all of it",
    );
}

/// A yaw motor that stands 90 degrees away from its target when it is armed. At 330c201, the whole voltage in the third tick.
#[cfg_attr(test, test)]
fn f69_a_position_loop_starts_from_where_the_shaft_is() {
    let run = |opening: Duration| {
        let world = Simulation::new(4);
        let key = world.attach(MotorConfig::gm6020_voltage(1)).unwrap();
        let (to_angle, volts) = (PidConfig::new(15.0, 0.0, 0.0), PidConfig::new(1.0, 5.0, 0.0));
        let yaw = Config::<Gm6020Voltage>::new(1).position_loop(to_angle, volts);
        let mut bus = Bus::new();
        let yaw = bus.attach(yaw.with_opening(opening)).unwrap();
        let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
        let mut words_ms = Vec::new();
        for ms in 0..1_500_u64 {
            world.advance(Duration::from_millis(1));
            runner.poll(16);
            let tick = runner.due().unwrap();
            if ms == 100 {
                runner.arm(tick).unwrap();
            }
            _ = runner.device_mut().set_angle(yaw, Angle::from_degrees(90.0));
            runner.tick(tick);
            words_ms.push(world.motor(key).unwrap().command);
        }
        let degrees = runner.device().state(yaw).unwrap().position.as_angle().as_degrees();
        assert!((degrees - 90.0).abs() < 1.0, "{degrees}");
        words_ms
    };
    // Before a blocked shaft and far within the range, the velocity that is asked for opens as well: 8 rad/s per rad and 0.6 A
    // per rad/s are 7.54 A.
    let (gentle, proportional) = (PidConfig::new(8.0, 0.0, 0.0), PidConfig::new(0.6, 0.0, 0.0));
    let mut bus = Bus::new();
    let config = Config::<M3508>::new(1).position_loop(gentle, proportional);
    let wheel = bus.attach(config).unwrap();
    _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(1));
    bus.arm(at_ms(1)).unwrap();
    let mut word = 0;
    for ms in 2..300 {
        _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
        let quarter = Angle::from_radians(core::f32::consts::FRAC_PI_2);
        bus.set_position(wheel, Position::from_angle(quarter)).unwrap();
        word = step(&mut bus, ms).map_or(word, |words| words[0]);
        let open = open_raw((ms - 1) * 1_000, 200_000, 6_177);
        assert!(word <= open, "{word} of {open} after {} ms", ms - 1);
    }
    assert!((6_170..=6_177).contains(&word), "{word}");

    let (soft, hard) = (run(Duration::from_millis(200)), run(Duration::ZERO));
    for (ms, word) in (0_u64..).zip(&soft) {
        let open = open_raw(ms.saturating_sub(100) * 1_000, 200_000, 25_000);
        assert!(word.abs() <= i32::from(open), "{word} of {open} at {ms} ms");
    }
    let jump = |words: &[i32]| words.windows(2).map(|pair| (pair[1] - pair[0]).abs()).max();
    let (soft, hard) = (jump(&soft).unwrap(), jump(&hard).unwrap());
    // The range opens once in a round of 12 updates: by 6 %, and so does what the position loop asks for.
    assert!(soft < 4_000 && hard > 20_000, "the largest step of the output: {soft}, {hard}");
    saw(format!("90 degrees away: steps of {soft} of 25000 at most, {hard} without an opening"));
}
