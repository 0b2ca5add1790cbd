use super::motor::Model;
use super::{Sender, *};
use embedded_can::Frame;
use embedded_can::nb::Can;
use std::string::{String, ToString};
use std::vec::Vec;

fn at(millis: u64) -> Instant {
    Instant::START + Duration::from_millis(millis)
}

fn m3508(id: u8) -> MotorConfig {
    MotorConfig::new(Model::M3508, id)
}

fn log(world: &Simulation, millis: u64) -> Vec<Transmission> {
    let mut records = Vec::new();
    world.advance_with(Duration::from_millis(millis), |record| records.push(*record));
    records
}

fn command(raw: i16) -> CanFrame {
    let [high, low] = raw.to_be_bytes();
    CanFrame::standard(0x200, [high, low, high, low, high, low, high, low]).unwrap()
}

/// Four motors and a controller that changes its mind, with `micros` between two readings of the time.
fn story(seed: u64, micros: u64) -> String {
    let world = Simulation::new(seed);
    let keys = [1, 2, 3, 4].map(|id| world.attach(m3508(id)).unwrap());
    let lossy = Fault::LostFrames { line: Line::Can1, id: None, probability: 0.1 };
    world.fault(lossy, at(20)..).unwrap();
    let mut text = String::new();
    for tick in 0..50_i16 {
        let _refused = world.controller().transmit(&command(tick * 300 - 5_000));
        for _ in 0..1_000 / micros {
            world.advance_with(Duration::from_micros(micros), |record| {
                text += &record.to_string();
                text += if record.delivered { "\n" } else { " lost\n" };
            });
        }
    }
    for key in keys {
        let motor = world.motor(key).unwrap();
        let velocity = motor.velocity.as_rad_per_s().to_bits();
        text += &std::format!("{} {velocity:08x}\n", motor.encoder_counts);
    }
    text
}

#[test]
fn one_seed_is_one_history_for_any_split_of_time_and_another_seed_is_another() {
    let story_of_7 = story(7, 100);
    assert!(story_of_7.lines().count() > 200 && story_of_7.contains("lost"));
    assert_eq!(story_of_7, story(7, 100));
    assert_eq!(story_of_7, story(7, 1));
    assert_eq!(story_of_7, story(7, 1_000));
    assert_ne!(story_of_7, story(8, 100));
}

#[test]
fn the_states_are_the_same_on_every_target() {
    // FNV-1a of the history on x86-64. The value changes with the physics, on purpose only.
    let fold = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
    let hash = story(7, 100).bytes().fold(0xCBF2_9CE4_8422_2325, fold);
    assert_eq!(hash, STORY_OF_7, "{hash:#018x}");
}

const STORY_OF_7: u64 = 0x698A_6C54_8C28_22AC;

#[test]
fn one_more_motor_does_not_change_the_others() {
    let phases = |count: u8| {
        let world = Simulation::new(3);
        for id in 1..=count {
            world.attach(m3508(id)).unwrap();
        }
        let first = |id| move |record: &&Transmission| record.frame.header() == id;
        let records = log(&world, 2);
        [0x201, 0x202].map(|id| records.iter().find(first(id)).unwrap().frame)
    };
    assert_eq!(phases(2), phases(5));
}

#[test]
fn eight_motors_and_two_command_frames_need_more_than_the_bus_has() {
    let world = Simulation::new(1);
    for id in 1..=8 {
        world.attach(m3508(id)).unwrap();
    }
    let mut can = world.controller();
    for _ in 0..1_000 {
        let _refused = can.transmit(&command(0));
        let _refused = can.transmit(&CanFrame::standard(0x1FF, [0; 8]).unwrap());
        world.advance(Duration::from_millis(1));
        while can.receive().is_ok() {}
    }
    let traffic = world.traffic(Line::Can1);
    assert!(traffic.load() > 0.999, "{traffic:?}");
    assert!(traffic.starved > 500, "{traffic:?}");
}

#[test]
fn a_full_world_refuses_the_seventeenth_motor() {
    let world = Simulation::new(1);
    for index in 0..16 {
        world.attach(m3508(index % 8 + 1)).unwrap();
    }
    assert_eq!(world.attach(m3508(1)), Err(SimError::Full));
    let wrong = SimError::Id { model: "M3508", id: 9 };
    assert_eq!(Simulation::new(1).attach(m3508(9)), Err(wrong));
    assert_eq!(wrong.to_string(), "M3508 has no id 9");
}

#[test]
fn the_angle_of_the_shaft_is_what_its_encoder_counts() {
    let world = Simulation::new(1);
    let wheel = world.attach(m3508(1).with_rotor_angle(4_096)).unwrap();
    let joint = world.attach_joint(Line::Can1, 1, Some(-16_384)).unwrap();
    let state = |key| world.motor(key).unwrap();
    let gear = m3508(1).facts().gear.as_f32();
    assert!((state(wheel).position.as_turns() * gear - 0.5).abs() < 1e-6);
    assert!((state(joint).position.as_angle().as_degrees() + 90.0).abs() < 1e-4);
    world.set_load_nm(wheel, 1.0);
    world.advance(Duration::from_secs(1));
    let MotorState { position, encoder_counts, drive_counts, .. } = state(wheel);
    let counted = encoder_counts as f32 / 8_192.0 / gear;
    assert!(position.turns() > 0 && (position.as_turns() - counted).abs() < 1e-4);
    assert_eq!(i64::from(drive_counts), encoder_counts);
    assert!(state(joint).torque_nm.is_nan() && state(joint).current.as_amperes().is_nan());
}

#[test]
fn a_drive_that_lost_its_angle_counts_from_the_present_angle() {
    let world = Simulation::new(1);
    let wheel = world.attach(m3508(1).with_rotor_angle(1_000)).unwrap();
    let loss = Fault::PowerLoss { motor: wheel, forgets_angle: true };
    world.fault(loss, at(10)..at(20)).unwrap();
    world.advance(Duration::from_millis(15));
    assert!(!world.motor(wheel).unwrap().is_enabled);
    world.advance(Duration::from_millis(15));
    let state = world.motor(wheel).unwrap();
    assert_eq!((state.encoder_counts, state.drive_counts, state.is_enabled), (1_000, 0, true));
    assert_eq!(state.replies, world.traffic(Line::Can1).frames);
}

#[test]
fn a_joint_has_no_fault_of_an_esc() {
    let world = Simulation::new(1);
    let joint = world.attach_joint(Line::Can1, 1, None).unwrap();
    for fault in [
        Fault::StuckEncoder(joint),
        Fault::FrozenFeedback(joint),
        Fault::BlockedShaft(joint),
        Fault::ErrorCode { motor: joint, code: 1 },
    ] {
        assert_eq!(world.fault(fault, ..), Err(SimError::NoFaultOfJoint));
    }
    assert_eq!(world.fault(Fault::Silent(joint), ..), Ok(()));
}

#[test]
fn a_load_turns_the_shaft_and_a_key_of_another_world_does_nothing() {
    let world = Simulation::new(1);
    let key = world.attach(m3508(1).with_rotor_angle(0)).unwrap();
    world.set_load_nm(key, -1.0);
    world.advance(Duration::from_millis(50));
    assert!(world.motor(key).unwrap().encoder_counts < -100);
    world.set_load_nm(key, f32::NAN);
    world.advance(Duration::from_secs(2));
    assert_eq!(world.motor(key).unwrap().velocity.as_rad_per_s().to_bits(), 0);
    let empty = Simulation::new(1);
    empty.set_load_nm(key, 1.0);
    assert_eq!(empty.motor(key), None);
}

/// The feedback of one motor in the 100 ms around a fault from 20 to 50 ms.
fn feedback_around(fault: impl Fn(MotorKey) -> Fault) -> Vec<(u64, CanFrame)> {
    let world = Simulation::new(5);
    let key = world.attach(m3508(1)).unwrap();
    let mut can = world.controller();
    world.fault(fault(key), at(20)..at(50)).unwrap();
    let mut heard = Vec::new();
    assert_eq!(can.transmit(&command(2_000)), Ok(None));
    for micros in (0..100_000).step_by(100) {
        world.advance(Duration::from_micros(100));
        while let Ok(frame) = can.receive() {
            heard.push((micros / 1_000, frame));
        }
    }
    heard
}

fn within(heard: &[(u64, CanFrame)]) -> Vec<CanFrame> {
    let inside = |(millis, _): &&(u64, CanFrame)| (21..49).contains(millis);
    heard.iter().filter(inside).map(|(_, frame)| *frame).collect()
}

#[test]
fn lost_and_silent_and_dead_motors_are_not_heard() {
    let line = Line::Can1;
    let lost = feedback_around(|_| Fault::LostFrames { line, id: None, probability: 1.0 });
    let silent = feedback_around(Fault::Silent);
    let dead = feedback_around(|motor| Fault::PowerLoss { motor, forgets_angle: false });
    for heard in [&lost, &silent, &dead] {
        assert_eq!(within(heard), []);
        assert!((69..=71).contains(&heard.len()), "{}", heard.len());
    }
    // A silent motor continues to pull; a motor without supply coasts and waits for a new
    // command.
    let current = |heard: &[(u64, CanFrame)]| heard.last().unwrap().1.bytes()[4..6].to_vec();
    assert_eq!(
        (current(&silent), current(&dead)),
        (2_000_i16.to_be_bytes().to_vec(), std::vec![0, 0])
    );
}

#[test]
fn duplicates_come_twice_and_lost_shares_by_their_probability() {
    let line = Line::Can1;
    let twice = within(&feedback_around(|_| Fault::DuplicateFrames { line, id: None }));
    assert!((55..=57).contains(&twice.len()));
    assert!(twice.chunks_exact(2).all(|pair| pair[0] == pair[1]));
    let half = within(&feedback_around(|_| Fault::LostFrames { line, id: None, probability: 0.5 }));
    assert!((5..=23).contains(&half.len()), "{} of 28", half.len());
}

#[test]
fn tampered_feedback_is_tampered_as_asked() {
    let wrong = within(&feedback_around(|motor| Fault::WrongAngle { motor, raw: 9_000 }));
    assert!(wrong.iter().all(|frame| frame.bytes()[..2] == 9_000_u16.to_be_bytes()));
    let short = within(&feedback_around(|motor| Fault::WrongLength { motor, length: 7 }));
    assert!(short.iter().all(|frame| frame.dlc() == 7));
    let code = within(&feedback_around(|motor| Fault::ErrorCode { motor, code: 8 }));
    assert!(code.iter().all(|frame| frame.bytes()[7] == 8));
    let stuck = within(&feedback_around(Fault::StuckEncoder));
    assert!(stuck.iter().all(|frame| frame.bytes()[..4] == stuck[0].bytes()[..4]));
    let frozen = within(&feedback_around(Fault::FrozenFeedback));
    assert!(frozen.iter().all(|frame| *frame == frozen[0]));
    let sound = within(&feedback_around(|_| Fault::Silent(MotorKey::new(9).unwrap())));
    assert!(!sound.windows(2).any(|pair| pair[0].bytes()[..2] == pair[1].bytes()[..2]));
    for heard in [wrong, short, code, stuck, frozen, sound] {
        assert!((27..=29).contains(&heard.len()));
    }
}

#[test]
fn a_blocked_shaft_stands_and_a_reversed_torque_drives_it_the_other_way_up_to_its_no_load_speed() {
    let end = |fault: fn(MotorKey) -> Fault| {
        let world = Simulation::new(5);
        let key = world.attach(m3508(1)).unwrap();
        assert_eq!(world.controller().transmit(&command(8_192)), Ok(None));
        world.advance(Duration::from_millis(20));
        world.fault(fault(key), ..).unwrap();
        world.advance(Duration::from_secs(2));
        world.motor(key).unwrap()
    };
    let blocked = end(Fault::BlockedShaft);
    assert_eq!(blocked.velocity.as_rad_per_s().to_bits(), 0);
    assert!((blocked.current.as_amperes() - 10.0).abs() < 0.01);
    let reversed = end(Fault::ReversedTorque).velocity.as_rpm();
    assert!((-485.0..-470.0).contains(&reversed), "{reversed}");
}

#[test]
fn a_flood_takes_the_time_left_by_higher_priorities() {
    let world = Simulation::new(2);
    world.attach(m3508(1)).unwrap();
    let frame = CanFrame::standard(0x7FF, [0x55; 8]).unwrap();
    let flood = Fault::Flood { line: Line::Can1, frame, period: Duration::from_micros(50) };
    world.fault(flood, ..).unwrap();
    let records = log(&world, 1_000);
    let feedback = records.iter().filter(|record| record.sender != Sender::Foreign).count();
    assert!((999..=1001).contains(&feedback)); // the lower id always wins
    assert!(world.traffic(Line::Can1).load() > 0.99);
}

#[test]
fn feedback_runs_on_clocks_of_its_own() {
    let world = Simulation::new(4);
    world.attach(m3508(1)).unwrap();
    world.attach(m3508(2)).unwrap();
    let records = log(&world, 1_000);
    let times = |id: u32| -> Vec<u64> {
        let own = records.iter().filter(|record| record.frame.header() == id);
        own.map(|record| record.at.as_micros()).collect()
    };
    let (first, second) = (times(0x201), times(0x202));
    assert_ne!(first[0] % 1_000, second[0] % 1_000);
    for times in [first, second] {
        let gaps: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(gaps.iter().all(|gap| (850..1_150).contains(gap)));
        assert!(gaps.iter().any(|gap| *gap != gaps[0]));
    }
}

#[test]
fn a_line_of_the_log_is_as_candump_writes_it() {
    let world = Simulation::new(1);
    let id = embedded_can::ExtendedId::new(0x12345).unwrap();
    world.inject(Line::Can2, CanFrame::new_remote(id, 3).unwrap()).unwrap();
    world.inject(Line::Can1, CanFrame::new(id, &[]).unwrap()).unwrap();
    let lines: Vec<String> =
        log(&world, 1).iter().map(|record| record.to_string()[11..].into()).collect();
    assert_eq!(lines.len(), 2);
    assert!(
        lines.contains(&"can1 00012345#R3".into()) && lines.contains(&"can0 00012345#".into()),
        "{lines:?}"
    );
}
