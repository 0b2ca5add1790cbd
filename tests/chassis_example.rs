//! What the example `chassis` shows, as assertions.

#![cfg(test)]

#[path = "../examples/chassis/scenario.rs"]
mod scenario;

#[path = "../examples/chassis/justfloat.rs"]
mod justfloat;

#[path = "../examples/chassis/serial.rs"]
mod serial;

#[path = "../examples/chassis/silence.rs"]
mod silence;

#[path = "../examples/chassis/report.rs"]
mod report;

#[path = "../examples/chassis/plot.rs"]
mod plot;

#[path = "../examples/chassis/modes.rs"]
mod modes;

#[path = "../examples/chassis/verdict.rs"]
mod verdict;

use drivetrain::chassis::ChassisMode;

use drivetrain::wire::Deframer;

use modes::Drive;
use scenario::{Run, Sample, Scenario, Trouble};
use serial::Script;
use verdict::Verdict;

const MODES: [ChassisMode; 4] =
    [ChassisMode::FollowGimbal, ChassisMode::Rotor, ChassisMode::Independent, ChassisMode::Relax];

fn run(seed: u64, fault: Option<Trouble>) -> Run {
    Scenario { seconds: 10.0, seed, fault, serial: None }.run(|_| {}, |_| {}).unwrap()
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
    assert!(between(&bus_off, 3.45, 9.9).all(|sample| sample.armed));
    let lost = run(1, Some(Trouble::LostFrames));
    assert!(between(&lost, 3.0, 9.9).all(|sample| sample.armed));
}

/// A bus-off at 1 m/s ends 2 mm off the path: what the ESCs did has to be said all the same.
#[test]
fn the_currents_that_the_escs_keep_while_the_bus_is_off_are_told_and_drawn() {
    let run = run(1, Some(Trouble::BusOff));
    let silence = run.silence.unwrap();
    assert!((silence.from_s - 3.0).abs() < 0.0015 && (silence.until_s - 3.3).abs() < 0.0015);
    assert!((199..=202).contains(&silence.disarmed_ms), "{} ms", silence.disarmed_ms);
    assert!((silence.way_m - 0.3).abs() < 0.01, "{} m", silence.way_m);
    // Each ESC goes on with one current, that of friction at this speed, to the last bit of its command.
    let kept = between(&run, 3.15, 3.16).next().unwrap().current_a.into_array();
    for sample in between(&run, 3.005, 3.3) {
        let off = sample.current_a.into_iter().zip(kept).map(|(a, b)| (a - b).abs());
        assert!(
            off.fold(0.0, f32::max) < 0.001 && kept.iter().all(|a| (0.3..1.0).contains(&a.abs()))
        );
    }
    let told = report::table(&run);
    let words = NAMES.iter().zip(kept).map(|(name, amperes)| format!("{name} {amperes:+.2} A"));
    let words = words.chain(
        [
            "no command reached them for 301 ms from 2.999 s on",
            "the robot went 0.30 m, and was disarmed for 201 ms",
            "simulated ESCs hold their last command; what real ones do is not documented",
        ]
        .map(str::to_owned),
    );
    for word in words {
        assert!(told.contains(&word), "no \"{word}\" in\n{told}");
    }
    let drawn = plot::Currents::of(&run);
    assert_eq!(drawn.shaded_s, Some((silence.from_s, silence.until_s)));
    assert!(drawn.from_s < 2.9 && drawn.until_s > 3.4 && drawn.title.contains("no command"));
    for (wheel, line) in drawn.lines.iter().enumerate() {
        let samples: Vec<_> = between(&run, drawn.from_s, drawn.until_s).collect();
        let expected: Vec<_> =
            samples.iter().map(|s| (s.time_s, s.current_a.into_array()[wheel])).collect();
        assert_eq!(*line, expected);
        assert!(
            line.iter().any(|(time_s, amperes)| *time_s > 3.3 && amperes.abs() < 0.01),
            "zeros"
        );
    }
}

const NAMES: [&str; 4] = ["front left", "front right", "rear left", "rear right"];

/// With each part of the square shorter, the bus goes off while the robot speeds up.
#[test]
fn a_bus_that_is_lost_while_the_robot_speeds_up_leaves_more_current() {
    let scenario = Scenario { seconds: 4.0, seed: 1, fault: Some(Trouble::BusOff), serial: None };
    let run = scenario.run(|_| {}, |_| {}).unwrap();
    let silence = run.silence.unwrap();
    assert!(silence.kept_a.into_iter().all(|(least, most)| least.abs().min(most.abs()) > 5.0));
    let off = run
        .samples
        .iter()
        .map(|s| (s.position_m.0 - s.planned_m.0).hypot(s.position_m.1 - s.planned_m.1));
    assert!(off.fold(0.0, f32::max) > 0.1, "it does no harm here either");
}

#[test]
fn without_a_lost_command_nothing_is_said_of_kept_currents() {
    for (fault, words) in [
        (None, None),
        (Some(Trouble::SilentMotor), Some("ESCs         commands reached them all the while\n")),
    ] {
        let run = run(1, fault);
        let told = report::table(&run);
        assert!(run.silence.is_none() && !told.contains("kept"), "{told}");
        assert_eq!(
            told.contains("ESCs"),
            words.is_some_and(|words| told.contains(words)),
            "{told}"
        );
        assert!((plot::Currents::of(&run).until_s - 9.999).abs() < 0.002);
    }
    let lost = run(1, Some(Trouble::LostFrames)).silence.unwrap();
    assert!((0.002..0.02).contains(&(lost.until_s - lost.from_s)), "{lost:?}");
}

#[test]
fn picture_and_rows_of_a_bus_off_have_the_currents() {
    let run = run(1, Some(Trouble::BusOff));
    let file = |name| std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let (picture, rows) = (file("bus-off.svg"), file("bus-off.csv"));
    plot::write(&picture, &run).unwrap();
    let picture = std::fs::read_to_string(picture).unwrap();
    assert!(picture.contains("current of the ESCs (shaded: no command reaches them)"));
    // Only these lines have the last two colours. 301 of 700 points of each stand at one height.
    for color in ["#288C3C", "#965AAA"] {
        let lines = picture.split("<polyline").filter(|line| line.contains(color));
        let line = lines.max_by_key(|line| line.len()).unwrap();
        let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
        let heights: Vec<_> =
            points.split_whitespace().filter_map(|point| point.split(',').nth(1)).collect();
        let at_one_height = heights.chunk_by(|a, b| a == b).map(<[_]>::len).max();
        assert!(at_one_height >= Some(290), "{at_one_height:?} of {}", heights.len());
    }
    report::write_csv(&rows, &run).unwrap();
    let rows = std::fs::read_to_string(rows).unwrap();
    let mut rows = rows.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let column = header.iter().position(|name| *name == "rl_a").unwrap();
    for (row, sample) in rows.zip(&run.samples) {
        assert_eq!(
            (row.len(), row[column]),
            (header.len(), &*format!("{:.3}", sample.current_a.rear_left))
        );
    }
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
    let mut reader = Deframer::<[f32; justfloat::CHANNELS], 64>::new();
    for sample in &run.samples {
        let channels = reader.read(&mut rest).unwrap();
        assert_eq!(&channels[..4], &sample.target_rpm.into_array());
        assert_eq!(&channels[4..], &sample.measured_rpm.into_array());
    }
    assert_eq!((reader.read(&mut rest), run.samples.len()), (None, 10_000));
}

#[test]
fn every_mode_does_what_it_is_for_with_and_without_a_power_limit() {
    for mode in MODES {
        for (seed, power_limit_w) in [(1, None), (2, Some(60.0)), (3, Some(25.0))] {
            let drive = Drive { mode, power_limit_w, seconds: 10.0, seed };
            let outcome = drive.run(|_| {}, |_| {}).unwrap();
            let Verdict { text, faults } = Verdict::of(&drive, &outcome);
            assert!(faults.is_empty(), "{mode:?} {power_limit_w:?}: {faults:?}\n{text}");
        }
    }
}

#[test]
fn the_power_limit_binds_and_the_buffer_stays_above_its_reserve() {
    let drive =
        Drive { mode: ChassisMode::Rotor, power_limit_w: Some(30.0), seconds: 10.0, seed: 1 };
    let outcome = drive.run(|_| {}, |_| {}).unwrap();
    let cut = outcome.samples.iter().filter(|sample| sample.scale < 0.9).count();
    assert!(cut > 500, "cut for {cut} ms");
    let lowest = outcome.samples.iter().map(|sample| sample.buffer_j).fold(60.0, f32::min);
    assert!((18.0..30.0).contains(&lowest), "{lowest} J");
    // The simulated winding has 0.065 ohm; the fit starts from 0.1.
    let load = (10.0, drivetrain::units::AngularVelocity::ZERO);
    let heat = outcome.fitted.power_w(load);
    assert!((heat - 6.5).abs() < 0.7, "{heat} W, {:?}", outcome.fitted);
}

#[test]
fn a_drive_that_fails_its_mode_is_told_so() {
    for mode in MODES {
        let drive = Drive { mode, power_limit_w: Some(60.0), seconds: 4.0, seed: 1 };
        let mut outcome = drive.run(|_| {}, |_| {}).unwrap();
        for sample in &mut outcome.samples {
            (sample.heading_deg, sample.wz_rad_s, sample.buffer_j) = (90.0, -1.0, 0.0);
            sample.is_quiet = false;
        }
        let faults = Verdict::of(&drive, &outcome).faults;
        assert!(faults.len() >= 2, "{mode:?}: {faults:?}");
    }
}

#[test]
fn the_rotor_goes_where_the_gimbal_looks_and_no_wheel_is_too_fast() {
    let drive = Drive { mode: ChassisMode::Rotor, power_limit_w: None, seconds: 10.0, seed: 1 };
    let samples = drive.run(|_| {}, |_| {}).unwrap().samples;
    let forward = samples.iter().find(|sample| sample.time_s >= 1.5).unwrap();
    let (x, y) = forward.position_m;
    assert!(x > 1.2 && y.abs() < 0.1 * x && forward.heading_deg > 180.0, "({x}, {y}) m");
    let speeds = samples.iter().flat_map(|sample| sample.wheel_rpm.into_array());
    let fastest = speeds.fold(0.0_f32, |fastest, rpm| fastest.max(rpm.abs()));
    assert!((430.0..475.0).contains(&fastest), "{fastest} rpm"); // the limit is 450
}

/// Runs with lines over the serial port.
fn with_serial(seconds: f32, text: &str) -> Run {
    let serial = Some(Script::parse(text).unwrap());
    Scenario { seconds, seed: 1, fault: None, serial }.run(|_| {}, |_| {}).unwrap()
}

#[test]
fn gains_over_the_serial_port_hold_from_then_on_and_bad_ones_change_nothing() {
    // The first side of the square begins at 0.5 s; a soft loop without integral falls behind.
    let soft = with_serial(4.0, "0.1 wheel_kp=0.5\n0.1 wheel_ki=0\n");
    let usual = with_serial(4.0, "");
    let refused =
        with_serial(4.0, "0.1 wheel_kp=0.1\n0.1 wheel_ki=nan\n0.2 kp=3\n0.3 wheel_kp=1.x\n");
    let worst = |run: &Run| {
        let error = |sample: &Sample| sample.target_rpm.front_left - sample.measured_rpm.front_left;
        run.samples.iter().map(|sample| error(sample).abs()).fold(0.0, f32::max)
    };
    assert!(worst(&soft) > 3.0 * worst(&usual), "{} {}", worst(&soft), worst(&usual));
    assert_eq!(worst(&refused).to_bits(), worst(&usual).to_bits());
    let (_, counts) = refused.serial.unwrap();
    assert_eq!((counts.frames, counts.content_errors), (0, 2));
    assert_eq!((counts.foreign_frames, counts.length_errors), (1, 1));
}

#[test]
fn a_turn_over_the_serial_port_expires_and_an_answer_tells_the_table() {
    let run = with_serial(4.0, "1.0 turn=1.0\n1.1 ?\n");
    let heading = |time_s: f32| {
        let sample = run.samples.iter().find(|sample| sample.time_s >= time_s).unwrap();
        sample.heading_rad
    };
    // 500 ms at 1 rad/s, and then no more of it.
    assert!(heading(0.99).abs() < 0.02, "{}", heading(0.99));
    assert!((heading(1.8) - 0.5).abs() < 0.06, "{}", heading(1.8));
    assert!((heading(3.0) - heading(1.8)).abs() < 0.05);
    let (answers, counts) = run.serial.unwrap();
    assert!(answers.contains("2 turn=1.000 from -1.000 to 1.000 rad/s"), "{answers}");
    assert_eq!(counts.frames, 2);
}
