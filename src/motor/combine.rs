//! Devices made of devices.

use super::{CanDevice, Claim, Ingest, MotorName};
use crate::frame::CanFrame;
use crate::time::{Instant, Tick};

/// Forwards everything that a borrowed device does.
impl<D: CanDevice> CanDevice for &mut D {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        (**self).ingest(frame, now)
    }
    fn update(&mut self, tick: Tick) {
        (**self).update(tick);
    }
    fn next_frame(&mut self, turn: u32) -> Option<CanFrame> {
        (**self).next_frame(turn)
    }
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        (**self).requeue(frame)
    }
    fn claims(&self) -> impl Iterator<Item = Claim> {
        (**self).claims()
    }
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        (**self).missing(now)
    }
    fn engage(&mut self, now: Instant) {
        (**self).engage(now);
    }
    fn disarm(&mut self) {
        (**self).disarm();
    }
    fn is_armed(&self) -> bool {
        (**self).is_armed()
    }
    fn emergency_stop(&mut self) {
        (**self).emergency_stop();
    }
    fn clear_emergency_stop(&mut self) {
        (**self).clear_emergency_stop();
    }
    fn is_stopped(&self) -> bool {
        (**self).is_stopped()
    }
}

/// The first device that knows a frame takes it; each cycle another one sends first.
impl<D: CanDevice, const N: usize> CanDevice for [D; N] {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        self.iter_mut()
            .map(|device| device.ingest(frame, now))
            .find(|outcome| *outcome != Ingest::Unrelated)
            .unwrap_or(Ingest::Unrelated)
    }
    fn update(&mut self, tick: Tick) {
        self.iter_mut().for_each(|device| device.update(tick));
    }
    fn next_frame(&mut self, turn: u32) -> Option<CanFrame> {
        let (early, late) = self.split_at_mut_checked(turn as usize % N.max(1))?;
        late.iter_mut().chain(early).find_map(|device| device.next_frame(turn))
    }
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        self.iter_mut().any(|device| device.requeue(frame))
    }
    fn claims(&self) -> impl Iterator<Item = Claim> {
        self.iter().flat_map(CanDevice::claims)
    }
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.iter().flat_map(move |device| device.missing(now))
    }
    fn engage(&mut self, now: Instant) {
        self.iter_mut().for_each(|device| device.engage(now));
    }
    fn disarm(&mut self) {
        self.iter_mut().for_each(CanDevice::disarm);
    }
    fn is_armed(&self) -> bool {
        N > 0 && self.iter().all(CanDevice::is_armed)
    }
    fn emergency_stop(&mut self) {
        self.iter_mut().for_each(CanDevice::emergency_stop);
    }
    fn clear_emergency_stop(&mut self) {
        self.iter_mut().for_each(CanDevice::clear_emergency_stop);
    }
    fn is_stopped(&self) -> bool {
        self.iter().any(CanDevice::is_stopped)
    }
}

macro_rules! tuple {
    ($count:literal: $($device:ident $index:tt),+) => {
        /// The first device that knows a frame takes it; each cycle another one sends first.
        impl<$($device: CanDevice),+> CanDevice for ($($device,)+) {
            fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
                $(
                    let outcome = self.$index.ingest(frame, now);
                    if outcome != Ingest::Unrelated {
                        return outcome;
                    }
                )+
                Ingest::Unrelated
            }
            fn update(&mut self, tick: Tick) {
                $(self.$index.update(tick);)+
            }
            fn next_frame(&mut self, turn: u32) -> Option<CanFrame> {
                (0..$count).find_map(|step| match turn.wrapping_add(step) % $count {
                    $($index => self.$index.next_frame(turn),)+
                    _ => None,
                })
            }
            fn requeue(&mut self, frame: &CanFrame) -> bool {
                $(self.$index.requeue(frame))||+
            }
            fn claims(&self) -> impl Iterator<Item = Claim> {
                core::iter::empty()$(.chain(self.$index.claims()))+
            }
            fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
                core::iter::empty()$(.chain(self.$index.missing(now)))+
            }
            fn engage(&mut self, now: Instant) {
                $(self.$index.engage(now);)+
            }
            fn disarm(&mut self) {
                $(self.$index.disarm();)+
            }
            fn is_armed(&self) -> bool {
                $(self.$index.is_armed())&&+
            }
            fn emergency_stop(&mut self) {
                $(self.$index.emergency_stop();)+
            }
            fn clear_emergency_stop(&mut self) {
                $(self.$index.clear_emergency_stop();)+
            }
            fn is_stopped(&self) -> bool {
                $(self.$index.is_stopped())||+
            }
        }
    };
}

tuple!(2: A 0, B 1);
tuple!(3: A 0, B 1, C 2);
tuple!(4: A 0, B 1, C 2, D 3);
