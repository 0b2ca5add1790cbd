//! Holds the table, the lists of cases and the tests together.

use crate::case::take_seen;
use crate::catalogue::CATALOGUE;
use crate::rows::{Row, TABLE, rows};
use crate::{drives, odrive, rmd, robstride};
use std::collections::BTreeSet;

/// The files of [`CATALOGUE`], in its order.
const SOURCES: [&str; 13] = [
    include_str!("receive.rs"),
    include_str!("plausibility.rs"),
    include_str!("timing.rs"),
    include_str!("clocks.rs"),
    include_str!("commands.rs"),
    include_str!("arming.rs"),
    include_str!("registration.rs"),
    include_str!("transmit.rs"),
    include_str!("health.rs"),
    include_str!("drives.rs"),
    include_str!("odrive.rs"),
    include_str!("robstride.rs"),
    include_str!("rmd.rs"),
];

fn problems(table: &str, cases: &BTreeSet<&str>) -> Vec<String> {
    let rows = rows(table);
    let mut problems = Vec::new();
    for Row { id, status, tests: named, .. } in &rows {
        let prefix = format!("{}_", id.to_lowercase());
        match *status {
            "held" => {}
            open if open.starts_with("part: ") || open.starts_with("open: ") => {}
            other => problems.push(format!("{id}: the status {other:?} is none")),
        }
        if named.is_empty() != status.starts_with("open") {
            problems.push(format!("{id} is {status} with {} tests", named.len()));
        }
        for name in named {
            if !name.starts_with(&prefix) || !cases.contains(name) {
                problems.push(format!("{id} names {name}, which is no test of it"));
            }
        }
    }
    let named: BTreeSet<&str> = rows.iter().flat_map(|row| row.tests.iter().copied()).collect();
    problems.extend(cases.difference(&named).map(|case| format!("{case} has no row")));
    problems
}

#[test]
fn every_row_has_its_tests_and_every_test_its_row() {
    let cases = CATALOGUE.iter().copied().flatten().map(|(name, _)| *name).collect();
    let found = problems(TABLE, &cases);
    assert!(found.is_empty(), "{found:#?}");
    let ids: Vec<&str> = rows(TABLE).iter().map(|row| row.id).collect();
    let all: Vec<String> = (1..=56).chain(64..=92).map(|number| format!("F{number:02}")).collect();
    assert_eq!(
        ids.iter().copied().collect::<BTreeSet<_>>(),
        all.iter().map(String::as_str).collect()
    );
    assert_eq!(ids.len(), all.len());
}

#[test]
fn every_test_is_in_the_list_of_its_file() {
    for (source, cases) in SOURCES.iter().zip(CATALOGUE) {
        let tests: Vec<&str> = source
            .split("#[cfg_attr(test, test)]")
            .skip(1)
            .filter_map(|rest| Some(rest.split_once("fn ")?.1.split_once('(')?.0))
            .collect();
        let listed: Vec<&str> = cases.iter().map(|(name, _)| *name).collect();
        assert_eq!(tests, listed);
        assert!(!source.contains("#[test]"), "the example would not run it");
    }
}

/// The lines F77 to F91 of the table of faults and families: `tests/families` holds the others.
#[test]
fn the_families_that_a_case_drives_are_those_of_its_line() {
    let head = "| id | damiao | robstride | vesc | lk | rmd | odrive |";
    let (_, table) = TABLE.split_once(head).unwrap();
    let lines = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let lines: Vec<Vec<&str>> =
        lines.map(|line| line.trim_matches('|').split('|').map(str::trim).collect()).collect();
    let families: Vec<&str> = head.trim_matches('|').split('|').map(str::trim).skip(1).collect();
    let cases = [drives::CASES, odrive::CASES, robstride::CASES, rmd::CASES];
    let mut checked = 0;
    for (name, case) in cases.into_iter().flatten().filter(|(name, _)| *name > "f77") {
        _ = take_seen();
        case();
        let seen = take_seen().families;
        let id = name[..3].to_uppercase();
        let line = lines.iter().find(|line| line[0] == id).unwrap_or_else(|| panic!("no {id}"));
        for (family, cell) in families.iter().zip(&line[1..]) {
            let is_driven = seen.contains(family);
            assert!(
                if is_driven { *cell == "held" } else { cell.starts_with("n/a: ") },
                "{id} {family}: {cell}, driven: {seen:?}"
            );
        }
        assert_eq!(line.len(), 1 + families.len(), "{id}");
        checked += 1;
    }
    assert_eq!(checked, 15);
}

#[test]
fn the_check_itself_finds_what_it_should() {
    let table = "| F01 | a | b | held | `f01_a` |\n| F02 | a | b | open: no edge | |\n";
    let one = BTreeSet::from(["f01_a"]);
    assert_eq!(problems(table, &one), Vec::<String>::new());
    assert_eq!(problems(table, &BTreeSet::new()).len(), 1, "a row without its test");
    let two = BTreeSet::from(["f01_a", "f03_b"]);
    assert_eq!(problems(table, &two).len(), 1, "a test without a row");
    assert_eq!(problems("| F01 | a | b | held | |", &BTreeSet::new()).len(), 1);
    assert_eq!(problems("| F01 | a | b | fine | `f01_a` |", &one).len(), 1);
    assert_eq!(problems("| F02 | a | b | held | `f01_a` |", &one).len(), 1);
}
