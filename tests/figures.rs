//! Figures stand in `firmware/qemu/budget.toml`, which a run of the bench writes; documents only quote them.
//!
//! The bench runs a closed loop on the simulator as well; here the same file runs on the host.
//!
//! Between `<!-- figures -->` and `<!-- /figures -->` stands what `firmware/qemu/figures.py --markdown` prints.

#![cfg(test)]

#[path = "../firmware/qemu/src/closed_loop.rs"]
mod closed_loop;

use std::fs;
use std::path::Path;

/// With the least number of rows that each quotes.
const DOCUMENTS: [(&str, usize); 4] =
    [("README.md", 5), ("README.zh-CN.md", 5), ("DESIGN.md", 0), ("docs/figures.md", 40)];

/// Work and figures at opt-level 3, 2 and "s", as text.
type Row = (String, Vec<String>);

fn list(text: &str, separator: char) -> Vec<String> {
    text.split(separator).map(|figure| figure.trim().to_owned()).collect()
}

fn measured(budget: &str) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for line in budget.lines() {
        if let Some(what) = line.strip_prefix("what = ") {
            rows.push((what.trim_matches('"').to_owned(), Vec::new()));
        } else if let (Some(last), Some(row)) = (line.strip_prefix("last = "), rows.last_mut()) {
            row.1 = list(last.trim_matches(['[', ']']), ',');
        }
    }
    rows
}

fn quoted(document: &str) -> Vec<Row> {
    document
        .split("<!-- figures -->")
        .skip(1)
        .filter_map(|rest| rest.split_once("<!-- /figures -->"))
        .flat_map(|(table, _)| table.lines())
        .map(|line| list(line.trim_matches('|'), '|'))
        .filter(|cells| cells.len() == 6 && cells[1].chars().all(|c| c.is_ascii_digit()))
        .map(|cells| (cells[0].clone(), cells[2..5].to_vec()))
        .collect()
}

/// What a document quotes that was not measured, and a block without an end.
fn wrong(document: &str, budget: &[Row]) -> Vec<String> {
    let mut wrong: Vec<String> = quoted(document)
        .into_iter()
        .filter(|row| !budget.contains(row))
        .map(|(what, figures)| format!("{what}: {figures:?}"))
        .collect();
    let [starts, ends] =
        ["<!-- figures -->", "<!-- /figures -->"].map(|mark| document.matches(mark).count());
    if starts != ends {
        wrong.push(format!("{starts} blocks begin, {ends} end"));
    }
    wrong
}

fn text() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    fs::read_to_string(root.join("firmware/qemu/budget.toml")).unwrap()
}

fn budget() -> Vec<Row> {
    measured(&text())
}

#[test]
fn the_closed_loop_gives_the_same_bits_on_the_host_and_on_the_target() {
    let (hash, frames) = closed_loop::run();
    assert_eq!(closed_loop::run(), (hash, frames), "the same twice");
    let line = format!("closed_loop = \"{hash:016x} {frames}\"");
    assert!(text().lines().any(|found| found == line), "budget.toml has another line than {line}");
}

#[test]
fn documents_quote_the_measured_figures() {
    let (root, budget) = (Path::new(env!("CARGO_MANIFEST_DIR")), budget());
    for (name, rows) in DOCUMENTS {
        let document = fs::read_to_string(root.join(name)).unwrap();
        assert!(quoted(&document).len() >= rows, "{name} quotes fewer than {rows} figures");
        let wrong = wrong(&document, &budget);
        assert!(
            wrong.is_empty(),
            "{name} does not quote budget.toml (figures.py --markdown): {wrong:#?}"
        );
    }
}

#[test]
fn every_row_of_the_budget_was_measured() {
    let budget = budget();
    assert!(budget.len() >= 20);
    for (what, figures) in budget {
        assert!(figures.len() == 3 && figures.iter().all(|figure| figure != "0"), "{what}");
    }
}

#[test]
fn the_check_itself_finds_a_figure_that_is_not_measured() {
    let budget = measured("[decode]\nwhat = \"decode\"\nbudget = [9, 9, 9]\nlast = [52, 53, 54]\n");
    let block = |figure| {
        format!("<!-- figures -->\n| decode | 60 | {figure} | 53 | 54 | |\n<!-- /figures -->\n")
    };
    assert!(wrong(&block("52"), &budget).is_empty());
    assert_eq!(wrong(&block("51"), &budget).len(), 1);
    assert_eq!(wrong("<!-- figures -->", &budget).len(), 1);
}
