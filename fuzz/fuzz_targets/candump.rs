//! Any bytes: the reader of candump's text ends, and reads back what it writes.
#![no_main]

use drivetrain::wire::candump::Record;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    for line in data.split(|byte| *byte == b'\n') {
        let Ok(record) = Record::parse(line) else { continue };
        for written in [format!("{record}"), format!("{record:#}")] {
            assert_eq!(Record::parse(written.as_bytes()), Ok(record), "{written}");
        }
    }
});
