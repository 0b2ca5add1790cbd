//! What a program runs: the cycle of a `Runner` over a driver with a frame type of its own.

use crate::meter::{CALLS, instructions};
use crate::row;
use crate::rows::START;
use crate::wiring::{Drive, Targets, feedback};
use core::cell::Cell;
use core::hint::black_box;
use drivetrain::dji::Bus;
use drivetrain::frame::CanFrame;
use drivetrain::runner::{Nb, Runner};
use drivetrain::time::{Clock, Instant};
use embedded_can::{ErrorKind, Frame, Id, nb::Can};

/// A frame as the drivers of bxCAN have it.
#[derive(Clone, Copy)]
struct DriverFrame {
    id: Id,
    is_remote: bool,
    dlc: u8,
    data: [u8; 8],
}

impl Frame for DriverFrame {
    #[inline]
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self { id: id.into(), is_remote: false, dlc: data.len() as u8, data: bytes })
    }

    #[inline]
    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        (dlc <= 8).then(|| Self { id: id.into(), is_remote: true, dlc: dlc as u8, data: [0; 8] })
    }

    #[inline]
    fn is_extended(&self) -> bool {
        matches!(self.id, Id::Extended(_))
    }

    #[inline]
    fn is_remote_frame(&self) -> bool {
        self.is_remote
    }

    #[inline]
    fn id(&self) -> Id {
        self.id
    }

    #[inline]
    fn dlc(&self) -> usize {
        self.dlc.into()
    }

    #[inline]
    fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.dlc)]
    }
}

/// Gives what it holds, and takes everything: out of line, so that its own instructions can be taken off.
struct Driver {
    received: [DriverFrame; 8],
    next: usize,
    sent: u32,
}

impl Can for Driver {
    type Frame = DriverFrame;
    type Error = ErrorKind;

    #[inline(never)]
    fn transmit(&mut self, frame: &DriverFrame) -> nb::Result<Option<DriverFrame>, ErrorKind> {
        black_box(frame);
        self.sent += 1;
        Ok(None)
    }

    #[inline(never)]
    fn receive(&mut self) -> nb::Result<DriverFrame, ErrorKind> {
        let frame = self.received.get(self.next).copied().ok_or(nb::Error::WouldBlock)?;
        self.next += 1;
        Ok(frame)
    }
}

struct Time<'c>(&'c Cell<Instant>);

impl Clock for Time<'_> {
    fn now(&mut self) -> Instant {
        self.0.get()
    }
}

type Loop<'c> = Runner<Nb<Driver>, Time<'c>, Bus>;

/// One cycle of a program: poll, due, tick.
#[unsafe(no_mangle)]
#[inline(never)]
fn runner_cycle(runner: &mut Loop<'_>) {
    runner.poll(16);
    if let Some(tick) = runner.due() {
        runner.tick(tick);
    }
}

#[unsafe(no_mangle)]
#[inline(never)]
fn runner_poll(runner: &mut Loop<'_>) {
    runner.poll(16);
}

/// What the driver itself takes: nine calls to receive, and as many to transmit as there are commands.
#[inline(never)]
fn driver_alone(runner: &mut Loop<'_>, commands: u32) {
    let driver = &mut runner.port_mut().0;
    while let Ok(frame) = driver.receive() {
        black_box(&frame);
    }
    let [frame, ..] = driver.received;
    for _ in 0..commands {
        _ = black_box(driver.transmit(&frame));
    }
}

fn of_driver(frame: &CanFrame) -> DriverFrame {
    frame.convert().unwrap()
}

fn driver() -> Driver {
    Driver { received: [of_driver(&feedback(1, 0, 0)); 8], next: 0, sent: 0 }
}

/// A cycle of eight motors, less what the driver takes.
fn cycle(targets: Targets) -> u32 {
    let mut drive = Drive::new(targets, 0, START);
    let now = Cell::new(drive.now);
    let bus = core::mem::take(&mut drive.bus);
    let mut runner = Runner::new(Nb(driver()), Time(&now), bus);
    let whole = instructions(runner_cycle as fn(&mut Loop<'_>), |cycle, _| {
        drive.advance_on(runner.device_mut());
        now.set(drive.now);
        let driver = &mut runner.port_mut().0;
        driver.next = 0;
        for (place, frame) in driver.received.iter_mut().zip(drive.frames()) {
            *place = of_driver(frame);
        }
        cycle(&mut runner);
    });
    assert_eq!(runner.statistics().sent, 2 * CALLS);
    whole - alone(&mut runner, 2)
}

/// One of eight frames of another device.
fn foreign() -> u32 {
    let Drive { bus, now, .. } = Drive::new(Targets::Speed, 0, START);
    let now = Cell::new(now);
    let mut runner = Runner::new(Nb(driver()), Time(&now), bus);
    for place in &mut runner.port_mut().0.received {
        *place = of_driver(&CanFrame::standard(0x100, [0; 8]).unwrap());
    }
    let whole = instructions(runner_poll as fn(&mut Loop<'_>), |poll, _| {
        runner.port_mut().0.next = 0;
        poll(&mut runner);
    });
    (whole - alone(&mut runner, 0)) / 8
}

fn alone(runner: &mut Loop<'_>, commands: u32) -> u32 {
    instructions(driver_alone as fn(&mut Loop<'_>, u32), |driver, _| {
        runner.port_mut().0.next = 0;
        driver(runner, commands);
    })
}

pub fn rows() {
    row("cycle_speed", &[cycle(Targets::Speed)]);
    row("cycle_cascade", &[cycle(Targets::Position)]);
    row("foreign_runner", &[foreign()]);
}
