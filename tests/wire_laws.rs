//! The laws that hold for every framed byte protocol, each proven for each: faults F57 to F60.

#![cfg(test)]

use std::fmt::Debug;

use drivetrain::wire::feetech::{self, Status};
use drivetrain::wire::hipnuc::Imu;
use drivetrain::wire::host_link::{
    COMMAND_LENGTH, HostCommand, Reset, TELEMETRY_LENGTH, Telemetry, TelemetryFormat,
};
use drivetrain::wire::referee::{self, RefereeMessage};
use drivetrain::wire::vofa::justfloat;
use drivetrain::wire::vt13::{DEAD_BAND, VideoRemote};
use drivetrain::wire::{Counts, Decode, Deframer};
use proptest::prelude::*;
use proptest::test_runner::TestCaseResult;

/// A frame under test, with a way to write one.
trait Subject: Decode<Options: Copy> + PartialEq + Debug {
    /// The bytes of a frame that `seed` makes up.
    fn frame(options: Self::Options, seed: u64) -> Vec<u8>;

    /// Whether a flipped bit is always found.
    const CHECKED: bool = true;
}

/// Bytes that look random, and are the same for the same seed.
fn scramble(seed: u64) -> impl Iterator<Item = u8> {
    let mut state = seed ^ 0x9E37_79B9_7F4A_7C15;
    std::iter::repeat_with(move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state.to_le_bytes()[3]
    })
}

impl Subject for HostCommand {
    fn frame(_: (), seed: u64) -> Vec<u8> {
        let mut bytes = scramble(seed);
        let mut byte = || bytes.next().unwrap();
        let mut command = Self::default();
        for joint in 0..12 {
            // Now and then a whole header, or half of one, inside of the payload.
            let position = match byte() % 4 {
                0 => [0xAA, 0x55, 0x01, 0x4B],
                1 => [byte(), byte(), 0xAA, 0x55],
                _ => [byte(), byte(), byte(), byte()],
            };
            command.speeds_rpm[joint] = byte();
            command.positions_pulses[joint] = i32::from_be_bytes(position);
        }
        if seed.is_multiple_of(3) {
            command.positions_pulses[5] = i32::from_be_bytes([0, 0, 0xAA, 0x55]);
            (command.speeds_rpm[6], command.positions_pulses[6]) = (1, 0x4B31_10AA);
        }
        command.reset = Reset::from_raw(byte());
        command.encode(&mut [0; COMMAND_LENGTH]).unwrap().to_vec()
    }
}

impl Subject for Telemetry {
    fn frame(format: TelemetryFormat, seed: u64) -> Vec<u8> {
        let mut bytes = scramble(seed);
        let mut byte = || bytes.next().unwrap();
        let mut telemetry = Self::default();
        for position in &mut telemetry.positions_pulses {
            *position = match byte() % 4 {
                0 => i32::from_be_bytes([byte(), 0xAA, 0x55, 0x74]),
                1 => i32::from_be_bytes([0xBB, 0x66, 0x74, byte()]),
                _ => i32::from_be_bytes([byte(), byte(), byte(), byte()]),
            };
        }
        telemetry.imu_angles_deg = [[f32::from(byte()), -1.5, f32::from(byte())]; 4];
        format.encode(&telemetry, &mut [0; TELEMETRY_LENGTH]).unwrap().to_vec()
    }
}

impl Subject for Imu {
    /// The frame of the manual with another time: the only encoder of this protocol.
    fn frame(_: (), seed: u64) -> Vec<u8> {
        const CRC: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_XMODEM);
        let golden = "5A A5 4C 00 14 BB 91 08 15 23 09 A2 C4 47 08 15 1C 00 CC E8 61 BE 9A 35 56 3E 65 EA 72 \
            3F 31 D0 7C BD 75 DD C5 BB 6B D7 24 BC 89 88 FC 40 01 00 6A 41 AB 2A 70 C2 96 D4 50 41 ED 03 43 \
            41 41 F4 F4 C2 CC CA F8 BE 73 6A 19 BE F0 00 1C 3D 8D 37 5C 3F";
        let bytes = golden.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap());
        let mut frame: Vec<u8> = bytes.collect();
        frame[14..18].copy_from_slice(&seed.to_le_bytes()[..4]);
        frame[7..9].copy_from_slice(&[0x5A, 0xA5]); // a header in the status
        let mut digest = CRC.digest();
        digest.update(&frame[..4]);
        digest.update(&frame[6..]);
        let crc = digest.finalize();
        frame[4..6].copy_from_slice(&crc.to_le_bytes());
        frame
    }
}

impl Subject for Status {
    fn frame(_: (), seed: u64) -> Vec<u8> {
        let mut bytes = scramble(seed);
        let count = usize::from(bytes.next().unwrap()) % (feetech::MAX_PARAMETERS + 1);
        let mut frame =
            vec![0xFF, 0xFF, bytes.next().unwrap() % 254, u8::try_from(count).unwrap() + 2, 0];
        frame.extend(bytes.take(count));
        let sum = frame[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        frame.push(!sum);
        frame
    }
}

impl Subject for RefereeMessage {
    /// One of the messages that are read, or any other, now and then with a whole frame in its data.
    fn frame(_: (), seed: u64) -> Vec<u8> {
        let mut bytes = scramble(seed);
        let mut byte = || bytes.next().unwrap();
        let (command, length) = match byte() % 8 {
            0 => (0x0201, 13),
            1 => (0x0201, 17),
            2 => (0x0202, 14),
            3 => (0x0202, 16),
            4 => (0x0207, 7),
            _ => (u16::from_le_bytes([byte(), 3]), usize::from(byte()) % (referee::MAX_DATA + 1)),
        };
        let mut data: Vec<u8> = (0..length).map(|_| byte()).collect();
        match (command, length) {
            (0x0201, 17) => data[12..16].copy_from_slice(&30.0_f32.to_le_bytes()),
            (0x0207, 7) => data[3..7].copy_from_slice(&24.5_f32.to_le_bytes()),
            (_, 60..) => {
                let inner = [0xEE; 13];
                _ = referee::encode(0x0201, 0, &inner, &mut data[..22]).unwrap();
            }
            _ => {}
        }
        referee::encode(command, byte(), &data, &mut [0; 160]).unwrap().to_vec()
    }
}

impl Subject for VideoRemote {
    fn frame(_: u16, seed: u64) -> Vec<u8> {
        let mut bytes = scramble(seed);
        let mut byte = || u64::from(bytes.next().unwrap());
        let mut bits = (byte() & 7) << 46 | (byte() & 0xF) << 60 | (byte() % 3) << 44;
        for place in [0, 11, 22, 33, 49] {
            bits |= (364 + (byte() << 8 | byte()) % 1_321) << place;
        }
        let mut frame = vec![0xA9, 0x53];
        frame.extend(bits.to_le_bytes());
        // A header among the counts of the mouse.
        frame.extend([0xA9, 0x53, 0xA9, 0x53, 1, 2, 0b01_0001, 0x34, 0x12]);
        let crc = crc::Crc::<u16>::new(&crc::CRC_16_MCRF4XX).checksum(&frame);
        frame.extend(crc.to_le_bytes());
        frame
    }
}

impl Subject for [f32; 3] {
    fn frame(_: (), seed: u64) -> Vec<u8> {
        let values: Vec<f32> = scramble(seed).take(3).map(|byte| f32::from(byte) - 100.5).collect();
        justfloat(&values, &mut [0; 16]).unwrap().to_vec()
    }

    const CHECKED: bool = false;
}

const BUFFER: usize = 160;

/// Reads `bytes` in pieces of the given lengths (one piece when there are none), and what is left in one.
fn read<F: Subject>(options: F::Options, bytes: &[u8], pieces: &[usize]) -> (Vec<F>, Counts) {
    let mut decoder = Deframer::<F, BUFFER>::with_options(options);
    let mut frames = Vec::new();
    let (mut rest, mut pieces) = (bytes, pieces.iter());
    while !rest.is_empty() {
        let length = pieces.next().map_or(rest.len(), |length| *length.min(&rest.len()));
        let (mut piece, later) = rest.split_at(length);
        while let Some(frame) = decoder.read(&mut piece) {
            frames.push(frame);
        }
        assert!(piece.is_empty(), "a decoder that has no frame has taken all");
        rest = later;
    }
    (frames, decoder.counts())
}

fn good<F: Subject>(options: F::Options, seed: u64) -> F {
    F::decode(&options, &F::frame(options, seed)).ok().unwrap()
}

fn any_split_gives_the_same_frames<F: Subject>(
    options: F::Options,
    seeds: &[u64],
    noise: &[u8],
    pieces: &[usize],
) -> TestCaseResult {
    let mut stream = noise.to_vec();
    for seed in seeds {
        stream.extend(F::frame(options, *seed));
        stream.extend(noise.iter().take((*seed % 5) as usize));
    }
    let whole = read::<F>(options, &stream, &[]);
    prop_assert_eq!(&read::<F>(options, &stream, pieces), &whole);
    prop_assert_eq!(&read::<F>(options, &stream, &vec![1; stream.len()]), &whole);
    Ok(())
}

/// What a patient reader finds who has all bytes before him and tries every place: where each frame begins and ends.
fn oracle<F: Subject>(options: F::Options, bytes: &[u8]) -> Vec<(std::ops::Range<usize>, F)> {
    let (mut at, mut found) = (0, Vec::new());
    while at < bytes.len() {
        let rest = &bytes[at..];
        let length = rest.get(..F::PREFIX).filter(|prefix| prefix.starts_with(F::header(&options)));
        let length = length
            .and_then(|prefix| F::length(&options, prefix))
            .filter(|length| *length <= BUFFER);
        let frame = length
            .and_then(|length| rest.get(..length))
            .map(|frame| (frame.len(), F::decode(&options, frame)));
        if let Some((length, Ok(frame))) = frame {
            found.push((at..at + length, frame));
            at += length;
        } else {
            at += 1;
        }
    }
    found
}

/// The decoder finds what the oracle finds, and with it every frame that was sent whole. Only chance can hide one:
/// when bytes before it and some of its own make up a frame with a checksum that fits.
fn whole_frames_are_found<F: Subject>(
    options: F::Options,
    parts: &[(&[u8], bool)],
) -> TestCaseResult {
    let mut stream = Vec::new();
    let mut sent = Vec::new();
    for (bytes, is_whole) in parts {
        if *is_whole {
            sent.push(stream.len()..stream.len() + bytes.len());
        }
        stream.extend(*bytes);
    }
    stream.extend([0x11; BUFFER]); // what noise that looks like a header waits for
    let found = oracle::<F>(options, &stream);
    for sent in sent {
        let chance =
            |place: &std::ops::Range<usize>| place.start < sent.start && place.end > sent.start;
        let is_found = found.iter().any(|(place, _)| *place == sent || chance(place));
        prop_assert!(is_found, "{:?}", sent);
    }
    let (frames, counts) = read::<F>(options, &stream, &[]);
    prop_assert_eq!(counts.frames as usize, frames.len());
    let found: Vec<F> = found.into_iter().map(|(_, frame)| frame).collect();
    prop_assert_eq!(format!("{frames:?}"), format!("{found:?}")); // as text: a flipped bit may make NaN
    Ok(())
}

fn noise_loses_no_frame<F: Subject>(
    options: F::Options,
    seeds: &[u64],
    noise: &[u8],
) -> TestCaseResult {
    let frames: Vec<Vec<u8>> = seeds.iter().map(|seed| F::frame(options, *seed)).collect();
    let parts: Vec<_> = frames.iter().flat_map(|frame| [(noise, false), (frame, true)]).collect();
    whole_frames_are_found::<F>(options, &parts)
}

/// The damaged frame is refused, and the one behind it is delivered.
fn damage_loses_only_the_damaged<F: Subject>(
    options: F::Options,
    seed: u64,
    cut: usize,
    bit: usize,
) -> TestCaseResult {
    let (frame, next) = (F::frame(options, seed), F::frame(options, seed ^ 1));
    whole_frames_are_found::<F>(options, &[(&frame[..cut % frame.len()], false), (&next, true)])?;

    let mut flipped = frame.clone();
    let bit = bit % (8 * frame.len());
    flipped[bit / 8] ^= 1 << (bit % 8);
    whole_frames_are_found::<F>(options, &[(&flipped, false), (&next, true)])?;
    if F::CHECKED {
        let (frames, counts) = read::<F>(options, &flipped, &[]);
        prop_assert!(!frames.contains(&good::<F>(options, seed)), "bit {bit} flipped");
        prop_assert!(bit < 8 * F::PREFIX || counts.checksum_errors > 0, "bit {bit} flipped");
    }
    Ok(())
}

/// Any bytes: nothing panics, and every byte is accounted for.
fn any_bytes_are_accounted_for<F: Subject>(options: F::Options, bytes: &[u8]) -> TestCaseResult {
    let mut decoder = Deframer::<F, BUFFER>::with_options(options);
    let mut input = bytes;
    let mut found = 0;
    while decoder.read(&mut input).is_some() {
        found += 1;
    }
    decoder.abandon();
    while decoder.read(&mut input).is_some() {
        found += 1;
    }
    let counts = decoder.counts();
    prop_assert_eq!(counts.frames, found);
    prop_assert!(counts.skipped_bytes as usize <= bytes.len());
    Ok(())
}

macro_rules! laws {
    ($($name:ident: $frame:ty, $options:expr;)*) => {$(
        mod $name {
            use super::*;

            proptest! {
                #[test]
                fn f57_any_split_gives_the_same_frames(
                    seeds in prop::collection::vec(any::<u64>(), 1..5),
                    noise in prop::collection::vec(any::<u8>(), 0..20),
                    pieces in prop::collection::vec(1_usize..100, 0..20),
                ) {
                    any_split_gives_the_same_frames::<$frame>($options, &seeds, &noise, &pieces)?;
                }

                #[test]
                fn f58_noise_loses_no_frame(
                    seeds in prop::collection::vec(any::<u64>(), 1..5),
                    noise in prop::collection::vec(any::<u8>(), 0..200),
                ) {
                    noise_loses_no_frame::<$frame>($options, &seeds, &noise)?;
                }

                #[test]
                fn f58_headers_in_the_noise_lose_no_frame(
                    seeds in prop::collection::vec(any::<u64>(), 1..5),
                    cut in 0_usize..200,
                ) {
                    let mut noise = <$frame>::frame($options, seeds[0] ^ 2);
                    noise.truncate(cut.min(noise.len() - 1));
                    noise_loses_no_frame::<$frame>($options, &seeds, &noise)?;
                }

                #[test]
                fn f59_one_flipped_bit_loses_only_its_frame(
                    seed in any::<u64>(), cut in any::<usize>(), bit in any::<usize>(),
                ) {
                    damage_loses_only_the_damaged::<$frame>($options, seed, cut, bit)?;
                }

                #[test]
                fn any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
                    any_bytes_are_accounted_for::<$frame>($options, &bytes)?;
                }
            }
        }
    )*};
}

laws! {
    host_link_command: HostCommand, ();
    host_link_telemetry: Telemetry, TelemetryFormat::new();
    host_link_telemetry_of_the_document: Telemetry, TelemetryFormat::new().with_document_header();
    imu: Imu, ();
    servo: Status, ();
    referee_system: RefereeMessage, ();
    video_remote: VideoRemote, DEAD_BAND;
    plot: [f32; 3], ();
}

#[test]
fn f60_a_length_of_zero_or_too_large_is_refused_at_once() {
    for length in [0_u16, 513, 0xFFFF, 155] {
        // 155: one byte more than the buffer takes
        let [low, high] = length.to_le_bytes();
        let mut decoder = Deframer::<Imu, BUFFER>::new();
        assert_eq!(decoder.read(&mut &[0x5A, 0xA5, low, high][..]), None);
        assert_eq!(decoder.counts().length_errors, 1, "{length}");
        assert!(decoder.read(&mut &Imu::frame((), 1)[..]).is_some(), "{length}");
    }
    for length in [0, 1, 35, 0xFF] {
        // 35: one parameter more than a status takes
        let mut decoder = Deframer::<Status, BUFFER>::new();
        assert_eq!(decoder.read(&mut &[0xFF, 0xFF, 1, length][..]), None);
        assert!(decoder.counts().length_errors >= 1, "{length}");
        assert!(decoder.read(&mut &[0xFF, 0xFF, 1, 2, 0, 0xFC][..]).is_some(), "{length}");
    }
}

#[test]
fn f60_a_referee_header_with_a_wrong_sum_or_too_much_data_holds_nothing_back() {
    let good = RefereeMessage::frame((), 5);
    // 129 bytes of data with a sum that fits, and 8 bytes with one that does not.
    let long = referee::encode(0x0310, 0, &[0; 129], &mut [0; 160]).unwrap()[..5].to_vec();
    for header in [&long[..], &[0xA5, 8, 0, 0, 0]] {
        let mut decoder = Deframer::<RefereeMessage, BUFFER>::new();
        assert_eq!(decoder.read(&mut &header[..]), None);
        assert_eq!(decoder.counts().length_errors, 1, "{header:02X?}");
        assert!(decoder.read(&mut &good[..]).is_some(), "{header:02X?}");
    }
}

#[test]
fn f58_a_third_ff_before_a_servo_frame_is_noise() {
    let (frames, counts) = read::<Status>((), &[0xFF, 0xFF, 0xFF, 0xFF, 1, 2, 0, 0xFC], &[]);
    assert_eq!((frames.len(), counts.skipped_bytes), (1, 2));
}

#[test]
fn f58_a_whole_frame_inside_a_damaged_one_is_found() {
    let inner = Status::frame((), 7);
    let mut outer = vec![0xFF, 0xFF, 1, u8::try_from(inner.len()).unwrap() + 3, 0];
    outer.extend(&inner);
    outer.extend([0, 0x55]); // not the sum
    let (frames, counts) = read::<Status>((), &outer, &[]);
    assert_eq!(frames, [good((), 7)]);
    assert_eq!(counts.checksum_errors, 1);
}

#[test]
fn a_pause_frees_what_a_damaged_length_holds_back() {
    let mut decoder = Deframer::<Status, BUFFER>::new();
    let held_back = [&[0xFF, 0xFF, 1, 30][..], &[0xFF, 0xFF, 1, 2, 0, 0xFC]].concat();
    assert_eq!(decoder.read(&mut &held_back[..]), None);
    decoder.abandon();
    assert!(decoder.read(&mut &[][..]).is_some());
}

#[test]
fn f58_a_checksum_that_fits_by_chance_hides_no_frame() {
    // The first 69 bytes of one frame with the first 13 of the next have a CRC that fits, and no quaternion.
    let seed = 17_266_557_442_579_749_602;
    let truncated = &Imu::frame((), seed ^ 2)[..69];
    let (frames, counts) =
        read::<Imu>((), &[truncated, &Imu::frame((), seed), &[0x11; 82]].concat(), &[]);
    assert_eq!((frames.len(), counts.content_errors), (1, 1));
}
