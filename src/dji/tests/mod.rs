//! Rules of the bus, driven through its public face.

mod attaching;
mod budget;
mod clock;
mod commanding;
mod conversions;
mod device;
mod duplicates;
mod gains;
mod health;
mod holding;
mod limiting;
mod measured;
mod receiving;
mod safety;
mod sized;
mod soft_limits;
mod takeover;
mod timing;
mod watching;

use super::*;
use crate::control::PidConfig;
use crate::encoder::{Homing, Position};
use crate::frame::CanFrame;
use crate::motor::{ArmError, CanDevice, Devices, Ingest, Link, TargetError, Timeouts};
use crate::time::{Duration, Instant, Tick};
use crate::units::{Angle, AngularVelocity, Current, Voltage};
use embedded_can::{ExtendedId, Frame, StandardId};
use std::string::ToString;
use std::vec::Vec;

impl<M: Model> Config<M> {
    /// A motor whose output range opens at once.
    pub(crate) const fn at_once(id: u8) -> Self {
        Self::new(id).with_opening(Duration::ZERO)
    }
}

const SPEED: PidConfig = PidConfig::new(1.0, 0.0, 0.0);

fn at_ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1_000)
}

fn feedback(id: u16, angle: u16, rpm: i16) -> CanFrame {
    let ([a, b], [c, d]) = (angle.to_be_bytes(), rpm.to_be_bytes());
    CanFrame::standard(id, [a, b, c, d, 0, 0, 25, 0]).unwrap()
}

fn step(bus: &mut Bus, ms: u64) {
    bus.update(Tick::new(at_ms(ms), 0.001));
}

fn sent(bus: &mut Bus) -> Vec<(u32, [i16; 4])> {
    let words = |frame: CanFrame| {
        let [a, b, c, d, e, f, g, h] = *frame.bytes();
        [[a, b], [c, d], [e, f], [g, h]].map(i16::from_be_bytes)
    };
    core::iter::from_fn(|| bus.next_frame()).map(|frame| (frame.header(), words(frame))).collect()
}

/// A bus with these motors heard at 1 ms and armed.
fn armed<M: Model, const N: usize>(configs: [Config<M>; N]) -> (Bus, [Handle<M>; N]) {
    let mut bus = Bus::new();
    let base = M::FACTS.feedback_base;
    let ids = configs.map(|config| base + u16::from(config.id()));
    let handles = bus.attach_all(configs).unwrap();
    for id in ids {
        assert_eq!(bus.ingest(&feedback(id, 0, 0), at_ms(1)), Ingest::Taken);
    }
    bus.arm(at_ms(1)).unwrap();
    (bus, handles)
}
