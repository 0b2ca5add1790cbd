//! A mecanum chassis on a DM-MC02 (STM32H723VG): embassy without the runner. One task receives, one ticks and sends. What the
//! runner does beside that is done by hand there: it watches the clock and the bus, and trips the motors when the bus is down.
//!
//! | plug | pins | what |
//! |---|---|---|
//! | CAN1 | PD0 receive, PD1 transmit, FDCAN1 | four C620, ids 1 to 4, classic frames, 1 Mbit/s |
//! | DBUS | PD2, UART5 (the board inverts the signal) | DR16 receiver |
//! | UART1 | PA10 receive, PA9 transmit, USART1 | HiPNUC IMU, 115200 baud, 100 Hz |
//! | 5 V | PC15 high switches it on | for the receiver and the IMU |
//!
//! Pins and the 24 MHz crystal: public projects for this board, which agree. Flash with a probe on the SWD plug:
//! `probe-rs run --chip STM32H723VGTx target/thumbv7em-none-eabihf/release/dm-mc02-embassy`
#![no_std]
#![no_main]

use core::cell::RefCell;
use defmt_rtt as _;
use drivetrain::dji::Bus;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Devices, SwitchOrder};
use drivetrain::time::{Duration, Instant, Tick};
use embassy_executor::Spawner;
use embassy_stm32::can::{self, BufferedCanReceiver, BufferedCanSender, CanConfigurator};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::interrupt::{self, InterruptExt};
use embassy_stm32::usart::{self, BufferedUart, BufferedUartRx, Parity};
use embassy_stm32::{Config, Peri, bind_interrupts, pac, peripherals, rcc, time::Hertz};
use embassy_stm32::{peripherals::IWDG1, wdg::IndependentWatchdog};
use embassy_sync::blocking_mutex::{Mutex, raw::ThreadModeRawMutex};
use embedded_io_async::Read;
use panic_probe as _;
use pilot::Pilot;
use static_cell::StaticCell;

bind_interrupts!(struct Interrupts {
    FDCAN1_IT0 => can::IT0InterruptHandler<peripherals::FDCAN1>;
    FDCAN1_IT1 => can::IT1InterruptHandler<peripherals::FDCAN1>;
    UART5 => usart::BufferedInterruptHandler<peripherals::UART5>;
    USART1 => usart::BufferedInterruptHandler<peripherals::USART1>;
});

/// The motors and who drives them; never borrowed across an await.
struct Robot {
    bus: Bus,
    pilot: Pilot,
}

type Shared = Mutex<ThreadModeRawMutex, RefCell<Robot>>;

fn micros(instant: embassy_time::Instant) -> Instant {
    Instant::from_micros(instant.as_micros())
}

#[embassy_executor::task]
async fn receive(can: BufferedCanReceiver, robot: &'static Shared) {
    loop {
        // An error of the bus is not a frame: the ages of the motors do the rest. What its buffer has no room for, embassy
        // does not say.
        let Ok(envelope) = can.receive().await else { continue };
        let (frame, arrived) = envelope.parts(); // stamped in the interrupt
        robot.lock(|robot| _ = robot.borrow_mut().bus.ingest_any(&frame, micros(arrived)));
    }
}

/// Calls back what waits in the controller and in the queue before it, so that no old command leaves when a bus is back. Tells
/// whether there was anything. embassy's buffered halves have no such call.
fn call_back() -> bool {
    let mut is_any = false;
    // Twice: the interrupt fills a buffer that is free from the queue, which holds one frame.
    for _ in 0..2 {
        let pending = pac::FDCAN1.txbrp().read();
        if pending.0 != 0 {
            is_any = true;
            // A frame that is on the wire is free at the end of this attempt.
            pac::FDCAN1.txbcr().write(|cancel| cancel.0 = pending.0);
            interrupt::FDCAN1_IT0.pend();
        }
    }
    is_any
}

#[embassy_executor::task]
async fn control(mut can: BufferedCanSender, robot: &'static Shared, iwdg: Peri<'static, IWDG1>) {
    // A loop that stands for so long is reset, and comes back disarmed. Its oscillator is up to half off.
    const WATCHDOG_US: u32 = 20_000;
    // A bus that takes nothing for so long is down: what it would do when it comes back is nobody's wish any more.
    const BUS_DOWN_AFTER: Duration = Duration::from_millis(100);
    let mut watchdog = IndependentWatchdog::new(iwdg, WATCHDOG_US);
    let mut refused_since: Option<Instant> = None;
    let mut was_down = false;
    // The frames of a tick: a bus has five at most.
    let mut taken: [Option<CanFrame>; 5] = [None; 5];
    let mut millisecond = embassy_time::Ticker::every(embassy_time::Duration::from_millis(1));
    let mut before = micros(embassy_time::Instant::now());
    watchdog.unleash();
    loop {
        millisecond.next().await;
        let now = micros(embassy_time::Instant::now());
        if now == before {
            // Two wakes within a microsecond, after a pause. When the clock stands, the watchdog bites.
            continue;
        }
        // The time that passed; zero when the clock goes back, and then the bus sends zeros and trips.
        let tick = Tick::new(now, now.since(before).as_secs_f32());
        before = now;
        robot.lock(|robot| {
            let Robot { bus, pilot } = &mut *robot.borrow_mut();
            match pilot.order(tick) {
                SwitchOrder::Arm => {
                    if let Err(why) = bus.arm(tick.now()) {
                        defmt::warn!("{}", why);
                    }
                }
                SwitchOrder::Keep | SwitchOrder::Brake => {}
                SwitchOrder::Disarm => bus.disarm(),
            }
            pilot.drive(bus, tick);
            pilot.edges(tick.now(), |who, edge| defmt::warn!("{}: {}", who, edge));
            // What did not leave within a period counts as refused, and is offered again with newer values.
            let mut is_refused = call_back();
            for frame in taken.iter_mut().filter_map(Option::take).filter(|_| is_refused) {
                bus.requeue(&frame);
            }
            bus.update(tick);
            let mut places = taken.iter_mut();
            while let Some(frame) = bus.next_frame() {
                // No waiting here: a frame without a place goes with the next tick, with newer values.
                let offered = frame.convert::<can::Frame>();
                if offered.is_none_or(|offered| can.try_write(offered).is_err()) {
                    is_refused = true;
                    bus.requeue(&frame);
                } else if let Some(place) = places.next() {
                    *place = Some(frame);
                }
            }
            refused_since = is_refused.then(|| refused_since.unwrap_or(tick.now()).min(tick.now()));
            let is_down =
                refused_since.is_some_and(|since| tick.now().since(since) >= BUS_DOWN_AFTER);
            if is_down && !was_down {
                defmt::warn!("the bus takes nothing: every motor is tripped");
            }
            was_down = is_down;
            if is_down {
                // In each tick: arming is refused until the bus is back, and then needs a new turn of the switch.
                bus.trip();
            }
            while let Some(edge) = bus.next_edge() {
                defmt::info!("{}", edge);
            }
        });
        // One executor runs all tasks: one that hangs keeps this one from coming here.
        watchdog.pet();
    }
}

#[embassy_executor::task]
async fn hear_remote(mut port: BufferedUartRx<'static>, robot: &'static Shared) {
    let mut bytes = [0; 18];
    loop {
        // An overrun loses bytes; what follows in this frame is thrown away by its decoder.
        let count = port.read(&mut bytes).await.unwrap_or(0);
        let now = micros(embassy_time::Instant::now());
        robot.lock(|robot| robot.borrow_mut().pilot.hear_remote(&bytes[..count], now));
    }
}

#[embassy_executor::task]
async fn hear_imu(mut port: BufferedUartRx<'static>, robot: &'static Shared) {
    let mut bytes = [0; 64];
    loop {
        let count = port.read(&mut bytes).await.unwrap_or(0);
        let now = micros(embassy_time::Instant::now());
        robot.lock(|robot| robot.borrow_mut().pilot.hear_imu(&bytes[..count], now));
    }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = embassy_stm32::init(clocks());
    let supply = Output::new(board.PC15, Level::High, Speed::Low);
    core::mem::forget(supply); // stays on

    let mut bus = Bus::new();
    let Ok(pilot) = Pilot::new(&mut bus) else { panic!("the wheels do not fit") };
    static ROBOT: StaticCell<Shared> = StaticCell::new();
    let robot: &'static Shared = ROBOT.init(Mutex::new(RefCell::new(Robot { bus, pilot })));

    // What waits here is called back through the controller, one frame a round, so it is short.
    static SENDING: StaticCell<can::TxBuf<1>> = StaticCell::new();
    static RECEIVED: StaticCell<can::RxBuf<32>> = StaticCell::new();
    let mut can = CanConfigurator::new(board.FDCAN1, board.PD0, board.PD1, Interrupts);
    can.set_bitrate(1_000_000);
    let can = can.into_normal_mode();
    let can = can.buffered(SENDING.init(can::TxBuf::new()), RECEIVED.init(can::RxBuf::new()));
    spawner.spawn(receive(can.reader(), robot).expect("the first"));
    spawner.spawn(control(can.writer(), robot, board.IWDG1).expect("the first"));

    static REMOTE: StaticCell<([u8; 4], [u8; 64])> = StaticCell::new();
    let (out, into) = REMOTE.init(([0; 4], [0; 64]));
    let mut line = usart::Config::default();
    (line.baudrate, line.parity) = (100_000, Parity::ParityEven);
    let port = BufferedUart::new(board.UART5, board.PD2, board.PC12, out, into, Interrupts, line);
    let Ok(port) = port else { panic!("the line of the remote control") };
    spawner.spawn(hear_remote(port.split().1, robot).expect("the first"));

    static IMU: StaticCell<([u8; 4], [u8; 256])> = StaticCell::new();
    let (out, into) = IMU.init(([0; 4], [0; 256]));
    let line = usart::Config::default();
    let port = BufferedUart::new(board.USART1, board.PA10, board.PA9, out, into, Interrupts, line);
    let Ok(port) = port else { panic!("the line of the IMU") };
    spawner.spawn(hear_imu(port.split().1, robot).expect("the first"));
    core::future::pending().await
}

/// 400 MHz from the 24 MHz crystal, which is also the clock of the CAN controller: 24 quanta a bit.
fn clocks() -> Config {
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
