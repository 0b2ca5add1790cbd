//! Arguments that make no sense, an output that nobody reads, and an output that a page shows: each example under a shell.

#![cfg(test)]
#![cfg(unix)]

use std::ffi::OsStr;
use std::fs;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// The files below a folder of the examples, or the file itself.
fn sources(path: &Path) -> Vec<PathBuf> {
    match fs::read_dir(path) {
        Ok(entries) => entries.flat_map(|entry| sources(&entry.unwrap().path())).collect(),
        Err(_) => vec![path.to_owned()],
    }
}

/// What stands in them.
fn texts(path: &Path) -> Vec<String> {
    sources(path).into_iter().map(|file| fs::read_to_string(file).unwrap()).collect()
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples")
}

/// The examples whose source hands their name to what reads the arguments.
fn with_arguments() -> Vec<String> {
    let examples = fs::read_dir(examples()).unwrap().map(|entry| entry.unwrap().path());
    let takes_some = |path: &PathBuf| {
        let name = path.file_stem().and_then(OsStr::to_str).unwrap();
        let asks =
            ["arguments::of", "output::path"].map(|function| format!("{function}(\"{name}\")"));
        let found = texts(path).iter().any(|text| asks.iter().any(|ask| text.contains(ask)));
        found.then(|| name.to_owned())
    };
    let mut names: Vec<_> = examples.filter_map(|path| takes_some(&path)).collect();
    names.sort();
    names
}

/// An example, which `cargo test` builds beside the tests.
fn program(name: &str) -> Command {
    let tests = std::env::current_exe().unwrap();
    let path = tests.parent().unwrap().with_file_name("examples").join(name);
    assert!(path.exists(), "build it first: cargo build --all-features --example {name}");
    Command::new(path)
}

#[test]
fn an_argument_that_is_not_utf_8_is_named_and_ends_each_example_with_code_2() {
    let names = with_arguments();
    let expected = [
        "arm",
        "balance",
        "candump",
        "capacitor",
        "chassis",
        "faults",
        "gimbal",
        "identify",
        "motion",
        "observer",
        "omni",
        "shooter",
        "snake",
        "socketcan",
        "state_space",
        "swerve",
        "tune",
    ];
    assert_eq!(names, expected, "not those that take arguments");
    for name in names {
        for before in [None, Some("--output")] {
            let wrong = OsStr::from_bytes(b"drive\xFF.log");
            let output = program(&name).args(before).arg(wrong).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            let expected = format!("{name}: the argument \"drive\\xFF.log\" is not UTF-8\n");
            assert_eq!((output.status.code(), &*said), (Some(2), &*expected));
            assert!(output.stdout.is_empty(), "{name} began to work");
        }
    }
}

/// Runs an example whose output nobody reads.
fn unread(mut program: Command) -> Output {
    let (reader, writer) = UnixStream::pair().unwrap();
    drop(reader);
    program.stdin(Stdio::null()).stdout(OwnedFd::from(writer)).output().unwrap()
}

// Exit code 1 of `omni`, `swerve` and `faults`; `tune` left a second argument out without a word.
#[test]
fn a_usage_error_is_said_and_ends_each_example_with_code_2() {
    for name in with_arguments() {
        let output = program(&name).arg("--no-such-option").output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{name}: {said}");
        assert!(said.starts_with(&format!("{name}: ")) && said.len() < 4_000, "{name}: {said}");
        assert!(output.stdout.is_empty(), "{name} began to work");
    }
    for (name, arguments) in [
        ("chassis", ["--seconds", "never"]),
        ("snake", ["--robot", "port"]),
        ("candump", ["--motors", "m3508:9"]),
        ("socketcan", ["can0", "--motors=servo:1"]),
        ("socketcan", ["can0", "--motors=damiao4310:1,damiao8009:1"]),
        ("socketcan", ["can0", "can1"]),
        ("socketcan", ["--motors", "m3508:1"]),
        ("faults", ["F24", "F999"]),
        ("gimbal", ["--fault", "tired-imu"]),
        ("arm", ["one.svg", "two.svg"]),
        ("omni", ["one.svg", "two.svg"]),
        ("swerve", ["one.svg", "two.svg"]),
        ("capacitor", ["one.svg", "two.svg"]),
        ("identify", ["one.svg", "two.svg"]),
        ("observer", ["one.svg", "two.svg"]),
        ("shooter", ["one.svg", "two.svg"]),
        ("tune", ["one.svg", "two.svg"]),
    ] {
        let output = program(name).args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{name} {arguments:?}: {output:?}");
    }
}

// `--seconds=5` was an unknown option.
#[test]
fn an_option_takes_its_value_behind_an_equals_sign_too() {
    for (name, option, value, said) in [
        // The range is looked at, and nothing runs.
        ("chassis", "--seconds", "1", "--seconds 1: not a number from 2 to 600"),
        ("chassis", "--power-limit", "5", "--power-limit 5: not a number from 10 to 500"),
        ("snake", "--seconds", "9", "--seconds 9: not from 10 to 600"),
        ("candump", "--gap", "0", "--gap 0: not a number of milliseconds above 0"),
        ("candump", "--motors", "m3508:9", "1..=8"),
        ("socketcan", "--motors", "m3508:9", "1..=8"),
        ("gimbal", "--fault", "tired-imu", "usage: "),
    ] {
        for arguments in [vec![format!("{option}={value}")], vec![option.into(), value.into()]] {
            let output = program(name).args(&arguments).output().unwrap();
            let error = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{name} {arguments:?}: {error}");
            assert!(error.contains(said), "{name} {arguments:?}: {error}");
        }
    }
    let plot = std::env::temp_dir().join(format!("seconds-{}.svg", std::process::id()));
    let run = |seconds: &[&str]| {
        let output = program("chassis").args(seconds).arg("--output").arg(&plot).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        fs::read_to_string(&plot).unwrap()
    };
    let (apart, together) = (run(&["--seconds", "3"]), run(&["--seconds=3"]));
    fs::remove_file(&plot).unwrap();
    assert_eq!(apart, together);
}

#[test]
fn each_example_with_arguments_says_how_it_is_called() {
    for name in with_arguments() {
        let mut asked = program(&name);
        asked.arg("--help");
        let output = asked.output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && said.contains("usage: "), "{name}: {output:?}");
        // `chassis --help | true` panicked with code 101, and so did all that printed.
        let output = unread(asked);
        let quiet = output.stderr.is_empty() && output.status.success();
        assert!(quiet, "{name} --help, unread: {output:?}");
    }
}

/// Those that print and take no arguments.
#[test]
fn each_example_whose_output_nobody_reads_ends_quietly() {
    let names = [
        "async_sans_io",
        "custom_motor",
        "interrupt_queue",
        "mixed_robot",
        "pwm",
        "sans_io",
        "two_buses",
    ];
    for name in names {
        let output = unread(program(name));
        assert!(output.status.success() && output.stderr.is_empty(), "{name}: {output:?}");
    }
    let rest = fs::read_dir(examples()).unwrap().map(|entry| entry.unwrap().path());
    let prints = rest.filter(|path| texts(path).iter().any(|text| text.contains("console::line")));
    let mut known: Vec<_> = names.map(str::to_owned).into_iter().chain(with_arguments()).collect();
    known.extend(["arguments", "course", "output", "picture"].map(str::to_owned));
    for path in prints {
        let name = path.file_stem().and_then(OsStr::to_str).unwrap();
        assert!(known.iter().any(|known| known == name), "{name} prints");
    }
}

/// The first block of text below a heading of a page.
fn block<'a>(page: &'a str, heading: &str) -> &'a str {
    let (_, below) = page.split_once(&format!("\n{heading}\n")).unwrap();
    let (_, begun) = below.split_once("```text\n").unwrap();
    begun.split_once("```").unwrap().0
}

// The gains of the page had changed with the simulator, and nobody saw it.
#[test]
fn the_page_shows_what_tune_prints() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tools.md");
    let page = fs::read_to_string(page).unwrap();
    let plot = std::env::temp_dir().join(format!("tune-{}.svg", std::process::id()));
    let output = program("tune").arg(&plot).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    fs::remove_file(&plot).unwrap();
    assert!(output.status.success(), "{said}");
    assert_eq!(format!("{}plot: {}\n", block(&page, "## Tune"), plot.display()), said);
}

#[test]
fn no_example_prints_by_a_way_that_panics() {
    for file in sources(&examples()) {
        let text = fs::read_to_string(&file).unwrap();
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        let prints =
            code.into_iter().find(|line| line.contains("print!(") || line.contains("println!("));
        assert_eq!(prints, None, "{}", file.display());
    }
}

#[test]
fn no_example_reads_its_arguments_by_another_way() {
    let readers = sources(&examples())
        .into_iter()
        .filter(|file| fs::read_to_string(file).is_ok_and(|text| text.contains("env::args")));
    let readers: Vec<_> = readers.collect();
    assert_eq!(readers, [examples().join("arguments/mod.rs")]);
}
