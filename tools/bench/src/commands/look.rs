//! What is on the bus.

use super::{Out, Task};
use crate::session::Session;
use crate::snapshot;
use crate::text;
use drivetrain::frame::CanFrame;
use embedded_can::{ExtendedId, StandardId, nb::Can};
use serde_json::json;

/// Lists the ids, with the motor or a guess whose they are.
#[derive(Debug)]
pub(super) struct Scan {
    questions: std::vec::IntoIter<CanFrame>,
}

impl Scan {
    pub(super) fn new(asks: bool) -> Self {
        let questions = if asks { questions() } else { Vec::new() };
        Self { questions: questions.into_iter() }
    }
}

/// Questions that change nothing: for the state of LK and RMD, for the control mode of Damiao, and for the identity of RobStride.
fn questions() -> Vec<CanFrame> {
    let standard = |id: u16, data: [u8; 8]| StandardId::new(id).map(|id| CanFrame::of(id, data));
    let lk = (1..=32).filter_map(|id| standard(0x140 + id, [0x9A, 0, 0, 0, 0, 0, 0, 0]));
    let damiao = (1..=15).filter_map(|id| standard(0x7FF, [id, 0, 0x33, 10, 0, 0, 0, 0]));
    let robstride = (1..=127).filter_map(|id| ExtendedId::new(0xFD00 | id));
    let robstride = robstride.map(|id| CanFrame::of(id, [0; 8]));
    lk.chain(damiao).chain(robstride).collect()
}

impl Task for Scan {
    fn ticked(&mut self, session: &mut Session, ticks: u64, out: &mut Out) -> bool {
        // Four milliseconds for each: a question and its answer are 1 % of the bus.
        let question = if ticks.is_multiple_of(4) { self.questions.next() } else { None };
        if let Some(question) = question {
            _ = session.tap().transmit(&question);
        }
        if !out.is_json && ticks.is_multiple_of(1_000) {
            out.say(format!("{:>3} s\n", ticks / 1_000));
        }
        true
    }

    fn report(&mut self, session: &mut Session, out: &mut Out) -> String {
        let load = session.tap().traffic.load();
        let mut report = String::new();
        // A question of this program tells nothing of who is there.
        for row in session.tap().traffic.rows().filter(|row| !row.is_ours) {
            let frame = text::of(&row.last);
            let (id, data) = frame.split_once('#').unwrap_or((&frame, ""));
            report += &if out.is_json {
                let value = json!({
                    "id": id, "frames": row.frames, "rate_hz": row.rate_hz, "last": data, "owner": row.owner,
                    "known": row.is_known,
                });
                format!("{value}\n")
            } else {
                format!(
                    "{id:>8} {:>7} {:>6.0} Hz  {data:<16}  {}\n",
                    row.frames, row.rate_hz, row.owner
                )
            };
        }
        if out.is_json {
            return report + &format!("{}\n", json!({ "load": load }));
        }
        report + &format!("load of 1 Mbit/s: {:.1} %\n", 100.0 * load)
    }
}

/// Says at the end what the motors reported.
#[derive(Debug)]
pub(super) struct Watch;

impl Task for Watch {
    fn ticked(&mut self, _: &mut Session, ticks: u64, out: &mut Out) -> bool {
        if !out.is_json && ticks.is_multiple_of(1_000) {
            out.say(format!("{:>3} s\n", ticks / 1_000));
        }
        true
    }

    fn report(&mut self, session: &mut Session, out: &mut Out) -> String {
        let edges = session.edges();
        let snapshot = snapshot::of(session);
        if out.is_json {
            format!("{}\n", snapshot.json())
        } else {
            snapshot.text() + &snapshot::edges(&edges)
        }
    }
}
