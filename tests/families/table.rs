//! Holds the table of faults and families in `docs/faults.md`: each cell is what its case saw, and each fault of the catalogue has a
//! line in the table, or a reason why the family makes no difference.

use crate::faults::CASES;
use crate::motors::FAMILIES;
use std::collections::BTreeMap;

const PAGE: &str = include_str!("../../docs/faults.md");

/// The first lines of the two tables.
const BY_FAMILY: &str = "| id | damiao | robstride | vesc | lk | rmd | odrive |";
const ALIKE: &str = "| ids | held for each family by |";

/// The faults of drives that `tests/faults` drives through the families of their line: its table holds the lines.
const OF_SOME_FAMILIES: std::ops::RangeInclusive<u32> = 77..=91;

fn lines<'a>(page: &'a str, head: &str) -> impl Iterator<Item = &'a str> {
    let (_, table) = page.split_once(head).unwrap_or_else(|| panic!("no table {head}"));
    table.lines().skip(2).take_while(|line| line.starts_with('|'))
}

fn cells(line: &str) -> Vec<&str> {
    line.trim_matches('|').split('|').map(str::trim).collect()
}

fn id(number: u32) -> String {
    format!("F{number:02}")
}

/// Runs each case with each family.
fn seen() -> Vec<(String, String)> {
    let cell = |outcome: Result<String, &'static str>| match outcome {
        Ok(seen) => seen,
        Err(reason) => format!("n/a: {reason}"),
    };
    let line = |(id, case): &(&str, fn(&_) -> _)| {
        let cells: Vec<String> = FAMILIES.iter().map(|family| cell(case(family))).collect();
        (id.to_string(), format!("| {id} | {} |", cells.join(" | ")))
    };
    CASES.iter().map(line).collect()
}

fn problems(page: &str, seen: &[(String, String)]) -> Vec<String> {
    let table: BTreeMap<&str, &str> =
        lines(page, BY_FAMILY).map(|line| (cells(line)[0], line)).collect();
    let mut problems: Vec<String> = seen
        .iter()
        .filter(|(id, line)| table.get(id.as_str()) != Some(&line.as_str()))
        .map(|(_, line)| format!("the run says {line}"))
        .collect();
    let ran: Vec<&str> = seen.iter().map(|(id, _)| id.as_str()).collect();
    let others: Vec<String> = OF_SOME_FAMILIES.map(id).collect();
    let is_driven = |id: &&str| ran.contains(id) || others.iter().any(|other| other == id);
    problems.extend(
        table.keys().filter(|id| !is_driven(id)).map(|id| format!("no test has driven {id}")),
    );
    let mut found: Vec<&str> = table.keys().copied().collect();
    for line in lines(page, ALIKE) {
        found.extend(cells(line)[0].split(", "));
    }
    let all: Vec<String> = (1..=56).chain(64..=92).map(id).collect();
    for id in &all {
        let count = found.iter().filter(|found| *found == id).count();
        if count != 1 {
            problems.push(format!("{id} stands in {count} places"));
        }
    }
    problems.extend(
        found
            .iter()
            .filter(|id| !all.contains(&(**id).to_owned()))
            .map(|id| format!("{id} is no fault")),
    );
    problems
}

#[test]
fn each_cell_of_the_table_is_what_its_case_saw() {
    let names = FAMILIES.map(|family| family.name).join(" | ");
    assert_eq!(BY_FAMILY, format!("| id | {names} |"));
    let found = problems(PAGE, &seen());
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_check_itself_finds_a_wrong_cell_and_a_line_without_a_test() {
    let seen: Vec<(String, String)> = (1..=56)
        .chain(64..=76)
        .map(|number| (id(number), format!("| {} | rest |", id(number))))
        .collect();
    let held = OF_SOME_FAMILIES.map(|number| format!("| {} | held |", id(number)));
    let lines: Vec<String> = seen.iter().map(|(_, line)| line.clone()).chain(held).collect();
    let page = |lines: &[String]| {
        let lines = lines.join("\n");
        format!("{BY_FAMILY}\n|---|\n{lines}\n\n{ALIKE}\n|---|\n| F92 | the runner |\n")
    };
    assert_eq!(problems(&page(&lines), &seen), Vec::<String>::new());
    let with = |line: usize, text: &str| {
        let mut lines = lines.clone();
        lines[line] = text.to_owned();
        problems(&page(&lines), &seen)
    };
    assert_eq!(with(0, "| F01 | driven on |"), ["the run says | F01 | rest |"]);
    assert_eq!(with(0, "| F93 | rest |").len(), 4, "F01 is missing, and no test drives F93");
    assert_eq!(problems(&page(&lines), &seen[1..]), ["no test has driven F01"]);
    let alike = page(&lines) + "| F01, F57 | its loops |\n";
    assert_eq!(problems(&alike, &seen), ["F01 stands in 2 places", "F57 is no fault"]);
}
