//! Drives the whole catalogue of `docs/faults.md` through the simulator and the public API, and prints for each row the
//! expected reaction, the reaction seen, and the ticks until the output was safe. Fails when a row differs.
//!
//! `cargo run --release --example faults`, or with ids: `cargo run --release --example faults -- F24 F54`

#![expect(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    reason = "the cases are tests; what fails is told"
)]

#[path = "../arguments/mod.rs"]
mod arguments;
#[path = "../../tests/faults/arming.rs"]
mod arming;
#[path = "../../tests/odrive/bench.rs"]
mod axle;
#[path = "../../tests/damiao/bench.rs"]
mod bench;
#[path = "../../tests/faults/case.rs"]
mod case;
#[path = "../../tests/faults/catalogue.rs"]
mod catalogue;
#[path = "../../tests/faults/clocks.rs"]
mod clocks;
#[path = "../../tests/faults/commands.rs"]
mod commands;
#[path = "../console/mod.rs"]
mod console;
#[path = "../../tests/faults/drives.rs"]
mod drives;
#[path = "../../tests/faults/health.rs"]
mod health;
#[path = "../../tests/lk/bench.rs"]
mod lk_bench;
#[path = "../../tests/faults/odrive.rs"]
mod odrive;
#[path = "../../tests/faults/plausibility.rs"]
mod plausibility;
#[path = "../../tests/faults/receive.rs"]
mod receive;
#[path = "../../tests/faults/registration.rs"]
mod registration;
#[path = "../../tests/faults/rig.rs"]
mod rig;
#[path = "../../tests/faults/rmd.rs"]
mod rmd;
#[path = "../../tests/rmd/bench.rs"]
mod rmd_bench;
#[path = "../../tests/faults/robstride.rs"]
mod robstride;
#[path = "../../tests/robstride/bench.rs"]
mod robstride_bench;
#[path = "../../tests/faults/rows.rs"]
mod rows;
#[path = "../../tests/faults/timing.rs"]
mod timing;
#[path = "../../tests/faults/transmit.rs"]
mod transmit;
#[path = "../../tests/vesc/bench.rs"]
mod vesc_bench;

use case::{Case, Seen};
use lexopt::Arg::{Long, Short, Value};
use rows::{Row, TABLE};
use std::panic::{catch_unwind, set_hook};
use std::process::ExitCode;

fn main() -> ExitCode {
    // What fails is told in its row.
    set_hook(Box::new(|_| {}));
    const USAGE: &str = "usage: faults [ID...]";
    let (mut arguments, mut wanted) = (arguments::of("faults"), Vec::new());
    loop {
        match arguments.next() {
            Ok(Some(Value(id))) => wanted.push(id.to_string_lossy().to_uppercase()),
            Ok(Some(Short('h') | Long("help"))) => {
                console::line(format_args!("{USAGE}"));
                return ExitCode::SUCCESS;
            }
            Ok(None) => break,
            Ok(Some(other)) => {
                arguments::refuse("faults", format_args!("{}; {USAGE}", other.unexpected()))
            }
            Err(error) => arguments::refuse("faults", format_args!("{error}; {USAGE}")),
        }
    }
    let rows = rows::rows(TABLE);
    if let Some(id) = wanted.iter().find(|id| rows.iter().all(|row| row.id != **id)) {
        arguments::refuse("faults", format_args!("no row {id}; {USAGE}"));
    }
    let (mut held, mut wrong) = (0, 0);
    console::line(format_args!("id  | outcome | ticks to safe | fault | required | observed"));
    for row in rows {
        if !wanted.is_empty() && !wanted.iter().any(|id| id == row.id) {
            continue;
        }
        let outcome = drive(&row);
        match outcome {
            Ok(_) => held += 1,
            Err(_) => wrong += 1,
        }
        print_row(&row, outcome);
    }
    console::line(format_args!("{held} rows as required, {wrong} not"));
    if wrong == 0 && held > 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs the cases of a row; the first that fails ends it.
fn drive(row: &Row<'_>) -> Result<Seen, String> {
    if row.tests.is_empty() || row.status != "held" {
        return Err(format!("not held: {}", row.status));
    }
    let mut seen = Seen::default();
    for name in &row.tests {
        let case = find(name).ok_or(format!("{name} is missing"))?;
        case::take_seen();
        catch_unwind(case).map_err(|panic| message(panic.as_ref()))?;
        let Seen { what, ticks_to_safe, .. } = case::take_seen();
        seen.what.extend(what);
        seen.ticks_to_safe = seen.ticks_to_safe.max(ticks_to_safe);
    }
    Ok(seen)
}

fn find(name: &str) -> Option<fn()> {
    let found = |case: &&Case| case.0 == name;
    catalogue::CATALOGUE.iter().copied().flatten().find(found).map(|(_, run)| *run)
}

fn message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("it failed").to_owned()
}

fn print_row(row: &Row<'_>, outcome: Result<Seen, String>) {
    let Row { id, fault, required, .. } = row;
    match outcome {
        Ok(Seen { what, ticks_to_safe, .. }) => {
            let ticks = ticks_to_safe.map_or("-".to_owned(), |ticks| ticks.to_string());
            console::line(format_args!(
                "{id} | ok | {ticks} | {fault} | {required} | {}",
                what.join("; ")
            ));
        }
        Err(why) => {
            console::line(format_args!("{id} | DIFFERS | - | {fault} | {required} | {why}"))
        }
    }
}
