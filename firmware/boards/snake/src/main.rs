//! A snake robot on a RoboMaster development board A (STM32F427II): embassy, one task a device, topics between them.
//!
//! ```text
//! hear_host ──COMMAND──> control, 1 kHz ──REPORT──> telemetry, 20 Hz ──> the computer
//! hear_imu, 4 of them ──IMUS───────────────────────────^
//! COMMAND, ARMED ──> servo, 50 Hz          control ──EVENTS──> log, lamps
//! ```
//!
//! Topics are those of `embassy-sync`: a `Watch` holds the last value, a `PubSubChannel` each one.
//!
//! | plug | pins | what |
//! |---|---|---|
//! | CAN1 | PD0 receive, PD1 transmit | 12 joints, ids 1 to 12; GM6020 id 1; C610 id 1; 1 Mbit/s |
//! | USART3 | PD9 receive, PD8 transmit | the computer, 115200 baud, by DMA |
//! | USART2, UART7, UART8, USART6 | PD6, PE7, PE0, PG9 receive | four HiPNUC IMUs, 115200 baud, 100 Hz, by DMA |
//! | USART1 | PB7 receive, PB6 transmit | STS3032 servo, 1 Mbaud, behind an adapter that does not hear itself, by DMA |
//! | LED | PF14 green, PE11 red | armed; not armed |
//!
//! Ports, rates and frames: the robot's public firmware. The pins of the ports: DJI's own examples for this board.
//! `probe-rs run --chip STM32F427IIHx target/thumbv7em-none-eabihf/release/snake`
#![no_std]
#![no_main]

mod lines;
mod topics;

use defmt_rtt as _;
use drivetrain::motor::Devices;
use drivetrain::runner::{NbAbort, Runner};
use drivetrain::time::Instant;
use embassy_executor::Spawner;
use embassy_stm32::can::{self, Can, filter::Mask32};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, dma, pac, peripherals, usart};
use embassy_time::{Duration, Ticker};
use halves::{Halves, WATCHDOG_US, clocks, now};
use panic_probe as _;
use pilot::snake::{Event, HOST_DEADLINE, Motors, Snake, Wish};
use static_cell::StaticCell;
use topics::{ARMED, COMMAND, EVENTS, REPORT};

bind_interrupts!(struct Interrupts {
    CAN1_TX => can::TxInterruptHandler<peripherals::CAN1>;
    CAN1_RX0 => can::Rx0InterruptHandler<peripherals::CAN1>;
    CAN1_RX1 => can::Rx1InterruptHandler<peripherals::CAN1>;
    CAN1_SCE => can::SceInterruptHandler<peripherals::CAN1>;
    USART1 => usart::InterruptHandler<peripherals::USART1>;
    USART2 => usart::InterruptHandler<peripherals::USART2>;
    USART3 => usart::InterruptHandler<peripherals::USART3>;
    USART6 => usart::InterruptHandler<peripherals::USART6>;
    UART7 => usart::InterruptHandler<peripherals::UART7>;
    UART8 => usart::InterruptHandler<peripherals::UART8>;
    DMA1_STREAM1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
    DMA1_STREAM3 => dma::InterruptHandler<peripherals::DMA1_CH3>;
    DMA1_STREAM4 => dma::InterruptHandler<peripherals::DMA1_CH4>;
    DMA1_STREAM5 => dma::InterruptHandler<peripherals::DMA1_CH5>;
    DMA1_STREAM6 => dma::InterruptHandler<peripherals::DMA1_CH6>;
    DMA2_STREAM1 => dma::InterruptHandler<peripherals::DMA2_CH1>;
    DMA2_STREAM5 => dma::InterruptHandler<peripherals::DMA2_CH5>;
    DMA2_STREAM7 => dma::InterruptHandler<peripherals::DMA2_CH7>;
});

type Robot = Runner<NbAbort<Halves>, fn() -> Instant, Motors>;

/// A stop of all joints, and the other frames of a tick.
const SENDING: usize = 16;

/// Frames in, loops, frames out. What the computer wants comes by the topic; what became of it goes by topics.
#[embassy_executor::task]
async fn control(
    mut runner: Robot,
    mut snake: Snake,
    mut watchdog: IndependentWatchdog<'static, peripherals::IWDG>,
) {
    let (armed, report) = (ARMED.sender(), REPORT.sender());
    let events = EVENTS.immediate_publisher();
    let mut was_armed = false;
    let mut beat = runner.heartbeat();
    // Four times a step: at the pace of the steps, one that wakes a microsecond early would be left out.
    let mut wake = Ticker::every(Duration::from_micros(250));
    watchdog.unleash();
    loop {
        wake.next().await;
        runner.poll(32);
        let Some(tick) = runner.due() else { continue };
        let heard = COMMAND.try_get();
        let command = heard.and_then(|heard| heard.fresh(tick.now(), HOST_DEADLINE));
        let wish = snake.wish(command.as_ref());
        match wish {
            Wish::Rezero | Wish::Arm => {
                if wish == Wish::Rezero {
                    runner.device_mut().disarm();
                    snake.zero(runner.device_mut());
                }
                if let Err(why) = runner.arm(tick) {
                    defmt::warn!("{}", why);
                    events.publish_immediate(Event::Refused);
                }
            }
            // One motor less, and the others rest as well.
            Wish::GoOn if runner.is_armed() => {}
            Wish::GoOn | Wish::Rest => {
                runner.device_mut().disarm();
            }
        }
        if let Some(command) = &command {
            snake.follow(runner.device_mut(), command);
        }
        runner.tick(tick);
        let is_armed = runner.is_armed();
        if is_armed != was_armed {
            events.publish_immediate(if is_armed { Event::Armed } else { Event::Rests });
        }
        was_armed = is_armed;
        armed.send(is_armed);
        report.send(snake.report(runner.device()));
        while let Some(edge) = runner.device_mut().0.next_edge() {
            defmt::info!("{}", edge);
        }
        while let Some(edge) = runner.device_mut().1.next_edge() {
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

#[embassy_executor::task]
async fn lamps(mut green: Output<'static>, mut red: Output<'static>) {
    let Ok(mut events) = EVENTS.subscriber() else { return };
    loop {
        match events.next_message_pure().await {
            Event::Armed => (green.set_high(), red.set_low()),
            Event::Rests | Event::Refused => (green.set_low(), red.set_high()),
        };
    }
}

#[embassy_executor::task]
async fn log() {
    let Ok(mut events) = EVENTS.subscriber() else { return };
    loop {
        match events.next_message_pure().await {
            Event::Armed => defmt::info!("armed"),
            Event::Refused => defmt::warn!("not armed"),
            Event::Rests => defmt::warn!("rests"),
        }
    }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = embassy_stm32::init(clocks());
    let line = |baudrate| {
        let mut line = usart::Config::default();
        line.baudrate = baudrate;
        line
    };
    let port = usart::Uart::new(
        board.USART3,
        board.PD9,
        board.PD8,
        board.DMA1_CH4,
        board.DMA1_CH1,
        Interrupts,
        line(115_200),
    );
    let Ok(host) = port else { panic!("the line of the computer") };
    let (to_host, from_host) = host.split();
    spawner.spawn(lines::hear_host(from_host).expect("the first"));
    spawner.spawn(lines::telemetry(to_host).expect("the first"));

    let imus = [
        usart::UartRx::new(board.USART2, board.PD6, board.DMA1_CH5, Interrupts, line(115_200)),
        usart::UartRx::new(board.UART7, board.PE7, board.DMA1_CH3, Interrupts, line(115_200)),
        usart::UartRx::new(board.UART8, board.PE0, board.DMA1_CH6, Interrupts, line(115_200)),
        usart::UartRx::new(board.USART6, board.PG9, board.DMA2_CH1, Interrupts, line(115_200)),
    ];
    for (imu, topic) in imus.into_iter().zip(&topics::IMUS) {
        let Ok(imu) = imu else { panic!("the line of an IMU") };
        spawner.spawn(lines::hear_imu(imu, topic).expect("four of them"));
    }

    let port = usart::Uart::new(
        board.USART1,
        board.PB7,
        board.PB6,
        board.DMA2_CH7,
        board.DMA2_CH5,
        Interrupts,
        line(1_000_000),
    );
    let Ok(servo) = port else { panic!("the line of the servo") };
    let (to_servo, from_servo) = servo.split();
    spawner.spawn(lines::lead_servo(to_servo).expect("the first"));
    spawner.spawn(lines::hear_servo(from_servo).expect("the first"));

    let (green, red) = (
        Output::new(board.PF14, Level::Low, Speed::Low),
        Output::new(board.PE11, Level::High, Speed::Low),
    );
    spawner.spawn(lamps(green, red).expect("the first"));
    spawner.spawn(log().expect("the first"));

    let Ok((snake, motors)) = Snake::new() else { panic!("the motors do not fit") };
    static TO_CAN: StaticCell<can::TxBuf<SENDING>> = StaticCell::new();
    static FROM_CAN: StaticCell<can::RxBuf<32>> = StaticCell::new();
    let mut controller = Can::new(board.CAN1, board.PD0, board.PD1, Interrupts);
    controller.modify_filters().enable_bank(0, can::Fifo::Fifo0, Mask32::accept_all());
    let (sending, received) = (TO_CAN.init(can::TxBuf::new()), FROM_CAN.init(can::RxBuf::new()));
    let can = halves::start(controller, pac::CAN1, sending, received).await;
    let runner = Runner::new(can, now as fn() -> Instant, motors);
    let watchdog = IndependentWatchdog::new(board.IWDG, WATCHDOG_US);
    spawner.spawn(control(runner, snake, watchdog).expect("the first"));
}
