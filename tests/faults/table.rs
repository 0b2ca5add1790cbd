//! Holds the table and the tests together.

use std::collections::BTreeSet;

const TABLE: &str = include_str!("../../docs/faults.md");
const TESTS: [&str; 6] = [
    include_str!("commands.rs"),
    include_str!("plausibility.rs"),
    include_str!("receive.rs"),
    include_str!("registration.rs"),
    include_str!("timing.rs"),
    include_str!("transmit.rs"),
];

struct Row<'a> {
    id: &'a str,
    status: &'a str,
    tests: Vec<&'a str>,
}

/// The rows `| F01 | fault | outcome | status | tests |`.
fn rows(table: &str) -> Vec<Row<'_>> {
    let cells = |line| str::split(line, '|').map(str::trim).collect::<Vec<_>>();
    table
        .lines()
        .map(cells)
        .filter(|cells| cells.len() == 7 && cells[1].starts_with('F') && cells[1].len() == 3)
        .map(|cells| Row {
            id: cells[1],
            status: cells[4],
            tests: cells[5]
                .split(", ")
                .map(|name| name.trim_matches('`'))
                .filter(|name| !name.is_empty())
                .collect(),
        })
        .collect()
}

/// The names of the functions after `#[test]`.
fn tests(sources: &[&str]) -> BTreeSet<String> {
    sources
        .iter()
        .flat_map(|source| source.split("#[test]").skip(1))
        .filter_map(|rest| Some(rest.split_once("fn ")?.1.split_once('(')?.0.to_owned()))
        .collect()
}

fn problems(table: &str, sources: &[&str]) -> Vec<String> {
    let (rows, tests) = (rows(table), tests(sources));
    let mut problems = Vec::new();
    for Row { id, status, tests: named } in &rows {
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
            if !name.starts_with(&prefix) || !tests.contains(*name) {
                problems.push(format!("{id} names {name}, which is no test of it"));
            }
        }
    }
    let named: BTreeSet<&str> = rows.iter().flat_map(|row| row.tests.iter().copied()).collect();
    problems.extend(
        tests
            .iter()
            .filter(|test| !named.contains(test.as_str()))
            .map(|test| format!("{test} has no row")),
    );
    problems
}

#[test]
fn every_row_has_its_tests_and_every_test_its_row() {
    let found = problems(TABLE, &TESTS);
    assert!(found.is_empty(), "{found:#?}");
    let ids: Vec<&str> = rows(TABLE).iter().map(|row| row.id).collect();
    let all: Vec<String> = (1..=56).chain([64]).map(|number| format!("F{number:02}")).collect();
    assert_eq!(
        ids.iter().copied().collect::<BTreeSet<_>>(),
        all.iter().map(String::as_str).collect()
    );
    assert_eq!(ids.len(), all.len());
}

#[test]
fn the_check_itself_finds_what_it_should() {
    let table = "| F01 | a | b | held | `f01_a` |\n| F02 | a | b | open: no edge | |\n";
    let source = "#[test]\nfn f01_a() {}\n";
    assert_eq!(problems(table, &[source]), Vec::<String>::new());
    assert_eq!(problems(table, &[]).len(), 1, "a row without its test");
    assert_eq!(
        problems(table, &[source, "#[test]\nfn f03_b() {}"]).len(),
        1,
        "a test without a row"
    );
    assert_eq!(problems("| F01 | a | b | held | |", &[]).len(), 1);
    assert_eq!(problems("| F01 | a | b | fine | `f01_a` |", &[source]).len(), 1);
    assert_eq!(problems("| F02 | a | b | held | `f01_a` |", &[source]).len(), 1);
}
