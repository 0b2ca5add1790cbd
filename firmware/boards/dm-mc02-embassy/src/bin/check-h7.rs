//! The drivers alone, for the virtual board: embassy's FDCAN in loop-back, and its serial port by DMA, as their examples use them.
//!
//! Each of ten frames has to come back as it was sent. The report goes out at USART1, by DMA; then what is heard there is sent back.
#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::can::{self, CanConfigurator, Frame};
use embassy_stm32::usart::{self, Uart};
use embassy_stm32::{Config, bind_interrupts, dma, peripherals, rcc, time::Hertz};
use panic_probe as _;

bind_interrupts!(struct Interrupts {
    FDCAN1_IT0 => can::IT0InterruptHandler<peripherals::FDCAN1>;
    FDCAN1_IT1 => can::IT1InterruptHandler<peripherals::FDCAN1>;
    USART1 => usart::InterruptHandler<peripherals::USART1>;
    DMA1_STREAM2 => dma::InterruptHandler<peripherals::DMA1_CH2>;
    DMA1_STREAM7 => dma::InterruptHandler<peripherals::DMA1_CH7>;
});

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let board = embassy_stm32::init(config());
    let mut can = CanConfigurator::new(board.FDCAN1, board.PD0, board.PD1, Interrupts);
    can.set_bitrate(1_000_000);
    let mut can = can.into_internal_loopback_mode();
    let mut count = b'0';
    for byte in 0..10 {
        let frame = Frame::new_standard(u16::from(byte) + 0x100, &[byte; 5]).expect("5 bytes");
        can.write(&frame).await;
        let heard = can.read().await.map(|envelope| envelope.frame);
        count += u8::from(heard.is_ok_and(|heard| {
            heard.header().id() == frame.header().id() && heard.data() == frame.data()
        }));
    }

    let (tx_dma, rx_dma) = (board.DMA1_CH7, board.DMA1_CH2);
    let line = usart::Config::default();
    let port = Uart::new(board.USART1, board.PA10, board.PA9, tx_dma, rx_dma, Interrupts, line);
    let Ok(mut port) = port else { panic!("the line") };
    // 10 frames: a colon, the character after 9.
    _ = port.write(&[b'c', b'a', b'n', b' ', count, b'\n']).await;
    let mut bytes = [0; 32];
    loop {
        let count = port.read_until_idle(&mut bytes).await.unwrap_or(0);
        _ = port.write(bytes.get(..count).unwrap_or_default()).await;
    }
}

/// 400 MHz from the 24 MHz crystal, which is also the clock of the CAN controller.
fn config() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(rcc::Hse { freq: Hertz(24_000_000), mode: rcc::HseMode::Oscillator });
    config.rcc.pll1 = Some(rcc::Pll {
        source: rcc::PllSource::HSE,
        prediv: rcc::PllPreDiv::DIV3,
        mul: rcc::PllMul::MUL50,
        divp: Some(rcc::PllDiv::DIV1),
        divq: None,
        divr: None,
    });
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config.rcc.voltage_scale = rcc::VoltageScale::Scale1;
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV2;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb3_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb4_pre = rcc::APBPrescaler::DIV2;
    config.rcc.mux.fdcansel = rcc::mux::Fdcansel::HSE;
    config
}
