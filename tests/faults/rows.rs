//! The rows of `docs/faults.md`.

pub(crate) const TABLE: &str = include_str!("../../docs/faults.md");

/// A row that has to be held.
pub(crate) struct Row<'a> {
    pub(crate) id: &'a str,
    #[cfg_attr(test, expect(dead_code, reason = "for the example `faults`"))]
    pub(crate) fault: &'a str,
    #[cfg_attr(test, expect(dead_code, reason = "for the example `faults`"))]
    pub(crate) required: &'a str,
    pub(crate) status: &'a str,
    pub(crate) tests: Vec<&'a str>,
}

/// The rows `| F01 | fault | outcome | status | tests |`.
pub(crate) fn rows(table: &str) -> Vec<Row<'_>> {
    let cells = |line| str::split(line, '|').map(str::trim).collect::<Vec<_>>();
    table
        .lines()
        .map(cells)
        .filter(|cells| cells.len() == 7 && cells[1].starts_with('F') && cells[1].len() == 3)
        .map(|cells| Row {
            id: cells[1],
            fault: cells[2],
            required: cells[3],
            status: cells[4],
            tests: cells[5]
                .split(", ")
                .map(|name| name.trim_matches('`'))
                .filter(|name| !name.is_empty())
                .collect(),
        })
        .collect()
}
