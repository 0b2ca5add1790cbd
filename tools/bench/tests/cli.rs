//! The bench from its arguments to its exit code, on the simulator.

#![cfg(test)]

use serde_json::{Value, json};
use std::fs;
use std::process::{Command, Output, Stdio};

fn bench(line: &str) -> Output {
    let arguments = line.split_whitespace();
    Command::new(env!("CARGO_BIN_EXE_drivetrain-bench")).args(arguments).output().unwrap()
}

/// The lines on standard output of a run that succeeds.
fn lines(line: &str) -> Vec<String> {
    let output = bench(line);
    assert!(output.status.success(), "{line}: {output:?}");
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

fn objects(line: &str) -> Vec<Value> {
    lines(line).iter().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn folder(name: &str) -> String {
    let path = std::env::temp_dir().join(format!("bench-cli-{}-{name}", std::process::id()));
    path.to_str().unwrap().to_owned()
}

#[test]
fn arguments_that_make_no_sense_end_it_with_code_2_and_help_with_0() {
    for line in [
        "dance",
        "spin --rpm soon",
        "--motors servo:1",
        "--motors m3508:9",
        "watch --motors m3508:1,m2006:1",
        "spin --mecanum 1,0,0 --motors m3508:1",
        "spin --seconds",
        "tune --motors m3508:1",
        "identify --motors m3508:1",
        "identify --motors m3508:1 --arm --rpm -5",
        "get Colour --motors damiao4310:1",
        "set-id 16 --motors damiao4310:1",
        "get ControlMode --motors m3508:1",
    ] {
        let output = bench(line);
        assert_eq!(output.status.code(), Some(2), "{line}");
        assert!(output.stderr.starts_with(b"bench: ") && output.stdout.is_empty(), "{output:?}");
    }
    let help = lines("--help").join("\n");
    for words in ["usage: ", "examples", "scan", "set-id", "cybergear", "exit codes"] {
        assert!(help.contains(words), "{words}");
    }
    let missing = bench("watch --interface no-such-interface");
    assert_eq!(missing.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("no-such-interface"));
}

/// All families, three at a time: at 1 kHz eight motors are more than a bus of 1 Mbit/s carries.
const GROUPS: [&str; 3] = [
    "m3508:1,gm6020:5,damiao4310:1",
    "mg4005e-i10:2,rmd-x8-90:3,cybergear:4",
    "odrive0.5:5,odrive0.6:7,vesc7:6",
];

#[test]
fn nothing_moves_without_arm_and_with_it_all_families_turn() {
    for group in GROUPS {
        let still = lines(&format!("spin --rpm 60 --motors {group} --seconds 1"));
        assert!(still.iter().any(|line| line == "nothing is sent without --arm"), "{still:?}");
        assert!(still.iter().any(|line| line == "sent 0"), "{still:?}");
        let objects = objects(&format!("spin --rpm 60 --motors {group} --seconds 4 --arm --json"));
        let last = objects.iter().rev().find(|object| object["stage"] == "ARMED").unwrap();
        let motors = last["motors"].as_array().unwrap();
        assert_eq!(motors.len(), 3);
        for motor in motors {
            let rpm = motor["rpm"].as_f64().unwrap();
            assert!((rpm - 60.0).abs() < 6.0 && motor["armed"] == true, "{motor}");
        }
        let counts = &objects.last().unwrap()["counts"];
        assert!(counts["sent"].as_u64().unwrap() > 1_000, "{counts}");
    }
}

#[test]
fn the_same_seed_gives_the_same_lines() {
    let line = "spin --rpm 90 --arm --seconds 2 --json --seed 7";
    assert_eq!(lines(line), lines(line));
}

#[test]
fn a_scan_lists_ids_with_a_guess() {
    // A motor that is there and not attached cannot be simulated: the recording has one.
    let path = folder("scan.log");
    let feedback: String = (0..2_000)
        .map(|ms| {
            format!(
                "({}.{:03}000) can0 201#0E160000FFFD2100\n({}.{:03}100) can0 7F0#00\n",
                ms / 1_000,
                ms % 1_000,
                ms / 1_000,
                ms % 1_000
            )
        })
        .collect();
    fs::write(&path, feedback).unwrap();
    let rows = objects(&format!("scan --replay {path} --motors m2006:5 --json"));
    let owner = |id: &str| rows.iter().find(|row| row["id"] == id).unwrap()["owner"].clone();
    assert_eq!(owner("201"), "(M3508 or M2006 #1?)");
    assert_eq!(owner("7F0"), "(unknown)");
    let load = rows.last().unwrap()["load"].as_f64().unwrap();
    // 1000 frames of 8 bytes and 1000 of one.
    assert!((0.15..0.25).contains(&load), "{load}");
    fs::remove_file(path).unwrap();
}

#[test]
fn motors_that_answer_only_are_found_by_questions() {
    let rows = objects("scan --ask --motors mg4005e-i10:2,damiao4310:3 --json");
    let ids: Vec<_> = rows.iter().filter_map(|row| row["id"].as_str()).collect();
    // The master id of Damiao, and the id that LK has for questions and answers; the other 173 questions are not heard.
    assert_eq!(ids, ["013", "142"]);
    let frames = |row: usize| rows[row]["frames"].as_u64();
    assert_eq!((frames(0), frames(1)), (Some(1), Some(1)), "{rows:?}");
}

#[test]
fn a_session_is_recorded_replayed_and_converted() {
    let (mcap, text) = (folder("a.mcap"), folder("a.log"));
    lines(&format!("spin --motors m3508:1-2 --rpm 60 --arm --seconds 2 --log {mcap}"));
    let replayed = objects(&format!("replay {mcap} --motors m3508:1-2 --json"));
    let motors = replayed.last().unwrap()["motors"].as_array().unwrap().clone();
    assert!(motors.iter().all(|motor| motor["turns"].as_f64().unwrap() > 1.0), "{motors:?}");
    assert!(lines(&format!("replay {mcap} --output {text}"))[0].contains(" frames to "));
    let log = fs::read_to_string(&text).unwrap();
    let commands: Vec<_> = log.lines().filter(|line| line.contains(" 200#")).collect();
    assert!(commands.iter().any(|line| !line.ends_with("#0000000000000000")));
    assert!(commands.last().unwrap().ends_with("200#0000000000000000"), "left at zero");
    assert_eq!(bench("record").status.code(), Some(2));
    lines(&format!("record --output {text} --motors m3508:1 --seconds 1"));
    assert!(fs::read_to_string(&text).unwrap().lines().count() > 900);
    [mcap, text].iter().for_each(|path| fs::remove_file(path).unwrap());
}

#[test]
fn gains_are_a_line_of_rust_and_toml() {
    let said = lines("tune --motors m3508:1 --arm").join("\n");
    assert!(said.contains("PidConfig::new(") && said.contains("[\"M3508 #1\"]\nkp = "), "{said}");
    let found = objects("identify --motors m3508:1 --arm --json").swap_remove(0);
    let rust = found["rust"].as_str().unwrap();
    assert!(rust.contains(").with_feed_forward(") && rust.contains(").with_output_limit(6.0)"));
    let toml = found["toml"].as_str().unwrap();
    assert!(toml.starts_with("[\"M3508 #1\"]\nkp = "), "{toml}");
    for row in
        ["\nks = ", "\nkv = ", "\nka = ", "\ndelay_s = ", "\ninertia_kg_m2 = ", "\nfriction_nm = "]
    {
        assert!(toml.contains(row), "{row} is not in {toml}");
    }
    assert!(found["delay_s"].as_f64().is_some_and(|delay_s| (0.0..0.005).contains(&delay_s)));
    // A limit that the motor meets is a failure.
    assert_eq!(bench("identify --motors m3508:1 --arm --turns 0.001").status.code(), Some(1));
}

#[test]
fn registers_are_read_and_written_and_ids_are_set() {
    let value = |line: &str| objects(line).last().unwrap()["value"].as_f64().unwrap();
    assert_eq!(value("get ControlMode --motors damiao4310:1 --json"), 1.0);
    assert_eq!(value("get positionrange --motors damiao4310:1 --json"), 12.5);
    assert_eq!(value("set VelocityRange 45 --motors damiao4310:1 --json"), 45.0);
    let unknown = failure("get Colour --motors damiao4310:1", 2);
    assert!(unknown.contains("no register Colour, but "), "{unknown}");
    let none = failure("get ControlMode --motors m3508:1", 2);
    assert!(none.contains("M3508 #1 has no registers"), "{none}");
    // The drive hears that its id is another, and that it is to be kept.
    for (motors, command, renamed) in [
        ("damiao4310:1", " 7FF#0100550809000000", "damiao4310:9:0x11"),
        ("damiao4310:1:0x21", " 7FF#0100AA0100000000", "damiao4310:9:0x21"),
        ("rs02:1", " 0709FD01#", "rs02:9"),
    ] {
        let log = folder("id.log");
        let said = objects(&format!("set-id 9 --motors {motors} --json --log {log}"));
        assert_eq!(said, [json!({ "id": 9, "motors": renamed })]);
        let sent = fs::read_to_string(&log).unwrap();
        assert!(sent.contains(command), "{motors}: {sent}");
        fs::remove_file(log).unwrap();
    }
    assert!(lines("set-id 9 --motors rs02:1")[0].contains("from now on --motors rs02:9"));
}

/// What a run that ends with `code` says on standard error; nothing else is said.
fn failure(line: &str, code: i32) -> String {
    let output = bench(line);
    assert_eq!(output.status.code(), Some(code), "{line}: {output:?}");
    assert!(output.stdout.is_empty(), "{line}: {output:?}");
    String::from_utf8(output.stderr).unwrap()
}

/// A serial adapter that takes everything and hears nothing: the other end of a terminal.
#[cfg(target_os = "linux")]
#[test]
fn who_is_not_there_gets_no_id_and_is_not_armed() {
    use serialport::{SerialPort, TTYPort};
    use std::io::Read;
    let (mut adapter, terminal) = TTYPort::pair().unwrap();
    let port = terminal.name().unwrap();
    std::thread::spawn(move || {
        loop {
            _ = adapter.read(&mut [0; 256]);
        }
    });
    for line in ["set-id 9 --json", "set-id 9"] {
        let said = failure(&format!("{line} --serial {port} --motors damiao4310:1"), 1);
        assert!(said.contains("DM-J4310 #1 is not heard"), "{said}");
    }
    let said = failure(&format!("get ControlMode --serial {port} --motors damiao4310:1"), 1);
    assert!(said.contains("ControlMode: no answer"), "{said}");
    let output = bench(&format!("spin --serial {port} --motors m3508:1 --seconds 1 --arm"));
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("bench: not armed: no feedback from M3508 #1"), "{said}");
}

#[test]
fn a_reader_that_is_gone_ends_it() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_drivetrain-bench"))
        .args(["spin", "--arm", "--rpm", "60", "--seconds", "100000"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("standard output: "));
}
