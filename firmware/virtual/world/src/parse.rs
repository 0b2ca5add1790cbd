//! The words of the line protocol that are more than a number.

use drivetrain::frame::CanFrame;
use drivetrain::sim::{Fault, Line, MotorKey};
use drivetrain::time::Instant;
use embedded_can::{Frame, StandardId};

pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Reads the kind of a fault: `silent`, `power`, `frozen`, `stuck`, `blocked`, `reversed`, `code:4`, `angle:9000`, `length:7`.
pub(crate) fn fault(kind: &str, motor: MotorKey) -> Outcome<Fault> {
    Ok(match kind.split_once(':') {
        None => match kind {
            "silent" => Fault::Silent(motor),
            "power" => Fault::PowerLoss { motor, forgets_angle: false },
            "frozen" => Fault::FrozenFeedback(motor),
            "stuck" => Fault::StuckEncoder(motor),
            "blocked" => Fault::BlockedShaft(motor),
            "reversed" => Fault::ReversedTorque(motor),
            _ => return Err("no such fault".into()),
        },
        Some(("code", code)) => Fault::ErrorCode { motor, code: code.parse()? },
        Some(("angle", raw)) => Fault::WrongAngle { motor, raw: raw.parse()? },
        Some(("length", length)) => Fault::WrongLength { motor, length: length.parse()? },
        Some(_) => return Err("no such fault".into()),
    })
}

pub(crate) fn instant(micros: &str) -> Outcome<Instant> {
    Ok(Instant::from_micros(micros.parse()?))
}

pub(crate) fn line(name: &str) -> Outcome<Line> {
    match name {
        "1" | "can1" => Ok(Line::Can1),
        "2" | "can2" => Ok(Line::Can2),
        _ => Err("no such line".into()),
    }
}

/// Reads `1:200#0666000000000000`: a line, a standard id and at most eight bytes.
pub(crate) fn frame(text: &str) -> Outcome<(Line, CanFrame)> {
    let (place, rest) = text.split_once(':').ok_or("no line")?;
    let (id, digits) = rest.split_once('#').ok_or("no #")?;
    let id = StandardId::new(u16::from_str_radix(id, 16)?).ok_or("not an 11-bit id")?;
    let (mut bytes, count) = ([0; 8], digits.len() / 2);
    for (at, byte) in bytes.iter_mut().enumerate().take(count) {
        *byte = u8::from_str_radix(digits.get(2 * at..2 * at + 2).ok_or("half a byte")?, 16)?;
    }
    let data = bytes.get(..count).ok_or("more than eight bytes")?;
    Ok((line(place)?, CanFrame::new(id, data).ok_or("no such frame")?))
}
