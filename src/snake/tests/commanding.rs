//! Targets, zeros and directions.

use super::*;

#[test]
fn zeroing_makes_the_present_position_zero_and_relaxes() {
    let mut bench = Bench::new(&[2, 3]);
    bench.raw = [70_000; 12];
    bench.run(30);
    assert_eq!(bench.state(0).homing, Homing::Relative);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    bench.drive(20);
    assert!(bench.state(0).is_driven);
    bench.joints.zero(bench.handles[0]).unwrap();
    let sent = bench.run(1);
    assert_eq!(sent[0], (2, Command::DISABLE));
    let state = bench.state(0);
    assert_eq!((state.pulses, state.raw_pulses, state.homing), (0, 70_000, Homing::Homed));
    assert_eq!(bench.joints.offset(bench.handles[0]), Some(70_000));
    bench.joints.set_pulses(bench.handles[0], -1_000).unwrap();
    let sent = bench.run(20);
    assert!(sent.contains(&(2, Command::Write(Register::Position, 69_000))));
}

#[test]
fn a_reversed_joint_turns_position_speed_and_target_around() {
    let mut bench = Bench::of(Joints::new(), [Config::new(6).reversed()]);
    bench.raw = [16_384; 12];
    bench.run(10);
    let state = bench.state(0);
    assert_eq!((state.pulses, state.position.as_turns()), (-16_384, -0.25));
    assert!((state.velocity.as_rpm() + 60.0).abs() < 1e-3);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    let quarter = Position::from_angle(Angle::from_degrees(90.0));
    bench.joints.set_position(bench.handles[0], quarter).unwrap();
    assert!(writes(&bench.run(8)).contains(&Command::Write(Register::Position, -16_384)));
}

#[test]
fn positions_saturate_and_refused_ones_relax() {
    let mut bench = Bench::armed(&[1]);
    let joint = bench.handles[0];
    for (turns, pulses) in [(i64::MAX, 0x7FFF_0000), (i64::MIN, i32::MIN), (-2, -131_072)] {
        bench.joints.set_position(joint, Position::from_turns(turns)).unwrap();
        let sent = writes(&bench.run(8));
        assert!(sent.contains(&Command::Write(Register::Position, pulses)), "{turns}");
    }
    let nan = Position::from_angle(Angle::from_radians(f32::NAN));
    assert_eq!(bench.joints.set_position(joint, nan), Err(TargetError::NotFinite));
    assert_eq!(bench.run(1)[0], (1, Command::DISABLE));
    assert_eq!(bench.state(0).refused_targets, 1);
    let rate = AngularVelocity::from_rpm(f32::INFINITY);
    assert_eq!(bench.joints.set_speed(joint, rate), Err(TargetError::NotFinite));
    bench.joints.set_speed(joint, AngularVelocity::from_rpm(9_999.0)).unwrap();
    bench.drive(8);
    assert!(
        !writes(&bench.drive(8))
            .iter()
            .any(|c| matches!(c, Command::Write(Register::Speed, v) if *v > 278_528))
    );
}

/// Runs joints of which the first is led by `lead` and the others go back and forth in each tick, from where they are armed;
/// returns what was written to the first.
fn led_among_others(
    count: u8,
    ticks: i32,
    lead: impl Fn(&mut Joints, Joint, i32),
) -> Vec<(Register, i32)> {
    let ids: Vec<u8> = (1..=count).collect();
    let mut bench = Bench::armed(&ids);
    let mut written = Vec::new();
    for tick in 0..ticks {
        let (first, others) = bench.handles.split_first().unwrap();
        lead(&mut bench.joints, *first, tick);
        for joint in others {
            bench.joints.set_pulses(*joint, tick % 1_000).unwrap();
        }
        let of_first = bench.run(1).into_iter().filter(|(id, _)| *id == 1);
        written.extend(of_first.filter_map(|(_, command)| match command {
            Command::Write(register, value) => Some((register, value)),
            Command::Read(_) => None,
        }));
    }
    written
}

/// A hostile reader had a joint enabled with the target before, and kept there for ever, where its target changed once, just
/// as only the enable waited, and others had news all the time.
#[test]
fn a_target_that_changes_in_any_tick_of_the_bring_up_is_written_also_where_others_have_news() {
    for (count, longest) in [(1, 12), (2, 20), (6, 50)] {
        for change in 0..longest {
            let written = led_among_others(count, 300, |joints, joint, tick| {
                let target = if tick < change { 4_000 } else { -4_000 };
                joints.set_pulses(joint, target).unwrap();
            });
            let mut positions =
                written.iter().filter(|(register, _)| *register == Register::Position);
            assert_eq!(
                positions.next_back(),
                Some(&(Register::Position, -4_000)),
                "{count}: {change}"
            );
            assert!(written.contains(&(Register::Enable, 1)), "{count}: {change}");
        }
    }
}

#[test]
fn a_speed_that_changes_in_each_tick_holds_up_neither_the_target_nor_the_enable() {
    let written = led_among_others(1, 60, |joints, joint, tick| {
        let rpm = 20.0 + (tick % 50) as f32;
        joints.set_speed(joint, AngularVelocity::from_rpm(rpm)).unwrap();
        joints.set_pulses(joint, if tick < 40 { 100 } else { 4_000 }).unwrap();
    });
    let enabled = written.iter().position(|one| *one == (Register::Enable, 1)).unwrap();
    assert!(written[..enabled].contains(&(Register::Position, 100)));
    assert!(written.contains(&(Register::Position, 4_000)), "{written:?}");
}

/// In each tick, the program sends NaN and then a good target. All joints are relaxed, in few frames.
#[test]
fn what_nothing_was_written_to_since_it_was_disabled_is_not_disabled_again() {
    let ids: Vec<u8> = (1..=12).collect();
    let mut bench = Bench::armed(&ids);
    let mut disables = 0;
    for _ in 0..1_000 {
        for joint in bench.handles.clone() {
            let nowhere = Position::from_angle(Angle::from_radians(f32::NAN));
            assert_eq!(bench.joints.set_position(joint, nowhere), Err(TargetError::NotFinite));
            bench.joints.set_pulses(joint, 4_000).unwrap();
        }
        let sent = bench.run(1);
        disables += sent.iter().filter(|(_, command)| *command == Command::DISABLE).count();
    }
    // One a tick: of the joint that was written to in the tick before.
    assert!((900..=1_100).contains(&disables), "{disables} in a second");
}

/// The write that waits is taken, and not sent.
fn taken(bench: &mut Bench) -> CanFrame {
    bench.ms += 1;
    bench.joints.set_pulses(bench.handles[0], 1_000).unwrap();
    bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    let frames: Vec<_> = core::iter::from_fn(|| bench.joints.next_frame()).collect();
    let is_write = |frame: &&CanFrame| !Command::decode(frame.data()).unwrap().is_safe();
    let write = *frames.iter().find(is_write).unwrap();
    for frame in frames {
        let id = u8::try_from(frame.header()).unwrap();
        bench.answer(id, Command::decode(frame.data()).unwrap());
    }
    write
}

/// A hostile reader had a joint enabled before it had its target: a driver gave back what waited in it, oldest first.
#[test]
fn writes_that_come_back_are_sent_again_in_the_order_of_the_bring_up() {
    for (from, count) in (0..7).flat_map(|from| (1..=7 - from).map(move |count| (from, count))) {
        let mut bench = Bench::armed(&[4]);
        let sequence: Vec<_> = (0..from + count).map(|_| taken(&mut bench)).collect();
        for frame in &sequence[from..] {
            assert!(bench.joints.requeue(frame));
        }
        let again: Vec<_> = (0..count).map(|_| taken(&mut bench)).collect();
        assert_eq!(again, sequence[from..], "{count} from {from}");
    }
}

#[test]
fn an_enable_that_comes_back_after_a_disable_is_not_sent_before_the_bring_up() {
    let mut bench = Bench::armed(&[4]);
    let sequence: Vec<_> = (0..7).map(|_| taken(&mut bench)).collect();
    bench.joints.relax(bench.handles[0]);
    let mut again = std::vec![taken(&mut bench)]; // after the disable
    assert!(bench.joints.requeue(&sequence[6]));
    again.extend((0..6).map(|_| taken(&mut bench)));
    assert_eq!(again, sequence);
}

/// Other values than those of a joint without settings.
fn heavy() -> Config {
    Config::new(4)
        .with_mode(3)
        .with_current(1_500)
        .with_acceleration(400_000)
        .with_deceleration(300_000)
}

const HEAVY_WRITES: [Command; 4] = [
    Command::Write(Register::Mode, 3),
    Command::Write(Register::Current, 1_500),
    Command::Write(Register::Acceleration, 400_000),
    Command::Write(Register::Deceleration, 300_000),
];

#[test]
fn a_joint_is_brought_up_with_the_settings_of_its_configuration() {
    let told = (heavy().mode(), heavy().current(), heavy().acceleration(), heavy().deceleration());
    assert_eq!(told, (3, 1_500, 400_000, 300_000));
    let mut bench = Bench::of(Joints::new(), [heavy()]).armed_after(30);
    assert_eq!(writes(&bench.drive(4)), HEAVY_WRITES);
}

#[test]
fn settings_of_a_joint_that_moves_are_written_once_and_unusable_ones_never() {
    let mut bench = Bench::armed(&[4]);
    let joint = bench.handles[0];
    bench.drive(20);
    bench.joints.set_settings(joint, &heavy()).unwrap();
    assert_eq!(writes(&bench.drive(4)), HEAVY_WRITES);
    let unusable = [
        (heavy().with_current(0), "current"),
        (heavy().with_acceleration(0), "acceleration"),
        (heavy().with_deceleration(-1), "deceleration"),
    ];
    for (config, parameter) in unusable {
        let refused = bench.joints.set_settings(joint, &config).unwrap_err().to_string();
        assert_eq!(refused, std::format!("snake joint #4: {parameter} is not usable"));
    }
    let target = Command::Write(Register::Position, 1_000);
    assert!(writes(&bench.drive(20)).iter().all(|command| *command == target));
    // Of the next bring-up, too.
    bench.joints.relax(joint);
    assert_eq!(writes(&bench.drive(4))[1..], HEAVY_WRITES);
}

#[test]
fn what_a_bring_up_writes_is_what_can_be_written() {
    let sent = writes(&Bench::armed(&[4]).drive(7));
    for register in Register::ALL {
        let is_written = sent.iter().any(|c| matches!(c, Command::Write(to, _) if *to == register));
        assert_eq!(register.is_writable(), is_written, "{register:?}");
    }
}

#[test]
fn a_target_is_repeated_after_100_ms_whatever_else_is_written() {
    for command_ms in [100, 1_000] {
        let timeouts = Timeouts::POLLED.with_command(Duration::from_millis(command_ms)).unwrap();
        let joints = Joints::new().with_timeouts(timeouts);
        let mut bench = Bench::of(joints, [1, 2].map(Config::new)).armed_after(30);
        bench.drive(60);
        let (mut last, mut longest) = (bench.ms, 0);
        for tick in 0..2_000_u16 {
            let [first, second] = bench.handles[..] else { panic!() };
            bench.joints.set_pulses(first, tick.into()).unwrap();
            bench.joints.set_pulses(second, 1_000).unwrap();
            let speed = AngularVelocity::from_rpm(50.0 + 0.05 * f32::from(tick));
            bench.joints.set_speed(second, speed).unwrap();
            for (id, command) in bench.run(1) {
                if id == 2 && matches!(command, Command::Write(Register::Position, _)) {
                    longest = longest.max(bench.ms - last);
                    last = bench.ms;
                }
            }
        }
        assert!((90..=140).contains(&longest), "command {command_ms}: {longest} ms");
    }
}
