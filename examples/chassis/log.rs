//! The frames on the bus, as candump would have written them.

use drivetrain::sim::Transmission;
use std::fs::File;
use std::io::{BufWriter, Result, Write};
use std::path::Path;

/// A file, or nothing. The first error is kept until the end: a simulation is not the place to handle it.
pub(crate) struct Log {
    file: Option<BufWriter<File>>,
    outcome: Result<()>,
}

impl Log {
    pub(crate) fn create(path: Option<&Path>) -> Result<Self> {
        let file = path.map(File::create).transpose()?.map(BufWriter::new);
        Ok(Self { file, outcome: Ok(()) })
    }

    pub(crate) fn write(&mut self, record: &Transmission) {
        if let (Some(file), Ok(())) = (&mut self.file, &self.outcome) {
            self.outcome = writeln!(file, "{record}");
        }
    }

    pub(crate) fn finish(mut self) -> Result<()> {
        self.outcome?;
        self.file.as_mut().map_or(Ok(()), BufWriter::flush)
    }
}
