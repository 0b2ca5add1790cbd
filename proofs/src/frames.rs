//! The router: what a bus does with a frame, and what can be seen of the bus afterwards.

use crate::Shared;
use drivetrain::dji::{AttachError, Bus, Config, Gm6020Voltage, M2006, M3508, Model};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Ingest, Malformed};
use drivetrain::time::Instant;
use embedded_can::{ExtendedId, Frame, Id, StandardId};

/// A frame as a CAN controller has it.
#[repr(C)]
pub struct Wire {
    pub id: u32,
    pub extended: u8,
    pub remote: u8,
    pub length: u8,
    pub unused: u8,
    pub data: [u8; 8],
}

impl Wire {
    pub fn frame(&self) -> Option<CanFrame> {
        let id = if self.extended == 0 {
            Id::Standard(StandardId::new(u16::try_from(self.id).ok()?)?)
        } else {
            Id::Extended(ExtendedId::new(self.id)?)
        };
        // A copy of constant length is no loop, which the proof would have to follow for each length.
        let [a, b, c, d, e, f, g, h] = self.data;
        if self.remote == 0 {
            match self.length {
                0 => CanFrame::new(id, &[]),
                1 => CanFrame::new(id, &[a]),
                2 => CanFrame::new(id, &[a, b]),
                3 => CanFrame::new(id, &[a, b, c]),
                4 => CanFrame::new(id, &[a, b, c, d]),
                5 => CanFrame::new(id, &[a, b, c, d, e]),
                6 => CanFrame::new(id, &[a, b, c, d, e, f]),
                7 => CanFrame::new(id, &[a, b, c, d, e, f, g]),
                8 => CanFrame::new(id, &[a, b, c, d, e, f, g, h]),
                _ => None,
            }
        } else {
            CanFrame::new_remote(id, usize::from(self.length))
        }
    }
}

const fn attached<M: Model>(bus: &mut Bus, id: u8) {
    match bus.attach(Config::<M>::new(id)) {
        Ok(_) => {}
        Err(AttachError::Collision(_)) => panic!("two motors on one id"),
        Err(_) => panic!("not attached"),
    }
}

/// 0x201, 0x202, 0x204, 0x206, 0x209, 0x20B: with gaps between, and both ends.
#[unsafe(no_mangle)]
static BUS: Shared<Bus> = Shared::new({
    let mut bus = Bus::new();
    attached::<M3508>(&mut bus, 1);
    attached::<M3508>(&mut bus, 2);
    attached::<M2006>(&mut bus, 4);
    attached::<M2006>(&mut bus, 6);
    attached::<Gm6020Voltage>(&mut bus, 5);
    attached::<Gm6020Voltage>(&mut bus, 7);
    bus
});

/// Gives the bus a frame: 0 there is no such frame, 1 taken, 2 not of this bus, 3 wrong length, 4 a bad field.
#[unsafe(no_mangle)]
extern "C" fn route(bus: &mut Bus, wire: &Wire, now_us: u32) -> u32 {
    wire.frame().map_or(0, |frame| outcome(bus, &frame, now_us))
}

pub fn outcome(bus: &mut Bus, frame: &CanFrame, now_us: u32) -> u32 {
    match bus.ingest(frame, Instant::from_micros(u64::from(now_us))) {
        Ingest::Taken => 1,
        Ingest::Unrelated => 2,
        Ingest::Malformed(Malformed::Length(length)) if length == frame.length() => 3,
        Ingest::Malformed(Malformed::Field) => 4,
        Ingest::Malformed(_) => 5,
    }
}

/// Writes the last frame of every motor, in the order of the ids, and returns how many were heard.
#[unsafe(no_mangle)]
extern "C" fn heard(bus: &Bus, frames: &mut [[u8; 8]; 11]) -> u32 {
    let mut count = 0;
    for ((motor, _), place) in bus.motors().zip(frames) {
        if let Some(state) = bus.state(motor) {
            *place = state.feedback.encode();
            count += 1;
        }
    }
    count
}

/// Writes how many frames had a wrong length, a bad field, and no motor.
#[unsafe(no_mangle)]
extern "C" fn counted(bus: &Bus, counts: &mut [u32; 3]) {
    let counters = bus.counters();
    *counts = [counters.bad_length, counters.bad_field, counters.unattached];
}
