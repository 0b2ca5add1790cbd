//! The router: what a bus does with a frame, and what can be seen of the bus afterwards.

use crate::Shared;
use drivetrain::dji::{
    AnyHandle, AttachError, Bus, Config, Counters, Gm6020Voltage, Handle, M2006, M3508, Model,
};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Condition, Health, Ingest};
use drivetrain::time::{Instant, Tick};
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

/// Stands between [`frame`] and [`route`].
#[unsafe(no_mangle)]
static FRAME: Shared<[u32; size_of::<CanFrame>() / 4]> = Shared::new([0; _]);

/// Makes a frame: 1, or 0 when there is no such frame.
#[unsafe(no_mangle)]
pub extern "C" fn frame(wire: &Wire, place: &mut CanFrame) -> u32 {
    wire.frame().map_or(0, |frame| {
        *place = frame;
        1
    })
}

const fn attached<M: Model>(bus: &mut Bus, id: u8) -> AnyHandle {
    match bus.attach(Config::<M>::new(id)) {
        Ok(motor) => Handle::erase(motor),
        Err(AttachError::Collision { .. }) => panic!("two motors on one id"),
        Err(_) => panic!("not attached"),
    }
}

/// 0x201, 0x202, 0x204, 0x206, 0x209, 0x20B: with gaps between, and both ends.
const ATTACHED: (Bus, [AnyHandle; 6]) = {
    let mut bus = Bus::new();
    let motors = [
        attached::<M3508>(&mut bus, 1),
        attached::<M3508>(&mut bus, 2),
        attached::<M2006>(&mut bus, 4),
        attached::<M2006>(&mut bus, 6),
        attached::<Gm6020Voltage>(&mut bus, 5),
        attached::<Gm6020Voltage>(&mut bus, 7),
    ];
    (bus, motors)
};

#[unsafe(no_mangle)]
static BUS: Shared<Bus> = Shared::new(ATTACHED.0);

/// Gives the bus a frame: 1 taken, 2 not of this bus, 3 wrong length, 4 a bad field.
#[unsafe(no_mangle)]
pub extern "C" fn route(bus: &mut Bus, frame: &CanFrame, now_us: u32) -> u32 {
    match bus.ingest(frame, Instant::from_micros(u64::from(now_us))) {
        Ingest::Taken => 1,
        Ingest::Unrelated => 2,
        Ingest::WrongLength(length) if length == frame.length() => 3,
        Ingest::WrongField => 4,
        Ingest::WrongLength(_) => 5,
    }
}

/// Updates the bus a millisecond after the time before.
#[unsafe(no_mangle)]
extern "C" fn update(bus: &mut Bus, now_us: u32) {
    bus.update(Tick::new(Instant::from_micros(u64::from(now_us)), 0.001));
}

#[unsafe(no_mangle)]
static MOTORS: [AnyHandle; 6] = ATTACHED.1;

/// Writes the last frame of a motor: 1, or 0 when it was not heard yet.
#[unsafe(no_mangle)]
extern "C" fn heard(bus: &Bus, motor: &AnyHandle, last: &mut [u8; 8]) -> u32 {
    bus.state(*motor).map_or(0, |state| {
        *last = state.feedback.encode();
        1
    })
}

/// Compares the health of a motor with what it was before: 0 it is the same, 1 it is the same but for a second master, who
/// is new, 2 there is more.
#[unsafe(no_mangle)]
extern "C" fn news(before: &Bus, after: &Bus, motor: &AnyHandle) -> u32 {
    let (old, new) = (before.health(*motor), after.health(*motor));
    let noted = old.map(|old| {
        let conditions = old.conditions.with(Condition::SecondMaster);
        Health { conditions, ..old }
    });
    match new {
        _ if new == old => 0,
        _ if new == noted => 1,
        _ => 2,
    }
}

/// Takes all edges and writes how many there were; of which motors a second master began, a bit for each id of an ESC; and the
/// earliest and the latest time in µs.
#[unsafe(no_mangle)]
extern "C" fn edges(bus: &mut Bus, told: &mut [u32; 4]) {
    let [mut count, mut rivals, mut latest] = [0_u32; 3];
    let mut earliest = u32::MAX;
    while let Some(edge) = bus.next_edge() {
        let is_rival = edge.began && edge.condition == Condition::SecondMaster;
        count += 1;
        rivals |= u32::from(is_rival) << edge.source.id();
        let at = edge.at.as_micros() as u32;
        (earliest, latest) = (earliest.min(at), latest.max(at));
    }
    *told = [count, rivals, earliest, latest];
}

/// Writes all counters: first those of frames with a wrong length, a bad field, and no motor.
#[unsafe(no_mangle)]
extern "C" fn counted(bus: &Bus, counts: &mut [u32; 6]) {
    let Counters { bad_length, bad_field, unattached, bad_steps, packed, superseded } =
        bus.counters();
    *counts = [bad_length, bad_field, unattached, bad_steps, packed, superseded];
}
