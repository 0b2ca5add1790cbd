//! Streams of `f32`, the least byte first.

use crate::Outcome;
use std::io::{ErrorKind, Read, Write};

/// Reads numbers; `None` at the end of the input.
pub fn next<const N: usize>(input: &mut (impl Read + ?Sized)) -> Outcome<Option<[f32; N]>> {
    let mut numbers = [0.0; N];
    for (place, number) in numbers.iter_mut().enumerate() {
        let mut bytes = [0; 4];
        match input.read_exact(&mut bytes) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof && place == 0 => {
                return Ok(None);
            }
            read => read?,
        }
        *number = f32::from_le_bytes(bytes);
    }
    Ok(Some(numbers))
}

/// Reads numbers that have to be there.
pub fn read<const N: usize>(input: &mut (impl Read + ?Sized)) -> Outcome<[f32; N]> {
    Ok(next(input)?.ok_or("the input ends too early")?)
}

pub fn write(
    numbers: impl IntoIterator<Item = f32>,
    output: &mut (impl Write + ?Sized),
) -> Outcome<()> {
    for number in numbers {
        output.write_all(&number.to_le_bytes())?;
    }
    Ok(())
}
