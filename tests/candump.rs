//! The candump example on real input: its logic from text to table, and its program from arguments to exit code.

#![cfg(test)]

#[path = "../examples/candump/motor.rs"]
mod motor;
#[path = "../examples/motors/mod.rs"]
mod motors;
#[path = "../examples/candump/options.rs"]
mod options;
#[path = "../examples/candump/replay.rs"]
mod replay;
#[path = "../examples/candump/report.rs"]
mod report;

use std::io::{BufReader, Cursor, Read, Write};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::motor::Ingest;
use drivetrain::time::Instant;
use drivetrain::wire::candump::Record;
use options::{Asked, Options};

const REST: &str = include_str!("data/candump/c620_rest.log");

fn parse(arguments: &str) -> Result<Asked, String> {
    let arguments = lexopt::Parser::from_args(arguments.split_whitespace());
    options::parse(arguments).map_err(|error| error.to_string())
}

fn options(arguments: &str) -> Options {
    match parse(arguments) {
        Ok(Asked::Run(options)) => options,
        other => panic!("{other:?}"),
    }
}

/// Returns what goes to standard output and to standard error.
fn run(arguments: &str, log: &str) -> (String, String) {
    let (mut output, mut complaints) = (Vec::new(), Vec::new());
    report::run(options(arguments), log.as_bytes(), &mut output, &mut complaints).unwrap();
    (String::from_utf8(output).unwrap(), String::from_utf8(complaints).unwrap())
}

/// The words of the row of a motor, its name left out.
fn row<'a>(table: &'a str, motor: &str) -> Vec<&'a str> {
    let row = table.lines().find_map(|line| line.strip_prefix(motor));
    row.unwrap_or_else(|| panic!("no {motor} in\n{table}")).split_whitespace().collect()
}

#[test]
fn the_real_capture_decodes_to_the_values_worked_out_by_hand() {
    let mut bus = Bus::new();
    let motor = bus.attach(Config::<M3508>::new(1)).unwrap();
    let raw_currents = [-3_i16, -66, 61];
    for ((line, raw), ms) in REST.lines().zip(raw_currents).zip(0..) {
        let record = Record::parse(line.as_bytes()).unwrap();
        assert_eq!((record.time, record.interface), (None, "can0"));
        assert_eq!(bus.ingest(&record.frame, Instant::from_micros(1_000 * ms)), Ingest::Taken);
        let state = bus.state(motor).unwrap();
        assert_eq!((state.feedback.angle(), state.feedback.rpm()), (3606, 0));
        assert_eq!(state.rotor_counts, 3606);
        let amperes = f32::from(raw) * 20.0 / 16384.0;
        assert!((state.current.as_amperes() - amperes).abs() < 1e-6);
        assert_eq!((state.temperature_c, state.error), (Some(33), None));
        // 3606 of 8192 counts of the rotor, behind 3591:187
        let degrees = 3606.0 / 8192.0 * 360.0 * 187.0 / 3591.0;
        assert!((state.position.angle().as_degrees() - degrees).abs() < 1e-4);
    }
    assert_eq!(REST.lines().count(), raw_currents.len());
}

#[test]
fn the_real_capture_makes_one_row() {
    let (table, complaints) = run("", REST);
    assert_eq!(table.lines().count(), 2, "{table}");
    let expected = ["3", "-", "0.0000", "0.00", "0.074", "33", "-", "-", "-"];
    assert_eq!(row(&table, "M3508 #1"), expected);
    assert!(complaints.contains("no times in the log"), "{complaints}");
}

#[test]
fn both_text_forms_give_the_same_rows() {
    let mut log = String::new();
    let mut columns = String::new();
    for line in REST.lines() {
        let record = Record::parse(line.as_bytes()).unwrap();
        let time = Some(Instant::from_micros(1_788_189_998_242_396));
        let record = Record { time, ..record };
        log.push_str(&format!("{record}\n"));
        columns.push_str(&format!("{record:#}\r\n"));
    }
    for arguments in ["", "--csv", "--motors m3508:1-4"] {
        assert_eq!(run(arguments, &log), run(arguments, &columns));
    }
    let (csv, _) = run("--csv", &log);
    assert_eq!(
        csv.lines().nth(1),
        Some("1788189998.242396,M3508 #1,0.022923,0.000,-0.0037,33,,3606")
    );
}

#[test]
fn a_bad_line_is_reported_with_its_number_and_skipped() {
    let log = "(1.000) can0 201#0E160000FFFD2100\n\n(1.001) can0 201#0E16zz\n\u{fffd}\n\
        (1.002) can0 201#0E160000FFFD2100\n(1.003) can0 201##100";
    let (table, complaints) = run("", log);
    assert_eq!(row(&table, "M3508 #1")[0], "2");
    let complaints: Vec<_> = complaints.lines().collect();
    assert_eq!(complaints[0], "line 3: column 22: expected two hexadecimal digits; skipped");
    assert!(complaints[1].starts_with("line 4: column 1: expected the name of an interface"));
    assert!(complaints[2].starts_with("line 6: column 18: expected a classic CAN frame"));
    assert_eq!(complaints[3], "3 lines skipped");
}

/// A frame and 60 MB of blanks in one line, and then a frame in a line of its own.
fn long_line() -> impl Read {
    let frame = b"can0 201#0E160000FFFD2100";
    let line = std::io::repeat(b' ').take(60_000_000);
    Cursor::new(frame).chain(line).chain(&b"\n"[..]).chain(&frame[..])
}

#[test]
fn a_line_of_60_mb_is_one_line_with_one_complaint() {
    let (mut output, mut complaints) = (Vec::new(), Vec::new());
    let input = BufReader::new(long_line());
    report::run(options(""), input, &mut output, &mut complaints).unwrap();
    assert_eq!(row(&String::from_utf8(output).unwrap(), "M3508 #1")[0], "1");
    let complaints = String::from_utf8(complaints).unwrap();
    let expected =
        "line 1: 60000026 bytes, a line of candump has at most 4096; skipped\n1 lines skipped\n";
    assert!(complaints.starts_with(expected), "{complaints}");
}

#[test]
fn no_more_of_a_line_is_kept_than_a_line_may_have() {
    let (mut input, mut line) = (BufReader::new(long_line()), Vec::new());
    assert_eq!(report::next_line(&mut input, &mut line).unwrap(), 60_000_026);
    assert_eq!(line.len(), report::LONGEST_LINE);
    assert!(line.capacity() <= 2 * report::LONGEST_LINE, "{}", line.capacity());
    assert_eq!(report::next_line(&mut input, &mut line).unwrap(), line.len());
    assert_eq!(line, b"can0 201#0E160000FFFD2100");
    assert_eq!(report::next_line(&mut input, &mut line).unwrap(), 0);
}

#[test]
fn a_line_may_have_4096_bytes_with_its_end_and_not_one_more() {
    let frame = REST.lines().next().unwrap();
    for (length, end, fits) in
        [(4095, "\n", true), (4096, "", true), (4096, "\n", false), (4097, "", false)]
    {
        let (table, complaints) = run("", &format!("{frame:<length$}{end}"));
        let rows = table.lines().count() - 1;
        assert_eq!(
            (rows, complaints.contains("1 lines skipped")),
            (fits.into(), !fits),
            "{length}"
        );
    }
}

#[test]
fn rate_gaps_turns_and_errors_are_those_of_the_log() {
    // 1 kHz for 101 frames, 20 ms of silence, 100 more; the rotor turns by 1000 counts a frame.
    let mut log = String::new();
    let (mut angle, mut us) = (0_i64, 5_000_000_u64);
    for frame in 0..201 {
        let bytes = angle.rem_euclid(8192) << 16 | 7324;
        log.push_str(&format!(
            "({}.{:06}) can0 202#{bytes:08X}20002502\n",
            us / 1_000_000,
            us % 1_000_000
        ));
        angle += if frame == 100 { 20_000 } else { 1_000 };
        us += if frame == 100 { 20_000 } else { 1_000 };
    }
    let (table, _) = run("--motors m3508:1-2,gm6020:1", &log);
    let expected_turns = (angle - 1_000) as f64 / 8192.0 * 187.0 / 3591.0;
    let row_2 = row(&table, "M3508 #2");
    assert_eq!(row_2[..2], ["201", "913.2"]); // 200 intervals in 219 ms
    assert!((row_2[2].parse::<f64>().unwrap() - expected_turns).abs() < 1e-4, "{row_2:?}");
    assert_eq!(row_2[3..8], ["381.39", "10.000", "37", "1", "20.000"]); // 7324 rpm / 19.2032
    assert_eq!(row_2[8..].join(" "), "supply voltage too high");
    assert_eq!(row(&table, "M3508 #1"), ["0", "not", "heard"]);
    assert_eq!(row(&table, "GM6020 (voltage) #1"), ["0", "not", "heard"]);
    assert_eq!(row(&run("--gap 25", &log).0, "M3508 #2")[6], "0");
}

#[test]
fn frames_of_others_are_counted_not_decoded() {
    let log = "can1 201#0E160000FFFD2100\ncan0 201#0E160000FFFD2100\ncan1 200#0000000000000000\n\
        can1 201#0E16\ncan1 00000201#0E160000FFFD2100\ncan1 201#R8\n";
    let (table, complaints) = run("", log);
    assert_eq!(row(&table, "M3508 #1")[0], "1");
    assert!(complaints.contains("1 frames of other interfaces"), "{complaints}");
    let (table, _) = run("--interface can0", log);
    assert_eq!(row(&table, "M3508 #1")[0], "1");
    assert_eq!(run("--interface can2", log).0.lines().count(), 1);
}

/// Two drives with one master id, an error and a register's answer among their feedback: codes of PMAX 12.5, VMAX 30.
#[test]
fn motors_of_damiao_are_decoded_beside_others() {
    let mut log = String::new();
    for ms in 0..100 {
        let angle = 0x8000 + 100 * ms;
        let velocity = 0xC00; // 3/4 of the range: 15 rad/s
        log.push_str(&format!("(5.{ms:03}000) can0 011#11{angle:04X}{velocity:03X}7FF2832\n"));
        log.push_str(&format!("(5.{ms:03}100) can0 012#D280007FF7FF1E1F\n"));
    }
    log.push_str("(5.100000) can0 011#0100330A01000000\n(5.101000) can0 011#1180\n");
    let (table, complaints) = run("--motors damiao4310:1-2,m3508:2", &log);
    let first = row(&table, "DM-J4310 #1");
    assert_eq!(first[..2], ["101", "1000.0"], "the answer of a register is a frame of the motor");
    let turns = 9_900.0 * 25.0 / 65_535.0 / std::f64::consts::TAU;
    assert!((first[2].parse::<f64>().unwrap() - turns).abs() < 1e-4, "{first:?}");
    let rpm = (f64::from(0xC00) * 60.0 / 4095.0 - 30.0) * 60.0 / std::f64::consts::TAU;
    assert!((first[3].parse::<f64>().unwrap() - rpm).abs() < 0.01, "{first:?}");
    assert_eq!(first[4..], ["-", "50", "0", "1.000", "-"]);
    assert_eq!(row(&table, "DM-J4310 #2")[5..].join(" "), "31 0 1.000 error 13");
    assert!(complaints.contains("DM-J4310 #1: 1 frames with its id are not its feedback"));
    let (csv, _) = run("--csv --motors damiao4310:2", &log);
    assert_eq!(csv.lines().nth(1).unwrap().split(',').nth(1), Some("DM-J4310 #2"));
}

/// Returns the log of a family, its rows of one frame each as lists of fields, and how many frames were another's. The numbers
/// are worked out in `tests/data/candump/README.md`.
fn family(motors: &str, log: &str) -> (Vec<Vec<String>>, usize) {
    let (rows, complaints) = run(&format!("--csv --motors {motors}"), log);
    let fields = |row: &str| row.split(',').map(str::to_owned).collect();
    let others = complaints.split(" other frames").next().unwrap().parse().unwrap_or(0);
    (rows.lines().skip(1).map(fields).collect(), others)
}

#[test]
fn a_motor_of_lk_is_decoded_and_commands_with_its_id_are_not() {
    let log = include_str!("data/candump/lk.log");
    let (rows, others) = family("mg4005e-i10:1", log);
    assert_eq!((rows.len(), others), (3, 3));
    let name = "MG4005E-i10 #1";
    // Three quarters of a rotor turn behind 10:1.
    assert_eq!(rows[0], ["1.000250", name, "0.075000", "-8.333", "1.6113", "50", "", ""]);
    assert_eq!(rows[2], ["1.002250", name, "0.093750", "-8.333", "1.6113", "50", "error 9", ""]);
}

#[test]
fn a_motor_on_a_vesc_has_the_turns_of_its_tachometer_and_the_warmer_temperature() {
    let log = include_str!("data/candump/vesc.log");
    let (rows, others) = family("vesc7:23", log);
    assert_eq!((rows.len(), others), (4, 1));
    assert_eq!(rows[0][1..], ["VESC #23", "", "1714.286", "5.5000", "", "", ""]);
    assert_eq!(rows[1][2], "-14.285714", "600 of 42 counts a turn");
    assert_eq!(rows[3][1..], ["VESC #23", "-12.285714", "1714.286", "5.5000", "40", "", ""]);
    // The turns since the first status 5, not since zero.
    assert_eq!(row(&run("--motors vesc7:23", log).0, "VESC #23")[2], "2.0000");
    assert_eq!(family("vesc1:23", log).0[0][3], "12000.000", "electrical");
}

#[test]
fn a_motor_at_an_odrive_has_the_errors_of_its_firmware() {
    let log = include_str!("data/candump/odrive.log");
    let (rows, others) = family("odrive0.6:1", log);
    assert_eq!((rows.len(), others), (3, 1));
    assert_eq!(rows[1], ["1.010000", "ODrive #1", "12.250000", "-210.000", "", "", "", ""]);
    assert_eq!(rows[2][2], "12.750000");
    assert_eq!(family("odrive0.5:1", log).0[1][6], "error 34", "the encoder has failed");
}

#[test]
fn a_robstride_and_a_cybergear_are_decoded_whoever_asked_them() {
    let log = include_str!("data/candump/robstride.log");
    let (rows, others) = family("rs00:127", log);
    assert_eq!((rows.len(), others), (3, 1));
    // Half a count more than half a turn, and (2 * 0xC000 / 65535 - 1) * 33 rad/s.
    assert_eq!(rows[2][1..], ["RS00 #127", "0.500038", "157.571", "", "27", "", ""]);
    let log = include_str!("data/candump/cybergear.log");
    let (rows, others) = family("cybergear:44", log);
    assert_eq!((rows.len(), others), (1, 0));
    // Half a count of 8 pi and of 60 rad/s; under-voltage is the first of the faults.
    assert_eq!(rows[0][1..], ["CyberGear #44", "0.000031", "0.004", "", "25", "error 16", ""]);
}

#[test]
fn wrong_options_say_what_is_wrong() {
    for (arguments, message) in [
        (
            "--motors m3508:5,gm6020-current:1",
            "feedback of GM6020 (current) #1 on 0x205, which is feedback of M3508 #5 on 0x205",
        ),
        ("--motors m3508:9", "1..=8"),
        ("--motors m3508:4-1", "4-1 is no id or range of ids"),
        ("--motors m3508", "not model:ids"),
        ("--motors servo:1", "no model servo"),
        ("--motors vesc:1", "no model vesc"),
        ("--motors vesc0:1", "pole_pairs 0"),
        ("--motors odrive0.6:63", "63"),
        ("--motors mg4005e-i10:33", "33"),
        ("--motors", "missing argument for option '--motors'"),
        ("--gap soon", "not a number of milliseconds"),
        ("--gap 0", "not a number of milliseconds"),
        ("--fast", "invalid option '--fast'"),
        ("a.log b.log", "what is b.log?"),
    ] {
        let error = parse(arguments).map(|_| ()).unwrap_err();
        assert!(error.contains(message), "{arguments}: {error}");
    }
    assert!(matches!(parse("--help"), Ok(Asked::Help)));
    assert!(options::help().contains("--motors") && options::help().contains("cybergear"));
}

/// The program, which `cargo test` builds beside the tests.
fn program() -> Command {
    let tests = std::env::current_exe().unwrap();
    let path: PathBuf = tests.parent().unwrap().with_file_name("examples").join("candump");
    let path = path.with_extension(std::env::consts::EXE_EXTENSION);
    assert!(path.exists(), "build it first: cargo build --example candump");
    Command::new(path)
}

fn fed(arguments: &[&str], input: &[u8]) -> Output {
    let mut child = program()
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(input).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn the_program_reads_standard_input_and_files() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/candump/c620_rest.log");
    let (from_input, from_dash) = (fed(&[], REST.as_bytes()), fed(&["-"], REST.as_bytes()));
    let from_file = program().arg(file).output().unwrap();
    for output in [&from_input, &from_dash, &from_file] {
        assert!(output.status.success());
        assert_eq!(String::from_utf8_lossy(&output.stdout), run("", REST).0);
    }
}

#[test]
fn the_program_says_no_with_an_exit_code() {
    let wrong = fed(&["--nope"], b"");
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("invalid option '--nope'"));
    let missing = fed(&["no/such/file.log"], b"");
    assert_eq!(missing.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("no/such/file.log"));
    assert!(fed(&["--help"], b"").status.success());
    assert!(fed(&[], b"\xFF\xFE bad\n").status.success(), "bad lines are not fatal");
}

#[test]
fn a_closed_pipe_is_the_end_and_no_panic() {
    let mut child = program()
        .arg("--csv")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let log = REST.repeat(10_000);
    let _ = child.stdin.take().unwrap().write_all(log.as_bytes());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(!String::from_utf8_lossy(&output.stderr).contains("panicked"));
}
