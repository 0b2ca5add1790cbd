//! The robot on a RoboMaster development board C (STM32F407IG).
//!
//! | plug | pins | what |
//! |---|---|---|
//! | CAN1 | PD0 receive, PD1 transmit | two C620, ids 1 and 2, 1 Mbit/s |
//! | DBUS | PC11, USART3 (the board inverts the signal) | DR16 receiver |
//!
//! `probe-rs run --chip STM32F407IGHx target/thumbv7em-none-eabihf/release/board` flashes it and shows its log.
#![no_std]
#![no_main]

use c_board_embassy::{WATCHDOG_US, can1, clocks, now};
use core::cell::RefCell;
use defmt_rtt as _;
use drivetrain::dji::Bus;
use drivetrain::motor::SwitchOrder;
use drivetrain::runner::Runner;
use drivetrain::wire::dbus::Dbus;
use embassy_executor::Spawner;
use embassy_stm32::usart::{self, BufferedUart, BufferedUartRx, Parity};
use embassy_stm32::{bind_interrupts, peripherals, wdg::IndependentWatchdog};
use embassy_sync::blocking_mutex::{Mutex, raw::ThreadModeRawMutex};
use embassy_time::{Duration, Ticker};
use embedded_io_async::Read;
use {{crate_name}}::Robot;
use panic_probe as _;
use static_cell::StaticCell;

bind_interrupts!(struct Interrupts {
    USART3 => usart::BufferedInterruptHandler<peripherals::USART3>;
});

/// A topic: what the remote control shows, for the task that drives.
type Remotes = Mutex<ThreadModeRawMutex, RefCell<Dbus>>;

#[embassy_executor::task]
async fn hear_remote(mut port: BufferedUartRx<'static>, remotes: &'static Remotes) {
    let mut bytes = [0; 18];
    loop {
        // An overrun loses bytes; what follows in this frame is thrown away by its decoder.
        let count = port.read(&mut bytes).await.unwrap_or(0);
        let mut received = &bytes[..count];
        remotes.lock(|dbus| {
            let mut dbus = dbus.borrow_mut();
            while dbus.read(&mut received, now()).is_some() {}
        });
    }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = embassy_stm32::init(clocks());
    let mut bus = Bus::new();
    let Ok(mut robot) = Robot::new(&mut bus) else { panic!("the wheels do not fit") };

    static REMOTES: StaticCell<Remotes> = StaticCell::new();
    let remotes: &'static Remotes = REMOTES.init(Mutex::new(RefCell::new(Dbus::new())));
    static BUFFERS: StaticCell<([u8; 4], [u8; 64])> = StaticCell::new();
    let (out, into) = BUFFERS.init(([0; 4], [0; 64]));
    let mut line = usart::Config::default();
    (line.baudrate, line.parity) = (100_000, Parity::ParityEven);
    let port = BufferedUart::new(board.USART3, board.PC11, board.PC10, out, into, Interrupts, line);
    let Ok(port) = port else { panic!("the line of the remote control") };
    spawner.spawn(hear_remote(port.split().1, remotes).expect("the first"));

    let can = can1(board.CAN1, board.PD0, board.PD1).await;
    let mut runner = Runner::new(can, now, bus);
    let mut watchdog = IndependentWatchdog::new(board.IWDG, WATCHDOG_US);
    let mut beat = runner.heartbeat();
    // Four times a step: at the pace of the steps, one that wakes a microsecond early would be left out.
    let mut wake = Ticker::every(Duration::from_micros(250));
    watchdog.unleash();
    loop {
        wake.next().await;
        runner.poll(32);
        let Some(tick) = runner.due() else { continue };
        let remote = remotes.lock(|dbus| dbus.borrow_mut().remote(tick.now()));
        match robot.hear(&remote, tick) {
            SwitchOrder::Arm => {
                if let Err(why) = runner.arm(tick) {
                    defmt::warn!("{}", why);
                }
            }
            SwitchOrder::Keep | SwitchOrder::Brake => {}
            SwitchOrder::Disarm => runner.device_mut().disarm(),
        }
        robot.drive(runner.device_mut(), &remote, tick);
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
