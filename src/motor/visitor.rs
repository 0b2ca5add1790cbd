//! Actions on every device of several: one visitor for each action.

use super::{CanDevice, Claim, Devices, Edge, Ingest, Missing, Role, WrongSetting};
use crate::frame::CanFrame;
use crate::time::{Instant, Tick};
use core::ops::Range;
use embedded_can::Frame;

/// An action on every device of [`Devices`].
pub trait Visitor {
    /// Visits one device.
    fn visit(&mut self, device: &mut impl CanDevice);
}

pub(super) struct Offer<'a> {
    pub(super) frame: &'a CanFrame,
    pub(super) now: Instant,
    pub(super) outcome: Ingest,
}

impl Visitor for Offer<'_> {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        if self.outcome == Ingest::Unrelated {
            self.outcome = device.ingest(self.frame, self.now);
        }
    }
}

pub(super) struct Update(pub(super) Tick);

impl Visitor for Update {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.update(self.0);
    }
}

pub(super) struct Parts(pub(super) u32);

impl Visitor for Parts {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        _ = device;
        self.0 += 1;
    }
}

/// Looks for a frame among the devices with these numbers.
pub(super) struct Search {
    pub(super) among: Range<u32>,
    pub(super) number: u32,
    pub(super) frame: Option<CanFrame>,
}

impl Search {
    pub(super) const fn among(among: Range<u32>) -> Self {
        Self { among, number: 0, frame: None }
    }
}

impl Visitor for Search {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        if self.frame.is_none() && self.among.contains(&self.number) {
            self.frame = device.next_frame();
        }
        self.number += 1;
    }
}

/// Gives a frame back: first to the device that claims its id as a command, then to a former sender.
pub(super) struct Back<'a> {
    pub(super) frame: &'a CanFrame,
    pub(super) to_owner: bool,
    pub(super) taken: bool,
}

impl Visitor for Back<'_> {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        let sends = |claim: Claim| claim.role() == Role::Command && claim.id() == self.frame.id();
        let asks = !self.to_owner || device.claims().any(sends);
        self.taken = self.taken || (asks && device.requeue(self.frame));
    }
}

pub(super) struct Superseded(pub(super) u32);

impl Visitor for Superseded {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        self.0 = self.0.wrapping_add(device.superseded());
    }
}

pub(super) struct Nth {
    pub(super) left: usize,
    pub(super) claim: Option<Claim>,
}

impl Visitor for Nth {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        for claim in device.claims() {
            match self.left.checked_sub(1) {
                Some(left) => self.left = left,
                None => self.claim = self.claim.or(Some(claim)),
            }
        }
    }
}

/// Searches for a claim that clashes with the claim at this index.
pub(super) struct Rival {
    pub(super) left: usize,
    pub(super) claim: Option<Claim>,
    pub(super) other: Option<Claim>,
}

impl Visitor for Rival {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        for other in device.claims() {
            match (self.claim, self.left.checked_sub(1)) {
                (Some(claim), _) => {
                    let clashes = self.other.is_none() && other.clashes_with(&claim);
                    self.other = if clashes { Some(other) } else { self.other };
                }
                (None, Some(left)) => self.left = left,
                (None, None) => self.claim = Some(other),
            }
        }
    }
}

pub(super) struct Obstacles {
    pub(super) now: Instant,
    pub(super) missing: Missing,
    pub(super) second_master: Option<Claim>,
    pub(super) faulty: Missing,
    pub(super) wrong_setting: Option<WrongSetting>,
}

impl Visitor for Obstacles {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.missing(self.now).for_each(|motor| self.missing.add(motor));
        device.faulty().for_each(|motor| self.faulty.add(motor));
        self.wrong_setting = self.wrong_setting.or_else(|| device.wrong_setting());
        self.second_master = self.second_master.or_else(|| device.second_master());
    }
}

/// Hands a request to arm to every device.
pub(crate) struct Ask {
    pub(super) granted: bool,
}

impl Ask {
    /// Returns whether the request counts for all of them. A caller with a refusal of its own passes the request on
    /// too.
    pub(crate) fn of(devices: &mut (impl Devices + ?Sized)) -> bool {
        let mut ask = Self { granted: true };
        devices.visit(&mut ask);
        ask.granted
    }
}

impl Visitor for Ask {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        self.granted &= device.ask();
    }
}

pub(super) struct Engage(pub(super) Instant);

impl Visitor for Engage {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.engage(self.0);
    }
}

pub(super) struct Standing {
    pub(super) any: bool,
    pub(super) all_armed: bool,
    pub(super) stopped: bool,
}

impl Standing {
    pub(super) const NONE: Self = Self { any: false, all_armed: true, stopped: false };
}

impl Visitor for Standing {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        self.any = true;
        self.all_armed &= device.is_armed();
        self.stopped |= device.is_stopped();
    }
}

pub(super) struct Read(pub(super) Option<Edge>);

impl Visitor for Read {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        self.0 = self.0.or_else(|| device.next_edge());
    }
}

pub(super) struct Disarm;

impl Visitor for Disarm {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.disarm();
    }
}

pub(super) struct Trip;

impl Visitor for Trip {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.trip();
    }
}

pub(super) struct Stop;

impl Visitor for Stop {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.emergency_stop();
    }
}

pub(super) struct ClearStop;

impl Visitor for ClearStop {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.clear_emergency_stop();
    }
}
