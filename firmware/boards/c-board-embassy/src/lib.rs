//! What the programs for this board share: its CAN.
#![no_std]

use drivetrain::runner::NbAbort;
use embassy_stm32::can::{self, Can, filter::Mask32};
use embassy_stm32::peripherals::{CAN1, CAN2, PB5, PB6, PD0, PD1};
use embassy_stm32::{Peri, bind_interrupts, pac};
use halves::Halves;
use static_cell::StaticCell;

pub use halves::{WATCHDOG_US, clocks, now};

bind_interrupts!(struct Interrupts {
    CAN1_TX => can::TxInterruptHandler<CAN1>;
    CAN1_RX0 => can::Rx0InterruptHandler<CAN1>;
    CAN1_RX1 => can::Rx1InterruptHandler<CAN1>;
    CAN1_SCE => can::SceInterruptHandler<CAN1>;
    CAN2_TX => can::TxInterruptHandler<CAN2>;
    CAN2_RX0 => can::Rx0InterruptHandler<CAN2>;
    CAN2_RX1 => can::Rx1InterruptHandler<CAN2>;
    CAN2_SCE => can::SceInterruptHandler<CAN2>;
});

/// The filter bank from which on they belong to CAN2.
const SECOND: u8 = 14;

/// CAN1 with 1 Mbit/s. To be called once.
pub async fn can1(
    can1: Peri<'static, CAN1>,
    receive: Peri<'static, PD0>,
    transmit: Peri<'static, PD1>,
) -> NbAbort<Halves> {
    static SENDING: StaticCell<can::TxBuf<1>> = StaticCell::new();
    static RECEIVED: StaticCell<can::RxBuf<32>> = StaticCell::new();
    let mut controller = Can::new(can1, receive, transmit, Interrupts);
    // CAN1 has the filters of both.
    controller
        .modify_filters()
        .set_split(SECOND)
        .enable_bank(0, can::Fifo::Fifo0, Mask32::accept_all())
        .slave_filters()
        .enable_bank(SECOND, can::Fifo::Fifo0, Mask32::accept_all());
    let (sending, received) = (SENDING.init(can::TxBuf::new()), RECEIVED.init(can::RxBuf::new()));
    halves::start(controller, pac::CAN1, sending, received).await
}

/// CAN2 with 1 Mbit/s, after [`can1`]. To be called once.
pub async fn can2(
    can2: Peri<'static, CAN2>,
    receive: Peri<'static, PB5>,
    transmit: Peri<'static, PB6>,
) -> NbAbort<Halves> {
    static SENDING: StaticCell<can::TxBuf<1>> = StaticCell::new();
    static RECEIVED: StaticCell<can::RxBuf<32>> = StaticCell::new();
    let controller = Can::new(can2, receive, transmit, Interrupts);
    let (sending, received) = (SENDING.init(can::TxBuf::new()), RECEIVED.init(can::RxBuf::new()));
    halves::start(controller, pac::CAN2, sending, received).await
}
