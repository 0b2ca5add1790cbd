use embedded_can::ErrorKind;

/// What a runner has counted since it was made; every counter saturates.
///
/// Received frames add up: `received = taken + unrelated + malformed`. Offered frames add up:
/// `offered = sent + refused + send_errors.total()`.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Statistics {
    /// Frames that the driver delivered, or that were given to `ingest`.
    pub received: u32,
    /// Frames that the device took as feedback.
    pub taken: u32,
    /// Frames of others, handed back.
    pub unrelated: u32,
    /// Frames with a motor's id in a form that is not its feedback; not used.
    pub malformed: u32,
    /// Errors of the driver when asked for a frame.
    pub receive_errors: ErrorCounts,
    /// Frames offered to the driver.
    pub offered: u32,
    /// Frames that the driver took.
    pub sent: u32,
    /// Frames that the driver had no place for. Kept, and offered again with newer values.
    pub refused: u32,
    /// Errors of the driver when offered a frame. The frame is kept as well.
    pub send_errors: ErrorCounts,
    /// Own frames that the driver gave back for others of higher priority. Kept as well.
    pub evicted: u32,
    /// Frames of others that the driver gave back for ours. Handed back, unless they are no classic CAN frames of at most 8 bytes.
    pub evicted_unrelated: u32,
    /// Command frames that newer ones replaced before the driver took them; wraps. See
    /// [`Devices::superseded`](crate::motor::Devices::superseded).
    pub superseded: u32,
    /// Received frames that a queue dropped before they came here.
    pub lost: u32,
    /// Periods without a tick: that passed before the program asked, or whose step it did not run.
    pub overruns: u32,
    /// Times that some command frame could not be sent for 100 ms: everything was disarmed.
    pub bus_losses: u32,
    /// Ticks whose time was that of the one before, those included that are due because the clock stands.
    pub clock_standstills: u32,
    /// Times that the clock went back.
    pub clock_reversals: u32,
}

/// Errors of the driver, by kind; every counter saturates.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ErrorCounts {
    /// The receive buffer overflowed.
    pub overrun: u32,
    /// A bit on the bus was not the one sent.
    pub bit: u32,
    /// The bit stuffing was wrong.
    pub stuff: u32,
    /// The checksum was wrong.
    pub crc: u32,
    /// The frame had a wrong form.
    pub form: u32,
    /// Nobody acknowledged the frame.
    pub acknowledge: u32,
    /// Any other error, bus-off included: `embedded-can` has no kind for it.
    pub other: u32,
}

impl ErrorCounts {
    pub(super) fn count(&mut self, kind: ErrorKind) {
        increment(match kind {
            ErrorKind::Overrun => &mut self.overrun,
            ErrorKind::Bit => &mut self.bit,
            ErrorKind::Stuff => &mut self.stuff,
            ErrorKind::Crc => &mut self.crc,
            ErrorKind::Form => &mut self.form,
            ErrorKind::Acknowledge => &mut self.acknowledge,
            _ => &mut self.other,
        });
    }

    /// Returns the sum over all kinds.
    #[must_use]
    pub const fn total(&self) -> u32 {
        self.overrun
            .saturating_add(self.bit)
            .saturating_add(self.stuff)
            .saturating_add(self.crc)
            .saturating_add(self.form)
            .saturating_add(self.acknowledge)
            .saturating_add(self.other)
    }
}

pub(super) const fn increment(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
