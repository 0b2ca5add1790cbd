//! A mecanum chassis on a RoboMaster development board C (STM32F407IG): embassy, and this crate's runner.
//!
//! | plug | pins | what |
//! |---|---|---|
//! | CAN1 | PD0 receive, PD1 transmit | four C620, ids 1 to 4, 1 Mbit/s |
//! | DBUS | PC11, USART3 (the board inverts the signal) | DR16 receiver |
//! | UART2, 4 pins | PB7 receive, PA9 transmit, USART1 | HiPNUC IMU, 115200 baud, 100 Hz |
//!
//! Pins and the 12 MHz crystal: DJI's own examples for this board. Flash with a probe on the SWD plug:
//! `probe-rs run --chip STM32F407IGHx target/thumbv7em-none-eabihf/release/c-board-embassy`
#![no_std]
#![no_main]

use core::cell::RefCell;
use drivetrain::dji::Bus;
use drivetrain::motor::CanDevice;
use drivetrain::runner::{Nb, Runner};
use drivetrain::time::Instant;
use embassy_executor::Spawner;
use embassy_stm32::can::{self, BufferedCanReceiver, BufferedCanSender, Can, filter::Mask32};
use embassy_stm32::usart::{self, BufferedUart, BufferedUartRx, Parity};
use embassy_stm32::{Config, bind_interrupts, peripherals, rcc, time::Hertz};
use embassy_sync::blocking_mutex::{Mutex, raw::ThreadModeRawMutex};
use embassy_time::{Duration, Ticker};
use embedded_can::ErrorKind;
use embedded_io_async::Read;
use panic_halt as _;
use pilot::{Pilot, Wish};
use static_cell::StaticCell;

bind_interrupts!(struct Interrupts {
    CAN1_TX => can::TxInterruptHandler<peripherals::CAN1>;
    CAN1_RX0 => can::Rx0InterruptHandler<peripherals::CAN1>;
    CAN1_RX1 => can::Rx1InterruptHandler<peripherals::CAN1>;
    CAN1_SCE => can::SceInterruptHandler<peripherals::CAN1>;
    USART3 => usart::BufferedInterruptHandler<peripherals::USART3>;
    USART1 => usart::BufferedInterruptHandler<peripherals::USART1>;
});

/// embassy's buffered halves as one polled driver: neither of its CAN types implements a trait of `embedded-can`.
struct Halves(BufferedCanSender, BufferedCanReceiver);

impl embedded_can::nb::Can for Halves {
    type Frame = can::Frame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &can::Frame) -> nb::Result<Option<can::Frame>, ErrorKind> {
        self.0.try_write(*frame).map(|()| None).map_err(|_| nb::Error::WouldBlock)
    }

    fn receive(&mut self) -> nb::Result<can::Frame, ErrorKind> {
        match self.1.try_receive() {
            Ok(Ok(envelope)) => Ok(envelope.frame),
            Ok(Err(error)) => Err(nb::Error::Other(kind(&error))),
            Err(_) => Err(nb::Error::WouldBlock),
        }
    }
}

fn kind(error: &can::enums::BusError) -> ErrorKind {
    use can::enums::BusError;
    match error {
        BusError::Stuff => ErrorKind::Stuff,
        BusError::Form => ErrorKind::Form,
        BusError::Acknowledge => ErrorKind::Acknowledge,
        BusError::BitRecessive | BusError::BitDominant => ErrorKind::Bit,
        BusError::Crc => ErrorKind::Crc,
        BusError::Software => ErrorKind::Other,
    }
}

type Shared<T> = Mutex<ThreadModeRawMutex, RefCell<T>>;

fn now() -> Instant {
    Instant::from_micros(embassy_time::Instant::now().as_micros())
}

#[embassy_executor::task]
async fn hear_remote(mut port: BufferedUartRx<'static>, pilot: &'static Shared<Pilot>) {
    let mut bytes = [0; 18];
    loop {
        // An overrun loses bytes; what follows in this frame is thrown away by its decoder.
        let count = port.read(&mut bytes).await.unwrap_or(0);
        pilot.lock(|pilot| pilot.borrow_mut().hear_remote(&bytes[..count], now()));
    }
}

#[embassy_executor::task]
async fn hear_imu(mut port: BufferedUartRx<'static>, pilot: &'static Shared<Pilot>) {
    let mut bytes = [0; 64];
    loop {
        let count = port.read(&mut bytes).await.unwrap_or(0);
        pilot.lock(|pilot| pilot.borrow_mut().hear_imu(&bytes[..count], now()));
    }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = embassy_stm32::init(clocks());

    static SENDING: StaticCell<can::TxBuf<8>> = StaticCell::new();
    static RECEIVED: StaticCell<can::RxBuf<32>> = StaticCell::new();
    let mut can = Can::new(board.CAN1, board.PD0, board.PD1, Interrupts);
    can.modify_filters().enable_bank(0, can::Fifo::Fifo0, Mask32::accept_all());
    can.set_bitrate(1_000_000);
    can.enable().await;
    let can = can.buffered(SENDING.init(can::TxBuf::new()), RECEIVED.init(can::RxBuf::new()));

    let mut bus = Bus::new();
    let Ok(pilot) = Pilot::new(&mut bus) else { panic!("the wheels do not fit") };
    static PILOT: StaticCell<Shared<Pilot>> = StaticCell::new();
    let pilot: &'static Shared<Pilot> = PILOT.init(Mutex::new(RefCell::new(pilot)));

    static REMOTE: StaticCell<([u8; 4], [u8; 64])> = StaticCell::new();
    let (out, into) = REMOTE.init(([0; 4], [0; 64]));
    let mut line = usart::Config::default();
    (line.baudrate, line.parity) = (100_000, Parity::ParityEven);
    let port = BufferedUart::new(board.USART3, board.PC11, board.PC10, out, into, Interrupts, line);
    let Ok(port) = port else { panic!("the line of the remote control") };
    spawner.spawn(hear_remote(port.split().1, pilot).expect("the first"));

    static IMU: StaticCell<([u8; 4], [u8; 256])> = StaticCell::new();
    let (out, into) = IMU.init(([0; 4], [0; 256]));
    let line = usart::Config::default();
    let port = BufferedUart::new(board.USART1, board.PB7, board.PA9, out, into, Interrupts, line);
    let Ok(port) = port else { panic!("the line of the IMU") };
    spawner.spawn(hear_imu(port.split().1, pilot).expect("the first"));

    let mut runner = Runner::new(Nb(Halves(can.writer(), can.reader())), now, bus);
    let mut millisecond = Ticker::every(Duration::from_millis(1));
    loop {
        millisecond.next().await;
        runner.poll(32);
        let Some(tick) = runner.due() else { continue };
        pilot.lock(|pilot| {
            let mut pilot = pilot.borrow_mut();
            match pilot.wish(tick.now()) {
                Wish::Arm => _ = runner.arm(tick),
                Wish::GoOn => {}
                Wish::Rest => runner.device_mut().disarm(),
            }
            pilot.drive(runner.device_mut(), tick);
        });
        runner.tick(tick);
    }
}

/// 168 MHz from the 12 MHz crystal; APB1 42 MHz, of which CAN makes 1 Mbit/s exactly.
fn clocks() -> Config {
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
