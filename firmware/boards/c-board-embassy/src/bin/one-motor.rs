//! One M3508 on a RoboMaster development board C, the first program to flash: hold the key down, and it turns with 60 rpm.
//!
//! | plug | pins | what |
//! |---|---|---|
//! | CAN1 | PD0 receive, PD1 transmit | a C620 with id 1, 1 Mbit/s |
//! | key | PA0, low while it is held down | arms when it is pressed, and disarms when it is let go; after a fault, press it again |
//! | LED | PH11 green, PH12 red | armed; not armed, though the key is held down |
//!
//! Pins: DJI's own examples for this board. Lift the motor, and flash with a probe on the SWD plug; why it does not arm, what
//! happens to it and how it is are told there:
//! `probe-rs run --chip STM32F407IGHx target/thumbv7em-none-eabihf/release/one-motor`
#![no_std]
#![no_main]

use c_board_embassy::{WATCHDOG_US, can1, clocks, now};
use defmt_rtt as _;
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::runner::Runner;
use drivetrain::units::{AngularVelocity, Current};
use embassy_executor::Spawner;
use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Ticker};
use panic_probe as _;

/// A per rad/s and A per rad at the output shaft: those of a wheel under 20 kg, calm on a motor alone.
const SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0);
const CURRENT_LIMIT: Current = Current::from_amperes(3.0);
const TARGET: AngularVelocity = AngularVelocity::from_rpm(60.0);

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let board = embassy_stm32::init(clocks());
    let key = Input::new(board.PA0, Pull::Up);
    let mut green = Output::new(board.PH11, Level::Low, Speed::Low);
    let mut red = Output::new(board.PH12, Level::Low, Speed::Low);

    let mut bus = Bus::new();
    let config = Config::<M3508>::new(1).speed_loop(SPEED).with_current_limit(CURRENT_LIMIT);
    let Ok(motor) = bus.attach(config) else { panic!("the motor does not fit") };
    let can = can1(board.CAN1, board.PD0, board.PD1).await;
    let mut runner = Runner::new(can, now, bus);

    let mut watchdog = IndependentWatchdog::new(board.IWDG, WATCHDOG_US);
    let mut beat = runner.heartbeat();
    // Four times a step: at the pace of the steps, one that wakes a microsecond early would be left out.
    let mut wake = Ticker::every(Duration::from_micros(250));
    // A key that is held down at power-on starts nothing.
    let mut was_down = true;
    let mut ticks = 0_u32;
    watchdog.unleash();
    loop {
        wake.next().await;
        runner.poll(32);
        let Some(tick) = runner.due() else { continue };
        let is_down = key.is_low();
        // The press, not the key that stays down: after a fault the motor rests until it is pressed anew.
        if is_down && !was_down {
            if let Err(why) = runner.arm(tick) {
                defmt::warn!("{}", why);
            }
        } else if !is_down {
            runner.device_mut().disarm();
        }
        was_down = is_down;
        // Refused, harmlessly, unless it is armed.
        _ = runner.device_mut().set_velocity(motor, TARGET);
        runner.tick(tick);
        if beat != runner.heartbeat() {
            beat = runner.heartbeat();
            watchdog.pet();
        }

        let is_armed = runner.is_armed();
        green.set_level(is_armed.into());
        red.set_level((is_down && !is_armed).into());
        while let Some(edge) = runner.device_mut().next_edge() {
            defmt::info!("{}", edge);
        }
        while let Some(edge) = runner.next_edge() {
            defmt::warn!("{}", edge);
        }
        ticks = ticks.wrapping_add(1);
        if ticks.is_multiple_of(500) {
            defmt::info!("{}", runner.device().state(motor));
        }
    }
}
