//! DJI motors, and a motor of one's own beside them.

use super::super::custom_motor::MyMotor;
use super::*;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::motor::{Actuator, CanDevice, Devices, VelocityDrive};
use drivetrain::units::{AngularVelocity, Current};
use embedded_can::Frame;

/// One that takes targets again after a recovery, or not.
pub(crate) struct Wheel<const RESUMES: bool>(Bus, Handle<M3508>);

impl<const RESUMES: bool> Wheel<RESUMES> {
    pub(crate) fn new(setup: Setup) -> Self {
        let config = Config::<M3508>::new(1).with_health(health(setup)).with_opening(setup.opening);
        let config = if RESUMES { config.with_resume() } else { config };
        let mut bus = Bus::new();
        let wheel = bus.attach(config).unwrap();
        Self(bus, wheel)
    }

    /// The first word of a command frame, of 16384 for 20 A.
    fn output(frame: &CanFrame) -> f64 {
        let [high, low, ..] = *frame.bytes();
        f64::from(i16::from_be_bytes([high, low]).unsigned_abs()) / 16_384.0
    }
}

impl<const RESUMES: bool> Subject<1> for Wheel<RESUMES> {
    const RULES: [Rules; 1] = [Rules { resumes: RESUMES, ..BUS }];

    stops!(self => self.0);

    fn hear(&mut self, now: Instant) {
        _ = self.0.ingest(&CanFrame::standard(0x201, [0; 8]).unwrap(), now);
    }
    fn link(&self) -> [Link; 1] {
        [self.0.link(self.1).unwrap()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.0.is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.0.set_current(self.1, Current::from_amperes(20.0 * value))]
    }
    fn relax(&mut self) -> [bool; 1] {
        self.0.relax(self.1);
        [true]
    }
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        self.0.update(tick);
        [core::iter::from_fn(|| self.0.next_frame()).map(|f| Self::output(&f)).fold(0.0, f64::max)]
    }
    fn conditions(&self) -> [Conditions; 1] {
        [self.0.conditions(self.1)]
    }
    fn next_edge(&mut self) -> Option<(usize, Edge<Condition, MotorName>)> {
        self.0.next_edge().map(|edge| (0, edge))
    }
    fn command(&self, _: usize) -> Option<CanFrame> {
        CanFrame::standard(0x200, [0; 8])
    }
    fn second_master(&self) -> [Option<Claim>; 1] {
        [CanDevice::second_master(&self.0)]
    }
}

/// A bus and a motor of one's own, as one device.
pub(crate) struct Both(Wheel<false>, Actuator<MyMotor>);

impl Both {
    pub(crate) fn new(setup: Setup) -> Self {
        let own = Actuator::new(MyMotor::new(3).unwrap()).with_health(health(setup)).unwrap();
        Self(Wheel::new(setup), own.with_opening(setup.opening))
    }
}

impl Subject<2> for Both {
    const RULES: [Rules; 2] = [BUS, Rules { opens: Opens::Fills, ..ACTUATOR }];

    stops!(self => (&mut self.0.0, &mut self.1));

    fn hear(&mut self, now: Instant) {
        let own = embedded_can::StandardId::new(0x143).unwrap();
        for frame in
            [CanFrame::standard(0x201, [0; 8]).unwrap(), CanFrame::new(own, &[0, 0, 30]).unwrap()]
        {
            self.ingest(&frame, now);
        }
    }
    fn link(&self) -> [Link; 2] {
        let [wheel] = self.0.link();
        [wheel, self.1.guard().link()]
    }
    fn is_armed(&self) -> [bool; 2] {
        let [wheel] = self.0.is_armed();
        [wheel, self.1.guard().is_armed()]
    }
    /// The actuator is asked for so much that its output is always at its limit.
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 2] {
        let [wheel] = self.0.set(value);
        [wheel, self.1.set_velocity((), AngularVelocity::from_rpm(1_000.0 * value))]
    }
    fn relax(&mut self) -> [bool; 2] {
        let [wheel] = self.0.relax();
        [wheel, false]
    }
    fn outputs(&mut self, tick: Tick) -> [f64; 2] {
        let mut both = (&mut self.0.0, &mut self.1);
        both.update(tick);
        let mut outputs = [0.0_f64; 2];
        while let Some(frame) = both.next_frame(0) {
            if frame.header() == 0x200 {
                outputs[0] = outputs[0].max(Wheel::<false>::output(&frame));
            } else {
                let [a, b, c, d, ..] = *frame.bytes();
                outputs[1] = outputs[1].max(f64::from(f32::from_le_bytes([a, b, c, d])) / 8.0);
            }
        }
        outputs
    }
    fn conditions(&self) -> [Conditions; 2] {
        let [wheel] = self.0.conditions();
        [wheel, self.1.guard().conditions()]
    }
    fn next_edge(&mut self) -> Option<(usize, Edge<Condition, MotorName>)> {
        let edge = (&mut self.0.0, &mut self.1).next_edge()?;
        Some((usize::from(edge.source.model() != "M3508"), edge))
    }
    fn command(&self, motor: usize) -> Option<CanFrame> {
        let own = embedded_can::StandardId::new(0x123).unwrap();
        if motor == 0 { self.0.command(0) } else { CanFrame::new(own, &[0; 4]) }
    }
    fn second_master(&self) -> [Option<Claim>; 2] {
        let [wheel] = self.0.second_master();
        [wheel, CanDevice::second_master(&self.1)]
    }
}
