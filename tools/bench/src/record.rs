//! Recordings: the text of candump, and MCAP, which Foxglove and Rerun open.

use crate::outlet::{Outlet, Sink};
use crate::text;
use drivetrain::frame::CanFrame;
use drivetrain::time::Instant;
use drivetrain::wire::candump::{ParseError, Record};
use embedded_can::{Frame, Id};
use mcap::records::MessageHeader;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};

/// Texts that wait for the disk: seven seconds of 8-byte frames with nothing between them.
const ROOM: usize = 1 << 16;

/// The topic of the frames.
const CAN: &str = "/can";

/// What a session writes down.
#[derive(Debug)]
pub(crate) struct Recorder {
    outlet: Outlet,
    is_mcap: bool,
}

impl Recorder {
    /// Begins the file that `option` names: MCAP if its name ends so.
    ///
    /// # Errors
    /// Says which file cannot be written, and why.
    pub(crate) fn create(option: &str, path: &str) -> Result<Self, String> {
        let failed = |error: &dyn std::fmt::Display| format!("{option} {path}: {error}");
        let file = File::create(path).map_err(|error| failed(&error))?;
        let (is_mcap, name) = (path.ends_with(".mcap"), format!("{option} {path}"));
        let outlet = if is_mcap {
            let sink = McapSink::new(file).map_err(|error| failed(&error))?;
            Outlet::new(&name, sink, ROOM)
        } else {
            Outlet::new(&name, file, ROOM)
        };
        Ok(Self { outlet: outlet.map_err(|error| failed(&error))?, is_mcap })
    }

    /// Notes a frame, in the form of candump; what is lost is said at the end.
    pub(crate) fn frame(&mut self, at: Instant, interface: &str, frame: &str, is_ours: bool) {
        let (seconds, micros) = (at.as_micros() / 1_000_000, at.as_micros() % 1_000_000);
        let text = if self.is_mcap {
            let (id, data) = frame.split_once('#').unwrap_or((frame, ""));
            let number = u32::from_str_radix(id, 16).unwrap_or(0);
            let is_extended = id.len() == 8;
            let message = json!({ "interface": interface, "id": number, "extended": is_extended, "data": data, "ours": is_ours });
            line(at, CAN, &message)
        } else {
            format!("({seconds}.{micros:06}) {interface} {frame}\n")
        };
        _ = self.outlet.offer(text);
    }

    /// Notes values of a motor, for plots.
    pub(crate) fn values(&mut self, at: Instant, topic: &str, values: &Value) {
        if self.is_mcap {
            _ = self.outlet.offer(line(at, topic, values));
        }
    }

    /// Tells whether nothing is written any more: a disk is full, or gone.
    pub(crate) fn is_broken(&self) -> bool {
        self.outlet.is_broken()
    }

    /// Waits until all is written.
    ///
    /// # Errors
    /// Where a part of it is missing.
    pub(crate) fn finish(self, say: impl FnMut(String)) -> Result<(), String> {
        let (lost, name) = (self.outlet.lost(), self.outlet.name().to_owned());
        self.outlet.finish(String::new(), say)?;
        if lost == 0 { Ok(()) } else { Err(format!("{name}: {lost} frames came too fast for it")) }
    }
}

fn line(at: Instant, topic: &str, message: &Value) -> String {
    format!("{}\t{topic}\t{message}\n", at.as_micros())
}

/// Writes lines of time in µs, topic and message as MCAP with messages in JSON.
struct McapSink {
    writer: mcap::Writer<BufWriter<File>>,
    channels: BTreeMap<String, (u16, u32)>,
    partial: String,
}

impl McapSink {
    fn new(file: File) -> io::Result<Self> {
        let options = mcap::WriteOptions::new()
            .compression(Some(mcap::Compression::Lz4))
            .library("drivetrain-bench");
        let writer = options.create(BufWriter::new(file)).map_err(io::Error::other)?;
        Ok(Self { writer, channels: BTreeMap::new(), partial: String::new() })
    }

    fn message(&mut self, line: &str) -> Result<(), mcap::McapError> {
        let mut parts = line.splitn(3, '\t');
        let (Some(micros), Some(topic), Some(message)) = (parts.next(), parts.next(), parts.next())
        else {
            return Ok(());
        };
        let log_time = micros.parse().unwrap_or(0_u64).saturating_mul(1_000);
        if !self.channels.contains_key(topic) {
            let schema = self.writer.add_schema(topic, "jsonschema", br#"{"type":"object"}"#)?;
            let channel = self.writer.add_channel(schema, topic, "json", &BTreeMap::new())?;
            self.channels.insert(topic.to_owned(), (channel, 0));
        }
        let Some((channel_id, sequence)) = self.channels.get_mut(topic) else { return Ok(()) };
        *sequence = sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time,
            publish_time: log_time,
        };
        self.writer.write_to_known_channel(&header, message.as_bytes())
    }
}

impl Write for McapSink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.partial += &String::from_utf8_lossy(bytes);
        while let Some((line, rest)) = self.partial.split_once('\n') {
            let (line, rest) = (line.to_owned(), rest.to_owned());
            self.partial = rest;
            self.message(&line).map_err(io::Error::other)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Sink for McapSink {
    /// A file without its end is one that some programs do not open.
    fn close(&mut self) -> io::Result<()> {
        self.writer.finish().map(|_| ()).map_err(io::Error::other)
    }
}

/// Reads the frames of a recording with their times, those of its first interface.
///
/// # Errors
/// Says what is wrong with the file, and in which line.
pub(crate) fn read(path: &str) -> Result<Vec<(Instant, CanFrame)>, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("{path}: {error}"))?;
    let frames = if bytes.starts_with(mcap::MAGIC) { read_mcap(&bytes) } else { read_text(&bytes) };
    let frames = frames.map_err(|error| format!("{path}: {error}"))?;
    if frames.is_empty() { Err(format!("{path}: no frames")) } else { Ok(frames) }
}

fn read_text(bytes: &[u8]) -> Result<Vec<(Instant, CanFrame)>, String> {
    let (mut frames, mut interface) = (Vec::new(), None);
    for (line, number) in bytes.split(|byte| *byte == b'\n').zip(1_u64..) {
        match Record::parse(line) {
            Ok(record) => {
                let first = *interface.get_or_insert(record.interface);
                // Without times, a frame each 0.1 ms.
                let at = record.time.unwrap_or(Instant::from_micros(100 * number));
                frames.extend((first == record.interface).then_some((at, record.frame)));
            }
            Err(ParseError::Blank(_) | ParseError::ErrorFrame(_) | ParseError::CanFd(_)) => {}
            Err(error) => return Err(format!("line {number}: {error}")),
        }
    }
    Ok(frames)
}

fn read_mcap(bytes: &[u8]) -> Result<Vec<(Instant, CanFrame)>, String> {
    let mut frames = Vec::new();
    for message in mcap::MessageStream::new(bytes).map_err(|error| error.to_string())? {
        let message = message.map_err(|error| error.to_string())?;
        if message.channel.topic != CAN {
            continue;
        }
        let value: Value =
            serde_json::from_slice(&message.data).map_err(|error| error.to_string())?;
        let at = Instant::from_micros(message.log_time / 1_000);
        frames.extend(frame_of(&value).map(|frame| (at, frame)));
    }
    Ok(frames)
}

/// Reads a frame by way of its text, so that there is one reader of it.
fn frame_of(value: &Value) -> Option<CanFrame> {
    let id = value.get("id")?.as_u64()?;
    let is_extended = value.get("extended")?.as_bool()?;
    let data = value.get("data")?.as_str()?;
    let text =
        if is_extended { format!("x {id:08X}#{data}") } else { format!("x {id:03X}#{data}") };
    Record::parse(text.as_bytes()).ok().map(|record| record.frame)
}

/// The key of an id, in order: standard ones first.
pub(crate) fn key(frame: &CanFrame) -> (bool, u32) {
    match frame.id() {
        Id::Standard(id) => (false, id.as_raw().into()),
        Id::Extended(id) => (true, id.as_raw()),
    }
}

/// Converts a recording into the other form, or the same anew; each second, `say` takes the progress.
///
/// # Errors
/// Says what is wrong with either file.
pub(crate) fn convert(from: &str, to: &str, mut say: impl FnMut(&str)) -> Result<usize, String> {
    let frames = read(from)?;
    let mut recorder = Recorder::create("--output", to)?;
    let mut said = std::time::Instant::now();
    for ((at, frame), count) in frames.iter().zip(0_usize..) {
        if said.elapsed().as_secs() >= 1 {
            said = std::time::Instant::now();
            say(&format!("{count} of {} frames", frames.len()));
        }
        // The disk sets the pace here, not a bus.
        while recorder.outlet.is_full() {
            std::thread::yield_now();
        }
        recorder.frame(*at, "can0", &text::of(frame), false);
    }
    recorder.finish(|_| {})?;
    Ok(frames.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> String {
        let path = std::env::temp_dir().join(format!("bench-{}-{name}", std::process::id()));
        path.to_str().unwrap().to_owned()
    }

    #[test]
    fn what_was_recorded_is_read_again_from_both_forms() {
        let texts = ["201#0E160000FFFD2100", "00000901#11", "201#R8", "7FF#"];
        for name in ["a.log", "a.mcap"] {
            let path = folder(name);
            let mut recorder = Recorder::create("--log", &path).unwrap();
            for (frame, micros) in
                texts.iter().zip([1_000_001_u64, 1_000_002, 2_000_000, 3_000_000])
            {
                recorder.frame(Instant::from_micros(micros), "can0", frame, false);
            }
            recorder.values(Instant::from_micros(1), "/motor/M3508 1", &json!({ "rpm": 1.5 }));
            recorder.frame(Instant::from_micros(4), "can0", "20000004#0001000000000000", false);
            recorder.finish(|_| {}).unwrap();
            let frames = read(&path).unwrap();
            let found: Vec<_> = frames.iter().map(|(_, frame)| text::of(frame)).take(4).collect();
            assert_eq!(found, texts, "{name}");
            assert_eq!(frames[1].0, Instant::from_micros(1_000_002));
            std::fs::remove_file(path).unwrap();
        }
    }

    #[test]
    fn each_form_becomes_the_other_without_a_loss() {
        let (text_a, mcap, text_b) = (folder("b.log"), folder("b.mcap"), folder("c.log"));
        let lines: String = (0..70_000)
            .map(|n| {
                format!(
                    "({}.{:06}) can0 {:03X}#{:04X}\n",
                    5 + n / 1_000,
                    n % 1_000,
                    n % 0x800,
                    n % 0x10000
                )
            })
            .collect();
        std::fs::write(&text_a, &lines).unwrap();
        assert_eq!(convert(&text_a, &mcap, |_| {}), Ok(70_000));
        assert_eq!(convert(&mcap, &text_b, |_| {}), Ok(70_000));
        assert!(std::fs::read_to_string(&text_b).unwrap() == lines);
        [text_a, mcap, text_b].iter().for_each(|path| std::fs::remove_file(path).unwrap());
    }

    #[test]
    fn a_file_that_is_none_is_named_with_its_line() {
        let path = folder("d.log");
        std::fs::write(&path, "(1.0) can0 201#00\nnonsense\n").unwrap();
        let error = read(&path).unwrap_err();
        assert!(error.contains(&path) && error.contains("line 2"), "{error}");
        std::fs::remove_file(&path).unwrap();
        assert!(read(&path).unwrap_err().contains(&path));
    }
}
