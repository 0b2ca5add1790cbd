//! Any bytes from the computer or from the robot, in any split.
#![no_main]

use drivetrain::wire::host_link::{ByteOrder, CommandFormat, TelemetryFormat, TelemetryHeader};
use drivetrain_fuzz::any_split_gives_the_same;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    any_split_gives_the_same(CommandFormat, data);
    let document = TelemetryFormat::new().with_header(TelemetryHeader::Document);
    for format in [document, TelemetryFormat::new().with_floats(ByteOrder::Big)] {
        any_split_gives_the_same(format, data);
    }
});
