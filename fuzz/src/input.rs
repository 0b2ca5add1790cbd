use crate::motors::Target;
use drivetrain::frame::CanFrame;
use embedded_can::{ExtendedId, Frame, StandardId};

/// The fuzzer's bytes, read as values until there are none left.
#[derive(Debug)]
pub struct Input<'a>(pub &'a [u8]);

impl Input<'_> {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How many good frames bring a motor back: the usual ten, or one. The last byte tells, which is also read in its turn.
    pub fn good_frames(&self) -> u8 {
        if self.0.last().is_some_and(|last| last % 2 == 1) { 1 } else { 10 }
    }

    /// The next byte; 0 after the last.
    pub fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    pub fn bytes<const N: usize>(&mut self) -> [u8; N] {
        core::array::from_fn(|_| self.byte())
    }

    /// One time in two.
    pub fn coin(&mut self) -> bool {
        self.byte().is_multiple_of(2)
    }

    /// Any bits, or, more often than chance would have it, a value of ordinary size.
    pub fn float(&mut self) -> f32 {
        match self.byte() {
            kind @ 0..=199 => {
                let value = f32::from(i16::from_le_bytes(self.bytes()));
                value * [1e-6, 1e-4, 0.01, 1.0][usize::from(kind % 4)]
            }
            200..=207 => 0.0,
            208..=211 => f32::NAN,
            212..=215 => f32::INFINITY,
            216..=219 => f32::MAX,
            220..=223 => f32::MIN_POSITIVE,
            _ => {
                let value = f32::from_le_bytes(self.bytes());
                // One NaN is as bad as another, but for the one by which a `Pid` knows that there is no setpoint.
                if value.is_nan() { f32::NAN } else { value }
            }
        }
    }

    /// A value above zero, as most configurations need it.
    pub fn positive(&mut self) -> f32 {
        self.float().abs()
    }

    /// A time step: 1 ms as a rule.
    pub fn step_s(&mut self) -> f32 {
        match self.byte() {
            0..=191 => 0.001,
            192..=223 => f32::from(self.byte()) * 0.001,
            _ => self.float(),
        }
    }

    /// Any frame, as a rule one that a motor could have sent.
    pub fn frame(&mut self) -> Option<CanFrame> {
        let (form, id, length) = (self.byte(), self.byte(), self.byte());
        let data: [u8; 8] = self.bytes();
        match form {
            0..=191 => {
                let [high, rest @ ..] = data;
                let [a, b, c, d, e, f, g] = rest;
                // Now and then the first angle that is none.
                let [high, a] = if form < 8 { [0x20, 0] } else { [high & 0x1F, a] };
                CanFrame::standard(0x201 + u16::from(id % 11), [high, a, b, c, d, e, f, g])
            }
            _ => {
                let number = match id {
                    0..=127 => 0x1F0 + u16::from(id % 32),
                    _ => u16::from_be_bytes([id & 7, length]),
                };
                let data = &data[..usize::from(length % 9)];
                let (short, long) = (StandardId::new(number)?, ExtendedId::new(number.into())?);
                match form % 4 {
                    0 | 1 => CanFrame::new(short, data),
                    2 => CanFrame::new_remote(short, data.len()),
                    _ => CanFrame::new(long, data),
                }
            }
        }
    }

    pub fn target(&mut self) -> Target {
        match self.byte() % 8 {
            0 | 1 => Target::Output(self.float()),
            2 => Target::Raw(i16::from_le_bytes(self.bytes())),
            3..=5 => Target::Velocity(self.float()),
            6 => Target::Angle(self.float()),
            _ => Target::Turns(i64::from_le_bytes(self.bytes()), self.float()),
        }
    }
}
