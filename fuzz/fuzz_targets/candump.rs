//! Any line: no panic; what is read is written and read again.
#![no_main]

use drivetrain::wire::candump::Record;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|line: &[u8]| {
    match Record::parse(line) {
        Ok(record) => {
            for text in [format!("{record}"), format!("{record:#}")] {
                assert_eq!(Record::parse(text.as_bytes()), Ok(record));
            }
        }
        Err(error) => assert!((1..=line.len() + 1).contains(&error.column())),
    }
});
