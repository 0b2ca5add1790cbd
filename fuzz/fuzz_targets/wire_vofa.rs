//! Any bytes in JustFloat, in any split; and any values are written so that they are read again.
#![no_main]

use drivetrain::wire::Deframer;
use drivetrain::wire::vofa::{JustFloat, justfloat};
use drivetrain_fuzz::any_split_gives_the_same;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    any_split_gives_the_same(JustFloat::<3>, data);
    let mut reader = Deframer::<JustFloat<3>, 16>::new(JustFloat);
    for values in data.chunks_exact(12) {
        let value = |at: usize| {
            f32::from_le_bytes([values[at], values[at + 1], values[at + 2], values[at + 3]])
        };
        let mut buffer = [0; 16];
        let mut bytes = justfloat(&[value(0), value(4), value(8)], &mut buffer).expect("16 bytes");
        assert!(reader.read(&mut bytes).is_some());
    }
    assert_eq!(reader.counts().skipped_bytes, 0);
});
