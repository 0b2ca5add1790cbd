//! A mecanum chassis on a RoboMaster development board C (STM32F407IG): RTIC 2, stm32f4xx-hal and bxcan.
//!
//! ```text
//! interrupt CAN1_RX0 ──FrameQueue, stamped──> control, 1 kHz: frames in, loops, frames out
//! interrupts USART3, USART1 ──bytes──> pilot <── steer, 100 Hz: arms, sets targets
//! ```
//!
//! | plug | pins | what |
//! |---|---|---|
//! | CAN1 | PD0 receive, PD1 transmit | four C620, ids 1 to 4, 1 Mbit/s |
//! | DBUS | PC11, USART3 (the board inverts the signal) | DR16 receiver |
//! | UART2, 4 pins | PB7 receive, USART1 | HiPNUC IMU, 115200 baud, 100 Hz |
//!
//! Pins and the 12 MHz crystal: DJI's own examples for this board. Flash with a probe on the SWD plug:
//! `probe-rs run --chip STM32F407IGHx target/thumbv7em-none-eabihf/release/c-board-rtic`
#![no_std]
#![no_main]

use bxcan::{Frame, Mailbox, Tx};
use core::convert::Infallible;
use defmt_rtt as _;
use drivetrain::runner::AbortPending;
use panic_probe as _;
use stm32f4xx_hal::{can::Can, pac};

/// The sending half of bxcan as a driver, with the frame that each mailbox was given; frames are received in the interrupt.
pub struct Sending(Tx<Can<pac::CAN1>>, [Option<Frame>; 3]);

impl embedded_can::nb::Can for Sending {
    type Frame = Frame;
    type Error = Infallible;

    fn transmit(&mut self, frame: &Frame) -> nb::Result<Option<Frame>, Infallible> {
        let status = self.0.transmit(frame)?;
        let [first, second, third] = &mut self.1;
        *match status.mailbox() {
            Mailbox::Mailbox0 => first,
            Mailbox::Mailbox1 => second,
            Mailbox::Mailbox2 => third,
        } = Some(frame.clone());
        Ok(status.dequeued_frame().cloned())
    }

    fn receive(&mut self) -> nb::Result<Frame, Infallible> {
        Err(nb::Error::WouldBlock)
    }
}

impl AbortPending for Sending {
    fn abort_pending(&mut self, mut back: impl FnMut(Frame)) {
        if self.0.is_idle() {
            return;
        }
        let mailboxes = [Mailbox::Mailbox0, Mailbox::Mailbox1, Mailbox::Mailbox2];
        for (mailbox, held) in mailboxes.into_iter().zip(&mut self.1) {
            // Waits for the end of the attempt when the frame is on the wire: 0.15 ms at most.
            if let Some(frame) = held.take_if(|_| self.0.abort(mailbox)) {
                back(frame);
            }
        }
    }
}

#[rtic::app(device = stm32f4xx_hal::pac, dispatchers = [EXTI0, EXTI1])]
mod app {
    use super::Sending;
    use bxcan::filter::Mask32;
    use bxcan::{Fifo, Interrupt, Rx0};
    use core::sync::atomic::{AtomicU32, Ordering};
    use drivetrain::dji::Bus;
    use drivetrain::motor::SwitchOrder;
    use drivetrain::runner::{FrameQueue, FrameReceiver, FrameSender, Nb, NbAbort, Runner};
    use drivetrain::time::{Instant, Tick};
    use pilot::Pilot;
    use rtic_time::Monotonic;
    use stm32f4xx_hal::can::Can;
    use stm32f4xx_hal::pac::{CAN1, TIM2, USART1, USART3};
    use stm32f4xx_hal::prelude::*;
    use stm32f4xx_hal::serial::{Config, Rx, Serial};
    use stm32f4xx_hal::{rcc, timer::MonoTimerUs, watchdog::IndependentWatchdog};

    type Micros = MonoTimerUs<TIM2>;
    type Robot = Runner<NbAbort<Sending>, fn() -> Instant, Bus>;

    /// Times that the controller's FIFO ran over.
    static OVERRUNS: AtomicU32 = AtomicU32::new(0);

    fn now() -> Instant {
        Instant::from_micros(Micros::now().ticks())
    }

    #[shared]
    struct Shared {
        runner: Robot,
        pilot: Pilot,
    }

    #[local]
    struct Local {
        receiving: Rx0<Can<CAN1>>,
        into_queue: FrameSender<'static>,
        queue: FrameReceiver<'static>,
        watchdog: IndependentWatchdog,
        remote: Rx<USART3>,
        imu: Rx<USART1>,
    }

    #[init(local = [frames: FrameQueue<64> = FrameQueue::new()])]
    fn init(mut cx: init::Context) -> (Shared, Local) {
        // 168 MHz from the crystal; APB1 42 MHz: prescaler 3, 14 quanta a bit, sampled at 85.7 %: 1 Mbit/s exactly.
        let clocks = rcc::Config::hse(12.MHz()).sysclk(168.MHz()).pclk1(42.MHz());
        let mut rcc = cx.device.RCC.freeze(clocks);
        cx.device.TIM2.monotonic_us(&mut cx.core.NVIC, &mut rcc);
        let gpiob = cx.device.GPIOB.split(&mut rcc);
        let gpioc = cx.device.GPIOC.split(&mut rcc);
        let gpiod = cx.device.GPIOD.split(&mut rcc);

        let can = cx.device.CAN1.can((gpiod.pd1, gpiod.pd0), &mut rcc);
        let mut can = bxcan::Can::builder(can).set_bit_timing(0x001A_0002).enable();
        can.modify_filters().enable_bank(0, Fifo::Fifo0, Mask32::accept_all());
        can.enable_interrupt(Interrupt::Fifo0MessagePending);
        let (sending, receiving, _) = can.split();

        let line = Config::default().baudrate(100_000.bps()).wordlength_9().parity_even();
        let remote = Serial::rx(cx.device.USART3, gpioc.pc11, line, &mut rcc);
        let line = Config::default().baudrate(115_200.bps());
        let imu = Serial::rx(cx.device.USART1, gpiob.pb7, line, &mut rcc);
        let (Ok(mut remote), Ok(mut imu)) = (remote, imu) else { panic!("a serial line") };
        remote.listen();
        imu.listen();

        let mut bus = Bus::new();
        let Ok(pilot) = Pilot::new(&mut bus) else { panic!("the wheels do not fit") };
        let runner = Runner::new(
            NbAbort(Nb(Sending(sending, [None, None, None]))),
            now as fn() -> Instant,
            bus,
        );
        let (into_queue, queue) = cx.local.frames.split();
        // A loop that stands for so long is reset, and comes back disarmed. Its oscillator is up to half off.
        let mut watchdog = IndependentWatchdog::new(cx.device.IWDG);
        watchdog.start(20.millis());
        control::spawn().expect("the first");
        steer::spawn().expect("the first");
        (Shared { runner, pilot }, Local { receiving, into_queue, queue, watchdog, remote, imu })
    }

    #[task(binds = CAN1_RX0, priority = 4, local = [receiving, into_queue])]
    fn receive(cx: receive::Context) {
        loop {
            match cx.local.receiving.receive() {
                Ok(frame) => _ = cx.local.into_queue.push(&frame, now()),
                // What came after is still to be read.
                Err(nb::Error::Other(_overrun)) => _ = OVERRUNS.fetch_add(1, Ordering::Relaxed),
                Err(nb::Error::WouldBlock) => break,
            }
        }
    }

    #[task(binds = USART3, priority = 3, shared = [pilot], local = [remote])]
    fn hear_remote(mut cx: hear_remote::Context) {
        if let Ok(byte) = cx.local.remote.read() {
            cx.shared.pilot.lock(|pilot| pilot.hear_remote(&[byte], now()));
        }
    }

    #[task(binds = USART1, priority = 3, shared = [pilot], local = [imu])]
    fn hear_imu(mut cx: hear_imu::Context) {
        if let Ok(byte) = cx.local.imu.read() {
            cx.shared.pilot.lock(|pilot| pilot.hear_imu(&[byte], now()));
        }
    }

    #[task(priority = 2, shared = [runner], local = [queue, watchdog])]
    async fn control(mut cx: control::Context) {
        let mut next = Micros::now();
        let mut beat = 0;
        loop {
            // Four times a step: at the pace of the steps, one that wakes a microsecond early would be left out.
            next += 250.micros();
            Micros::delay_until(next).await;
            cx.shared.runner.lock(|runner| {
                runner.poll_queue(cx.local.queue, 64);
                runner.note_lost(OVERRUNS.swap(0, Ordering::Relaxed));
                if let Some(tick) = runner.due() {
                    runner.tick(tick);
                }
                if beat != runner.heartbeat() {
                    beat = runner.heartbeat();
                    cx.local.watchdog.feed();
                }
            });
        }
    }

    #[task(priority = 1, shared = [runner, pilot])]
    async fn steer(cx: steer::Context) {
        const PERIOD_S: f32 = 0.01;
        let steer::SharedResources { mut runner, mut pilot, .. } = cx.shared;
        let mut next = Micros::now();
        loop {
            next += 10.millis();
            Micros::delay_until(next).await;
            let tick = Tick::new(now(), PERIOD_S);
            (&mut runner, &mut pilot).lock(|runner, pilot| {
                match pilot.order(tick) {
                    SwitchOrder::Arm => {
                        if let Err(why) = runner.arm(tick) {
                            defmt::warn!("{}", why);
                        }
                    }
                    SwitchOrder::Keep | SwitchOrder::Brake => {}
                    SwitchOrder::Disarm => runner.device_mut().disarm(),
                }
                pilot.drive(runner.device_mut(), tick);
                pilot.edges(tick.now(), |who, edge| defmt::warn!("{}: {}", who, edge));
                while let Some(edge) = runner.device_mut().next_edge() {
                    defmt::info!("{}", edge);
                }
                while let Some(edge) = runner.next_edge() {
                    defmt::warn!("{}", edge);
                }
            });
        }
    }
}
