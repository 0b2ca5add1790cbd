//! Defects that a review of this crate found, each as a case of its own.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Current, Gm6020Voltage, Handle, M3508, Model};
use drivetrain::encoder::{GearRatio, Position};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    ArmError, CanDevice, Condition, HealthConfig, Ingest, Link, Measured, MotorName, Reaction,
    TargetError,
};
use drivetrain::runner::{EmergencyStop, Nb, Runner};
use drivetrain::time::{Duration, Edge, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity, Current, Voltage};
use embedded_can::ErrorKind;
use std::cell::Cell;

fn us(micros: u64) -> Instant {
    Instant::from_micros(micros)
}

fn feedback(id: u16, angle: u16, rpm: i16) -> CanFrame {
    let ([a, b], [c, d]) = (angle.to_be_bytes(), rpm.to_be_bytes());
    CanFrame::standard(id, [a, b, c, d, 0, 0, 25, 0]).unwrap()
}

fn hear(bus: &mut Bus, frame: CanFrame, micros: u64) {
    assert_eq!(bus.ingest(&frame, us(micros)), Ingest::Taken);
}

fn step(bus: &mut Bus, micros: u64) {
    bus.update(Tick::new(us(micros), 0.001));
}

fn sent(bus: &mut Bus) -> Vec<(u32, [i16; 4])> {
    let word = |frame: &CanFrame, slot: usize| {
        i16::from_be_bytes([frame.bytes()[2 * slot], frame.bytes()[2 * slot + 1]])
    };
    std::iter::from_fn(|| bus.next_frame())
        .map(|frame| (frame.header(), [0, 1, 2, 3].map(|slot| word(&frame, slot))))
        .collect()
}

/// A motor whose output range opens at once, so that the first word after arming is the whole one.
fn at_once<M: Model>(id: u8) -> Config<M> {
    Config::new(id).with_opening(Duration::ZERO)
}

fn armed(config: Config<M3508>) -> (Bus, Handle<M3508>) {
    let mut bus = Bus::new();
    let motor = bus.attach(config).unwrap();
    hear(&mut bus, feedback(0x200 + u16::from(config.id()), 0, 0), 1_000);
    bus.arm(us(1_000)).unwrap();
    (bus, motor)
}

/// Feeds one frame a millisecond with the error code that `code` gives, and returns the edges of each update.
fn edges_of_errors(
    bus: &mut Bus,
    to_ms: u64,
    code: impl Fn(u64) -> u8,
) -> Vec<(u64, Edge<Condition, MotorName>)> {
    let mut edges = Vec::new();
    for ms in 2..to_ms {
        let error = CanFrame::standard(0x201, [0, 0, 0, 0, 0, 0, 25, code(ms)]).unwrap();
        hear(bus, error, ms * 1_000);
        step(bus, ms * 1_000);
        edges.extend(std::iter::from_fn(|| bus.next_edge()).map(|edge| (ms, edge)));
    }
    edges
}

struct Recorder(Vec<CanFrame>);

impl embedded_can::nb::Can for Recorder {
    type Frame = CanFrame;
    type Error = ErrorKind;
    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        self.0.push(*frame);
        Ok(None)
    }
    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        Err(nb::Error::WouldBlock)
    }
}

#[test]
fn the_emergency_stop_reaches_every_part_also_when_one_is_stopped_already() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let clock = Cell::new(us(1_000));
    let (mut left, mut right) = (Bus::new(), Bus::new());
    left.attach(at_once::<M3508>(1)).unwrap();
    let wheel = right.attach(at_once::<M3508>(5)).unwrap();
    hear(&mut left, feedback(0x201, 0, 0), 1_000);
    hear(&mut right, feedback(0x205, 0, 0), 1_000);
    let mut runner =
        Runner::new(Nb(Recorder(Vec::new())), &clock, (left, right)).with_emergency_stop(&STOP);
    let tick = Tick::new(us(1_000), 0.001);
    runner.arm(tick).unwrap();
    runner.device_mut().0.emergency_stop();
    runner.device_mut().1.set_raw(wheel, 9_000).unwrap();
    STOP.set();
    runner.tick(tick);
    assert!(runner.port_mut().0.0.iter().all(|frame| *frame.bytes() == [0; 8]));
}

#[test]
fn a_ramp_starts_at_zero_also_when_frames_are_stamped_after_the_tick() {
    let config = Config::<M3508>::new(1)
        .speed_loop(PidConfig::new(100.0, 0.0, 0.0))
        .with_resume()
        .with_opening(Duration::from_secs(2));
    let (mut bus, motor) = armed(config);
    for ms in 2..150 {
        step(&mut bus, ms * 1_000);
    }
    for ms in 150..200_u64 {
        hear(&mut bus, feedback(0x201, 0, 0), ms * 1_000 + 300);
        _ = bus.set_velocity(motor, AngularVelocity::from_rad_per_s(10.0));
        step(&mut bus, ms * 1_000);
        let most = sent(&mut bus).iter().map(|frame| frame.1[0]).max().unwrap_or(0);
        assert!(most < 500, "{most} of 16384 at {ms} ms of a ramp of 2 s");
    }
}

#[test]
fn a_speed_loop_does_not_wind_up_behind_the_limit_of_a_ramp() {
    let config = Config::<M3508>::new(1)
        .speed_loop(PidConfig::new(0.1, 50.0, 0.0))
        .with_resume()
        .with_opening(Duration::from_secs(2));
    let (mut bus, motor) = armed(config);
    for ms in 2..150 {
        step(&mut bus, ms * 1_000);
    }
    let mut at_release = 0;
    for ms in 150..3_000_u64 {
        // Blocked for a second, then exactly at its target.
        let rpm = if ms < 1_150 { 0 } else { 184 };
        hear(&mut bus, feedback(0x201, 0, rpm), ms * 1_000);
        _ = bus.set_velocity(motor, AngularVelocity::from_rad_per_s(1.0));
        step(&mut bus, ms * 1_000);
        let raw = sent(&mut bus).last().map_or(0, |frame| frame.1[0]);
        if ms == 1_149 {
            at_release = raw;
        }
        if ms > 1_170 {
            assert!(raw <= at_release + 400, "{raw} at {ms} ms, {at_release} when it was released");
        }
    }
    assert!((7_000..9_500).contains(&at_release), "{at_release}: half of the ramp");
}

#[test]
fn a_target_refused_for_late_feedback_takes_the_older_one_away() {
    let (mut bus, motor) = armed(at_once(1));
    bus.set_raw(motor, 5_000).unwrap();
    for ms in 2..15 {
        step(&mut bus, ms * 1_000);
    }
    assert_eq!(bus.set_raw(motor, 0), Err(TargetError::NoFeedback));
    _ = sent(&mut bus);
    hear(&mut bus, feedback(0x201, 0, 0), 15_000);
    step(&mut bus, 15_000);
    assert!(sent(&mut bus).iter().all(|frame| frame.1 == [0; 4]));
    let nan = Current::from_amperes(f32::NAN);
    assert_eq!(bus.set_current(motor, nan), Err(TargetError::NotFinite));
}

#[test]
fn frames_that_waited_for_a_stalled_loop_never_make_up_a_turn_silently() {
    for stall_us in (1_000..40_000_u64).step_by(333) {
        let mut bus = Bus::new();
        let wheel = bus.attach(at_once::<M3508>(1)).unwrap();
        // 9000 rpm, one frame a millisecond, none lost; all of them are polled when the stall is over.
        let counts = |ms: u64| i64::try_from(ms * 12_288 / 10).unwrap();
        let frame = |ms| feedback(0x201, u16::try_from(counts(ms) % 8192).unwrap(), 9_000);
        hear(&mut bus, frame(0), 10_000);
        let frames = stall_us / 1_000;
        for ms in 1..=frames {
            hear(&mut bus, frame(ms), 10_000 + stall_us);
        }
        let state = bus.state(wheel).unwrap();
        assert!(
            state.rotor_counts == counts(frames) || state.ambiguous_gaps > 0,
            "stalled for {stall_us} us"
        );
    }
}

#[test]
fn frames_delayed_on_the_bus_are_not_followed_blindly() {
    let mut bus = Bus::new();
    let wheel = bus.attach(at_once::<M3508>(1)).unwrap();
    hear(&mut bus, feedback(0x201, 0, 9_256), 10_000);
    hear(&mut bus, feedback(0x201, 4_200, 9_256), 13_200); // 4200 counts take 3.32 ms
    assert_eq!(bus.state(wheel).unwrap().rotor_counts, 4_200);
}

#[test]
fn a_zeroed_gm6020_keeps_its_angle_through_a_dropout() {
    let mut bus = Bus::new();
    let gains = PidConfig::new(1.0, 0.0, 0.0);
    let yaw = bus.attach(at_once::<Gm6020Voltage>(1).position_loop(gains, gains)).unwrap();
    hear(&mut bus, feedback(0x205, 1_000, 0), 1_000);
    bus.zero(yaw).unwrap();
    for ms in 2..150 {
        step(&mut bus, ms * 1_000);
    }
    for ms in 150..170 {
        hear(&mut bus, feedback(0x205, 1_000, 0), ms * 1_000);
        step(&mut bus, ms * 1_000);
    }
    bus.arm(us(169_000)).unwrap();
    assert_eq!(bus.set_angle(yaw, Angle::ZERO), Ok(()));
}

#[test]
fn the_order_of_configuration_does_not_matter() {
    let mut bus = Bus::new();
    let direct = at_once::<M3508>(1).with_torque_constant(0.5).with_gear(GearRatio::DIRECT);
    let wheel = bus.attach(direct).unwrap();
    let ten_amperes = CanFrame::standard(0x201, [0, 0, 0, 0, 0x20, 0, 0, 0]).unwrap();
    hear(&mut bus, ten_amperes, 1_000);
    assert!((bus.state(wheel).unwrap().torque_nm - 5.0).abs() < 1e-5);

    let limited = at_once::<Gm6020Voltage>(1).with_voltage_limit(Voltage::from_volts(6.0));
    let yaw = bus.attach(limited.with_nominal_voltage(Voltage::from_volts(25.2))).unwrap();
    hear(&mut bus, feedback(0x205, 0, 0), 1_000);
    bus.arm(us(1_000)).unwrap();
    bus.set_voltage(yaw, Voltage::from_volts(25.0)).unwrap();
    step(&mut bus, 2_000);
    let raw = sent(&mut bus).iter().find(|frame| frame.0 == 0x1FF).unwrap().1[0];
    assert_eq!(raw, 5_952); // 6 V of 25.2 V
}

/// The target has the time of the arming: an update at that time sends it, one before it would make it younger.
#[test]
fn a_target_set_after_an_arming_counts_from_the_arming_on_and_an_update_before_it_trips() {
    for (update, word) in [(1_003, 77), (1_002, 0), (1_000, 0), (0, 0)] {
        let mut bus = Bus::new();
        let motor = bus.attach(at_once::<M3508>(1)).unwrap();
        hear(&mut bus, feedback(0x201, 0, 0), 1_000);
        bus.arm(us(1_003)).unwrap();
        bus.set_raw(motor, 77).unwrap();
        step(&mut bus, update);
        assert_eq!(sent(&mut bus), [(0x200, [word, 0, 0, 0])], "{update}");
        let (is_armed, is_lost) = (word != 0, word == 0);
        assert_eq!(bus.is_motor_armed(motor), is_armed, "{update}");
        assert_eq!(bus.conditions(motor).contains(Condition::ClockFault), is_lost, "{update}");
    }
}

#[test]
fn a_clock_that_stands_still_stops_the_motors() {
    let (mut bus, motor) = armed(at_once(1));
    bus.set_raw(motor, 100).unwrap();
    step(&mut bus, 1_500);
    assert_eq!(sent(&mut bus), [(0x200, [100, 0, 0, 0])]);
    step(&mut bus, 1_500);
    assert_eq!(sent(&mut bus), [(0x200, [0; 4])], "in the first update that stands");
    assert_eq!(bus.set_raw(motor, 100), Err(TargetError::Relaxed));
    for _ in 0..2 {
        step(&mut bus, 1_500);
    }
    assert_eq!(bus.counters().bad_steps, 3);
    // It stays at rest when the time goes on, until it is armed anew.
    for ms in 2..150 {
        hear(&mut bus, feedback(0x201, 0, 0), ms * 1_000);
        assert_eq!(bus.set_raw(motor, 100), Err(TargetError::Relaxed), "{ms}");
        step(&mut bus, ms * 1_000);
        assert!(sent(&mut bus).iter().all(|frame| frame.1 == [0; 4]), "{ms}");
    }
    assert_eq!(bus.arm(us(149_000)), Ok(()));
}

#[test]
fn an_old_command_is_not_repeated_by_a_late_step_without_length() {
    let (mut bus, motor) = armed(at_once(1));
    bus.set_raw(motor, 100).unwrap();
    step(&mut bus, 2_000);
    assert_eq!(sent(&mut bus), [(0x200, [100, 0, 0, 0])]);
    bus.update(Tick::new(us(5_000_000), 0.0));
    assert_eq!(sent(&mut bus), [(0x200, [0; 4])]);

    // The limit is that of feedback, 10 ms.
    for (pause, word) in [(10_000, 100), (10_001, 0)] {
        let (mut bus, motor) = armed(at_once(1));
        bus.set_raw(motor, 100).unwrap();
        step(&mut bus, 2_000);
        hear(&mut bus, feedback(0x201, 0, 0), 2_000 + pause);
        bus.update(Tick::new(us(2_000 + pause), 0.0));
        assert_eq!(sent(&mut bus).last(), Some(&(0x200, [word, 0, 0, 0])), "{pause}");
    }

    // Nor by one in which the feedback is late.
    let (mut bus, motor) = armed(at_once(1));
    bus.set_raw(motor, 100).unwrap();
    step(&mut bus, 2_000);
    bus.update(Tick::new(us(12_000), 0.0));
    assert_eq!(sent(&mut bus).last(), Some(&(0x200, [0; 4])));
}

#[test]
fn feedback_older_than_a_stamp_can_tell_does_not_arm() {
    let mut bus = Bus::new();
    bus.attach(at_once::<M3508>(1)).unwrap();
    hear(&mut bus, feedback(0x201, 0, 0), 1_000);
    step(&mut bus, 1_000);
    assert!(bus.arm(us(1_005 + (1 << 32))).is_err());
}

#[test]
fn an_array_that_does_not_fit_leaves_no_trace() {
    let mut bus = Bus::new();
    bus.attach(at_once::<Gm6020Current>(3)).unwrap();
    for _ in 0..40 {
        assert!(bus.attach_all([1, 9].map(at_once::<M3508>)).is_err());
    }
    step(&mut bus, 1_000);
    assert_eq!(sent(&mut bus), [(0x1FE, [0; 4])], "no frame that nobody owns");
    assert!(bus.attach(at_once::<M3508>(1)).is_ok(), "no place is worn out");
}

#[test]
fn frames_are_conserved_through_refusals_and_evictions() {
    let (mut bus, first) = armed(at_once(1));
    let second = bus.attach(at_once::<M3508>(5)).unwrap();
    hear(&mut bus, feedback(0x205, 0, 0), 1_000);
    bus.arm(us(1_000)).unwrap();
    let (mut taken, mut evicted, mut seed) = (0_u32, 0_u32, 1_u32);
    let mut random = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        seed >> 30
    };
    for ms in 2..2_000 {
        hear(&mut bus, feedback(0x201, 0, 0), ms * 1_000);
        hear(&mut bus, feedback(0x205, 0, 0), ms * 1_000);
        bus.set_raw(first, if random() < 2 { 5 } else { 0 }).unwrap();
        bus.set_raw(second, 6).unwrap();
        step(&mut bus, ms * 1_000);
        while let Some(frame) = bus.next_frame() {
            match random() {
                0 => {
                    assert!(bus.requeue(&frame)); // refused
                    break;
                }
                1 => {
                    taken += 1;
                    evicted += 1;
                    assert!(bus.requeue(&frame));
                }
                _ => taken += 1,
            }
        }
    }
    // What is given back waits for the next update: one that marks nothing new brings it all out.
    bus.update(Tick::new(us(1_999_500), 0.0));
    let counters = bus.counters();
    let waiting = u32::try_from(sent(&mut bus).len()).unwrap();
    assert_eq!(counters.packed + evicted, taken + counters.superseded + waiting);
}

/// After it a stamp of 32 bits is the same again.
const WRAP_US: u64 = 1 << 32;

fn stays_at_rest(bus: &mut Bus, motor: Handle<M3508>, micros: u64) {
    assert!(bus.arm(us(micros)).is_err(), "armed by feedback of long ago");
    assert!(bus.arm_only(&[motor.erase()], us(micros)).is_err(), "armed alone");
    CanDevice::engage(bus, us(micros));
    assert!(bus.set_raw(motor, 5_000).is_err(), "takes targets");
    step(bus, micros);
    assert!(sent(bus).iter().all(|frame| frame.1 == [0; 4]), "driven");
}

/// Pauses after which the stamps look fresh: as they were, and as far as a stamp may lie before and ahead.
const PAUSES_US: [u64; 5] = [WRAP_US - 9_999, WRAP_US - 1, WRAP_US, WRAP_US + 1, WRAP_US + 9_999];

#[test]
fn a_first_update_that_ends_a_pause_drives_no_motor_by_what_was_heard_before_it() {
    for pause in PAUSES_US {
        let mut bus = Bus::new();
        let motor = bus.attach(at_once::<M3508>(1)).unwrap();
        hear(&mut bus, feedback(0x201, 0, 0), 1_000);
        stays_at_rest(&mut bus, motor, 1_000 + pause);

        let (mut bus, motor) = armed(at_once(1));
        bus.set_raw(motor, 5_000).unwrap();
        step(&mut bus, 1_000 + pause);
        assert!(sent(&mut bus).iter().all(|frame| frame.1 == [0; 4]), "{pause}");
        stays_at_rest(&mut bus, motor, 10_999 + pause);
    }
}

#[test]
fn a_frame_that_ends_a_pause_before_the_first_update_is_the_first_of_a_motor_that_was_lost() {
    for pause in PAUSES_US {
        let (mut bus, motor) = armed(at_once(1));
        bus.set_raw(motor, 5_000).unwrap();
        hear(&mut bus, feedback(0x201, 0, 0), 1_000 + pause);
        assert_eq!(bus.link(motor), Some(Link::Recovering), "{pause}");
        stays_at_rest(&mut bus, motor, 1_000 + pause);
    }
}

#[test]
fn a_motor_that_joins_before_the_first_update_neither_hides_nor_shares_the_pause_of_another() {
    for pause in PAUSES_US {
        let mut bus = Bus::new();
        let [old, young] = bus.attach_all([1, 2].map(at_once::<M3508>)).unwrap();
        hear(&mut bus, feedback(0x201, 0, 0), 10_000);
        // At once after the pause, and all the time.
        for heard in [1, 100] {
            let end = 10_000 + pause;
            (1..=heard).for_each(|n| hear(&mut bus, feedback(0x202, 0, 0), end * n / heard));
            for good in 1..10 {
                hear(&mut bus, feedback(0x202, 0, 0), end + good);
            }
            CanDevice::engage(&mut bus, us(end + 9));
            assert!(bus.set_raw(old, 5_000).is_err());
            bus.set_raw(young, 5_000).unwrap();
            step(&mut bus, end + 1_000);
            assert_eq!(sent(&mut bus), [(0x200, [0, 5_000, 0, 0])], "{pause} {heard}");

            bus = Bus::new();
            _ = bus.attach_all([1, 2].map(at_once::<M3508>)).unwrap();
            hear(&mut bus, feedback(0x201, 0, 0), 10_000);
        }
    }
}

#[test]
fn a_target_of_long_ago_drives_no_motor_at_the_first_update() {
    for pause in PAUSES_US {
        let (mut bus, motor) = armed(at_once(1));
        bus.set_raw(motor, 5_000).unwrap();
        for n in 1..=100 {
            hear(&mut bus, feedback(0x201, 0, 0), 1_000 + pause * n / 100);
        }
        step(&mut bus, 1_000 + pause);
        assert!(sent(&mut bus).iter().all(|frame| frame.1 == [0; 4]), "{pause}");
    }
}

#[test]
fn an_update_without_a_step_that_ends_a_pause_drives_no_motor_by_what_was_heard_before_it() {
    for pause in PAUSES_US {
        for dt_s in [f32::NAN, 0.0, -0.001] {
            let (mut bus, motor) = armed(at_once(1));
            step(&mut bus, 1_500);
            bus.set_raw(motor, 5_000).unwrap();
            bus.update(Tick::new(us(1_000 + pause), dt_s));
            stays_at_rest(&mut bus, motor, 1_500 + pause);

            let (mut bus, motor) = armed(at_once(1));
            bus.set_raw(motor, 5_000).unwrap();
            bus.update(Tick::new(us(1_000 + pause), dt_s));
            stays_at_rest(&mut bus, motor, 1_500 + pause);
        }
    }
}

#[test]
fn updates_without_a_step_are_one_pause_however_many() {
    for updated in [true, false] {
        let (mut bus, motor) = armed(at_once(1));
        if updated {
            step(&mut bus, 1_500);
        }
        bus.set_raw(motor, 5_000).unwrap();
        for held in 1..=100 {
            bus.update(Tick::new(us(1_000 + held * WRAP_US / 100), 0.0));
        }
        stays_at_rest(&mut bus, motor, 1_500 + WRAP_US);
    }
}

#[test]
fn a_stamp_that_wraps_before_the_first_update_is_no_pause() {
    // From the last frame to the first update the stamps wrap, exactly between them and by some.
    for (before, after) in [(1, 0), (1, 1), (0, 1), (1_000, 1_000), (9_999, 0), (0, 9_999)] {
        for frames in 1..20 {
            let mut bus = Bus::new();
            let motor = bus.attach(at_once::<M3508>(1)).unwrap();
            for n in (0..frames).rev() {
                hear(&mut bus, feedback(0x201, 0, 0), WRAP_US - before - n * 1_000);
            }
            bus.arm(us(WRAP_US + after)).unwrap();
            bus.set_raw(motor, 77).unwrap();
            step(&mut bus, WRAP_US + after);
            assert_eq!(sent(&mut bus), [(0x200, [77, 0, 0, 0])], "{before} {after} {frames}");
            assert_eq!(bus.link(motor), Some(Link::Online));
        }
    }
}

#[test]
fn a_clock_that_is_late_already_at_the_first_frame_is_no_pause() {
    for bad_update_first in [true, false] {
        let mut bus = Bus::new();
        let motor = bus.attach(at_once::<M3508>(1)).unwrap();
        if bad_update_first {
            bus.update(Tick::new(us(WRAP_US - 500), 0.0));
        }
        hear(&mut bus, feedback(0x201, 0, 0), WRAP_US);
        bus.arm(us(WRAP_US)).unwrap();
        bus.set_raw(motor, 77).unwrap();
        step(&mut bus, WRAP_US);
        assert_eq!(sent(&mut bus).last(), Some(&(0x200, [77, 0, 0, 0])));
    }
}

#[test]
fn a_minute_without_an_update_is_late_but_no_pause_and_a_microsecond_more_is_one() {
    for (pause, link) in [(60_000_000, Link::Online), (60_000_001, Link::Offline)] {
        let (mut bus, motor) = armed(at_once(1));
        step(&mut bus, 1_500);
        hear(&mut bus, feedback(0x201, 0, 0), 1_500 + pause - 1);
        step(&mut bus, 1_500 + pause);
        assert_eq!(bus.link(motor), Some(link), "{pause}");

        let (mut bus, motor) = armed(at_once(1));
        step(&mut bus, 1_500);
        hear(&mut bus, feedback(0x201, 0, 0), 1_500 + pause - 1);
        bus.update(Tick::new(us(1_500 + pause), 0.0));
        assert_eq!(bus.link(motor), Some(link), "{pause}, and no step");
    }
}

/// A minute before the last update, or after it, is as far as anybody arms.
#[test]
fn a_minute_from_the_last_update_a_motor_is_armed_and_a_microsecond_more_is_too_far() {
    const MINUTE_US: u64 = 60_000_000;
    let updated = 100_000_000;
    for (now, is_near) in [
        (updated + MINUTE_US, true),
        (updated + MINUTE_US + 1, false),
        (updated - MINUTE_US, true),
        (updated - MINUTE_US - 1, false),
    ] {
        let mut bus = Bus::new();
        let motor = bus.attach(at_once::<M3508>(1)).unwrap();
        step(&mut bus, updated);
        hear(&mut bus, feedback(0x201, 0, 0), now);
        assert_eq!(bus.arm(us(now)).is_ok(), is_near, "{now}");
        assert_eq!(bus.is_motor_armed(motor), is_near, "{now}");
        let alone = bus.arm_only(&[motor.erase()], us(now));
        assert_eq!(alone.is_ok(), is_near, "{now}");
    }
}

#[test]
fn an_error_of_5_ms_is_an_edge_whenever_it_comes() {
    for begin in 100..112 {
        let (mut bus, motor) = armed(at_once(1));
        let lasts = begin..begin + 5;
        let edges = edges_of_errors(&mut bus, 200, |ms| if lasts.contains(&ms) { 3 } else { 0 });
        let told: Vec<_> = edges.iter().map(|(_, edge)| (edge.condition, edge.began)).collect();
        assert_eq!(told, [(Condition::Fault, true), (Condition::Fault, false)], "from {begin} ms");
        assert_eq!(edges[0].0, begin, "told at once");
        assert!(begin * 1_000 - edges[0].1.at.as_micros() < 1_024, "{}", edges[0].1);
        assert!((begin + 5..=begin + 29).contains(&edges[1].0), "over after two looks: {edges:?}");
        assert!(!bus.is_motor_armed(motor), "a fault relaxes");
    }
}

#[test]
fn an_error_that_comes_with_every_other_frame_is_one_edge() {
    for codes in [[3, 0], [8, 0], [0, 8]] {
        let (mut bus, _) = armed(at_once(1));
        let code = |ms: u64| if ms < 900 { codes[usize::from(ms.is_multiple_of(2))] } else { 0 };
        let edges = edges_of_errors(&mut bus, 1_000, code);
        assert_eq!(edges.len(), 2, "{edges:?}");
    }
}

#[test]
fn codes_that_take_turns_do_not_flood() {
    let (mut bus, _) = armed(at_once(1));
    let edges = edges_of_errors(&mut bus, 1_200, |ms| if ms.is_multiple_of(2) { 3 } else { 8 });
    assert!(edges.len() <= 4 * 1_200 / 12, "{} edges in 1200 ms", edges.len());
    let fault = |edge: &&(u64, Edge<Condition, MotorName>)| {
        edge.1.condition == Condition::Fault && edge.1.began
    };
    assert!(edges.iter().any(|edge| fault(&edge)));
}

#[test]
fn a_motor_that_reports_a_fault_before_the_first_update_is_not_armed() {
    let mut bus = Bus::new();
    bus.attach(at_once::<M3508>(1)).unwrap();
    let fault = CanFrame::standard(0x201, [0, 0, 0, 0, 0, 0, 25, 3]).unwrap();
    hear(&mut bus, fault, 1_000);
    assert!(bus.arm(us(1_000)).is_err());
    assert!(!bus.is_armed());
}

/// The clock of whoever arms is set back, by as much as a stamp cannot tell. The fuzzer found it.
#[test]
fn a_motor_is_not_armed_at_a_time_of_long_ago() {
    for back in PAUSES_US {
        let now = 20 * WRAP_US;
        let mut bus = Bus::new();
        let motor = bus.attach(at_once::<M3508>(1)).unwrap();
        step(&mut bus, now);
        hear(&mut bus, feedback(0x201, 0, 0), now);
        assert!(bus.arm(us(now - back)).is_err());
        assert!(bus.arm_only(&[motor.erase()], us(now - back)).is_err());
        CanDevice::engage(&mut bus, us(now - back));
        assert!(bus.set_raw(motor, 5_000).is_err());
        bus.arm(us(now)).unwrap();
        // What is armed goes on, and its targets count from the bus's own time.
        CanDevice::engage(&mut bus, us(now - WRAP_US - 50_000));
        bus.set_raw(motor, 5_000).unwrap();
        hear(&mut bus, feedback(0x201, 0, 0), now + 60_000);
        step(&mut bus, now + 60_000);
        assert_eq!(sent(&mut bus).last(), Some(&(0x200, [5_000, 0, 0, 0])));
    }
}

/// The fuzzer found a motor that was offline, because the clock went back, driven once more.
#[test]
fn an_update_without_a_step_holds_no_command_of_a_motor_that_was_relaxed() {
    const NOW_US: u64 = 11_000 + 20 * WRAP_US;
    type Work = fn(&mut Bus, Handle<M3508>) -> u64;
    let relaxing: [Work; 3] = [
        |bus, motor| {
            bus.relax(motor);
            NOW_US + 2_000
        },
        |bus, motor| {
            bus.set_current(motor, Current::from_amperes(f32::NAN)).unwrap_err();
            NOW_US + 2_000
        },
        // Hours back: as far as the stamps tell, it was heard long ago.
        |_, _| NOW_US % WRAP_US + WRAP_US / 4,
    ];
    for relax in relaxing {
        let mut bus = Bus::new();
        let [motor, other] = bus.attach_all([1, 2].map(at_once::<M3508>)).unwrap();
        for id in [0x201, 0x202] {
            hear(&mut bus, feedback(id, 0, 0), NOW_US);
        }
        bus.arm(us(NOW_US)).unwrap();
        bus.set_raw(motor, 5_000).unwrap();
        bus.set_raw(other, 6_000).unwrap();
        step(&mut bus, NOW_US + 1_000);
        assert_eq!(sent(&mut bus), [(0x200, [5_000, 6_000, 0, 0])]);
        let at = relax(&mut bus, motor);
        bus.update(Tick::new(us(at), 0.0));
        // Where the time goes back, nothing is held at all.
        let goes_on = at > NOW_US;
        let held = if goes_on { 6_000 } else { 0 };
        assert_eq!(sent(&mut bus), [(0x200, [0, held, 0, 0])]);
        assert_eq!(bus.is_motor_armed(other), goes_on);
    }
}

/// A hostile reader found the word from before a rest held once more, where a new target came between the rest and an
/// update without a step; a second one, that there are more ways to rest than those that were mended.
#[test]
fn an_update_without_a_step_holds_no_command_from_before_a_rest() {
    static CAREFUL: HealthConfig =
        HealthConfig::new().with_reaction(Condition::Warning, Reaction::Relax);
    type Work = fn(&mut Bus, Handle<M3508>);
    // Whether it trips: then it is armed again after the pause, which consists of updates.
    let resting: [(bool, Work); 7] = [
        (false, |bus, motor| bus.relax(motor)),
        (false, |bus, motor| bus.zero(motor).unwrap()),
        (false, |bus, _| bus.disarm()),
        (true, |bus, _| {
            bus.emergency_stop();
            bus.clear_emergency_stop();
        }),
        (false, |bus, motor| {
            let nowhere = AngularVelocity::from_rad_per_s(f32::NAN);
            assert_eq!(bus.set_velocity(motor, nowhere), Err(TargetError::NotFinite));
        }),
        (false, |bus, motor| {
            let (angle, velocity) = (Angle::ZERO, AngularVelocity::ZERO);
            let old = Measured { angle, velocity, at: us(1_000_000) };
            let refused = bus.set_angle_measured(motor, Angle::ZERO, old);
            assert_eq!(refused, Err(TargetError::StaleMeasurement));
        }),
        (true, |bus, motor| {
            let warning = CanFrame::standard(0x201, [0, 0, 0, 0, 0, 0, 25, 8]).unwrap();
            hear(bus, warning, 12_500);
            assert!(!bus.is_motor_armed(motor));
        }),
    ];
    for (case, (trips, rest)) in resting.iter().enumerate() {
        let mut bus: Bus = Bus::new();
        let loops = PidConfig::new(1.0, 0.0, 0.0);
        let config = at_once::<M3508>(1).position_loop(loops, loops).with_health(&CAREFUL);
        let motor = bus.attach(config).unwrap();
        hear(&mut bus, feedback(0x201, 0, 0), 11_000);
        bus.arm(us(11_000)).unwrap();
        bus.set_position(motor, Position::new(1, Angle::ZERO)).unwrap();
        step(&mut bus, 12_000);
        assert!(sent(&mut bus)[0].1[0] > 4_000, "{case}: it is driven");
        rest(&mut bus, motor);
        let armed_again = bus.arm(us(12_500));
        let mut now = 13_000;
        if *trips {
            assert_eq!(armed_again, Err(ArmError::NotReleased), "{case}");
            for _ in 0..100 {
                step(&mut bus, now);
                now += 1_000;
                hear(&mut bus, feedback(0x201, 0, 0), now - 600);
            }
            assert_eq!(bus.arm(us(now - 500)), Ok(()), "{case}");
        } else {
            assert_eq!(armed_again, Ok(()), "{case}");
        }
        bus.set_velocity(motor, AngularVelocity::from_rpm(1.0)).unwrap();
        bus.update(Tick::new(us(now), 0.0));
        assert_eq!(sent(&mut bus).last(), Some(&(0x200, [0; 4])), "{case}");
        // From then on it is held as ever.
        bus.set_velocity(motor, AngularVelocity::from_rpm(1.0)).unwrap();
        step(&mut bus, now + 1_000);
        let driven = sent(&mut bus)[0];
        assert_ne!(driven.1[0], 0, "{case}");
        bus.update(Tick::new(us(now + 2_000), 0.0));
        assert_eq!(sent(&mut bus), [driven], "{case}");
    }
}

/// A hostile reader found that what is looked for in the last command, a runaway and a jam, was looked for in a zero where
/// the program relaxes a motor before each target.
#[test]
fn a_motor_that_is_relaxed_before_each_target_is_looked_at_by_what_it_was_sent() {
    for is_jammed in [false, true] {
        let (mut bus, motor) = armed(at_once(1));
        let (mut rpm, mut counts, mut word) = (0, 0, 0_i16);
        let mut conditions = Vec::new();
        for ms in 2..1_000 {
            if is_jammed {
                // It trembles: feedback that never changes is another fault.
                counts = (counts + 3) % 7;
            } else {
                rpm += (i32::from(word) * 9_000 / 16_384 - rpm) / 50;
                counts = (counts + rpm * 8_192 / 60_000).rem_euclid(8_192);
            }
            let (angle, rpm) = (u16::try_from(counts).unwrap(), i16::try_from(rpm).unwrap());
            hear(&mut bus, feedback(0x201, angle, rpm), ms * 1_000);
            bus.relax(motor);
            _ = bus.set_raw(motor, 16_384);
            step(&mut bus, ms * 1_000);
            word = sent(&mut bus).last().map_or(word, |(_, words)| words[0]);
            conditions.extend(std::iter::from_fn(|| bus.next_edge()).map(|edge| edge.condition));
        }
        let expected: &[Condition] = if is_jammed { &[Condition::Stalled] } else { &[] };
        assert_eq!((&conditions[..], word), (expected, 16_384));
    }
}

/// A jam relaxes the motor again after each window, where it is armed again as soon as that is granted; a program that arms
/// in each tick arms once.
#[test]
fn a_jam_that_relaxes_does_so_again_where_the_motor_is_armed_again_at_once() {
    static FEEDER: HealthConfig =
        HealthConfig::new().with_reaction(Condition::Stalled, Reaction::Relax);
    let jams_of = |pause_ms: u64| {
        let (mut bus, motor) = armed(at_once(1).with_health(&FEEDER));
        let (mut jams, mut driven, mut asked) = (0, 0, 0);
        for ms in 10..4_000 {
            hear(&mut bus, feedback(0x201, 100, 0), ms * 1_000);
            if ms >= asked + pause_ms {
                let granted = bus.is_armed() || pause_ms >= 100;
                let refusal = if granted { Ok(()) } else { Err(ArmError::NotReleased) };
                assert_eq!(bus.arm(us(ms * 1_000)), refusal, "{ms}");
                asked = ms;
            }
            _ = bus.set_raw(motor, 12_000);
            step(&mut bus, ms * 1_000);
            driven += u32::from(sent(&mut bus).iter().any(|frame| frame.1[0] != 0));
            let edges = core::iter::from_fn(|| bus.next_edge());
            let began = edges.filter(|edge| edge.condition == Condition::Stalled && edge.began);
            if began.count() > 0 {
                jams += 1;
                // The hand is taken off the switch, and put on it again.
                asked = ms;
            }
        }
        (jams, driven)
    };
    let (jams, driven) = jams_of(101);
    assert!(jams >= 4, "{jams} jams in 4 s");
    let (jams_when_asked_always, driven_when_asked_always) = jams_of(1);
    assert_eq!(jams_when_asked_always, 1);
    assert!(driven_when_asked_always * jams <= driven + jams, "as long as one of them");
}

/// A hostile reader found that new gains, set while the feedback was late, wrote the error of before into the integral.
#[test]
fn new_gains_for_a_late_motor_know_nothing_of_the_error_before() {
    let run = |retunes: bool| {
        let gains = |kp| PidConfig::new(kp, 1.0, 0.0);
        let (mut bus, motor) = armed(at_once(1).speed_loop(gains(0.5)));
        let mut word = 0;
        for ms in 2..300 {
            // Far off, then silent, then there.
            let rpm = if ms < 100 { 0 } else { 1_920 };
            if !(100..150).contains(&ms) {
                hear(&mut bus, feedback(0x201, 0, rpm), ms * 1_000);
                _ = bus.set_velocity(motor, AngularVelocity::from_rpm(100.0));
            }
            if ms == 140 && retunes {
                bus.set_speed_loop(motor, gains(0.1)).unwrap();
            }
            step(&mut bus, ms * 1_000);
            word = sent(&mut bus).last().map_or(word, |(_, words)| words[0]);
        }
        word
    };
    assert!((run(true) - run(false)).abs() <= 1, "{} and {}", run(true), run(false));
}

/// A hostile reader found that a refused target kept the integral over a rest of any length.
#[test]
fn a_target_that_is_not_finite_ends_the_integral() {
    let (mut bus, motor) = armed(at_once(1).speed_loop(PidConfig::new(0.0, 10.0, 0.0)));
    for ms in 2..400 {
        hear(&mut bus, feedback(0x201, 0, 0), ms * 1_000);
        let rpm = match ms {
            ..300 => 100.0,
            300 => f32::NAN,
            399 => 0.0,
            _ => continue,
        };
        _ = bus.set_velocity(motor, AngularVelocity::from_rpm(rpm));
        step(&mut bus, ms * 1_000);
        let word = sent(&mut bus).last().map(|(_, words)| words[0]);
        assert!(ms < 300 || word.is_none_or(|word| word == 0), "{word:?} at {ms} ms");
    }
}

/// A hostile reader found that a device which is engaged beside a motor that tripped forgot the trip.
#[test]
fn engaging_the_others_keeps_the_trip_of_one() {
    let mut bus: Bus = Bus::new();
    let handles = bus.attach_all([1, 2].map(Config::<M3508>::new)).unwrap();
    for ms in 1..500 {
        hear(&mut bus, feedback(0x201, 0, 0), ms * 1_000);
        if !(10..310).contains(&ms) {
            hear(&mut bus, feedback(0x202, 0, 0), ms * 1_000);
        }
        if ms == 1 {
            bus.arm(us(1_000)).unwrap();
        }
        if ms == 300 {
            // A request that counts, and is refused: one motor is missing.
            assert!(bus.arm(us(300_000)).is_err());
            CanDevice::engage(&mut bus, us(300_000));
        }
        if ms >= 320 {
            assert!(bus.arm(us(ms * 1_000)).is_err(), "asked in each tick, {ms}");
        }
        step(&mut bus, ms * 1_000);
    }
    assert!(bus.is_motor_armed(handles[0]) && !bus.is_motor_armed(handles[1]));
}

/// The fuzzer found that two motors which were armed together after a trip of both left the trip standing.
#[test]
fn motors_that_are_armed_together_after_a_trip_leave_none_behind() {
    let mut bus: Bus = Bus::new();
    let handles = bus.attach_all([1, 2].map(Config::<M3508>::new)).unwrap();
    let motors = handles.map(Handle::erase);
    for ms in 1..400 {
        // Both silent for 110 ms.
        if !(10..120).contains(&ms) {
            hear(&mut bus, feedback(0x201, 0, 0), ms * 1_000);
            hear(&mut bus, feedback(0x202, 0, 0), ms * 1_000);
        }
        if ms == 1 || ms >= 390 {
            assert_eq!(bus.arm_only(&motors, us(ms * 1_000)), Ok(()), "{ms}");
        }
        step(&mut bus, ms * 1_000);
    }
}
