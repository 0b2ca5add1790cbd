//! Any bytes from the servos, in any split.
#![no_main]

use drivetrain::wire::Decode;
use drivetrain::wire::feetech::Status;
use drivetrain_fuzz::{Input, any_split_gives_the_same, refuses_a_flipped_bit};
use libfuzzer_sys::fuzz_target;

/// From the documentation: the longest answer that is taken.
const MAX_PARAMETERS: usize = 32;

fuzz_target!(|data: &[u8]| any_split_gives_the_same::<Status>((), data, status));

/// Header, id, length, errors, parameters, and the complement of their sum.
fn status(input: &mut Input) -> Vec<u8> {
    let (id, parameters) = (input.byte(), input.byte() % 40);
    let mut frame = vec![0xFF, 0xFF, id, parameters + 2];
    frame.extend((0..=parameters).map(|_| input.byte()));
    let sum = frame[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    frame.push(!sum);
    refuses_a_flipped_bit::<Status>(&(), &frame);
    let status = Status::decode(&(), &frame);
    if usize::from(parameters) <= MAX_PARAMETERS {
        let status = status.expect("a whole frame");
        let sent = &frame[5..5 + usize::from(parameters)];
        assert_eq!((status.id(), status.parameters()), (id, sent));
        assert_eq!(status.errors(), frame[4]);
        assert_eq!(status.is_overloaded(), frame[4] & 0x20 != 0);
    } else {
        assert!(status.is_err(), "{status:?}");
    }
    frame
}
