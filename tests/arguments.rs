//! An argument that is not UTF-8 is an error with a text in every example that takes arguments, and no panic.

#![cfg(test)]
#![cfg(unix)]

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The files below a folder of the examples, or the file itself.
fn sources(path: &Path) -> Vec<PathBuf> {
    match fs::read_dir(path) {
        Ok(entries) => entries.flat_map(|entry| sources(&entry.unwrap().path())).collect(),
        Err(_) => vec![path.to_owned()],
    }
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples")
}

/// The examples whose source hands their name to what reads the arguments.
fn with_arguments() -> Vec<String> {
    let examples = fs::read_dir(examples()).unwrap().map(|entry| entry.unwrap().path());
    let takes_some = |path: &PathBuf| {
        let name = path.file_stem().and_then(OsStr::to_str).unwrap();
        let asks = [format!("arguments::of(\"{name}\")"), format!("course::output(\"{name}\")")];
        let texts = sources(path).into_iter().map(|file| fs::read_to_string(file).unwrap());
        let found = texts.into_iter().any(|text| asks.iter().any(|ask| text.contains(ask)));
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
    let expected =
        ["candump", "chassis", "faults", "gimbal", "omni", "snake", "socketcan", "swerve", "tune"];
    assert_eq!(names, expected, "not those that take arguments");
    for name in names {
        if name == "socketcan" && cfg!(not(target_os = "linux")) {
            continue; // it does nothing there
        }
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

#[test]
fn no_example_reads_its_arguments_by_another_way() {
    let readers = sources(&examples())
        .into_iter()
        .filter(|file| fs::read_to_string(file).is_ok_and(|text| text.contains("env::args")));
    let readers: Vec<_> = readers.collect();
    assert_eq!(readers, [examples().join("arguments").join("mod.rs")]);
}
