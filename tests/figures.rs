//! Figures stand in the budgets of the benches, which a run writes; documents and documentation only quote them.
//!
//! The bench runs a closed loop on the simulator as well; here the same file runs on the host.
//!
//! Between `<!-- figures NAME -->` and `<!-- /figures -->` stands what `firmware/qemu/figures.py --quote` writes, and so does the
//! line with the price in the documentation of a function.

#![cfg(test)]

#[path = "../firmware/qemu/src/closed_loop.rs"]
mod closed_loop;

use std::fs;
use std::path::Path;

/// The benches: name, budget, figures of a row.
const SHEETS: [(&str, &str, usize); 2] =
    [("user", "firmware/user/budget.toml", 5), ("core", "firmware/qemu/budget.toml", 3)];

/// With the least number of rows of each bench that each quotes.
const DOCUMENTS: [(&str, [usize; 2]); 3] =
    [("README.md", [5, 0]), ("README.zh-CN.md", [5, 0]), ("docs/figures.md", [18, 60])];

/// A row of a budget.
#[derive(Debug, Clone, Default)]
struct Row {
    what: String,
    goal: Vec<String>,
    last: Vec<String>,
    peer: String,
    is_bytes: bool,
    /// File, name of the function or type, and in which case.
    price: Vec<String>,
}

impl Row {
    /// The line of a table.
    fn line(&self) -> String {
        let cells =
            self.last.iter().enumerate().map(|(column, figure)| match self.goal.get(column) {
                Some(goal) if goal != "0" => format!("{figure} ({goal})"),
                _ => figure.clone(),
            });
        let cells: Vec<String> = cells.collect();
        format!("| {} | {} | {} |", self.what, cells.join(" | "), self.peer)
    }

    /// The line in the documentation.
    fn price(&self, case: &str) -> String {
        let (verb, unit) =
            if self.is_bytes { ("Takes", "bytes") } else { ("Costs", "instructions") };
        let case = if case.is_empty() { String::new() } else { format!(", {case}") };
        format!("/// {verb} {} {unit} on a Cortex-M4F{case} (`docs/figures.md`).", self.last[0])
    }
}

fn list(value: &str) -> Vec<String> {
    value.trim_matches(['[', ']']).split(", ").map(ToOwned::to_owned).collect()
}

fn measured(budget: &str) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for line in budget.lines() {
        if line.starts_with('[') && line != "[host]" {
            rows.push(Row::default());
        }
        let (Some(row), Some((field, value))) = (rows.last_mut(), line.split_once(" = ")) else {
            continue;
        };
        let text = value.trim_matches('"');
        match field {
            "what" => row.what = text.to_owned(),
            "peer" => row.peer = text.to_owned(),
            "goal" => row.goal = list(value),
            "last" => row.last = list(value),
            "unit" => row.is_bytes = text == "bytes",
            "price" => row.price = texts(value),
            _ => {}
        }
    }
    rows
}

/// The texts of a list.
fn texts(value: &str) -> Vec<String> {
    value.split('"').skip(1).step_by(2).map(ToOwned::to_owned).collect()
}

/// The rows of the tables of one bench in a document.
fn quoted<'d>(document: &'d str, name: &str) -> Vec<&'d str> {
    document
        .split(&format!("<!-- figures {name} -->"))
        .skip(1)
        .filter_map(|rest| rest.split_once("<!-- /figures -->"))
        .flat_map(|(table, _)| table.lines())
        .filter(|line| line.starts_with("| ") && !line.starts_with("| work |"))
        .collect()
}

/// What a document quotes that was not measured, and a block without an end.
fn wrong(document: &str, name: &str, budget: &[Row]) -> Vec<String> {
    let lines: Vec<String> = budget.iter().map(Row::line).collect();
    let quoted = quoted(document, name);
    let mut wrong: Vec<String> = quoted
        .iter()
        .filter(|row| !lines.iter().any(|line| line == *row))
        .map(|row| (*row).into())
        .collect();
    let [starts, ends] =
        ["<!-- figures ", "<!-- /figures -->"].map(|mark| document.matches(mark).count());
    if starts != ends {
        wrong.push(format!("{starts} blocks begin, {ends} end"));
    }
    wrong
}

fn text(file: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    fs::read_to_string(root.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// The documentation above the item of a name, which has to be the only one of its file.
fn documentation(source: &str, name: &str) -> Vec<String> {
    let (owner, name) = name.split_once("::").unwrap_or(("", name));
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    let is_item = |line: &str| {
        ["pub fn ", "pub const fn ", "pub struct "].iter().any(|start| {
            line.strip_prefix(start)
                .and_then(|rest| rest.strip_prefix(name))
                .is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
        })
    };
    // Of several functions of one name, that of a type: `Bus::ingest`.
    let is_of = |number: usize, owner: &str| {
        let head = source.lines().take(number + 1).filter(|line| line.starts_with("impl")).last();
        let mut words = head.unwrap_or_default().split(|c: char| !c.is_alphanumeric());
        owner.is_empty() || words.any(|word| word == owner)
    };
    let items: Vec<usize> = (0..lines.len())
        .filter(|number| is_item(lines[*number]) && is_of(*number, owner))
        .collect();
    assert_eq!(items.len(), 1, "items of the name {name}");
    let above = lines[..items[0]].iter().rev();
    above
        .take_while(|line| line.starts_with("//") || line.starts_with("#["))
        .map(|line| (*line).to_owned())
        .collect()
}

#[test]
fn the_closed_loop_gives_the_same_bits_on_the_host_and_on_the_target() {
    let (hash, frames) = closed_loop::run();
    assert_eq!(closed_loop::run(), (hash, frames), "the same twice");
    let line = format!("closed_loop = \"{hash:016x} {frames}\"");
    let budget = text("firmware/qemu/budget.toml");
    assert!(budget.lines().any(|found| found == line), "budget.toml has another line than {line}");
}

#[test]
fn documents_quote_the_measured_figures() {
    for ((sheet, file, _), index) in SHEETS.into_iter().zip(0..) {
        let budget = measured(&text(file));
        for (name, rows) in DOCUMENTS {
            let document = text(name);
            let quoted = quoted(&document, sheet);
            assert!(
                quoted.len() >= rows[index],
                "{name} quotes fewer than {} rows of {sheet}",
                rows[index]
            );
            let wrong = wrong(&document, sheet, &budget);
            assert!(
                wrong.is_empty(),
                "{name} does not quote {file} (figures.py --quote): {wrong:#?}"
            );
        }
    }
}

#[test]
fn the_documentation_of_functions_has_the_measured_prices() {
    let mut prices = 0;
    for (_, file, _) in SHEETS {
        for row in measured(&text(file)) {
            for place in &row.price {
                let mut words = place.splitn(3, ' ');
                let (Some(source), Some(name)) = (words.next(), words.next()) else {
                    panic!("{file}: {place}")
                };
                let expected = row.price(words.next().unwrap_or_default());
                let found = documentation(&text(source), name);
                assert!(found.contains(&expected), "{source}, {name} lacks: {expected}");
                prices += 1;
            }
        }
    }
    assert!(prices >= 30, "{prices} prices");
    // And there is no price that nobody measured.
    let written = sources(Path::new(env!("CARGO_MANIFEST_DIR")).join("src").as_path());
    assert_eq!(written, prices, "lines with a price in src");
}

/// Lines with a price in a folder.
fn sources(folder: &Path) -> usize {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let of = |path: &Path| {
        let text = fs::read_to_string(path).unwrap();
        text.lines()
            .filter(|line| line.contains(" on a Cortex-M4F") && line.contains("`docs/figures.md`"))
            .count()
    };
    entries.map(|path| if path.is_dir() { sources(&path) } else { of(&path) }).sum()
}

#[test]
fn every_row_of_a_budget_was_measured() {
    for (sheet, file, figures) in SHEETS {
        let budget = measured(&text(file));
        assert!(budget.len() >= 15, "{sheet}");
        for row in budget {
            assert_eq!(row.last.len(), figures, "{sheet}: {}", row.what);
            assert!(row.last.iter().all(|figure| figure != "0"), "{sheet}: {}", row.what);
        }
    }
}

#[test]
fn the_check_itself_finds_a_figure_that_is_not_measured() {
    let budget = measured(
        "[decode]\nwhat = \"decode\"\ngoal = [60]\nbudget = [9, 9, 9]\nlast = [52, 53, 54]\nprice = [\"src/a.rs f\", \"src/b.rs g, often\"]\n",
    );
    assert_eq!(budget[0].price, ["src/a.rs f", "src/b.rs g, often"]);
    assert_eq!(
        budget[0].price("often"),
        "/// Costs 52 instructions on a Cortex-M4F, often (`docs/figures.md`)."
    );
    let block = |figure| {
        format!("<!-- figures core -->\n| decode | {figure} | 53 | 54 |  |\n<!-- /figures -->\n")
    };
    assert!(wrong(&block("52 (60)"), "core", &budget).is_empty());
    assert_eq!(wrong(&block("51 (60)"), "core", &budget).len(), 1);
    assert_eq!(wrong(&block("52 (61)"), "core", &budget).len(), 1);
    assert_eq!(wrong("<!-- figures core -->", "core", &budget).len(), 1);
    let source =
        "/// Does.\n/// Costs 1.\n#[inline]\npub const fn of(x: f32) {}\npub fn of_all() {}\n";
    assert_eq!(documentation(source, "of").len(), 3);
}
