//! Framed byte protocols: what is found must not depend on how the bytes were split.

use std::fmt::Debug;

use drivetrain::wire::{Counts, Deframer, Protocol};

/// Long enough for every frame of every protocol.
const BUFFER: usize = 160;

/// Reads `bytes` in pieces of `piece` bytes and checks what holds for any bytes.
fn read<P: Protocol>(protocol: P, bytes: &[u8], piece: usize) -> (Vec<P::Frame>, Counts) {
    let mut decoder = Deframer::<P, BUFFER>::new(protocol);
    let mut frames = Vec::new();
    for mut piece in bytes.chunks(piece) {
        while let Some(frame) = decoder.read(&mut piece) {
            frames.push(frame);
        }
        assert!(piece.is_empty());
    }
    let counts = decoder.counts();
    assert_eq!(counts.frames as usize, frames.len());
    assert!(counts.skipped_bytes as usize <= bytes.len());
    (frames, counts)
}

/// The first byte says how the others are split: the frames found and the counts must not depend on it.
pub fn any_split_gives_the_same<P: Protocol + Copy>(protocol: P, data: &[u8])
where
    P::Frame: Debug,
{
    let Some((piece, bytes)) = data.split_first() else { return };
    let (whole, whole_counts) = read(protocol, bytes, usize::MAX);
    let (split, split_counts) = read(protocol, bytes, usize::from(*piece % 64) + 1);
    assert_eq!(whole_counts, split_counts);
    // Compared as text: a frame may hold NaN.
    assert_eq!(format!("{whole:?}"), format!("{split:?}"));
}
