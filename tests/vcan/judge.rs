//! Compares what three parties saw: candump, the bench, and the robot.

use socketcan::{CanFrame, EmbeddedFrame, Frame};
use std::collections::HashMap;
use std::fs;

/// A frame in the form of candump, without time and interface.
pub(crate) fn line_of(frame: &CanFrame) -> String {
    let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{:03X}#{data}", frame.raw_id())
}

#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Written {
    pub(crate) accepted: u64,
    /// The queue was full.
    pub(crate) refused: u64,
}

#[derive(Debug)]
pub(crate) struct Phase {
    pub(crate) name: &'static str,
    /// By the robot.
    pub(crate) written: Written,
    /// By the kernel, as `tc` counts.
    pub(crate) dropped: u64,
}

pub(crate) struct Judge {
    candump: Vec<String>,
    ours: Vec<String>,
    robot_received: Vec<String>,
    counts: HashMap<String, u64>,
    phases: Vec<Phase>,
}

/// Without time and interface, up to the end.
fn frames(path: &str) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap();
    assert!(!text.contains("DROPCOUNT"), "{path}: candump itself lost frames");
    let frames = text.lines().filter_map(|line| line.split_whitespace().nth(2));
    frames.take_while(|frame| !frame.starts_with("7F1#")).map(str::to_owned).collect()
}

fn is_command(frame: &str) -> bool {
    ["200#", "2FF#"].iter().any(|id| frame.starts_with(id))
}

fn is_marker(frame: &str) -> bool {
    frame.starts_with("7F0#")
}

/// An error frame: candump writes its class in eight digits, with the flag of error frames.
fn is_error(frame: &str) -> bool {
    frame.starts_with('2') && frame.find('#') == Some(8)
}

/// Frames that follow themselves. Nobody here sends a frame twice in a row, so the kernel doubled them.
fn doubled(frames: &[String]) -> u64 {
    frames.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
}

/// Commands that the kernel doubled. Its copies have lost their sender, so that the bench receives them: frames of its own
/// ids, which it has to hand back.
fn doubled_commands(frames: &[String]) -> u64 {
    frames.windows(2).filter(|pair| pair[0] == pair[1] && is_command(&pair[0])).count() as u64
}

/// Commands that the bench sent, by its own log.
fn sent(ours: &[String], seen: &[String]) -> u64 {
    let commands = ours.iter().filter(|frame| is_command(frame)).count() as u64;
    commands - doubled_commands(seen)
}

/// The commands of each of these ids have to end with zeros, more than one in case it is lost, after others.
pub(crate) fn end_with_zeros(frames: &[String], ids: &[&str]) {
    for id in ids {
        let of_id = || frames.iter().filter(|frame| frame.starts_with(&format!("{id}#")));
        let zeros = of_id().rev().take_while(|frame| **frame == format!("{id}#0000000000000000"));
        let zeros = zeros.count();
        assert!(
            (3..of_id().count()).contains(&zeros),
            "{zeros} frames of zeros at the end of {id}"
        );
    }
}

/// What the form of a frame says that the bench has to count it as.
fn class(frame: &str) -> &'static str {
    let (id, data) = frame.split_once('#').unwrap();
    let attached = ["201", "202", "203", "204", "209"].contains(&id);
    let family = id.len() == 3 && ("201"..="20B").contains(&id);
    if is_error(frame) {
        return "receive_errors";
    }
    match (attached, data) {
        (true, data) if data.starts_with('R') => "others",
        (true, data) if data.len() != 16 => "bad_length",
        (true, data) if data > "2" => "bad_field",
        (true, _) => "taken",
        (false, _) if family => "unattached",
        _ => "others",
    }
}

impl Judge {
    pub(crate) fn new(
        candump: &str,
        ours: &str,
        report: &[String],
        robot_received: Vec<String>,
        phases: Vec<Phase>,
    ) -> Self {
        let count = |line: &String| {
            let (name, count) = line.split_once(' ')?;
            Some((name.to_owned(), count.parse().ok()?))
        };
        let counts = report.iter().filter_map(count).collect();
        Self { candump: frames(candump), ours: frames(ours), robot_received, counts, phases }
    }

    fn count(&self, name: &str) -> u64 {
        *self.counts.get(name).unwrap_or_else(|| panic!("the bench reports no {name}"))
    }

    /// Everything that candump saw of the robot, the bench received, in this order; everything that candump saw of the
    /// bench, the robot received, and the bench says that it sent it.
    pub(crate) fn bytes_are_equal(&self) {
        let of = |frames: &[String], ours: bool| -> Vec<String> {
            frames.iter().filter(|frame| is_command(frame) == ours).cloned().collect()
        };
        let (seen, received) = (of(&self.candump, false), of(&self.ours, false));
        assert_eq!(seen.len(), received.len());
        assert!(seen == received, "candump and the bench saw different frames");
        let commands = of(&self.candump, true);
        // The copies of its own frames come back to the robot as well.
        let received = of(&self.robot_received, true);
        assert_eq!(commands.len(), received.len());
        assert!(commands == received, "candump and the robot saw different commands");
        // What was lost is missing, what was doubled is there twice; nothing else, and nothing in another order.
        let mut sent = self.ours.iter().filter(|frame| is_command(frame));
        let mut last: Option<&String> = None;
        for command in &commands {
            if last != Some(command) {
                last = sent.find(|frame| *frame == command);
                assert!(last.is_some(), "{command} was seen, and not sent");
            }
        }
    }

    /// By the witness that is not ours.
    pub(crate) fn all_motors_are_left_at_zero(&self) {
        end_with_zeros(&self.candump, &["200", "2FF"]);
    }

    /// I6, and each counter for itself.
    pub(crate) fn frames_add_up(&self) {
        let mut expected: HashMap<&str, u64> = HashMap::new();
        for frame in self.candump.iter().filter(|frame| !is_command(frame)) {
            *expected.entry(class(frame)).or_default() += 1;
        }
        for name in ["taken", "bad_length", "bad_field", "unattached", "receive_errors"] {
            assert_eq!(self.count(name), expected[name], "{name}");
            assert!(expected[name] > 100, "{name}: hardly any");
        }
        let received = self.candump.iter().filter(|frame| !is_error(frame));
        let (ids, data): (Vec<_>, Vec<_>) = received.filter_map(|one| one.split_once('#')).unzip();
        let extended = ids.iter().filter(|id| id.len() == 8).count();
        let remote = data.iter().filter(|data| data.starts_with('R')).count();
        assert!(extended.min(remote) > 100, "{extended} extended, {remote} remote: hardly any");
        let copies = doubled_commands(&self.candump);
        let unrelated = expected["others"] + expected["unattached"] + copies;
        assert_eq!(self.count("unrelated"), unrelated);
        assert_eq!(self.count("malformed"), expected["bad_length"] + expected["bad_field"]);
        let sum = |names: &[&str]| -> u64 { names.iter().map(|name| self.count(name)).sum() };
        assert_eq!(self.count("received"), sum(&["taken", "unrelated", "malformed"]));
        assert_eq!(self.count("offered"), sum(&["sent", "refused", "send_errors"]));
        assert_eq!(self.count("packed"), sum(&["sent", "superseded"]), "a frame waits");
        assert_eq!(self.count("sent"), sent(&self.ours, &self.candump));
        assert!(self.count("refused") > 5, "the queue was never full");
        assert_eq!((self.count("send_errors"), self.count("bus_losses")), (0, 0));

        let (seen, ours) = (self.split(&self.candump), self.split(&self.ours));
        for ((phase, seen), ours) in self.phases.iter().zip(seen).zip(ours) {
            let offered = phase.written.accepted + sent(ours, seen);
            // A full queue drops what it refuses, and says so to whoever wrote it.
            if phase.name == "queue full" {
                assert_eq!(phase.dropped, phase.written.refused + self.count("refused"));
            }
            let lost = if phase.name == "queue full" { 0 } else { phase.dropped };
            // Where it does both, the kernel may lose a copy too: that is in its count and in no other.
            let copies_lost = (seen.len() as u64 + lost).checked_sub(offered + doubled(seen));
            let some = if phase.name == "both" { doubled(seen) / 5 } else { 0 };
            assert!(
                copies_lost.is_some_and(|lost| lost <= some),
                "{}: {copies_lost:?}",
                phase.name
            );
            let percent = |count: u64| count as f64 * 100.0 / offered as f64;
            let (lost, doubled) = (percent(lost), percent(doubled(seen)));
            let (loses, doubles) = (
                phase.name == "5 % lost" || phase.name == "both",
                phase.name.contains("doubled") || phase.name == "both",
            );
            assert!(if loses { (4.0..6.0).contains(&lost) } else { lost == 0.0 }, "{lost} % lost");
            assert!(
                if doubles { (1.2..2.8).contains(&doubled) } else { doubled == 0.0 },
                "{doubled} %"
            );
        }
    }

    /// The frames of each phase, from marker to marker.
    fn split<'a>(&self, frames: &'a [String]) -> impl Iterator<Item = &'a [String]> {
        frames.split(|frame| is_marker(frame)).take(self.phases.len())
    }

    pub(crate) fn print_table(&self) {
        println!("phase         robot  bench  refused     lost  doubled  candump  (frames)");
        let mut total = [0; 6];
        let (seen, ours) = (self.split(&self.candump), self.split(&self.ours));
        for ((phase, seen), ours) in self.phases.iter().zip(seen).zip(ours) {
            let sent = sent(ours, seen);
            let lost = if phase.name == "queue full" { 0 } else { phase.dropped };
            let refused = if phase.name == "queue full" { phase.dropped } else { 0 };
            let row =
                [phase.written.accepted, sent, refused, lost, doubled(seen), seen.len() as u64];
            println!(
                "{:<12}{:>7}{:>9}{:>9}{:>9}{:>9}{:>9}",
                phase.name, row[0], row[1], row[2], row[3], row[4], row[5]
            );
            total.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
        let [robot, bench, refused, lost, doubled, candump] = total;
        println!("{:<12}{robot:>7}{bench:>9}{refused:>9}{lost:>9}{doubled:>9}{candump:>9}", "all");
        let counts = [
            "received",
            "taken",
            "unrelated",
            "unattached",
            "malformed",
            "bad_length",
            "bad_field",
            "receive_errors",
            "packed",
            "superseded",
            "offered",
            "sent",
            "refused",
            "send_errors",
        ];
        let counts = counts.map(|name| format!("{name} {}", self.count(name)));
        println!("the bench counts, to its end: {}", counts.join(", "));
        assert!(robot + bench > 100_000, "not 100 000 frames");
    }
}
