//! Holds the floors of the house: a module uses only floors below its own, and no file grows past 400 lines.

#![cfg(test)]

use std::fs;
use std::path::{Path, PathBuf};

/// Module and floor, as `DESIGN.md` draws them. Modules of one floor do not know each other.
const FLOORS: [(&str, u32); 12] = [
    ("units", 0),
    ("time", 0),
    ("math", 0),
    ("frame", 0),
    ("encoder", 10),
    ("control", 10),
    ("geometry", 10),
    ("motor", 20),
    ("wire", 20),
    ("chassis", 21),
    ("dji", 30),
    ("runner", 40),
];

/// The simulator stands on the devices' side of the wire: it takes their facts and nothing else of their code.
const SIM_FLOOR: u32 = 31;

const LONGEST_FILE: usize = 400;

fn floor(module: &str) -> Option<u32> {
    if module == "sim" {
        return Some(SIM_FLOOR);
    }
    FLOORS.iter().find(|(name, _)| *name == module).map(|(_, floor)| *floor)
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

/// The lines before the tests.
fn code(text: &str) -> impl Iterator<Item = &str> {
    text.lines().take_while(|line| !line.trim_start().starts_with("#[cfg(test)]"))
}

/// The modules that a line of code names as `crate::module`, alone or in braces.
fn named(line: &str) -> Vec<String> {
    if line.trim_start().starts_with("//") {
        return Vec::new();
    }
    let word = |text: &str| {
        text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()
    };
    let mut modules = Vec::new();
    for rest in line.split("crate::").skip(1) {
        match rest.strip_prefix('{') {
            Some(list) => modules.extend(list.split(',').map(|item| word(item.trim()))),
            None => modules.push(word(rest)),
        }
    }
    modules
}

fn violations(own: &str, text: &str) -> Vec<String> {
    let own_floor = floor(own).unwrap_or(u32::MAX);
    let mut found = Vec::new();
    for (number, line) in (1..).zip(code(text)) {
        for module in named(line) {
            match floor(&module) {
                Some(other) if module != own && other >= own_floor => {
                    found.push(format!(
                        "line {number}: {own} (floor {own_floor}) uses {module} (floor {other})"
                    ));
                }
                _ => {}
            }
        }
    }
    found
}

fn sources() -> Vec<(String, PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    rust_files(&root)
        .into_iter()
        .map(|path| {
            let module = path
                .strip_prefix(&root)
                .unwrap()
                .iter()
                .next()
                .unwrap()
                .to_string_lossy()
                .into_owned();
            let text = fs::read_to_string(&path).unwrap();
            (module, path, text)
        })
        .collect()
}

#[test]
fn a_module_uses_only_floors_below_its_own() {
    let mut found = Vec::new();
    for (module, path, text) in sources() {
        if module != "lib.rs" {
            assert!(
                floor(&module).is_some(),
                "{module} has no floor: give it one here and in DESIGN.md"
            );
            found.extend(
                violations(&module, &text).into_iter().map(|v| format!("{}: {v}", path.display())),
            );
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn no_file_is_longer_than_400_lines_without_its_tests() {
    let long: Vec<String> = sources()
        .iter()
        .filter(|(_, path, _)| path.file_name().is_some_and(|name| name != "tests.rs"))
        .map(|(_, path, text)| (path, code(text).count()))
        .filter(|(_, lines)| *lines > LONGEST_FILE)
        .map(|(path, lines)| format!("{}: {lines} lines", path.display()))
        .collect();
    assert!(long.is_empty(), "{long:#?}");
}

#[test]
fn the_check_itself_finds_what_it_should() {
    assert_eq!(violations("encoder", "use crate::dji::Bus;").len(), 1);
    assert_eq!(violations("encoder", "use crate::{units::Angle, motor::Link};").len(), 1);
    assert_eq!(violations("dji", "let x = crate::runner::Nb(can);").len(), 1);
    assert_eq!(violations("chassis", "use crate::dji::Bus;").len(), 1);
    assert!(
        violations(
            "dji",
            "use crate::encoder::Shaft;\n/// crate::runner\n#[cfg(test)]\nuse crate::runner;"
        )
        .is_empty()
    );
}
