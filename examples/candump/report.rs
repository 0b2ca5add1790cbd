//! Prints what a log says: one row a motor, or one row a frame.

use std::io::{self, BufRead, Read, Write};

use drivetrain::wire::candump::{ParseError, Record};

use super::motor::Reading;
use super::options::Options;
use super::replay::{Account, Replay};

/// In bytes, with the line end. Longer lines are reported as wrong and skipped: no log of candump has them.
pub(crate) const LONGEST_LINE: usize = 4096;

/// Reads the next line and returns its length with the line end, 0 at the end of `input`.
///
/// `line` holds its first [`LONGEST_LINE`] bytes; the rest of a longer line is read and dropped.
pub(crate) fn next_line(input: &mut impl BufRead, line: &mut Vec<u8>) -> io::Result<usize> {
    line.clear();
    let kept = input.by_ref().take(LONGEST_LINE as u64).read_until(b'\n', line)?;
    if kept < LONGEST_LINE || line.ends_with(b"\n") {
        return Ok(kept);
    }
    Ok(kept + input.skip_until(b'\n')?)
}

/// Reads all of `input`. Bad lines are reported to `complaints` and skipped.
pub(crate) fn run(
    options: Options,
    mut input: impl BufRead,
    output: &mut impl Write,
    complaints: &mut impl Write,
) -> io::Result<()> {
    let (csv, show_silent) = (options.csv, options.show_silent);
    let mut replay = Replay::new(options);
    if csv {
        writeln!(output, "time_s,motor,turns,rpm,amperes,temperature_c,error,rotor_counts")?;
    }
    let (mut line, mut number, mut bad) = (Vec::new(), 0_u64, 0_u64);
    loop {
        let length = next_line(&mut input, &mut line)?;
        if length == 0 {
            break;
        }
        number += 1;
        if length > LONGEST_LINE {
            bad += 1;
            let limit = "bytes, a line of candump has at most";
            writeln!(complaints, "line {number}: {length} {limit} {LONGEST_LINE}; skipped")?;
            continue;
        }
        match Record::parse(&line) {
            Ok(record) => match replay.take(&record) {
                Some(account) if csv => row_of_frame(output, account)?,
                _ => {}
            },
            Err(ParseError::Blank(_)) => {}
            Err(error) => {
                bad += 1;
                writeln!(complaints, "line {number}: {error}; skipped")?;
            }
        }
    }
    if !csv {
        table(show_silent, &replay, output)?;
    }
    notes(&replay, bad, complaints)
}

fn row_of_frame(output: &mut impl Write, account: &Account) -> io::Result<()> {
    let Some((now, reading)) = &account.latest else { return Ok(()) };
    let micros = now.as_micros();
    write!(output, "{}.{:06},{},", micros / 1_000_000, micros % 1_000_000, account.motor.name())?;
    let amperes = reading.amperes.map(|amperes| format!("{amperes:.4}"));
    let turns = or_nothing(reading.turns.map(|turns| format!("{turns:.6}")));
    write!(output, "{turns},{:.3},{},", reading.rpm, or_nothing(amperes))?;
    let (temperature, error) = (or_nothing(reading.temperature_c), reading.error.as_deref());
    writeln!(output, "{temperature},{},{}", or_nothing(error), or_nothing(reading.rotor_counts))
}

fn or_nothing(value: Option<impl ToString>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

fn table(show_silent: bool, replay: &Replay, output: &mut impl Write) -> io::Result<()> {
    writeln!(
        output,
        "{:<20} {:>8} {:>8} {:>11} {:>8} {:>8} {:>4} {:>5} {:>10}  error",
        "motor", "frames", "rate/Hz", "turns", "rpm", "A", "°C", "gaps", "longest/ms"
    )?;
    for account in &replay.accounts {
        match &account.latest {
            Some((_, reading)) => row_of_motor(output, account, reading, replay.has_times)?,
            None if show_silent => {
                writeln!(output, "{:<20} {:>8}  not heard", account.motor.name().to_string(), 0)?;
            }
            None => {}
        }
    }
    Ok(())
}

fn row_of_motor(
    output: &mut impl Write,
    account: &Account,
    reading: &Reading,
    has_times: bool,
) -> io::Result<()> {
    let timed = |text: String| if has_times { text } else { "-".to_owned() };
    let rate = account.rate_hz().map_or("-".to_owned(), |hz| format!("{hz:.1}"));
    let longest_ms = account.longest_silence.as_micros() as f64 / 1e3;
    let or_dash = |text: Option<String>| text.unwrap_or("-".to_owned());
    let temperature = or_dash(reading.temperature_c.map(|degrees| degrees.to_string()));
    let amperes = or_dash(reading.amperes.map(|amperes| format!("{amperes:.3}")));
    let turns = or_dash(account.turns().map(|turns| format!("{turns:.4}")));
    let error = or_dash(reading.error.clone());
    writeln!(
        output,
        "{:<20} {:>8} {:>8} {turns:>11} {:>8.2} {amperes:>8} {temperature:>4} {:>5} {:>10}  {error}",
        account.motor.name().to_string(),
        account.frames,
        timed(rate),
        reading.rpm,
        timed(account.gaps.to_string()),
        timed(format!("{longest_ms:.3}")),
    )
}

fn notes(replay: &Replay, bad: u64, complaints: &mut impl Write) -> io::Result<()> {
    for account in &replay.accounts {
        if account.malformed > 0 {
            let (name, count) = (account.motor.name(), account.malformed);
            writeln!(complaints, "{name}: {count} frames with its id are not its feedback")?;
        }
        let gaps = account.latest.as_ref().map_or(0, |(_, reading)| reading.ambiguous_gaps);
        if gaps > 0 {
            let (name, count) = (account.motor.name(), gaps);
            writeln!(
                complaints,
                "{name}: after {count} gaps its turns are a guess from its speed"
            )?;
        }
    }
    for (count, what) in [
        (replay.unrelated, "other frames: commands, motors that were not listed, other devices"),
        (replay.other_interfaces, "frames of other interfaces; choose with --interface"),
        (bad, "lines skipped"),
    ] {
        if count > 0 {
            writeln!(complaints, "{count} {what}")?;
        }
    }
    if !replay.has_times && replay.accounts.iter().any(|account| account.frames > 0) {
        writeln!(complaints, "no times in the log: record it with candump -ta or -L")?;
    }
    Ok(())
}
