//! A sentry on a RoboMaster development board C (STM32F407IG): embassy, one task a part of the robot, topics between them.
//!
//! ```text
//! hear_remote ──REMOTE───> control, 1 kHz ──PILOT, CHASSIS_YAW──> steer, 500 Hz ──MOTION──> control
//! hear_imu ────ATTITUDE──> aim, 1 kHz <────PILOT, ARMED────────── control;    aim ──AIM─────> control
//!                          shoot, 500 Hz <──PILOT, BARREL───────── control;  shoot ──SHOT────> control
//!                                                         EVENTS ──> log, lamps
//! ```
//!
//! Topics are those of `embassy-sync`: a `Watch` holds the last value, a `PubSubChannel` each one. A target is set once for each
//! new value, so the motors of a task that is dead rest when their command deadline expires.
//!
//! | plug | pins | what |
//! |---|---|---|
//! | CAN1 | PD0 receive, PD1 transmit | four C620, ids 1 to 4; GM6020 id 1: yaw |
//! | CAN2 | PB5 receive, PB6 transmit | GM6020 id 2: pitch; two C620, ids 1 and 2: friction wheels; C610 id 3: loader |
//! | DBUS | PC11, USART3 (the board inverts the signal) | DR16 receiver, by DMA |
//! | UART2, 4 pins | PB7 receive, USART1 | HiPNUC IMU on the gimbal, 921600 baud, 500 Hz, by DMA |
//! | LED | PH11 green, PH12 red | armed; not armed |
//!
//! Switches and sticks: `pilot::sentry`. Pins and the 12 MHz crystal: DJI's own examples for this board.
//! `probe-rs run --chip STM32F407IGHx target/thumbv7em-none-eabihf/release/sentry`
#![no_std]
#![no_main]

mod parts;
mod topics;

use c_board_embassy::{WATCHDOG_US, can1, can2, clocks, now};
use defmt_rtt as _;
use drivetrain::dji::Bus;
use drivetrain::motor::SwitchOrder;
use drivetrain::runner::{NbAbort, Runner};
use drivetrain::time::{Instant, Tick};
use drivetrain::wire::dbus::Remote;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::usart::{self, Parity, UartRx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, dma, peripherals};
use embassy_time::{Duration, Ticker};
use halves::Halves;
use panic_probe as _;
use pilot::sentry::{Event, Sentry};
use topics::{AIM, ARMED, BARREL, CHASSIS_YAW, EVENTS, MOTION, PILOT, REMOTE, SHOT};

bind_interrupts!(struct Interrupts {
    USART3 => usart::InterruptHandler<peripherals::USART3>;
    USART1 => usart::InterruptHandler<peripherals::USART1>;
    DMA1_STREAM1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
    DMA2_STREAM2 => dma::InterruptHandler<peripherals::DMA2_CH2>;
});

type Side = Runner<NbAbort<Halves>, fn() -> Instant, Bus>;

/// Both buses: armed together, and when a motor of one is lost the other rests as well.
struct Robot {
    first: Side,
    second: Side,
    sentry: Sentry,
    was_armed: bool,
}

impl Robot {
    fn is_armed(&mut self) -> bool {
        self.first.is_armed() && self.second.is_armed()
    }

    fn rest(&mut self) {
        self.first.device_mut().disarm();
        self.second.device_mut().disarm();
    }

    fn arm(&mut self, tick: Tick) -> bool {
        let armed = self.first.arm(tick).and_then(|()| self.second.arm(tick));
        if let Err(why) = armed {
            defmt::warn!("{}", why);
            self.rest();
        }
        armed.is_ok()
    }

    /// The first bus sets the pace; the second has the same.
    fn step(&mut self, tick: Tick) {
        let heard = REMOTE.try_get();
        let remote = heard.map_or_else(Default::default, |heard| parts::fresh(heard, tick.now()));
        let events = EVENTS.immediate_publisher();
        let order = self.sentry.order(&remote, tick);
        // While it brakes, the sentry stands, looks where it looked and shoots nothing, whatever is heard again.
        let counts = if order == SwitchOrder::Brake { Remote::default() } else { remote };
        PILOT.sender().send(counts);
        match order {
            SwitchOrder::Arm => {
                if !self.arm(tick) {
                    events.publish_immediate(Event::Refused);
                }
            }
            SwitchOrder::Keep | SwitchOrder::Brake if self.is_armed() => {}
            SwitchOrder::Keep | SwitchOrder::Brake | SwitchOrder::Disarm => self.rest(),
        }
        let (first, second) = (self.first.device_mut(), self.second.device_mut());
        self.sentry.roll(first, MOTION.try_get(), tick);
        if let Some(aim) = AIM.try_get() {
            self.sentry.aim(first, second, &aim);
        }
        if let Some(shot) = SHOT.try_take() {
            self.sentry.shoot(second, shot);
        }
        let is_armed = self.is_armed();
        if is_armed != self.was_armed {
            events.publish_immediate(if is_armed { Event::Armed } else { Event::Rests });
        }
        self.was_armed = is_armed;
        ARMED.sender().send(is_armed);
        BARREL.sender().send(self.sentry.barrel(self.second.device()));
        CHASSIS_YAW.sender().send(self.sentry.gimbal_yaw(self.first.device()));
    }

    fn log(&mut self) {
        for side in [&mut self.first, &mut self.second] {
            while let Some(edge) = side.device_mut().next_edge() {
                defmt::info!("{}", edge);
            }
            while let Some(edge) = side.next_edge() {
                defmt::warn!("{}", edge);
            }
        }
    }
}

#[embassy_executor::task]
async fn control(mut robot: Robot, mut watchdog: IndependentWatchdog<'static, peripherals::IWDG>) {
    let mut beats = (robot.first.heartbeat(), robot.second.heartbeat());
    // Four times a step: at the pace of the steps, one that wakes a microsecond early would be left out.
    let mut wake = Ticker::every(Duration::from_micros(250));
    watchdog.unleash();
    loop {
        wake.next().await;
        robot.first.poll(32);
        robot.second.poll(32);
        if let Some(tick) = robot.first.due() {
            robot.step(tick);
            robot.first.tick(tick);
        }
        if let Some(tick) = robot.second.due() {
            robot.second.tick(tick);
            robot.log();
        }
        // Both beat, or the watchdog bites.
        let now = (robot.first.heartbeat(), robot.second.heartbeat());
        if now.0 != beats.0 && now.1 != beats.1 {
            beats = now;
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
            Event::Jammed => continue,
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
            Event::Jammed => defmt::warn!("the loader is jammed"),
        }
    }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = embassy_stm32::init(clocks());

    let mut line = usart::Config::default();
    (line.baudrate, line.parity) = (100_000, Parity::ParityEven);
    let remote = UartRx::new(board.USART3, board.PC11, board.DMA1_CH1, Interrupts, line);
    let mut line = usart::Config::default();
    line.baudrate = 921_600;
    let imu = UartRx::new(board.USART1, board.PB7, board.DMA2_CH2, Interrupts, line);
    let (Ok(remote), Ok(imu)) = (remote, imu) else { panic!("a serial line") };
    spawner.spawn(parts::hear_remote(remote).expect("the first"));
    spawner.spawn(parts::hear_imu(imu).expect("the first"));
    spawner.spawn(parts::steer().expect("the first"));
    spawner.spawn(parts::aim().expect("the first"));
    spawner.spawn(parts::shoot().expect("the first"));

    let (green, red) = (
        Output::new(board.PH11, Level::Low, Speed::Low),
        Output::new(board.PH12, Level::High, Speed::Low),
    );
    spawner.spawn(lamps(green, red).expect("the first"));
    spawner.spawn(log().expect("the first"));

    let Ok((sentry, first, second)) = Sentry::new() else { panic!("the motors do not fit") };
    let can1 = can1(board.CAN1, board.PD0, board.PD1).await;
    let can2 = can2(board.CAN2, board.PB5, board.PB6).await;
    let clock = now as fn() -> Instant;
    let (first, second) = (Runner::new(can1, clock, first), Runner::new(can2, clock, second));
    let watchdog = IndependentWatchdog::new(board.IWDG, WATCHDOG_US);
    spawner.spawn(
        control(Robot { first, second, sentry, was_armed: false }, watchdog).expect("the first"),
    );
}
