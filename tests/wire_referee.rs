//! The referee system, the remote control of the video link and the controllers of super-capacitors: golden vectors, silence, and values
//! that cannot be.

#![cfg(test)]

use drivetrain::chassis::CapacitorPlan;
use drivetrain::frame::CanFrame;
use drivetrain::time::{Duration, Edge, Instant};
use drivetrain::wire::dbus::Keys;
use drivetrain::wire::referee::{BarrelHeat, MAX_FRAME, Referee, RefereeMessage, encode};
use drivetrain::wire::supercap::{hkust, pacific_spirit};
use drivetrain::wire::vt13::{DEAD_BAND, FRAME_LENGTH, VideoRemote};
use drivetrain::wire::{Counts, Decode, Deframer, Receiver};
use embedded_can::{Frame, StandardId};
use proptest::prelude::*;
use serde_json::Value;

fn vectors(prefix: &str) -> Vec<Value> {
    let file: Value = serde_json::from_str(include_str!("data/wire/vectors.json")).unwrap();
    let vectors = file["vectors"].as_array().unwrap().clone();
    let found: Vec<Value> = vectors
        .into_iter()
        .filter(|vector| vector["id"].as_str().unwrap().starts_with(prefix))
        .collect();
    assert!(!found.is_empty(), "no vector {prefix}");
    found
}

fn vector(id: &str) -> Value {
    vectors(id).into_iter().find(|vector| vector["id"] == id).unwrap()
}

fn hex(text: &Value) -> Vec<u8> {
    let bytes = text.as_str().unwrap().split_whitespace();
    bytes.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn number<T: TryFrom<u64>>(value: &Value) -> T {
    T::try_from(value.as_u64().unwrap()).ok().unwrap()
}

#[expect(clippy::cast_possible_truncation, reason = "rounds")]
fn float(value: &Value) -> f32 {
    value.as_f64().unwrap() as f32
}

fn read<F: Decode, const N: usize>(options: F::Options, id: &str) -> (Vec<F>, Counts) {
    let bytes = hex(&vector(id)["input"]["frame"]);
    let mut decoder = Deframer::<F, N>::with_options(options);
    let mut input = &bytes[..];
    let mut frames = Vec::new();
    while let Some(frame) = decoder.read(&mut input) {
        frames.push(frame);
    }
    (frames, decoder.counts())
}

fn message(id: &str) -> RefereeMessage {
    let (messages, counts) = read::<RefereeMessage, MAX_FRAME>((), id);
    assert_eq!((messages.len(), counts.skipped_bytes), (1, 0), "{id}");
    messages[0]
}

#[test]
fn referee_robot_states_of_both_layouts() {
    for id in ["referee.0201.13", "referee.0201.17"] {
        let expect = &vector(id)["expect"];
        let state = RefereeMessage::Robot {
            robot_id: number(&expect["robot_id"]),
            level: number(&expect["level"]),
            hp: number(&expect["hp"]),
            max_hp: number(&expect["max_hp"]),
            barrel_cooling_per_s: number(&expect["cooling"]),
            barrel_heat_limit: number(&expect["heat_limit"]),
            chassis_power_limit_w: number(&expect["power_limit_w"]),
            muzzle_velocity_limit_m_s: expect["velocity_limit"]
                .as_f64()
                .map(|_| float(&expect["velocity_limit"])),
            gimbal_is_powered: expect["outputs"][0].as_bool().unwrap(),
            chassis_is_powered: expect["outputs"][1].as_bool().unwrap(),
            shooter_is_powered: expect["outputs"][2].as_bool().unwrap(),
        };
        assert_eq!(message(id), state, "{id}");
    }
}

#[test]
fn referee_power_and_heat_of_both_layouts_and_a_shot() {
    for id in ["referee.0202.16", "referee.0202.14"] {
        let expect = &vector(id)["expect"];
        let power = RefereeMessage::Power {
            buffer_energy_j: number(&expect["buffer_j"]),
            heat_17mm: number(&expect["heat_17mm"]),
            heat_17mm_second: expect["heat_17mm_second"]
                .as_u64()
                .map(|heat| heat.try_into().unwrap()),
            heat_42mm: number(&expect["heat_42mm"]),
        };
        assert_eq!(message(id), power, "{id}");
    }
    let expect = &vector("referee.0207")["expect"];
    let shot = RefereeMessage::Shot {
        projectile: number(&expect["projectile"]),
        shooter: number(&expect["shooter"]),
        rate_hz: number(&expect["rate_hz"]),
        muzzle_velocity_m_s: float(&expect["velocity"]),
    };
    assert_eq!(message("referee.0207"), shot);
}

#[test]
fn referee_frames_of_other_commands_and_lengths_are_raw() {
    let status = message("referee.game_status");
    let (command, data) = status.as_raw().unwrap();
    let expect = &vector("referee.game_status")["expect"];
    assert_eq!((command, data.len()), (1, number(&expect["data_length"])));
    assert_eq!(u64::from(data[0] & 0xF), expect["game_type"]);
    let old = message("referee.0201.27");
    assert_eq!(old.as_raw().map(|(command, data)| (command, data.len())), Some((0x0201, 27)));
    assert!(format!("{old:?}").contains("data: [0, 1, 2"), "{old:?}");
}

#[test]
fn referee_frames_in_the_other_direction() {
    for id in ["referee.zero_len", "referee.taproot"] {
        let vector = vector(id);
        let (input, expected) = (&vector["input"], hex(&vector["expect"]["frame"]));
        let data = if input["data"].is_null() { Vec::new() } else { hex(&input["data"]) };
        let (command, sequence) = (number(&input["cmd_id"]), number(&input["seq"]));
        assert_eq!(encode(command, sequence, &data, &mut [0; 32]).unwrap(), expected, "{id}");
    }
}

#[test]
fn referee_frames_that_are_wrong_are_refused_each_for_its_reason() {
    let refused = |id| {
        let (messages, counts) = read::<RefereeMessage, MAX_FRAME>((), id);
        assert!(messages.is_empty(), "{id}");
        [counts.length_errors, counts.checksum_errors, counts.content_errors]
    };
    assert_eq!(refused("referee.neg.crc8"), [1, 0, 0]);
    assert_eq!(refused("referee.neg.crc16"), [0, 1, 0]);
    assert_eq!(refused("referee.neg.0207.nan"), [0, 0, 1]);
    assert_eq!(refused("referee.neg.0201.infinite"), [0, 0, 1]);
    // A school's frame without a command: two bytes shorter than its length says here.
    assert_eq!(refused("referee.like.no_cmdid"), [0, 0, 0]);
}

fn ms(ms: u64) -> Instant {
    Instant::START + Duration::from_millis(ms)
}

const fn heard(at: Instant) -> Edge<&'static str> {
    Edge { source: (), condition: "silence", began: false, at }
}

const fn lost(at: Instant) -> Edge<&'static str> {
    Edge { source: (), condition: "silence", began: true, at }
}

fn robot(limit_w: u16) -> Vec<u8> {
    let [low, high] = limit_w.to_le_bytes();
    let data = [3, 1, 200, 0, 200, 0, 40, 0, 100, 0, low, high, 7];
    encode(0x0201, 0, &data, &mut [0; 22]).unwrap().to_vec()
}

fn power(buffer_j: u16) -> Vec<u8> {
    let [low, high] = buffer_j.to_le_bytes();
    encode(0x0202, 0, &[0, 0, 0, 0, 0, 0, 0, 0, low, high, 0, 0, 0, 0], &mut [0; 23])
        .unwrap()
        .to_vec()
}

fn tell(referee: &mut Referee, bytes: &[u8], now: Instant) {
    let mut input = bytes;
    while referee.read(&mut input, now).is_some() {}
}

fn watts(referee: &Referee, at: u64) -> u16 {
    let limit_w = referee.power_limit_w(ms(at));
    (0..=u16::MAX).find(|watts| f32::from(*watts).to_bits() == limit_w.to_bits()).unwrap()
}

#[test]
fn a_limit_falls_at_once_and_rises_with_the_second_frame() {
    let mut referee = Referee::new(45);
    assert_eq!((watts(&referee, 0), referee.is_live(ms(0))), (45, false));
    for (at, told, holds) in
        [(0, 100, 45), (100, 100, 100), (200, 60, 60), (300, 120, 60), (400, 120, 120), (500, 0, 0)]
    {
        tell(&mut referee, &robot(told), ms(at));
        assert_eq!(watts(&referee, at), holds, "{told} W at {at} ms");
    }
}

#[test]
fn silence_gives_the_safe_limit_with_an_edge_and_never_raises_one() {
    let mut referee = Referee::new(60);
    for at in [0, 100] {
        tell(&mut referee, &[robot(100), power(50)].concat(), ms(at));
    }
    assert_eq!(referee.edge(ms(100)), Some(heard(ms(0))));
    assert_eq!((watts(&referee, 600), referee.is_live(ms(600))), (100, true));
    assert_eq!((watts(&referee, 601), referee.is_live(ms(601))), (60, false));
    assert_eq!(referee.edge(ms(601)), Some(lost(ms(600))));
    assert!(referee.buffer_energy_j(ms(350)).is_some());
    assert_eq!(referee.buffer_energy_j(ms(351)), None);
    // Back, but once: not yet what it says. A lower one counts at once.
    tell(&mut referee, &robot(100), ms(1_000));
    assert_eq!(watts(&referee, 1_000), 60);
    tell(&mut referee, &robot(30), ms(1_100));
    assert_eq!(watts(&referee, 1_100), 30);
    assert_eq!(watts(&referee, 5_000), 30, "the safe limit would be higher");
}

#[test]
fn values_that_cannot_be_count_as_silence() {
    let mut referee = Referee::new(45).with_highest_limit_w(120);
    for at in [0, 100] {
        tell(&mut referee, &[robot(120), power(300)].concat(), ms(at));
    }
    assert_eq!((watts(&referee, 100), referee.buffer_energy_j(ms(100))), (120, Some(300.0)));
    for at in [200, 300, 400, 500, 600] {
        tell(&mut referee, &[robot(121), power(301), robot(u16::MAX)].concat(), ms(at));
    }
    assert_eq!((watts(&referee, 600), watts(&referee, 601)), (120, 45));
    assert_eq!(referee.buffer_energy_j(ms(600)), None);
}

#[test]
fn the_deadlines_can_be_set_and_half_a_frame_given_up() {
    let long = Duration::from_millis(2_000);
    let mut referee = Referee::new(45).with_deadlines(long, long);
    tell(&mut referee, &robot(80)[..10], ms(0));
    referee.abandon();
    for at in [10, 20] {
        tell(&mut referee, &[robot(80), power(20)].concat(), ms(at));
    }
    assert_eq!((watts(&referee, 2_020), watts(&referee, 2_021)), (80, 45));
    assert!(referee.buffer_energy_j(ms(2_020)).is_some());
    let heat = BarrelHeat { heat: 0, limit: 100, cooling_per_s: 40 };
    assert_eq!(referee.heat_17mm(ms(2_020)), Some(heat));
    assert_eq!(referee.heat_17mm(ms(2_021)), None);
    assert_eq!((referee.counts().frames, referee.counts().skipped_bytes), (4, 10));
}

#[test]
fn a_frame_behind_a_header_that_promises_more_is_found_after_a_pause() {
    let promises = encode(0x0310, 0, &[0; 128], &mut [0; MAX_FRAME]).unwrap()[..9].to_vec();
    let mut referee = Referee::new(45);
    tell(&mut referee, &[promises, robot(30)].concat(), ms(0));
    assert_eq!((referee.counts().frames, watts(&referee, 0)), (0, 45));
    referee.abandon();
    tell(&mut referee, &[], ms(10));
    assert_eq!((referee.counts().frames, watts(&referee, 10)), (1, 30));
}

proptest! {
    /// Whatever comes: never more than the safe limit or than two frames in a row told, and nothing that was not told in time.
    #[test]
    fn no_bytes_raise_a_limit_that_two_frames_did_not_tell(
        noise in prop::collection::vec(any::<u8>(), 0..60),
        told in prop::collection::vec((0_u16..400, 0_u16..400, 0_u64..800, any::<usize>(), 0_u8..4), 1..20),
    ) {
        let mut referee = Referee::new(45);
        let (mut now, mut limits, mut buffers) = (0, Vec::new(), Vec::new());
        for (limit_w, buffer_j, pause, bit, kind) in told {
            now += pause;
            let mut frames = [robot(limit_w), power(buffer_j)];
            let damaged = if kind == 0 { bit % 2 } else { 2 };
            if let Some(frame) = frames.get_mut(damaged) {
                let bit = bit / 2 % (8 * frame.len());
                frame[bit / 8] ^= 1 << (bit % 8);
            }
            tell(&mut referee, &noise, ms(now));
            tell(&mut referee, &frames.concat(), ms(now));
            if damaged != 0 && limit_w <= 250 {
                limits.push((now, limit_w));
            }
            if damaged != 1 && buffer_j <= 300 {
                buffers.push((now, buffer_j));
            }
            let highest = |told: &[(u64, u16)], age: u64| {
                told.windows(2).filter(|two| two[1].0 + age >= now).map(|two| two[0].1.min(two[1].1)).max()
            };
            let most_w = highest(&limits, 500).map_or(45, |told| told.max(45));
            prop_assert!(watts(&referee, now) <= most_w);
            if let Some(energy_j) = referee.buffer_energy_j(ms(now)) {
                prop_assert!(highest(&buffers, 250).is_some_and(|most| energy_j <= f32::from(most)));
            }
        }
    }
}

/// Every truncation and every single-bit flip of a frame gives nothing, and the frame behind it is found.
fn damage_is_refused<F: Decode<Options: Copy> + PartialEq + Copy, const N: usize>(
    options: F::Options,
    frame: &[u8],
) {
    let found = |bytes: &[u8]| {
        let mut decoder = Deframer::<F, N>::with_options(options);
        let (mut input, mut found) = (bytes, Vec::new());
        while let Some(frame) = decoder.read(&mut input) {
            found.push(frame);
        }
        found
    };
    let good = F::decode(&options, frame).ok().unwrap();
    // A damaged header may wait for as many bytes as the longest frame has.
    let rest = [0; N];
    for cut in 0..frame.len() {
        assert!(found(&frame[..cut]).is_empty(), "{cut} bytes");
        assert!(found(&[&frame[..cut], frame, &rest].concat()) == [good], "{cut} bytes before");
    }
    for bit in 0..8 * frame.len() {
        let mut flipped = frame.to_vec();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(found(&[&flipped[..], &rest].concat()).is_empty(), "bit {bit}");
        assert!(found(&[&flipped[..], frame, &rest].concat()) == [good], "bit {bit} before");
    }
}

#[test]
fn every_truncation_and_every_flipped_bit_is_refused_and_costs_only_its_frame() {
    for bytes in [robot(80), power(50), hex(&vector("referee.0201.17")["input"]["frame"])] {
        damage_is_refused::<RefereeMessage, MAX_FRAME>((), &bytes);
    }
    for id in ["vt03.mixed", "vt03.center"] {
        let bytes = hex(&vector(id)["input"]["frame"]);
        damage_is_refused::<VideoRemote, FRAME_LENGTH>(DEAD_BAND, &bytes);
    }
}

fn remote(id: &str) -> (Vec<VideoRemote>, Counts) {
    read::<VideoRemote, FRAME_LENGTH>(DEAD_BAND, id)
}

#[test]
fn vt13_frames() {
    let (shown, _) = remote("vt03.mixed");
    let shown = shown[0];
    let expect = &vector("vt03.mixed")["expect"];
    let channels = [shown.right_x, shown.right_y, shown.left_y, shown.left_x, shown.dial];
    let raw = expect["ch"].as_array().unwrap().iter().chain([&expect["wheel"]]);
    for (value, raw) in channels.into_iter().zip(raw) {
        assert!((value - (float(raw) - 1024.0) / 660.0).abs() < 1e-6, "{value} {raw}");
    }
    assert_eq!(shown.mode, VideoRemote::S);
    let switches = [
        (shown.pause, "pause"),
        (shown.button_left, "fn_1"),
        (shown.button_right, "fn_2"),
        (shown.trigger, "trigger"),
        (shown.mouse_left, "mouse_left"),
        (shown.mouse_right, "mouse_right"),
        (shown.mouse_middle, "mouse_middle"),
    ];
    for (value, name) in switches {
        assert_eq!(u64::from(value), expect[name], "{name}");
    }
    let mouse = [shown.mouse_x, shown.mouse_y, shown.mouse_z].map(i64::from);
    assert_eq!(serde_json::json!(mouse), expect["mouse"]);
    assert_eq!(shown.keys, Keys(0x8001));
    assert_eq!(expect["keys"], "0x8001");

    let (rest, _) = remote("vt03.center");
    assert_eq!(rest[0].mode, VideoRemote::N);
    let channels = [rest[0].right_x, rest[0].right_y, rest[0].left_y, rest[0].left_x, rest[0].dial];
    assert_eq!(channels.map(f32::to_bits), [0; 5]);
}

#[test]
fn f62_vt13_frames_with_impossible_values_are_refused() {
    for vector in vectors("vt03.neg.") {
        let id = vector["id"].as_str().unwrap();
        let (shown, counts) = remote(id);
        assert!(shown.is_empty(), "{id}");
        assert_eq!((counts.content_errors, counts.checksum_errors), (1, 0), "{id}");
    }
}

#[test]
fn f62_a_silent_or_damaged_video_remote_is_told() {
    let good = hex(&vector("vt03.mixed")["input"]["frame"]);
    let mut damaged = good.clone();
    damaged[3] ^= 4;
    let mut remote =
        Receiver::<VideoRemote, FRAME_LENGTH>::with_options(DEAD_BAND, Duration::from_millis(100));
    assert_eq!(remote.latest(ms(0)), None);
    assert!(remote.read(&mut &good[..], ms(0)).is_some());
    for at in [20, 40, 60, 80, 100] {
        assert_eq!(remote.read(&mut &damaged[..], ms(at)), None);
    }
    assert!(remote.latest(ms(100)).is_some() && remote.latest(ms(101)).is_none());
    assert_eq!(remote.edge(ms(101)), Some(heard(ms(0))));
    assert_eq!(remote.edge(ms(101)), Some(lost(ms(100))));
    assert!(remote.read(&mut &good[..], ms(500)).is_some());
    assert_eq!(remote.edge(ms(500)), Some(heard(ms(500))));
    assert_eq!(remote.losses(), 1);
}

#[test]
fn the_dead_band_of_the_video_remote_ends_at_one_whatever_it_is() {
    let bytes = hex(&vector("vt03.mixed")["input"]["frame"]);
    for dead_band in [0, 10, 659, 660, u16::MAX] {
        let shown = VideoRemote::decode(&dead_band, &bytes).unwrap();
        assert!((shown.right_x - 1.0).abs() < 1e-6 && (shown.right_y + 1.0).abs() < 1e-6);
        assert_eq!(shown.left_y.to_bits(), 0);
    }
}

#[test]
fn referee_and_remote_share_a_line() {
    let remote_frame = hex(&vector("vt03.mixed")["input"]["frame"]);
    let stream = [robot(80), remote_frame.clone(), power(50), robot(80), remote_frame].concat();
    let mut remote =
        Receiver::<VideoRemote, FRAME_LENGTH>::with_options(DEAD_BAND, Duration::from_millis(100));
    let mut referee = Referee::new(45);
    for piece in stream.chunks(7) {
        tell(&mut referee, piece, ms(0));
        let mut piece = piece;
        while remote.read(&mut piece, ms(0)).is_some() {}
    }
    assert_eq!((referee.counts().frames, remote.counts().frames), (3, 2));
    assert_eq!(watts(&referee, 0), 80);
}

fn frame(vector: &Value) -> CanFrame {
    let id = u16::from_str_radix(&vector["can_id"].as_str().unwrap()[2..], 16).unwrap();
    CanFrame::standard(id, hex(&vector["data"]).try_into().unwrap()).unwrap()
}

#[test]
fn supercap_frames_of_hkust() {
    let command = vector("supercap.hkust.command");
    let expected = frame(&command["expect"]);
    assert_eq!(u32::from(hkust::COMMAND_ID), expected.header());
    assert_eq!(hkust::command(true, 80, 60), *expected.bytes());
    let vector = vector("supercap.hkust.state");
    let (state, expect) = (hkust::decode(&frame(&vector["input"])).unwrap(), &vector["expect"]);
    assert_eq!(u64::from(state.errors), expect["errors"]);
    assert_eq!(state.is_on, expect["is_on"]);
    assert_eq!(u64::from(state.chassis_limit_w), expect["chassis_limit_w"]);
    assert!((state.chassis_w - float(&expect["chassis_w"])).abs() < 1e-6);
    assert!((state.share - float(&expect["share"])).abs() < 1e-6);
    assert_eq!(state.energy(), None, "off");
}

#[test]
fn supercap_frames_of_pacific_spirit() {
    let command = vector("supercap.pacific_spirit.command");
    let expected = frame(&command["expect"]);
    let input = &command["input"];
    assert_eq!(u32::from(pacific_spirit::COMMAND_ID), expected.header());
    let sent = pacific_spirit::command(float(&input["power_w"]), float(&input["limit_w"]));
    assert_eq!(sent, *expected.bytes());
    let vector = vector("supercap.pacific_spirit.state");
    let state = pacific_spirit::decode(&frame(&vector["input"])).unwrap();
    let expect = &vector["expect"];
    assert_eq!(u64::from(state.state), expect["state"]);
    assert!((state.discharge_w - float(&expect["discharge_w"])).abs() < 1e-4);
    assert!((state.supply_w - float(&expect["supply_w"])).abs() < 1e-4);
    assert_eq!(state.energy(), Some(0.0), "a little below zero");
    for (percent, share) in [(1, 0.01), (80, 0.8), (100, 1.0), (110, 1.0)] {
        let data = [0, 0, 0, 0, percent, 0, 2, 0];
        let frame = CanFrame::standard(pacific_spirit::STATE_ID, data).unwrap();
        let energy = pacific_spirit::decode(&frame).and_then(|state| state.energy());
        assert_eq!(energy, Some(share), "{percent} %");
    }
}

#[test]
fn supercap_frames_of_another_kind_are_none() {
    let data = [0, 0, 0, 0, 0, 0, 0, 200];
    let id = |raw| StandardId::new(raw).unwrap();
    for other in [
        CanFrame::standard(0x061, data).unwrap(),
        CanFrame::of(id(hkust::STATE_ID), [0; 7]),
        CanFrame::of(id(pacific_spirit::STATE_ID), [0; 7]),
        CanFrame::new_remote(id(hkust::STATE_ID), 8).unwrap(),
        CanFrame::new_remote(id(pacific_spirit::STATE_ID), 8).unwrap(),
    ] {
        assert!(hkust::decode(&other).is_none() && pacific_spirit::decode(&other).is_none());
    }
    for power in [f32::NAN, f32::INFINITY, 2_001.0, -2_001.0] {
        let [a, b, c, d] = power.to_le_bytes();
        let frame = CanFrame::standard(hkust::STATE_ID, [0, a, b, c, d, 0, 0, 200]).unwrap();
        assert!(hkust::decode(&frame).is_none(), "{power}");
    }
    for percent in [-101_i16, 111, i16::MIN, i16::MAX] {
        let [low, high] = percent.to_le_bytes();
        let data = [0, 0, 0, 0, low, high, 2, 0];
        let frame = CanFrame::standard(pacific_spirit::STATE_ID, data).unwrap();
        assert!(pacific_spirit::decode(&frame).is_none(), "{percent}");
    }
}

proptest! {
    #[test]
    fn any_supercap_frame_gives_a_share_or_none_and_none_in_error(
        data in any::<[u8; 8]>(), burst: bool,
    ) {
        let plan = CapacitorPlan::new(2_000.0, 0.0).unwrap().with_most_w(150.0).unwrap();
        if let Some(state) = hkust::decode(&CanFrame::standard(hkust::STATE_ID, data).unwrap()) {
            prop_assert!((0.0..=1.0).contains(&state.share) && state.chassis_w.is_finite());
            prop_assert!(state.energy().is_none() || data[0] == 0);
            prop_assert!(plan.allowance_w(80.0, state.energy(), burst) <= 230.0);
        }
        let frame = CanFrame::standard(pacific_spirit::STATE_ID, data).unwrap();
        if let Some(state) = pacific_spirit::decode(&frame) {
            prop_assert!((0.0..=1.0).contains(&state.share));
            prop_assert!(state.energy().is_none() || data[6..] == [2, 0]);
            prop_assert!(plan.allowance_w(80.0, state.energy(), burst) <= 230.0);
        }
    }

    #[test]
    fn a_supercap_is_never_told_more_than_was_meant(
        limit_w: u16, buffer_j: u16, on: bool, power_w in any::<u32>().prop_map(f32::from_bits),
    ) {
        let [flags, low, high, a, b, rest @ ..] = hkust::command(on, limit_w, buffer_j);
        let told_w = u16::from_le_bytes([low, high]);
        prop_assert!(told_w <= limit_w && told_w <= 250 && rest == [0; 3]);
        prop_assert_eq!(flags, u8::from(on && limit_w >= 30));
        prop_assert_eq!(u16::from_le_bytes([a, b]), buffer_j);
        let [low, high, ..] = pacific_spirit::command(power_w, 0.0);
        let told_w = f64::from(u16::from_le_bytes([low, high])) / 100.0;
        prop_assert!(told_w == 0.0 || told_w <= f64::from(power_w) + 1e-4 * f64::from(power_w));
    }
}
