//! What the programs for this board share: its clocks, its CAN, its watchdog.
#![no_std]

use drivetrain::runner::{AbortPending, Nb, NbAbort};
use drivetrain::time::Instant;
use embassy_stm32::can::{self, BufferedCanReceiver, BufferedCanSender, Can, filter::Mask32};
use embassy_stm32::peripherals::{CAN1, PD0, PD1};
use embassy_stm32::{Config, Peri, bind_interrupts, pac, rcc, time::Hertz};
use embedded_can::{ErrorKind, StandardId};
use static_cell::StaticCell;

/// A loop that stands for so long is reset, and comes back disarmed. The watchdog's own oscillator is up to half off.
pub const WATCHDOG_US: u32 = 20_000;

bind_interrupts!(struct Interrupts {
    CAN1_TX => can::TxInterruptHandler<CAN1>;
    CAN1_RX0 => can::Rx0InterruptHandler<CAN1>;
    CAN1_RX1 => can::Rx1InterruptHandler<CAN1>;
    CAN1_SCE => can::SceInterruptHandler<CAN1>;
});

/// embassy's buffered halves as one polled driver: neither of its CAN types implements a trait of `embedded-can`.
///
/// In embassy-stm32 0.6 no error of the bus comes this way, and a frame for which its buffer had no room is dropped without a
/// word: what was lost shows in the rate and the longest gap of each motor's health.
pub struct Halves(BufferedCanSender, BufferedCanReceiver);

impl embedded_can::nb::Can for Halves {
    type Frame = can::Frame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &can::Frame) -> nb::Result<Option<can::Frame>, ErrorKind> {
        self.0.try_write(*frame).map(|()| None).map_err(|_| nb::Error::WouldBlock)
    }

    fn receive(&mut self) -> nb::Result<can::Frame, ErrorKind> {
        match self.1.try_receive() {
            Ok(Ok(envelope)) => Ok(envelope.frame),
            Ok(Err(_)) => Err(nb::Error::Other(ErrorKind::Other)),
            Err(_) => Err(nb::Error::WouldBlock),
        }
    }
}

/// embassy's buffered halves have no such call, so it goes by the registers: TSR, and the mailboxes.
impl AbortPending for Halves {
    fn abort_pending(&mut self, mut back: impl FnMut(can::Frame)) {
        // Twice: the interrupt fills a mailbox that is free from the queue, which holds one frame.
        for _ in 0..2 {
            for mailbox in 0..3 {
                let status = pac::CAN1.tsr().read();
                // One that is on the wire is free at the end of this attempt.
                if status.tme(mailbox) || status.abrq(mailbox) {
                    continue;
                }
                let held = pac::CAN1.tx(mailbox);
                let id = StandardId::new(held.tir().read().stid()).unwrap_or(StandardId::MAX);
                let length = held.tdtr().read().dlc();
                let words = [held.tdlr().read().0, held.tdhr().read().0];
                pac::CAN1.tsr().write(|status| status.set_abrq(mailbox, true));
                let [[a, b, c, d], [e, f, g, h]] = words.map(u32::to_le_bytes);
                let header = can::frame::Header::new(id.into(), length, false);
                if let Ok(frame) = can::Frame::new(header, &[a, b, c, d, e, f, g, h]) {
                    back(frame);
                }
            }
        }
    }
}

/// CAN1 with 1 Mbit/s. To be called once.
pub async fn can1(
    can1: Peri<'static, CAN1>,
    receive: Peri<'static, PD0>,
    transmit: Peri<'static, PD1>,
) -> NbAbort<Halves> {
    // What waits here is called back through the mailboxes, one frame a round, so it is short.
    static SENDING: StaticCell<can::TxBuf<1>> = StaticCell::new();
    static RECEIVED: StaticCell<can::RxBuf<32>> = StaticCell::new();
    let mut controller = Can::new(can1, receive, transmit, Interrupts);
    controller.modify_filters().enable_bank(0, can::Fifo::Fifo0, Mask32::accept_all());
    controller.set_bitrate(1_000_000);
    // Otherwise embassy drops a frame, and says nothing, while one with the same id still waits in a mailbox.
    controller.set_tx_fifo_scheduling(true);
    controller.enable().await;
    let (sending, received) = (SENDING.init(can::TxBuf::new()), RECEIVED.init(can::RxBuf::new()));
    let buffered = controller.buffered(sending, received);
    let halves = Halves(buffered.writer(), buffered.reader());
    // Dropped, they would reset the controller and put it to sleep.
    core::mem::forget((controller, buffered));
    NbAbort(Nb(halves))
}

/// Reads the time, for the runner.
pub fn now() -> Instant {
    Instant::from_micros(embassy_time::Instant::now().as_micros())
}

/// 168 MHz from the 12 MHz crystal; APB1 42 MHz, of which CAN makes 1 Mbit/s exactly.
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
