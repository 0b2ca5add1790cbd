//! Any bytes from an IMU, in any split.
#![no_main]

use drivetrain::wire::hipnuc::HipNuc;
use drivetrain_fuzz::any_split_gives_the_same;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| any_split_gives_the_same(HipNuc, data));
