//! The serial lines: each has a task, which turns bytes into a topic or a topic into bytes. All by DMA.

use crate::topics::{ARMED, COMMAND, IMUS, REPORT, Topic};
use drivetrain::units::Angle;
use drivetrain::wire::feetech::{self, Goal, Present, ServoId, Status, register};
use drivetrain::wire::hipnuc::{self, Imu};
use drivetrain::wire::host_link::{
    COMMAND_LENGTH, HostCommand, TELEMETRY_LENGTH, Telemetry, TelemetryFormat,
};
use drivetrain::wire::{Decode, Deframer};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{UartRx, UartTx};
use embassy_time::{Duration, Ticker, Timer};
use halves::now;
use pilot::snake::{Heard, IMU_DEADLINE};
use static_cell::StaticCell;

/// Reads frames of one kind for ever.
async fn hear<T: Decode, const N: usize>(
    mut line: UartRx<'static, Async>,
    mut deframer: Deframer<T, N>,
    mut take: impl FnMut(T),
) -> ! {
    let mut bytes = [0; 128];
    loop {
        // Each read is a transfer of its own: a ring of embassy 0.6 may read old bytes anew after an error of the line.
        let count = line.read_until_idle(&mut bytes).await.unwrap_or(0);
        let mut rest = bytes.get(..count).unwrap_or_default();
        while let Some(frame) = deframer.read(&mut rest) {
            take(frame);
        }
    }
}

#[embassy_executor::task]
pub async fn hear_host(line: UartRx<'static, Async>) {
    let topic = COMMAND.sender();
    hear(line, Deframer::<HostCommand, COMMAND_LENGTH>::new(), |value| {
        topic.send(Heard { value, at: now() });
    })
    .await
}

#[embassy_executor::task(pool_size = 4)]
pub async fn hear_imu(line: UartRx<'static, Async>, topic: &'static Topic<Heard<Imu>>) {
    let topic = topic.sender();
    hear(line, Deframer::<Imu, { hipnuc::MAX_FRAME }>::new(), |value| {
        topic.send(Heard { value, at: now() });
    })
    .await
}

/// What the servo answers is only looked at for its errors.
#[embassy_executor::task]
pub async fn hear_servo(line: UartRx<'static, Async>) {
    let mut errors = 0;
    hear(line, Deframer::<Status, { feetech::MAX_FRAME }>::new(), |status| {
        if status.errors() != errors {
            errors = status.errors();
            defmt::warn!("errors of the servo: {}", errors);
        }
    })
    .await
}

/// Goal, torque and question in turn, each 20 ms: the servo is released when the robot is not armed. The goal goes first, for a servo
/// whose torque is switched on drives to the goal of before.
#[embassy_executor::task]
pub async fn lead_servo(mut line: UartTx<'static, Async>) {
    static BYTES: StaticCell<[u8; feetech::MAX_FRAME]> = StaticCell::new();
    let buffer = BYTES.init([0; feetech::MAX_FRAME]);
    let mut wake = Ticker::every(Duration::from_millis(20));
    loop {
        wake.next().await;
        let command = COMMAND.try_get().filter(|_| ARMED.try_get() == Some(true));
        if let Some(command) = &command {
            let counts =
                i32::from(command.value.sts3032_degrees) * i32::from(feetech::COUNTS_PER_TURN);
            let position = i16::try_from(counts / 360).unwrap_or(i16::MAX);
            let goal = Goal { acceleration: 50, position, time: 0, speed: 2_250 };
            let goal = feetech::write(ServoId::ONE, Goal::ADDRESS, &goal.to_bytes(), buffer);
            _ = line.write(goal.unwrap_or_default()).await;
        }
        Timer::after_millis(6).await;
        let is_on = [command.is_some().into()];
        let torque = feetech::write(ServoId::ONE, register::TORQUE, &is_on, buffer);
        _ = line.write(torque.unwrap_or_default()).await;
        Timer::after_millis(6).await;
        let question = feetech::read(ServoId::ONE, Present::ADDRESS, Present::LENGTH, buffer);
        _ = line.write(question.unwrap_or_default()).await;
    }
}

#[embassy_executor::task]
pub async fn telemetry(mut line: UartTx<'static, Async>) {
    static BYTES: StaticCell<[u8; TELEMETRY_LENGTH]> = StaticCell::new();
    let buffer = BYTES.init([0; TELEMETRY_LENGTH]);
    let format = TelemetryFormat::new();
    let mut wake = Ticker::every(Duration::from_millis(50));
    loop {
        wake.next().await;
        let Some(report) = REPORT.try_get() else { continue };
        let now = now();
        let telemetry = Telemetry {
            positions_pulses: report.pulses,
            speeds_rpm: report.rpm,
            gm6020_position: report.gripper_degrees[0],
            c610_position: report.gripper_degrees[1],
            imu_angles_deg: IMUS.each_ref().map(|imu| {
                // Better no angle than an old one.
                let fresh = imu.try_get().and_then(|imu| imu.fresh(now, IMU_DEADLINE));
                fresh.map_or([f32::NAN; 3], |imu| {
                    let (roll, pitch, yaw) = imu.euler_roll_x();
                    [pitch, roll, yaw].map(Angle::as_degrees)
                })
            }),
        };
        if let Ok(frame) = format.encode(&telemetry, buffer) {
            _ = line.write(frame).await;
        }
    }
}
