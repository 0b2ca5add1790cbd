//! One device or several, as seen by their caller.

use super::device::{
    Ask, Back, ClearStop, Disarm, Engage, Nth, Offer, Parts, PutBack, Read, Rival, Search,
    Standing, Stop, Superseded, Survey, Trip, Update, Visitor,
};
use super::{ArmError, Claim, Condition, Ingest, MotorName, Obstacles};
use crate::frame::CanFrame;
use crate::time::{Edge, Instant, Tick};

/// One [`CanDevice`](super::CanDevice) or several: the unit driven by a runner, an async task or a test.
///
/// The caller pushes received frames in and *pulls* frames to send out; a device never does I/O. In each cycle:
///
/// 1. `ingest` every received frame, with the time of its arrival;
/// 2. `update` once: all loops run, all commands are encoded;
/// 3. `next_frame` until `None`, sending each; give a frame that was not sent, or was sent and evicted again, back to
///    `requeue`. The frame is offered again after the next update, with the newest values.
///
/// A tuple or array of devices and `&mut D` are devices. A struct of devices names its parts in one method; everything else,
/// from routing to arming, follows from it.
///
/// # Examples
/// ```
/// use drivetrain::dji::{Bus, Config, M3508};
/// use drivetrain::motor::{ArmError, Devices, Visitor};
/// use drivetrain::time::Instant;
///
/// struct Robot { chassis: Bus, gimbal: Bus }
///
/// impl Devices for Robot {
///     fn visit(&mut self, visitor: &mut impl Visitor) {
///         self.chassis.visit(visitor);
///         self.gimbal.visit(visitor);
///     }
/// }
///
/// let mut robot = Robot { chassis: Bus::new(), gimbal: Bus::new() };
/// robot.gimbal.attach(Config::<M3508>::new(4))?;
/// let refused = robot.arm(Instant::from_micros(1_000)).map_err(|error| error.to_string());
/// assert_eq!(refused, Err("no feedback from M3508 #4".into()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Devices {
    /// Lets the visitor visit every device, always in the same order.
    fn visit(&mut self, visitor: &mut impl Visitor);

    /// Takes a frame received at `now`. Constant time, no I/O, no control.
    #[inline]
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let mut offer = Offer { frame, now, outcome: Ingest::Unrelated };
        self.visit(&mut offer);
        offer.outcome
    }

    /// Returns header and mask of this device's usual feedback; any, as zeros unless said otherwise, if it has none.
    ///
    /// An array of devices finds the first one to ask by it, if their headers are as far apart from each other as the first two.
    fn usual_feedback(&self) -> (u32, u32) {
        (0, 0)
    }

    /// Takes a received frame of any driver's own type. A frame of more than 8 bytes is unrelated.
    fn ingest_any(&mut self, frame: &impl embedded_can::Frame, now: Instant) -> Ingest {
        CanFrame::copy_of(frame).map_or(Ingest::Unrelated, |frame| self.ingest(&frame, now))
    }

    /// Runs every control loop once and encodes the commands.
    #[inline]
    fn update(&mut self, tick: Tick) {
        self.visit(&mut Update(tick));
    }

    /// Returns a pending frame, and removes it from the list.
    ///
    /// `turn` is any number that grows by one a cycle: the search starts with another device each time, so no device starves
    /// on a full bus.
    #[inline]
    fn next_frame(&mut self, turn: u32) -> Option<CanFrame> {
        let mut parts = Parts(0);
        self.visit(&mut parts);
        let first = turn.checked_rem(parts.0)?;
        let mut search = Search::among(first..u32::MAX);
        self.visit(&mut search);
        if search.frame.is_none() && first > 0 {
            search = Search::among(0..first);
            self.visit(&mut search);
        }
        search.frame
    }

    /// Takes back a frame that was not sent, or was evicted; `false` for a frame of no device.
    ///
    /// The frame is not offered again before the next update, and then with the newest values.
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        let mut back = Back { frame, to_owner: true, taken: false };
        self.visit(&mut back);
        // No device claims the last frame of a detached motor.
        back.to_owner = false;
        self.visit(&mut back);
        back.taken
    }

    /// Takes back a frame of this update for which the driver had no place, and offers the frame again in this update, with the newest
    /// values; `false` for a frame of an earlier update and for a frame of no device.
    fn put_back(&mut self, frame: &CanFrame) -> bool {
        let mut put_back = PutBack { frame, taken: false };
        self.visit(&mut put_back);
        put_back.taken
    }

    /// Returns the number of frames replaced by newer frames before sending, wrapping.
    fn superseded(&mut self) -> u32 {
        let mut superseded = Superseded(0);
        self.visit(&mut superseded);
        superseded.0
    }

    /// Lists the CAN ids sent and expected by the devices.
    fn claims(&mut self) -> impl Iterator<Item = Claim> {
        (0..).map_while(move |index| {
            let mut nth = Nth { left: index, claim: None };
            self.visit(&mut nth);
            nth.claim
        })
    }

    /// Returns two motors with one CAN id, if any, for example on a bus with several families.
    fn clash(&mut self) -> Option<(Claim, Claim)> {
        for index in 0.. {
            let mut rival = Rival { left: index, claim: None, other: None };
            self.visit(&mut rival);
            let claim = rival.claim?;
            if let Some(other) = rival.other {
                return Some((claim, other));
            }
        }
        None
    }

    /// Returns the oldest unread edge of a motor; of several devices, from the first device with an edge.
    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        let mut read = Read(None);
        self.visit(&mut read);
        read.0
    }

    /// Arms every device: nothing moves before.
    ///
    /// Arming is a gesture. After a trip, arming is granted only after 100 ms of updates without a request, so a program that
    /// calls this in each tick never re-arms. A refused call counts as a request.
    ///
    /// After power-on or a reset, no trip is remembered. Call this when a switch *turns* on, and take the switch as on before the
    /// first reading: a switch left on then arms nothing.
    ///
    /// # Errors
    /// Names the reason: motors without feedback, a CAN id with two owners or two senders, a fault, a drive with other settings,
    /// a set emergency stop, a request not released since a trip.
    fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        let (granted, is_stopped) = (ask(self), self.is_stopped());
        Obstacles::check(is_stopped, granted, |found| {
            found.has_motors = self.claims().next().is_some();
            found.clash = self.clash();
            self.visit(&mut Survey { now, found });
        })?;
        self.visit(&mut Engage(now));
        Ok(())
    }

    /// Relaxes every motor and refuses targets until armed again.
    fn disarm(&mut self) {
        self.visit(&mut Disarm);
    }

    /// Disarms because of a fault around the motors: arming again needs a new request.
    fn trip(&mut self) {
        self.visit(&mut Trip);
    }

    /// Tells whether there is a device and every motor takes targets.
    fn is_armed(&mut self) -> bool {
        let mut standing = Standing::NONE;
        self.visit(&mut standing);
        standing.any && standing.all_armed
    }

    /// Trips every motor at once; the runner repeats the stop in each tick while it is set. From the next frame on, all
    /// commands are zero until the stop is cleared and the devices armed.
    fn emergency_stop(&mut self) {
        self.visit(&mut Stop);
    }

    /// Clears the emergency stop. The devices stay disarmed.
    fn clear_emergency_stop(&mut self) {
        self.visit(&mut ClearStop);
    }

    /// Tells whether the emergency stop of any device is set.
    fn is_stopped(&mut self) -> bool {
        let mut standing = Standing::NONE;
        self.visit(&mut standing);
        standing.stopped
    }
}

/// Hands a request to arm to every device; returns whether the request counts for all of them. A caller with a refusal of its own passes
/// the request on too.
pub(crate) fn ask(devices: &mut (impl Devices + ?Sized)) -> bool {
    let mut ask = Ask { granted: true };
    devices.visit(&mut ask);
    ask.granted
}

impl<D: Devices> Devices for &mut D {
    #[inline]
    fn visit(&mut self, visitor: &mut impl Visitor) {
        (**self).visit(visitor);
    }

    #[inline]
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        (**self).ingest(frame, now)
    }

    #[inline]
    fn usual_feedback(&self) -> (u32, u32) {
        (**self).usual_feedback()
    }

    #[inline]
    fn next_frame(&mut self, turn: u32) -> Option<CanFrame> {
        (**self).next_frame(turn)
    }
}

/// An array of motors with ids at one distance takes a frame by one look at its id.
impl<D: Devices, const N: usize> Devices for [D; N] {
    #[inline]
    fn visit(&mut self, visitor: &mut impl Visitor) {
        self.iter_mut().for_each(|device| device.visit(visitor));
    }

    #[inline]
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        // The one that it is for is the first; where a frame is for none, or ids are shared, each is asked once.
        let mut place = place_of(self, frame.header());
        for _ in 0..N {
            let Some(device) = self.get_mut(place) else { break };
            let outcome = device.ingest(frame, now);
            if outcome != Ingest::Unrelated {
                return outcome;
            }
            place = if place + 1 < N { place + 1 } else { 0 };
        }
        Ingest::Unrelated
    }

    #[inline]
    fn next_frame(&mut self, turn: u32) -> Option<CanFrame> {
        let first = turn.checked_rem(u32::try_from(N).ok()?)?;
        let (before, after) = self.split_at_mut_checked(usize::try_from(first).ok()?)?;
        after.iter_mut().chain(before).find_map(|device| device.next_frame(turn))
    }
}

/// Returns the place of the device whose usual feedback may have a header, for it to be asked first.
#[inline]
fn place_of<D: Devices>(devices: &[D], header: u32) -> usize {
    let [one, two, ..] = devices else { return 0 };
    let ((first, mask), (second, _)) = (one.usual_feedback(), two.usual_feedback());
    let way = (header & mask).wrapping_sub(first);
    let place = way.checked_div(second.wrapping_sub(first)).and_then(|place| place.try_into().ok());
    place.filter(|place| *place < devices.len()).unwrap_or(0)
}

macro_rules! tuple {
    ($($device:ident $index:tt),+) => {
        impl<$($device: Devices),+> Devices for ($($device,)+) {
            #[inline]
            fn visit(&mut self, visitor: &mut impl Visitor) {
                $(self.$index.visit(visitor);)+
            }
        }
    };
}

tuple!(A 0, B 1);
tuple!(A 0, B 1, C 2);
tuple!(A 0, B 1, C 2, D 3);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::damiao::{Model, Motor};
    use crate::dji::{Bus, Config, Gm6020Voltage, M2006, M3508};
    use crate::motor::{Actuator, ArmError, ImpedanceControl};
    use std::vec::Vec;

    fn bus<M: crate::dji::Model>(id: u8) -> Bus {
        let mut bus = Bus::new();
        bus.attach(Config::<M>::new(id)).unwrap();
        bus
    }

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn hear(device: &mut impl Devices, id: u16, now: Instant) -> Ingest {
        Devices::ingest(device, &CanFrame::standard(id, [0; 8]).unwrap(), now)
    }

    fn drain(device: &mut impl Devices, turn: u32) -> Vec<u32> {
        core::iter::from_fn(|| Devices::next_frame(device, turn))
            .map(|frame| frame.header())
            .collect()
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

    /// By one look at its id; one for none of them is offered to each, from the first on.
    #[test]
    fn an_array_of_drives_asks_first_the_one_that_a_frame_is_for() {
        let gains = ImpedanceControl::new(3.0).unwrap();
        let mut drives =
            [1, 2, 3].map(|id| Actuator::new(Motor::new(Model::J4310, id, gains).unwrap()));
        for id in [0x11, 0x12, 0x13] {
            // Enabled, and the id again.
            let frame = CanFrame::standard(id.into(), [id, 0, 0, 0, 0, 0, 0, 0]).unwrap();
            assert_eq!(drives.ingest(&frame, at(1)), Ingest::Taken);
        }
        let place = |id| place_of(&drives, CanFrame::standard(id, [0; 8]).unwrap().header());
        assert_eq!([0x11, 0x12, 0x13, 0x14, 0x01].map(place), [0, 1, 2, 0, 0]);
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

    /// Counts how often its parts are visited.
    struct Counted([Bus; 2], usize);

    impl Devices for Counted {
        fn visit(&mut self, visitor: &mut impl Visitor) {
            self.1 += 1;
            self.0.visit(visitor);
        }
    }

    /// Each visit lists all ids. With a visit for each pair of devices, arming took longer than a watchdog waits.
    #[test]
    fn clashes_are_found_in_one_visit_for_each_id() {
        let mut parts = [Bus::new(), Bus::new()];
        for id in 1..=4 {
            parts[0].attach(Config::<M3508>::new(id)).unwrap();
            parts[1].attach(Config::<Gm6020Voltage>::new(id + 3)).unwrap();
        }
        let mut counted = Counted(parts, 0);
        assert_eq!(counted.clash(), None);
        let visits = counted.1;
        assert_eq!((visits, counted.claims().count()), (12, 11), "8 of feedback, 3 commands");
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
