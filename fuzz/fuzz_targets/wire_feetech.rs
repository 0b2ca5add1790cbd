//! Any bytes from the servos, in any split.
#![no_main]

use drivetrain::wire::feetech::Sts;
use drivetrain_fuzz::any_split_gives_the_same;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| any_split_gives_the_same(Sts, data));
