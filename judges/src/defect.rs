//! Planted mistakes.

use crate::Outcome;

/// A mistake of the kind that codecs have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Defect {
    None,
    /// The halves of the byte that velocity and kp share are exchanged, in feedback those of velocity and torque.
    Nibbles,
    /// Fields span 2^bits counts, not 2^bits - 1.
    Scale,
    /// Counts are rounded, not truncated.
    Rounded,
    /// Frames that switch a drive have the next id.
    Id,
    /// Frames about registers name the next drive.
    Number,
    /// Registers are written as if each were a float.
    Kind,
    /// The simulated drive answers with two bytes of its velocity and torque exchanged.
    Drive,
    /// It answers with two bytes of the value of a register exchanged.
    Answer,
    /// The simulated drive reads commands with two bytes of the position exchanged.
    Ear,
}

impl Defect {
    pub fn named(name: &str) -> Outcome<Self> {
        Ok(match name {
            "nibbles" => Self::Nibbles,
            "scale" => Self::Scale,
            "rounded" => Self::Rounded,
            "id" => Self::Id,
            "number" => Self::Number,
            "kind" => Self::Kind,
            "drive" => Self::Drive,
            "answer" => Self::Answer,
            "ear" => Self::Ear,
            _ => return Err(format!("no defect {name}").into()),
        })
    }
}
