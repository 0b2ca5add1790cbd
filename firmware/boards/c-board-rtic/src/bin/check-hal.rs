//! The drivers alone, for the virtual board: bxcan in loop-back, and the DMA of stm32f4xx-hal from memory to memory and to a serial
//! port, as their examples use them.
//!
//! Each of ten frames has to come back as it was sent. The report goes out at USART1, by DMA, out of the copy.
#![no_std]
#![no_main]

use bxcan::filter::Mask32;
use bxcan::{Data, Fifo, Frame, StandardId};
use cortex_m_rt::entry;
use defmt_rtt as _;
use panic_probe as _;
use static_cell::StaticCell;
use stm32f4xx_hal::dma::config::DmaConfig;
use stm32f4xx_hal::dma::traits::Direction as _;
use stm32f4xx_hal::dma::{MemoryToMemory, StreamsTuple, Transfer};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Config, Serial, config};
use stm32f4xx_hal::{pac, rcc};

const LENGTH: usize = 6;
static REPORT: StaticCell<[u8; LENGTH]> = StaticCell::new();
static COPY: StaticCell<[u8; LENGTH]> = StaticCell::new();

#[entry]
fn main() -> ! {
    let Some(board) = pac::Peripherals::take() else { panic!("the first") };
    let clocks = rcc::Config::hse(12.MHz()).sysclk(168.MHz()).pclk1(42.MHz());
    let mut rcc = board.RCC.freeze(clocks);
    let (gpiob, gpiod) = (board.GPIOB.split(&mut rcc), board.GPIOD.split(&mut rcc));

    let can = board.CAN1.can((gpiod.pd1, gpiod.pd0), &mut rcc);
    let can = bxcan::Can::builder(can).set_bit_timing(0x001A_0002);
    let mut can = can.set_loopback(true).set_silent(true).enable();
    can.modify_filters().enable_bank(0, Fifo::Fifo0, Mask32::accept_all());
    let mut count = b'0';
    for byte in 0..10 {
        let id = StandardId::new(u16::from(byte) + 0x100).expect("11 bits");
        let frame = Frame::new_data(id, Data::new(&[byte; 5]).expect("5 bytes"));
        let sent = nb::block!(can.transmit(&frame)).is_ok();
        count += u8::from(nb::block!(can.receive()).is_ok_and(|heard| sent && heard == frame));
    }

    // 10 frames: a colon, the character after 9.
    let report = REPORT.init([0; LENGTH]);
    *report = [b'c', b'a', b'n', b' ', count, b'\n'];
    let copy = COPY.init([0; LENGTH]);
    let streams = StreamsTuple::new(board.DMA2, &mut rcc);
    let config =
        DmaConfig::default().memory_increment(true).peripheral_increment(true).fifo_enable(true);
    let mut transfer = Transfer::<_, 0, _, MemoryToMemory<u8>, _>::init_memory_to_memory(
        streams.0,
        MemoryToMemory::<u8>::new(),
        copy,
        report,
        config,
    );
    transfer.start(|_| {});
    transfer.wait();
    let (_, _, copy, _) = transfer.release();

    let line = Config::default().baudrate(115_200.bps()).dma(config::DmaConfig::Tx);
    let Ok(port) = Serial::tx(board.USART1, gpiob.pb6, line, &mut rcc) else { panic!("the line") };
    let config = DmaConfig::default().memory_increment(true);
    let mut transfer = Transfer::init_memory_to_peripheral(streams.7, port, copy, None, config);
    transfer.start(|_| {});
    transfer.wait();
    loop {
        cortex_m::asm::wfi();
    }
}
