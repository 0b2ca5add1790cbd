//! Framed byte protocols: what is found must not depend on how the bytes were split.

use crate::Input;
use std::fmt::Debug;

use drivetrain::time::{Duration, Instant};
use drivetrain::wire::{Counts, Decode, Deframer, Receiver, Reject};
use std::cell::Cell;
use std::rc::Rc;

/// Long enough for every frame of every protocol.
const BUFFER: usize = 160;

/// A frame that notes how many bytes were frames.
struct Counted<F>(F);

impl<F: Decode> Decode for Counted<F> {
    type Options = (F::Options, Rc<Cell<usize>>);
    const PREFIX: usize = F::PREFIX;

    fn header((options, _): &Self::Options) -> &[u8] {
        F::header(options)
    }

    fn length((options, _): &Self::Options, prefix: &[u8]) -> Option<usize> {
        F::length(options, prefix)
    }

    fn decode((options, bytes): &Self::Options, frame: &[u8]) -> Result<Self, Reject> {
        let outcome = F::decode(options, frame);
        if matches!(outcome, Ok(_) | Err(Reject::Foreign)) {
            bytes.set(bytes.get() + frame.len());
        }
        outcome.map(Self)
    }
}

/// Reads `bytes` in pieces of `piece` bytes and checks what holds for any bytes.
fn read<F: Decode>(options: F::Options, bytes: &[u8], piece: usize) -> (Vec<F>, Counts) {
    let in_frames = Rc::new(Cell::new(0));
    let options = (options, Rc::clone(&in_frames));
    let mut decoder = Deframer::<Counted<F>, BUFFER>::with_options(options);
    let mut frames = Vec::new();
    for mut piece in bytes.chunks(piece) {
        while let Some(Counted(frame)) = decoder.read(&mut piece) {
            frames.push(frame);
        }
        assert!(piece.is_empty());
    }
    let counts = decoder.counts();
    assert_eq!(counts.frames as usize, frames.len(), "I6");
    // I6: every byte was in a frame, was skipped, or waits for the end of its frame.
    let waiting = bytes.len().checked_sub(in_frames.get() + counts.skipped_bytes as usize);
    assert!(waiting.is_some_and(|waiting| waiting <= BUFFER), "I6: {counts:?}, {in_frames:?}");
    (frames, counts)
}

/// What comes over a line: noise, frames as their sender writes them, and frames that lost their end or of which one byte was
/// changed on the way.
fn stream(mut input: Input, frame: impl Fn(&mut Input) -> Vec<u8>) -> Vec<u8> {
    let mut bytes = Vec::new();
    while !input.is_empty() {
        match input.byte() {
            noise @ 0..=127 => bytes.extend((0..=noise % 16).map(|_| input.byte())),
            128..=207 => bytes.extend(frame(&mut input)),
            kind => {
                let (place, change, mut frame) = (input.byte(), input.byte(), frame(&mut input));
                let place = usize::from(place) % frame.len();
                match kind {
                    208..=231 => frame[place] ^= change,
                    _ => frame.truncate(place),
                }
                bytes.extend(frame);
            }
        }
    }
    bytes
}

/// One bit that was turned over on the way, wherever it is behind the header and the length, makes a frame none. Which bit is chosen
/// by what the frame holds.
pub fn refuses_a_flipped_bit<F: Decode + Debug>(options: &F::Options, frame: &[u8]) {
    let seed = frame.iter().fold(0_usize, |sum, byte| sum * 31 % 65_521 + usize::from(*byte));
    let mut damaged = frame.to_vec();
    damaged[F::PREFIX + seed / 8 % (frame.len() - F::PREFIX)] ^= 1 << (seed % 8);
    let outcome = F::decode(options, &damaged);
    assert!(matches!(outcome, Err(Reject::Checksum)), "{damaged:02X?}: {outcome:?}");
}

/// The first byte says how the others are split: the frames found and the counts must not depend on it. `frame` writes what the
/// protocol takes.
pub fn any_split_gives_the_same<F: Decode<Options: Copy> + Copy + Debug>(
    options: F::Options,
    data: &[u8],
    frame: impl Fn(&mut Input) -> Vec<u8>,
) {
    let Some((piece, data)) = data.split_first() else { return };
    let bytes = &stream(Input(data), frame);
    let (whole, whole_counts) = read::<F>(options, bytes, usize::MAX);
    assert_eq!(format!("{whole:?}"), format!("{:?}", search::<F>(&options, bytes)), "I6");
    let (split, split_counts) = read::<F>(options, bytes, usize::from(*piece % 64) + 1);
    assert_eq!(whole_counts, split_counts);
    // Compared as text: a frame may hold NaN.
    assert_eq!(format!("{whole:?}"), format!("{split:?}"));
    assert_eq!(watch::<F>(options, bytes, usize::from(*piece % 64) + 1), whole_counts);
}

/// The frames as one finds them who has all bytes before them: a frame that is none costs one byte, not its length.
fn search<F: Decode>(options: &F::Options, bytes: &[u8]) -> Vec<F> {
    let (mut frames, mut rest) = (Vec::new(), bytes);
    while let Some(prefix) = rest.get(..F::PREFIX) {
        let total = F::length(options, prefix).filter(|total| (F::PREFIX..=BUFFER).contains(total));
        let used = match total.filter(|_| rest.starts_with(F::header(options))) {
            None => 1,
            Some(total) => match rest.get(..total).map(|frame| F::decode(options, frame)) {
                None => break,
                Some(Ok(frame)) => {
                    frames.push(frame);
                    total
                }
                Some(Err(Reject::Foreign)) => total,
                Some(Err(_)) => 1,
            },
        };
        rest = &rest[used..];
    }
    frames
}

/// Reads through a link, each piece up to 255 ms after the one before: what it shows came in time (I4).
fn watch<F: Decode + Copy>(options: F::Options, bytes: &[u8], piece: usize) -> Counts {
    const DEADLINE: Duration = Duration::from_millis(100);
    let mut link = Receiver::<F, BUFFER>::with_options(options, DEADLINE);
    let (mut now, mut heard, mut repeated) = (Instant::START, None, 0);
    for mut piece in bytes.chunks(piece) {
        now = now + Duration::from_millis(piece.first().copied().unwrap_or_default().into());
        while link.read(&mut piece, now).is_some() {
            // A frame that is the same sample again is no sign of life.
            let frozen = core::mem::replace(&mut repeated, link.frozen_frames());
            if frozen == repeated {
                heard = Some(now);
            }
        }
        let fresh = heard.is_some_and(|heard| now - heard <= DEADLINE);
        assert_eq!(link.latest(now).is_some(), fresh, "I4: at {now:?}, heard {heard:?}");
    }
    link.counts()
}
