//! What the example `chassis` shows, as assertions.

#![cfg(test)]

#[path = "../examples/chassis/scenario.rs"]
mod scenario;

#[path = "../examples/chassis/justfloat.rs"]
mod justfloat;

use drivetrain::wire::Deframer;
use drivetrain::wire::vofa::JustFloat;

use scenario::{Run, Sample, Scenario, Trouble};

fn run(seed: u64, fault: Option<Trouble>) -> Run {
    Scenario { seconds: 10.0, seed, fault }.run(|_| {}, |_| {}).unwrap()
}

fn between(run: &Run, from_s: f32, to_s: f32) -> impl Iterator<Item = &Sample> {
    run.samples.iter().filter(move |sample| sample.time_s > from_s && sample.time_s < to_s)
}

#[test]
fn every_wheel_is_within_two_percent_300_ms_into_constant_motion() {
    for seed in 1..=5 {
        let run = run(seed, None);
        assert!(run.settled_error < 0.02, "seed {seed}: {}", run.settled_error);
        let last = run.samples.last().unwrap();
        let error =
            (last.position_m.0 - last.planned_m.0).hypot(last.position_m.1 - last.planned_m.1);
        assert!(error < 0.02, "seed {seed}: {error} m off at the end");
        assert!(
            (0.56..0.68).contains(&run.traffic.load()),
            "seed {seed}: load {}",
            run.traffic.load()
        );
        assert_eq!((run.statistics.overruns, run.statistics.refused), (0, 0));
    }
}

#[test]
fn the_robot_turns_and_comes_back_to_its_corner() {
    let run = run(1, None);
    let furthest = run.samples.iter().map(|sample| sample.position_m.0).fold(0.0, f32::max);
    assert!((furthest - 1.5).abs() < 0.05, "{furthest} m");
    assert!(run.samples.last().unwrap().heading_rad > 4.0);
}

#[test]
fn a_silent_motor_stops_the_robot_until_it_is_heard_again() {
    let run = run(1, Some(Trouble::SilentMotor));
    assert!(between(&run, 3.12, 3.4).all(|sample| !sample.armed));
    let stopped =
        between(&run, 3.35, 3.4).all(|sample| sample.measured_rpm.rear_right.abs() < 25.0);
    assert!(stopped, "the other wheels stand");
    assert!(between(&run, 3.45, 9.9).all(|sample| sample.armed));
}

#[test]
fn a_lost_bus_disarms_and_lost_frames_do_not() {
    let bus_off = run(1, Some(Trouble::BusOff));
    assert!(between(&bus_off, 3.12, 3.3).all(|sample| !sample.armed));
    assert!(between(&bus_off, 3.4, 9.9).all(|sample| sample.armed));
    let lost = run(1, Some(Trouble::LostFrames));
    assert!(between(&lost, 3.0, 9.9).all(|sample| sample.armed));
}

#[test]
fn every_fault_has_a_name_and_a_window_in_the_run() {
    for fault in Trouble::ALL {
        let run = run(2, Some(fault));
        let (named, from_s, until_s) = run.trouble.unwrap();
        assert!(named == fault && !named.name().is_empty());
        assert!((from_s - 3.0).abs() < 1e-3 && until_s > from_s && until_s < 10.0);
    }
}

#[test]
fn the_same_seed_gives_the_same_samples() {
    let positions =
        |run: Run| run.samples.iter().map(|sample| sample.position_m).collect::<Vec<_>>();
    assert!(positions(run(3, None)) == positions(run(3, None)));
    assert!(positions(run(3, None)) != positions(run(4, None)));
}

#[test]
fn the_justfloat_stream_reads_back_as_the_samples() {
    let run = run(1, None);
    let bytes = justfloat::stream(&run.samples).unwrap();
    let mut rest = &bytes[..];
    let mut reader = Deframer::<JustFloat<{ justfloat::CHANNELS }>, 64>::new(JustFloat);
    for sample in &run.samples {
        let channels = reader.read(&mut rest).unwrap();
        assert_eq!(&channels[..4], &sample.target_rpm.into_array());
        assert_eq!(&channels[4..], &sample.measured_rpm.into_array());
    }
    assert_eq!((reader.read(&mut rest), run.samples.len()), (None, 10_000));
}
