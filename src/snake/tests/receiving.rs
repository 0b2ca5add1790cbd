//! Replies, and what is none.

use super::*;

#[test]
fn replies_are_sorted_by_their_register() {
    let mut bench = Bench::new(&[3]);
    bench.raw = [-7; 12];
    bench.run(10);
    let (pulses, rpm) = (bench.state(0).pulses, bench.state(0).velocity.as_rpm());
    assert!(pulses == -7 && (rpm - 60.0).abs() < 1e-3);
    bench.joints.read(bench.handles[0], Register::Deceleration).unwrap();
    assert_eq!(bench.joints.answer(bench.handles[0]), None);
    bench.run(4);
    let answer = bench.joints.answer(bench.handles[0]);
    assert_eq!(answer, Some((Register::Deceleration, 77)));
    assert_eq!((bench.state(0).pulses, bench.joints.answer(bench.handles[0])), (-7, None));
}

#[test]
fn what_is_no_reply_is_refused_counted_and_keeps_nothing_fresh() {
    let mut bench = Bench::armed(&[3]);
    let now = at_ms(bench.ms);
    let mut ingest = |id, data: &[u8]| bench.joints.ingest(&frame(id, data), now);
    assert_eq!(ingest(3, &[4, 7, 0, 0, 0]), Ingest::WrongLength(5));
    assert_eq!(ingest(3, &[4, 0x0D, 0, 0, 0, 0]), Ingest::WrongField);
    assert_eq!(ingest(3, &[9, 7, 0, 0, 0, 0]), Ingest::WrongField);
    assert_eq!(ingest(3, &[1, 0x10, 0, 0, 0, 1]), Ingest::WrongField);
    assert_eq!(ingest(3, &[3, 7]), Ingest::WrongLength(2));
    assert_eq!(ingest(4, &[4, 7, 0, 0, 0, 0]), Ingest::Unrelated);
    assert_eq!(ingest(13, &[4, 7, 0, 0, 0, 0]), Ingest::Unrelated);
    let counters = bench.joints.counters();
    assert_eq!((counters.bad_length, counters.bad_field), (1, 2));
    assert_eq!((counters.foreign_commands, counters.unattached), (2, 1));
    assert_eq!(bench.state(0).bad_replies, 5);
}
