//! Any bytes from the referee system or from the remote control of its video link, in any split; and any times between them.
#![no_main]

use core::array::from_fn;
use drivetrain::frame::CanFrame;
use drivetrain::time::{Duration, Instant};
use drivetrain::wire::Decode;
use drivetrain::wire::referee::{MAX_DATA, MAX_FRAME, Referee, RefereeMessage, encode};
use drivetrain::wire::supercap::{hkust, pacific_spirit};
use drivetrain::wire::vt13::{DEAD_BAND, FRAME_LENGTH, VideoRemote};
use drivetrain_fuzz::{Input, any_split_gives_the_same, refuses_a_flipped_bit};
use libfuzzer_sys::fuzz_target;

const SAFE_W: u16 = 45;
/// From the documentation: so long a limit holds, and a charge.
const LIMIT_AGE: Duration = Duration::from_millis(500);
const BUFFER_AGE: Duration = Duration::from_millis(250);

fuzz_target!(|data: &[u8]| {
    any_split_gives_the_same::<RefereeMessage>((), data, message);
    any_split_gives_the_same::<VideoRemote>(DEAD_BAND, data, remote);
    limits(Input(data));
    capacitors(Input(data));
});

/// A message with any command and data.
fn message(input: &mut Input) -> Vec<u8> {
    let (command, length) = match input.byte() % 8 {
        0 => (0x0201, 13),
        1 => (0x0201, 17),
        2 => (0x0202, 14),
        3 => (0x0202, 16),
        4 => (0x0207, 7),
        _ => (u16::from_le_bytes(input.bytes()), usize::from(input.byte()) % (MAX_DATA + 1)),
    };
    let data: Vec<u8> = (0..length).map(|_| input.byte()).collect();
    let sequence = input.byte();
    let frame = encode(command, sequence, &data, &mut [0; MAX_FRAME]).expect("room").to_vec();
    let speed = |at: usize| f32::from_le_bytes(data[at..at + 4].try_into().expect("four"));
    let bytes = |at: usize| u16::from_le_bytes([data[at], data[at + 1]]);
    let refused = |speed: f32| !(speed.is_finite() && speed >= 0.0);
    match (RefereeMessage::decode(&(), &frame), command, length) {
        (
            Ok(RefereeMessage::Robot {
                robot_id,
                level,
                hp,
                max_hp,
                barrel_cooling_per_s,
                barrel_heat_limit,
                chassis_power_limit_w,
                muzzle_velocity_limit_m_s,
                gimbal_is_powered,
                chassis_is_powered,
                shooter_is_powered,
            }),
            0x0201,
            13 | 17,
        ) => {
            assert_eq!([robot_id, level], data[..2]);
            assert_eq!([hp, max_hp, barrel_cooling_per_s], [2, 4, 6].map(bytes));
            assert_eq!([barrel_heat_limit, chassis_power_limit_w], [8, 10].map(bytes));
            let outputs = [gimbal_is_powered, chassis_is_powered, shooter_is_powered];
            assert_eq!(outputs, [1, 2, 4].map(|bit| data[length - 1] & bit != 0));
            let told = muzzle_velocity_limit_m_s.map(f32::to_bits);
            assert_eq!(told, (length == 17).then(|| speed(12).to_bits()));
            assert!(length == 13 || !refused(speed(12)), "I2: {muzzle_velocity_limit_m_s:?}");
        }
        (
            Ok(RefereeMessage::Power { buffer_energy_j, heat_17mm, heat_17mm_second, heat_42mm }),
            0x0202,
            14 | 16,
        ) => {
            assert_eq!([buffer_energy_j, heat_17mm], [8, 10].map(bytes));
            assert_eq!(heat_42mm, bytes(length - 2));
            assert_eq!(heat_17mm_second, (length == 16).then(|| bytes(12)));
        }
        (
            Ok(RefereeMessage::Shot { projectile, shooter, rate_hz, muzzle_velocity_m_s }),
            0x0207,
            7,
        ) => {
            assert_eq!([projectile, shooter, rate_hz], data[..3]);
            assert_eq!(muzzle_velocity_m_s.to_bits(), speed(3).to_bits());
            assert!(!refused(speed(3)), "I2: {muzzle_velocity_m_s}");
        }
        (Ok(raw @ RefereeMessage::Raw { .. }), _, _) => {
            assert_eq!(raw.as_raw(), Some((command, &data[..])));
        }
        (outcome, 0x0201, 17) => assert!(outcome.is_err() && refused(speed(12)), "{outcome:?}"),
        (outcome, 0x0207, 7) => assert!(outcome.is_err() && refused(speed(3)), "{outcome:?}"),
        (outcome, ..) => panic!("{outcome:?}"),
    }
    refuses_a_flipped_bit::<RefereeMessage>(&(), &frame);
    frame
}

/// A frame of the remote control: any position of everything on it.
fn remote(input: &mut Input) -> Vec<u8> {
    let channels: [u64; 5] =
        from_fn(|_| 364 + u64::from(u16::from_le_bytes(input.bytes()) % 1_321));
    let (mode, buttons) = (u64::from(input.byte() % 3), u64::from(input.byte() & 0xF));
    let mouse: [u8; 6] = input.bytes();
    let (clicks, keys): (u8, [u8; 2]) = (input.byte() & 0b01_0101, input.bytes());
    let [a, b, c, d, dial] = channels;
    let bits = a | b << 11 | c << 22 | d << 33 | mode << 44 | dial << 49;
    let bits = bits | (buttons & 7) << 46 | (buttons >> 3) << 60;
    let mut frame = vec![0xA9, 0x53];
    frame.extend(bits.to_le_bytes());
    frame.extend(mouse);
    frame.push(clicks);
    frame.extend(keys);
    frame.extend(crc16(&frame).to_le_bytes());
    assert_eq!(frame.len(), FRAME_LENGTH);
    let shown = VideoRemote::decode(&0, &frame).expect("a whole frame");
    let values = [shown.right_x, shown.right_y, shown.left_y, shown.left_x, shown.dial];
    for (value, raw) in values.into_iter().zip(channels) {
        assert!((value - (raw as f32 - 1024.0) / 660.0).abs() < 1e-6, "I2: {value} {raw}");
    }
    let places = [VideoRemote::C, VideoRemote::N, VideoRemote::S];
    assert_eq!(Some(&shown.mode), places.get(mode as usize));
    let down = [shown.pause, shown.button_left, shown.button_right, shown.trigger];
    assert_eq!(down, [1, 2, 4, 8].map(|bit| buttons & bit != 0));
    let down = [shown.mouse_left, shown.mouse_right, shown.mouse_middle];
    assert_eq!(down, [1, 4, 16].map(|bit| clicks & bit != 0));
    assert_eq!(shown.keys.0.to_le_bytes(), keys);
    refuses_a_flipped_bit::<VideoRemote>(&DEAD_BAND, &frame);
    frame
}

/// Bit by bit, as the sources that have no table reckon it.
fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |sum, byte| {
        (0..8).fold(
            sum ^ u16::from(*byte),
            |sum, _| {
                if sum & 1 == 1 { sum >> 1 ^ 0x8408 } else { sum >> 1 }
            },
        )
    })
}

/// What is told, when, and the numbers that this allows: the last two in a row that can be, for so long.
fn limits(mut input: Input) {
    let mut referee = Referee::new(SAFE_W);
    let (mut now, mut limits, mut charges) = (Instant::START, Vec::new(), Vec::new());
    while !input.is_empty() {
        now = now + Duration::from_millis(4 * u64::from(input.byte()));
        let value = match input.byte() {
            small @ 0..=199 => u16::from(small),
            _ => u16::from_le_bytes(input.bytes()),
        };
        let [low, high] = value.to_le_bytes();
        let (command, mut data, told, most) = if input.coin() {
            (0x0201, vec![0; 13], &mut limits, 250)
        } else {
            (0x0202, vec![0; 14], &mut charges, 300)
        };
        let place = if command == 0x0201 { 10 } else { 8 };
        data[place..place + 2].copy_from_slice(&[low, high]);
        let frame = encode(command, 0, &data, &mut [0; 32]).expect("room").to_vec();
        assert!(referee.read(&mut &frame[..], now).is_some());
        if value <= most {
            told.push((now, value));
        }
        let limit = in_a_row(&limits, now, LIMIT_AGE);
        let last = limits.last().map_or(u16::MAX, |(_, value)| *value);
        let expected = limit.unwrap_or(last.min(SAFE_W));
        assert_eq!(referee.power_limit_w(now), f32::from(expected), "I2 or I4 at {now:?}");
        let charge = in_a_row(&charges, now, BUFFER_AGE).map(f32::from);
        assert_eq!(referee.buffer_energy_j(now), charge, "I2 or I4 at {now:?}");
    }
    now = now + LIMIT_AGE + Duration::from_micros(1);
    assert!(referee.power_limit_w(now) <= f32::from(SAFE_W), "I4: a limit for ever");
    assert!(!referee.is_live(now) && referee.buffer_energy_j(now).is_none(), "I4");
}

/// The lower of the last two, if each came in time: the second after the first, and now after the second.
fn in_a_row(told: &[(Instant, u16)], now: Instant, age: Duration) -> Option<u16> {
    let [.., first, second] = told else { return None };
    let in_time = second.0 - first.0 <= age && now - second.0 <= age;
    in_time.then_some(first.1.min(second.1))
}

/// Any frame from a controller of a super-capacitor: a share or none, and nothing to use from one that is off or in error.
fn capacitors(mut input: Input) {
    while !input.is_empty() {
        let data: [u8; 8] = input.bytes();
        let whole = |id| CanFrame::standard(id, data).expect("an id");
        if let Some(state) = hkust::decode(&whole(hkust::STATE_ID)) {
            assert_eq!(state.energy(), (data[0] == 0).then(|| f32::from(data[7]) / 255.0));
            assert!(state.chassis_w.is_finite());
        }
        if let Some(state) = pacific_spirit::decode(&whole(pacific_spirit::STATE_ID)) {
            assert!((0.0..=1.0).contains(&state.share), "I2: {state:?}");
            assert_eq!(state.energy().is_some(), data[6..] == [2, 0]);
        }
        assert!(hkust::decode(&whole(hkust::COMMAND_ID)).is_none());
        let power_w = input.float();
        let [low, high, ..] = pacific_spirit::command(power_w, 0.0);
        let told_w = f32::from(u16::from_le_bytes([low, high])) / 100.0;
        assert!(told_w <= power_w.max(0.0) * 1.0001 || told_w == 0.0, "I2: {told_w} of {power_w}");
    }
}
