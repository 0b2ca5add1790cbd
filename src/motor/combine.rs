//! Devices made of devices.

use super::{CanDevice, Claim, Edge, Ingest, MotorName};
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
    fn superseded(&self) -> u32 {
        (**self).superseded()
    }
    fn claims(&self) -> impl Iterator<Item = Claim> {
        (**self).claims()
    }
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        (**self).missing(now)
    }
    fn faulty(&self) -> impl Iterator<Item = MotorName> {
        (**self).faulty()
    }
    fn second_master(&self) -> Option<Claim> {
        (**self).second_master()
    }
    fn next_edge(&mut self) -> Option<Edge> {
        (**self).next_edge()
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
    fn superseded(&self) -> u32 {
        self.iter().fold(0, |sum, device| sum.wrapping_add(device.superseded()))
    }
    fn claims(&self) -> impl Iterator<Item = Claim> {
        self.iter().flat_map(CanDevice::claims)
    }
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.iter().flat_map(move |device| device.missing(now))
    }
    fn faulty(&self) -> impl Iterator<Item = MotorName> {
        self.iter().flat_map(CanDevice::faulty)
    }
    fn second_master(&self) -> Option<Claim> {
        self.iter().find_map(CanDevice::second_master)
    }
    fn next_edge(&mut self) -> Option<Edge> {
        self.iter_mut().find_map(CanDevice::next_edge)
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
            fn superseded(&self) -> u32 {
                0_u32$(.wrapping_add(self.$index.superseded()))+
            }
            fn claims(&self) -> impl Iterator<Item = Claim> {
                core::iter::empty()$(.chain(self.$index.claims()))+
            }
            fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
                core::iter::empty()$(.chain(self.$index.missing(now)))+
            }
            fn faulty(&self) -> impl Iterator<Item = MotorName> {
                core::iter::empty()$(.chain(self.$index.faulty()))+
            }
            fn second_master(&self) -> Option<Claim> {
                None$(.or_else(|| self.$index.second_master()))+
            }
            fn next_edge(&mut self) -> Option<Edge> {
                None$(.or_else(|| self.$index.next_edge()))+
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Bus, Config, Gm6020Voltage, M2006, M3508};
    use crate::motor::ArmError;
    use std::vec::Vec;

    fn bus<M: crate::dji::Model>(id: u8) -> Bus {
        let mut bus = Bus::new();
        bus.attach(Config::<M>::new(id)).unwrap();
        bus
    }

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn hear(device: &mut impl CanDevice, id: u16, now: Instant) -> Ingest {
        device.ingest(&CanFrame::standard(id, [0; 8]).unwrap(), now)
    }

    fn drain(device: &mut impl CanDevice, turn: u32) -> Vec<u32> {
        core::iter::from_fn(|| device.next_frame(turn)).map(|frame| frame.header()).collect()
    }

    #[test]
    fn a_frame_goes_to_the_part_that_knows_it() {
        let mut both = (bus::<M3508>(1), bus::<Gm6020Voltage>(7));
        assert_eq!(hear(&mut both, 0x201, at(1)), Ingest::Taken);
        assert_eq!(hear(&mut both, 0x20B, at(1)), Ingest::Taken);
        assert_eq!(hear(&mut both, 0x205, at(1)), Ingest::Unrelated);
        assert!(both.requeue(&CanFrame::standard(0x2FF, [0; 8]).unwrap()));
        assert!(!both.requeue(&CanFrame::standard(0x1FE, [0; 8]).unwrap()));
    }

    #[test]
    fn each_turn_another_part_sends_first() {
        let mut tuple = (bus::<M3508>(1), bus::<M3508>(5), bus::<Gm6020Voltage>(7));
        let mut array = [bus::<M3508>(1), bus::<M3508>(5), bus::<Gm6020Voltage>(7)];
        for turn in 0..6 {
            let tick = Tick::new(at(u64::from(turn) * 20_000), 0.001);
            tuple.update(tick);
            array.update(tick);
            let mut expected = std::vec![0x200, 0x1FF, 0x2FF];
            expected.rotate_left(turn as usize % 3);
            assert_eq!(drain(&mut tuple, turn), expected);
            assert_eq!(drain(&mut array, turn), expected);
        }
    }

    #[test]
    fn two_parts_that_claim_one_id_are_not_armed() {
        let mut both = [bus::<M3508>(5), bus::<M2006>(5)];
        for device in &mut both {
            assert_eq!(hear(device, 0x205, at(1)), Ingest::Taken);
        }
        let Err(ArmError::Clash(one, other)) = both.arm(at(1)) else {
            panic!("armed in spite of a clash")
        };
        assert_eq!((one.motor().model(), other.motor().model()), ("M3508", "M2006"));
        assert!(!both.is_armed());
    }

    #[test]
    fn all_parts_are_armed_or_none() {
        let (mut first, mut second) = (bus::<M3508>(1), bus::<Gm6020Voltage>(7));
        let mut both = (&mut first, &mut second);
        assert_eq!(hear(&mut both, 0x201, at(1)), Ingest::Taken);
        let missing = both.arm(at(1)).unwrap_err();
        assert!(
            std::format!("{missing}") == "no feedback from GM6020 (voltage) #7"
                && !both.0.is_armed()
        );
        assert_eq!(hear(&mut both, 0x20B, at(1)), Ingest::Taken);
        assert_eq!(both.arm(at(1)), Ok(()));
        both.emergency_stop();
        assert!(first.is_stopped() && second.is_stopped());
    }

    #[test]
    fn an_array_of_nothing_is_never_armed() {
        let mut none: [Bus; 0] = [];
        assert_eq!(none.arm(at(1)), Err(ArmError::NoMotors));
        assert!(!none.is_armed() && none.next_frame(3).is_none());
    }
}
