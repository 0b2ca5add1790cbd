//! Planted mistakes.

/// Declares the mistakes that a judge has to find, each with its name in the argument `--plant NAME`.
macro_rules! defects {
    ($($(#[$doc:meta])* $variant:ident = $name:literal,)+) => {
        /// A mistake that the judge has to find.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(crate) enum Defect {
            None,
            $($(#[$doc])* $variant,)+
        }

        impl Defect {
            /// Takes the mistake off the end of the arguments.
            pub(crate) fn split<'a, 'b>(
                arguments: &'a [&'b str],
            ) -> crate::Outcome<(&'a [&'b str], Self)> {
                match arguments {
                    $([rest @ .., "--plant", $name] => Ok((rest, Self::$variant)),)+
                    [.., "--plant", name] => Err(format!("no defect {name}").into()),
                    _ => Ok((arguments, Self::None)),
                }
            }
        }
    };
}
pub(crate) use defects;

/// Returns the factor if the mistake is this one, otherwise 1.
pub fn factor<D: PartialEq>(defect: D, of: D, factor: f32) -> f32 {
    if defect == of { factor } else { 1.0 }
}

// Mistakes of the kind that codecs have.
defects! {
    /// The halves of the byte that velocity and kp share are exchanged, in feedback those of velocity and torque.
    Nibbles = "nibbles",
    /// Fields span 2^bits counts, not 2^bits - 1.
    Scale = "scale",
    /// Counts are rounded, not truncated.
    Rounded = "rounded",
    /// Frames that switch a drive have the next id.
    Id = "id",
    /// Frames about registers name the next drive.
    Number = "number",
    /// Registers are written as if each were a float.
    Kind = "kind",
    /// The simulated drive answers with two bytes of its velocity and torque exchanged.
    Drive = "drive",
    /// It answers with two bytes of the value of a register exchanged.
    Answer = "answer",
    /// The simulated drive reads commands with two bytes of the position exchanged.
    Ear = "ear",
}
