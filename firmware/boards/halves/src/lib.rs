//! embassy's bxCAN as a polled driver of `embedded-can`; the clocks and the watchdog of boards with an STM32F4 and a crystal of
//! 12 MHz.
#![no_std]

use drivetrain::runner::{AbortPending, Nb, NbAbort};
use drivetrain::time::Instant;
use embassy_stm32::can::{self, BufferedCanReceiver, BufferedCanSender, Can};
use embassy_stm32::{Config, pac, rcc, time::Hertz};
use embedded_can::{ErrorKind, ExtendedId, Id, StandardId};

/// A loop that stands for so long is reset, and comes back disarmed. The watchdog's own oscillator is up to half off.
pub const WATCHDOG_US: u32 = 20_000;

/// Bits per second.
pub const BIT_RATE: u32 = 1_000_000;

/// embassy's buffered halves as one polled driver: neither of its CAN types implements a trait of `embedded-can`.
///
/// In embassy-stm32 0.6 no error of the bus comes this way, and a frame for which its buffer had no room is dropped without a
/// word: the rate and the longest gap in the health of each motor show lost frames.
pub struct Halves {
    sender: BufferedCanSender,
    receiver: BufferedCanReceiver,
    registers: pac::can::Can,
    /// Three mailboxes and the queue before them take so many rounds to call back.
    rounds: usize,
}

impl embedded_can::nb::Can for Halves {
    type Frame = can::Frame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &can::Frame) -> nb::Result<Option<can::Frame>, ErrorKind> {
        self.sender.try_write(*frame).map(|()| None).map_err(|_| nb::Error::WouldBlock)
    }

    fn receive(&mut self) -> nb::Result<can::Frame, ErrorKind> {
        match self.receiver.try_receive() {
            Ok(Ok(envelope)) => Ok(envelope.frame),
            Ok(Err(_)) => Err(nb::Error::Other(ErrorKind::Other)),
            Err(_) => Err(nb::Error::WouldBlock),
        }
    }
}

/// embassy's buffered halves have no such call, so it goes by the registers: TSR, and the mailboxes. Waits as `bxcan` does: for the
/// end of an attempt that is on the wire.
impl AbortPending for Halves {
    fn abort_pending(&mut self, mut back: impl FnMut(can::Frame)) {
        // The interrupt fills a mailbox that is free from the queue, so there is a round for each three frames of it.
        for _ in 0..self.rounds {
            let mut is_empty = true;
            for mailbox in 0..3 {
                let status = self.registers.tsr().read();
                if status.tme(mailbox) {
                    continue;
                }
                is_empty = false;
                let held = self.registers.tx(mailbox);
                let (id, is_remote) = header(held.tir().read().0);
                let length = held.tdtr().read().dlc();
                let words = [held.tdlr().read().0, held.tdhr().read().0];
                // One that is on the wire is free at the end of this attempt, 0.14 ms at most, and only then it is known
                // whether it was sent: a question that was sent and counted as unsent would meet its answer. Meanwhile
                // embassy's interrupt must not clear the flag.
                let was_sent = critical_section::with(|_| {
                    self.registers.tsr().write(|status| status.set_abrq(mailbox, true));
                    while !self.registers.tsr().read().tme(mailbox) {}
                    self.registers.tsr().read().txok(mailbox)
                });
                if was_sent {
                    continue;
                }
                let [[a, b, c, d], [e, f, g, h]] = words.map(u32::to_le_bytes);
                let header = can::frame::Header::new(id, length, is_remote);
                let bytes = [a, b, c, d, e, f, g, h];
                if let Ok(frame) = can::Frame::new(header, &bytes) {
                    back(frame);
                }
            }
            if is_empty {
                return;
            }
        }
    }
}

/// Reads id and kind of a frame in the register TIR of its mailbox: 29 bits from bit 3 on if bit 2 is set, 11 bits from bit 21 on
/// otherwise; bit 1 is set for a remote frame (RM0090, 32.9.3).
fn header(tir: u32) -> (Id, bool) {
    let standard = || StandardId::new((tir >> 21) as u16).unwrap_or(StandardId::MAX).into();
    let extended = || ExtendedId::new(tir >> 3).unwrap_or(ExtendedId::MAX).into();
    (if tir & 1 << 2 == 0 { standard() } else { extended() }, tir & 1 << 1 != 0)
}

/// Switches on a controller whose filters are set, with 1 Mbit/s. `registers` are its own.
///
/// What waits in `sending` is called back through the mailboxes, three frames a round: a short one is called back sooner.
pub async fn start<const SENDING: usize, const RECEIVED: usize>(
    mut controller: Can<'static>,
    registers: pac::can::Can,
    sending: &'static mut can::TxBuf<SENDING>,
    received: &'static mut can::RxBuf<RECEIVED>,
) -> NbAbort<Halves> {
    controller.set_bitrate(BIT_RATE);
    // Otherwise embassy drops a frame, and says nothing, while one with the same id still waits in a mailbox.
    controller.set_tx_fifo_scheduling(true);
    // Buffered before it is enabled: embassy's unbuffered interrupt masks itself until somebody reads, and a frame that came
    // in between would leave the controller deaf for ever.
    let buffered = controller.buffered(sending, received);
    controller.enable().await;
    let (sender, receiver) = (buffered.writer(), buffered.reader());
    // Dropped, they would reset the controller and put it to sleep.
    core::mem::forget((controller, buffered));
    NbAbort(Nb(Halves { sender, receiver, registers, rounds: 1 + SENDING.div_ceil(3) }))
}

/// Reads the time, for the runner.
pub fn now() -> Instant {
    Instant::from_micros(embassy_time::Instant::now().as_micros())
}

/// 168 MHz from a crystal of 12 MHz; APB1 42 MHz, of which CAN makes 1 Mbit/s exactly.
pub fn clocks() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(rcc::Hse { freq: Hertz(12_000_000), mode: rcc::HseMode::Oscillator });
    config.rcc.pll_src = rcc::PllSource::HSE;
    config.rcc.pll = Some(rcc::Pll {
        prediv: rcc::PllPreDiv::DIV6,
        mul: rcc::PllMul::MUL168,
        divp: Some(rcc::PllPDiv::DIV2),
        divq: Some(rcc::PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV1;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV4;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config
}
