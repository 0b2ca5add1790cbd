//! A mecanum chassis on a RoboMaster development board C (STM32F407IG): embassy, and this crate's runner.
//!
//! | plug | pins | what |
//! |---|---|---|
//! | CAN1 | PD0 receive, PD1 transmit | four C620, ids 1 to 4, 1 Mbit/s |
//! | DBUS | PC11, USART3 (the board inverts the signal) | DR16 receiver |
//! | UART2, 4 pins | PB7 receive, PA9 transmit, USART1 | HiPNUC IMU, 115200 baud, 100 Hz |
//! | UART1, 3 pins | PG9 receive, PG14 transmit, USART6 | a PC with VOFA+, 115200 baud: gains in, five curves out at 100 Hz |
//!
//! Lines of the PC are those of `wire::parameters`, such as `wheel_kp=2.5`; curves are those of [`Pilot::curves`]. No line arms.
//!
//! Pins and the 12 MHz crystal: DJI's own examples for this board. Flash with a probe on the SWD plug; what happens to the
//! motors is told there: `probe-rs run --chip STM32F407IGHx target/thumbv7em-none-eabihf/release/c-board-embassy`
#![no_std]
#![no_main]

use c_board_embassy::{WATCHDOG_US, can1, clocks, now};
use core::cell::RefCell;
use defmt_rtt as _;
use drivetrain::dji::Bus;
use drivetrain::motor::SwitchOrder;
use drivetrain::runner::Runner;
use embassy_executor::Spawner;
use embassy_stm32::usart::{self, BufferedUart, BufferedUartRx, BufferedUartTx, Parity};
use embassy_stm32::{bind_interrupts, peripherals, wdg::IndependentWatchdog};
use embassy_sync::blocking_mutex::{Mutex, raw::ThreadModeRawMutex};
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Ticker};
use embedded_io_async::{Read, ReadReady, Write};
use panic_probe as _;
use pilot::{CURVES_BYTES, Pilot};
use static_cell::StaticCell;

bind_interrupts!(struct Interrupts {
    USART3 => usart::BufferedInterruptHandler<peripherals::USART3>;
    USART1 => usart::BufferedInterruptHandler<peripherals::USART1>;
    USART6 => usart::BufferedInterruptHandler<peripherals::USART6>;
});

type Shared<T> = Mutex<ThreadModeRawMutex, RefCell<T>>;

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

/// Curves for the PC. A frame that the port had no time to send is replaced by the next one.
static CURVES: Signal<ThreadModeRawMutex, [u8; CURVES_BYTES]> = Signal::new();
const TICKS_PER_CURVE: u8 = 10;

#[embassy_executor::task]
async fn show(mut port: BufferedUartTx<'static>) {
    loop {
        let curves = CURVES.wait().await;
        // An error loses this frame only: VOFA+ finds the next one by its tail.
        _ = port.write_all(&curves).await;
    }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = embassy_stm32::init(clocks());

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

    static PC: StaticCell<([u8; 64], [u8; 64])> = StaticCell::new();
    let (out, into) = PC.init(([0; 64], [0; 64]));
    let line = usart::Config::default();
    let port = BufferedUart::new(board.USART6, board.PG9, board.PG14, out, into, Interrupts, line);
    let Ok(port) = port else { panic!("the line of the PC") };
    let (to_pc, mut from_pc) = port.split();
    spawner.spawn(show(to_pc).expect("the first"));

    let can = can1(board.CAN1, board.PD0, board.PD1).await;
    let mut runner = Runner::new(can, now, bus);
    let mut watchdog = IndependentWatchdog::new(board.IWDG, WATCHDOG_US);
    let mut beat = runner.heartbeat();
    // Four times a step: at the pace of the steps, one that wakes a microsecond early would be left out.
    let mut wake = Ticker::every(Duration::from_micros(250));
    let mut ticks = 0;
    watchdog.unleash();
    loop {
        wake.next().await;
        runner.poll(32);
        let Some(tick) = runner.due() else { continue };
        pilot.lock(|pilot| {
            let mut pilot = pilot.borrow_mut();
            match pilot.order(tick) {
                SwitchOrder::Arm => {
                    if let Err(why) = runner.arm(tick) {
                        defmt::warn!("{}", why);
                    }
                }
                SwitchOrder::Keep | SwitchOrder::Brake => {}
                SwitchOrder::Disarm => runner.device_mut().disarm(),
            }
            // Read here, because the bus belongs to this loop: the bytes that are there, without waiting for more.
            let mut bytes = [0; 64];
            if from_pc.read_ready().unwrap_or(false) {
                let count = embedded_io::Read::read(&mut from_pc, &mut bytes).unwrap_or(0);
                pilot.hear_debug_port(runner.device_mut(), &bytes[..count], tick.now());
            }
            pilot.drive(runner.device_mut(), tick);
            ticks = (ticks + 1) % TICKS_PER_CURVE;
            if ticks == 0 {
                CURVES.signal(pilot.curves(runner.device(), tick.now()));
            }
            pilot.edges(tick.now(), |who, edge| defmt::warn!("{}: {}", who, edge));
        });
        runner.tick(tick);
        while let Some(edge) = runner.device_mut().next_edge() {
            defmt::info!("{}", edge);
        }
        while let Some(edge) = runner.next_edge() {
            defmt::warn!("{}", edge);
        }
        if beat != runner.heartbeat() {
            beat = runner.heartbeat();
            watchdog.pet();
        }
    }
}
