//! The drivers alone, for the virtual board: embassy's CAN in loop-back, and its serial port by DMA, as their examples use them.
//!
//! Each of ten frames has to come back as it was sent. The report goes out at USART1, by DMA; then what is heard there is sent back.
#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::can::{self, Can, Fifo, Frame, StandardId, filter::Mask32};
use embassy_stm32::usart::{self, Uart};
use embassy_stm32::{bind_interrupts, dma, peripherals};
use halves::clocks;
use panic_probe as _;

bind_interrupts!(struct Interrupts {
    CAN1_TX => can::TxInterruptHandler<peripherals::CAN1>;
    CAN1_RX0 => can::Rx0InterruptHandler<peripherals::CAN1>;
    CAN1_RX1 => can::Rx1InterruptHandler<peripherals::CAN1>;
    CAN1_SCE => can::SceInterruptHandler<peripherals::CAN1>;
    USART1 => usart::InterruptHandler<peripherals::USART1>;
    DMA2_STREAM2 => dma::InterruptHandler<peripherals::DMA2_CH2>;
    DMA2_STREAM7 => dma::InterruptHandler<peripherals::DMA2_CH7>;
});

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let board = embassy_stm32::init(clocks());
    let mut can = Can::new(board.CAN1, board.PD0, board.PD1, Interrupts);
    can.modify_filters().enable_bank(0, Fifo::Fifo0, Mask32::accept_all());
    can.modify_config().set_loopback(true).set_silent(true).set_bitrate(1_000_000);
    can.enable().await;
    let mut count = b'0';
    for byte in 0..10 {
        let id = StandardId::new(u16::from(byte) + 0x100).expect("11 bits");
        let frame = Frame::new_data(id, &[byte; 5]).expect("5 bytes");
        can.write(&frame).await;
        let heard = can.read().await.map(|envelope| envelope.frame);
        count += u8::from(heard.is_ok_and(|heard| {
            heard.header().id() == frame.header().id() && heard.data() == frame.data()
        }));
    }

    let (tx_dma, rx_dma) = (board.DMA2_CH7, board.DMA2_CH2);
    let line = usart::Config::default();
    let port = Uart::new(board.USART1, board.PB7, board.PB6, tx_dma, rx_dma, Interrupts, line);
    let Ok(mut port) = port else { panic!("the line") };
    // 10 frames: a colon, the character after 9.
    _ = port.write(&[b'c', b'a', b'n', b' ', count, b'\n']).await;
    let mut bytes = [0; 32];
    loop {
        let count = port.read_until_idle(&mut bytes).await.unwrap_or(0);
        _ = port.write(bytes.get(..count).unwrap_or_default()).await;
    }
}
