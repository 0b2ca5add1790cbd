//! Any bytes in JustFloat, in any split; and any values are written so that they are read again.
#![no_main]

use core::array::from_fn;
use drivetrain::wire::Deframer;
use drivetrain::wire::vofa::justfloat;
use drivetrain_fuzz::{Input, any_split_gives_the_same};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    any_split_gives_the_same::<[f32; 3]>((), data, plot);
    let mut input = Input(data);
    let mut reader = Deframer::<[f32; 3], 16>::new();
    while !input.is_empty() {
        let frame = plot(&mut input);
        let ends = frame.windows(4).filter(|bytes| *bytes == [0, 0, 0x80, 0x7F]);
        assert_eq!(ends.count(), 1, "{frame:?}");
        assert!(reader.read(&mut &frame[..]).is_some());
    }
    assert_eq!(reader.counts().skipped_bytes, 0);
});

/// Values that hold, more often than chance would have it, the bytes that end a frame.
fn plot(input: &mut Input) -> Vec<u8> {
    let mut byte = || match input.byte() {
        0..=63 => 0,
        64..=127 => 0x80,
        128..=191 => 0x7F,
        other => other,
    };
    let values: [f32; 3] = from_fn(|_| f32::from_le_bytes(from_fn(|_| byte())));
    justfloat(&values, &mut [0; 16]).expect("16 bytes").to_vec()
}
