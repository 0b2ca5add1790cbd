//! Any bytes from the servos, in any split.
#![no_main]

use drivetrain::wire::feetech::Sts;
use drivetrain_fuzz::{Input, any_split_gives_the_same};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| any_split_gives_the_same(Sts, data, status));

/// Header, id, length, errors, parameters, and the complement of their sum.
fn status(input: &mut Input) -> Vec<u8> {
    let (id, parameters) = (input.byte(), input.byte() % 40);
    let mut frame = vec![0xFF, 0xFF, id, parameters + 2];
    frame.extend((0..=parameters).map(|_| input.byte()));
    let sum = frame[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    frame.push(!sum);
    frame
}
