//! Both drivers of the MCP2515 on a chip of 128 registers, by its data sheet (DS20001801, chapter 12).

use super::{Interface, Mcp25xx, Mcp2515};
use core::cell::Cell;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::runner::{AbortPending, Nb, NbAbort, Runner};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::Current;
use embedded_can::Frame;
use embedded_can::nb::Can;
use embedded_can_interface::{AsyncRxFrameIo, AsyncTxFrameIo, RxFrameIo, TxFrameIo};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;
use std::{vec, vec::Vec};

const CANSTAT: usize = 0x0E;
const CANCTRL: usize = 0x0F;
const CANINTF: usize = 0x2C;
const CONTROLS: [usize; 3] = [0x30, 0x40, 0x50];

struct Chip {
    registers: [u8; 128],
    /// What was on the wire.
    sent: Vec<CanFrame>,
    is_plugged: bool,
}

#[derive(Clone)]
struct Wire(Rc<RefCell<Chip>>);

impl Wire {
    fn new() -> Self {
        let chip = Chip { registers: [0; 128], sent: Vec::new(), is_plugged: true };
        Self(Rc::new(RefCell::new(chip)))
    }

    /// The line is free: the most urgent frames leave, if somebody acknowledges.
    fn send(&self) {
        let mut chip = self.0.borrow_mut();
        for control in CONTROLS {
            if chip.is_plugged && chip.registers[control] & 8 != 0 {
                chip.registers[control] &= !8;
                let frame = chip.frame(control + 1);
                chip.sent.push(frame);
            }
        }
    }

    fn receive(&self, id: u16, data: [u8; 8]) {
        let mut chip = self.0.borrow_mut();
        let (high, low) = ((id >> 3) as u8, (id << 5) as u8);
        chip.registers[0x61..0x66].copy_from_slice(&[high, low, 0, 0, 8]);
        chip.registers[0x66..0x6E].copy_from_slice(&data);
        chip.registers[CANINTF] |= 1;
    }
}

impl Chip {
    fn frame(&self, at: usize) -> CanFrame {
        let id = u16::from(self.registers[at]) << 3 | u16::from(self.registers[at + 1]) >> 5;
        let length = usize::from(self.registers[at + 4] & 0xF);
        let id = embedded_can::StandardId::new(id).unwrap();
        CanFrame::new(id, &self.registers[at + 5..at + 5 + length]).unwrap()
    }

    fn status(&self) -> u8 {
        let pending = |at: usize| (self.registers[CONTROLS[at]] >> 3 & 1) << (2 + 2 * at);
        self.registers[CANINTF] & 3 | pending(0) | pending(1) | pending(2)
    }

    fn write(&mut self, at: usize, value: u8) {
        self.registers[at & 0x7F] = value;
        if at == CANCTRL {
            self.registers[CANSTAT] = value & 0xE0;
        }
    }

    /// One transaction: what goes in, and as many bytes out.
    fn exchange(&mut self, sent: &[u8]) -> Vec<u8> {
        let (first, rest) = sent.split_first().unwrap();
        let mut out = vec![0; sent.len()];
        match *first {
            0xC0 => self.write(CANCTRL, 0x80),
            0x03 => {
                for (at, byte) in out.iter_mut().skip(2).enumerate() {
                    *byte = self.registers[(usize::from(rest[0]) + at) & 0x7F];
                }
            }
            0x02 => rest[1..]
                .iter()
                .enumerate()
                .for_each(|(at, byte)| self.write(usize::from(rest[0]) + at, *byte)),
            0x05 => {
                let at = usize::from(rest[0]);
                let value = self.registers[at] & !rest[1] | rest[2] & rest[1];
                self.write(at, value);
            }
            0xA0 => {
                let status = self.status();
                out.iter_mut().skip(1).for_each(|byte| *byte = status);
            }
            load @ 0x40..=0x45 => {
                let start =
                    CONTROLS[usize::from(load - 0x40) / 2] + if load & 1 == 0 { 1 } else { 6 };
                rest.iter().enumerate().for_each(|(at, byte)| self.write(start + at, *byte));
            }
            request @ 0x80..=0x87 => {
                for (at, control) in CONTROLS.into_iter().enumerate() {
                    self.registers[control] |= (request >> at & 1) << 3;
                }
            }
            read @ (0x90 | 0x94) => {
                let (start, flag) = if read == 0x90 { (0x61, 1) } else { (0x71, 2) };
                for (at, byte) in out.iter_mut().skip(1).enumerate() {
                    *byte = self.registers[start + at];
                }
                self.registers[CANINTF] &= !flag;
            }
            other => panic!("instruction {other:#x}"),
        }
        out
    }
}

impl ErrorType for Wire {
    type Error = Infallible;
}

impl SpiDevice for Wire {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let mut sent = Vec::new();
        for operation in operations.iter() {
            match operation {
                Operation::Write(bytes) => sent.extend_from_slice(bytes),
                Operation::Read(bytes) => sent.extend(bytes.iter().map(|_| 0)),
                Operation::TransferInPlace(bytes) => sent.extend_from_slice(bytes),
                Operation::Transfer(_, bytes) => sent.extend_from_slice(bytes),
                Operation::DelayNs(_) => {}
            }
        }
        let mut answer = self.0.borrow_mut().exchange(&sent).into_iter();
        for operation in operations {
            match operation {
                Operation::Write(bytes) => _ = answer.by_ref().take(bytes.len()).count(),
                Operation::Read(bytes)
                | Operation::TransferInPlace(bytes)
                | Operation::Transfer(bytes, _) => {
                    bytes.iter_mut().zip(answer.by_ref()).for_each(|(byte, answer)| *byte = answer);
                }
                Operation::DelayNs(_) => {}
            }
        }
        Ok(())
    }
}

impl DelayNs for Wire {
    fn delay_ns(&mut self, _: u32) {}
}

/// Drives a motor, pulls the plug for 50 ms while its current changes, and returns what leaves when it is back.
fn after_a_pulled_plug<C: AbortPending>(wire: &Wire, driver: C) -> Vec<CanFrame> {
    let clock = Cell::new(Instant::START);
    let mut bus = Bus::new();
    let motor =
        bus.attach(Config::<M3508>::new(1).speed_loop(PidConfig::new(1.0, 0.0, 0.0))).unwrap();
    let mut runner = Runner::new(NbAbort(Nb(driver)), &clock, bus);
    let mut drive = |from: u16, until: u16| {
        for ms in from..until {
            clock.set(clock.get() + Duration::from_millis(1));
            if wire.0.borrow().is_plugged {
                wire.receive(0x201, [0, 0, 0, 0, 0, 0, 30, 0]);
            }
            runner.poll(16);
            let Some(tick) = runner.due() else { continue };
            if ms == 10 {
                runner.arm(tick).unwrap();
            }
            _ = runner
                .device_mut()
                .set_current(motor, Current::from_amperes(f32::from(ms) / 100.0));
            runner.tick(tick);
            wire.send();
        }
    };
    drive(0, 500);
    let word = |frame: &CanFrame| i16::from_be_bytes([frame.data()[0], frame.data()[1]]);
    let last = *wire.0.borrow().sent.last().unwrap();
    // 4.99 A, of 16384 counts for 20 A.
    assert_eq!((last.header(), word(&last)), (0x200, 4_088));
    wire.0.borrow_mut().is_plugged = false;
    drive(500, 550);
    let count = wire.0.borrow().sent.len();
    wire.0.borrow_mut().is_plugged = true;
    wire.send();
    wire.0.borrow().sent[count..].to_vec()
}

/// The feedback was lost 40 ms ago, so the one frame that waits is zero.
fn is_one_of_zeros(sent: &[CanFrame]) {
    assert_eq!(sent.len(), 1, "{sent:?}");
    assert_eq!((sent[0].header(), sent[0].data()), (0x200, &[0; 8][..]));
}

#[test]
fn mcp25xx_receives_sends_and_calls_back_what_waits_while_the_plug_is_out() {
    let wire = Wire::new();
    let mut can = mcp25xx::MCP25xx { spi: wire.clone() };
    let timing = mcp25xx::bitrates::clock_16mhz::CNF_1000K_BPS;
    can.apply_config(&mcp25xx::Config::default().bitrate(timing)).unwrap();
    is_one_of_zeros(&after_a_pulled_plug(&wire, Mcp25xx::new(can)));
}

#[test]
fn mcp2515_receives_sends_and_calls_back_what_waits_while_the_plug_is_out() {
    let wire = Wire::new();
    let mut can = mcp2515::MCP2515::new(wire.clone());
    can.init(&mut wire.clone(), mcp2515::Settings::default()).unwrap();
    is_one_of_zeros(&after_a_pulled_plug(&wire, Mcp2515::new(can)));
}

/// A driver with the traits of `embedded-can-interface` that holds one frame, and hears what it sends.
#[derive(Default)]
struct Loop(Option<CanFrame>);

impl TxFrameIo for Loop {
    type Frame = CanFrame;
    type Error = nb::Error<Infallible>;

    fn send(&mut self, frame: &CanFrame) -> Result<(), Self::Error> {
        self.try_send(frame)
    }

    fn try_send(&mut self, frame: &CanFrame) -> Result<(), Self::Error> {
        if self.0.is_some() {
            return Err(nb::Error::WouldBlock);
        }
        self.0 = Some(*frame);
        Ok(())
    }

    fn send_timeout(
        &mut self,
        frame: &CanFrame,
        _: core::time::Duration,
    ) -> Result<(), Self::Error> {
        self.try_send(frame)
    }
}

impl RxFrameIo for Loop {
    type Frame = CanFrame;
    type Error = nb::Error<Infallible>;

    fn recv(&mut self) -> Result<CanFrame, Self::Error> {
        self.try_recv()
    }

    fn try_recv(&mut self) -> Result<CanFrame, Self::Error> {
        self.0.take().ok_or(nb::Error::WouldBlock)
    }

    fn recv_timeout(&mut self, _: core::time::Duration) -> Result<CanFrame, Self::Error> {
        self.try_recv()
    }

    fn wait_not_empty(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

#[test]
fn an_interface_that_is_full_or_empty_would_block() {
    let mut can =
        Interface { io: Loop::default(), is_not_now: |error| *error == nb::Error::WouldBlock };
    let frame = CanFrame::standard(0x201, [7; 8]).unwrap();
    assert_eq!(can.receive(), Err(nb::Error::WouldBlock));
    assert_eq!(can.transmit(&frame), Ok(None));
    assert_eq!(can.transmit(&frame), Err(nb::Error::WouldBlock));
    assert_eq!(can.receive(), Ok(frame));
}

impl AsyncTxFrameIo for Loop {
    type Frame = CanFrame;
    type Error = nb::Error<Infallible>;

    async fn send(&mut self, frame: &CanFrame) -> Result<(), Self::Error> {
        self.try_send(frame)
    }

    async fn send_timeout(
        &mut self,
        frame: &CanFrame,
        _: core::time::Duration,
    ) -> Result<(), Self::Error> {
        self.try_send(frame)
    }
}

impl AsyncRxFrameIo for Loop {
    type Frame = CanFrame;
    type Error = nb::Error<Infallible>;

    async fn recv(&mut self) -> Result<CanFrame, Self::Error> {
        self.try_recv()
    }

    async fn recv_timeout(&mut self, _: core::time::Duration) -> Result<CanFrame, Self::Error> {
        self.try_recv()
    }

    async fn wait_not_empty(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// A tick of a program, as docs/porting.md has it.
async fn tick<C>(
    can: &mut C,
    bus: &mut Bus,
    now: Instant,
) -> Result<(), <C as AsyncRxFrameIo>::Error>
where
    C: AsyncRxFrameIo<Frame = CanFrame>
        + AsyncTxFrameIo<Frame = CanFrame, Error = <C as AsyncRxFrameIo>::Error>,
{
    _ = bus.ingest(&can.recv().await?, now);
    bus.update(Tick::new(now, 0.001));
    if let Some(frame) = bus.next_frame() {
        AsyncTxFrameIo::send(can, &frame).await?;
    }
    Ok(())
}

#[test]
fn a_task_hears_and_drives_by_the_async_traits() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
    let feedback = CanFrame::standard(0x201, [0; 8]).unwrap();
    let mut can = Loop::default();
    let mut now = Instant::from_micros(1_000);
    for _ in 0..300 {
        now = now + Duration::from_millis(1);
        can.0 = Some(feedback);
        let mut context = Context::from_waker(Waker::noop());
        let outcome = pin!(tick(&mut can, &mut bus, now)).as_mut().poll(&mut context);
        assert_eq!(outcome, Poll::Ready(Ok(())));
        if !bus.is_armed() {
            bus.arm(now).unwrap();
        }
        bus.set_current(wheel, Current::from_amperes(1.0)).unwrap();
    }
    let words = can.0.unwrap();
    assert_eq!((words.header(), words.data()[0..2].to_vec()), (0x200, vec![0x03, 0x33])); // 819 of 16384
}
