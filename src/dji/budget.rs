//! How full the bus is.

use super::{Bus, CommandFrame};
use crate::motor::BusLoad;

/// What the load is reckoned with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    bit_rate: u32,
    pub(super) feedback_hz: u32,
    tick_hz: u32,
    pub(super) ceiling_percent: Option<u16>,
}

impl Budget {
    pub(super) const fn new() -> Self {
        Self { bit_rate: 1_000_000, feedback_hz: 1_000, tick_hz: 1_000, ceiling_percent: None }
    }

    const fn load(&self, motors: u32, commands: u32) -> BusLoad {
        BusLoad::new(self.bit_rate)
            .with_frames(motors, self.feedback_hz)
            .with_frames(commands, self.tick_hz)
    }

    /// Returns the highest feedback rate that fits below a ceiling beside the commands.
    const fn feedback_within(&self, percent: u16, motors: u32, commands: u32) -> u32 {
        let fits = BusLoad::new(self.bit_rate).frames_within(percent as f32 / 100.0);
        let left = fits.saturating_sub(self.tick_hz.saturating_mul(commands));
        let motors = if motors == 0 { 1 } else { motors };
        left / motors
    }
}

/// The load of the bus. Feedback and commands alone: leave room for what else talks on it.
///
/// # What starves on a full bus
/// The lowest id wins. The commands 0x1FE, 0x1FF and 0x200 win over all feedback (0x201 to 0x20B), but **0x2FE and
/// 0x2FF, the commands of GM6020 #5..=7, lose to it**: on a bus that feedback alone fills, those motors never get a
/// new command and may go on with the last one. After them, the highest feedback ids starve first. So give a GM6020 an id
/// of 1..=4 on a bus that is nearly full.
impl<B> Bus<B> {
    /// Sets the bit rate, in bits a second, for [`load`](Self::load); 1 000 000 at first.
    #[must_use]
    pub const fn with_bit_rate(mut self, bits_per_s: u32) -> Self {
        self.budget.bit_rate = bits_per_s;
        self
    }

    /// Sets the rate of each motor's feedback in Hz, for [`load`](Self::load); 1000 at first.
    ///
    /// The rate itself is set in the ESCs, with RoboMaster Assistant.
    #[must_use]
    pub const fn with_feedback_rate(mut self, hz: u32) -> Self {
        self.budget.feedback_hz = hz;
        self
    }

    /// Sets the rate of updates in Hz, for [`load`](Self::load); 1000 at first.
    #[must_use]
    pub const fn with_tick_rate(mut self, hz: u32) -> Self {
        self.budget.tick_hz = hz;
        self
    }

    /// Has [`attach`](Self::attach) refuse a motor with which the worst case of the load would exceed `ceiling`, to
    /// whole percent; 1 is a full bus. There is none at first. Set rates before, and attach after.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// let mut bus = Bus::new().with_load_ceiling(0.95);
    /// bus.attach_all([1, 2, 3, 4, 5].map(Config::<M3508>::new))?;
    /// let refused = bus.attach(Config::<M3508>::new(6)).map_err(|error| error.to_string());
    /// let why = "M3508 #6: the bus load of up to 108 % is above its ceiling of 95 %; \
    ///     feedback at 839 Hz fits, or a second bus";
    /// assert_eq!(refused.err().as_deref(), Some(why));
    /// # Ok::<(), drivetrain::dji::AttachError>(())
    /// ```
    #[must_use]
    pub const fn with_load_ceiling(mut self, ceiling: f32) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, NaN gives 0: nothing can be attached"
        )]
        let percent = (ceiling * 100.0 + 0.5) as u16;
        self.budget.ceiling_percent = Some(percent);
        self
    }

    /// Returns the load of the attached motors' feedback and of the command frames in use, when each of these goes out
    /// with every update.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// let mut bus = Bus::new();
    /// bus.attach_all([1, 2, 3, 4].map(Config::<M3508>::new))?;
    /// assert_eq!(bus.load().to_string(), "56 % to 68 %"); // four feedback frames and one command
    /// bus.attach_all([5, 6].map(Config::<M3508>::new))?;
    /// assert_eq!(bus.load().to_string(), "89 % to 108 %");
    /// bus.attach_all([7, 8].map(Config::<M3508>::new))?;
    /// assert_eq!(bus.load().to_string(), "111 % to 135 %");
    /// assert_eq!(bus.with_feedback_rate(500).load().to_string(), "67 % to 81 %");
    /// # Ok::<(), drivetrain::dji::AttachError>(())
    /// ```
    #[must_use]
    pub const fn load(&self) -> BusLoad {
        self.budget.load(self.motor_count(), self.outbox.frames_in_use())
    }

    /// Returns the load with one more motor, when it is above the ceiling: with that, and the feedback rate that fits.
    pub(super) const fn overload(&self, frame: CommandFrame) -> Option<(BusLoad, u16, u32)> {
        let Some(ceiling) = self.budget.ceiling_percent else { return None };
        let motors = self.motor_count() + 1;
        let commands = self.outbox.frames_in_use_with(frame);
        let load = self.budget.load(motors, commands);
        if load.worst_percent() <= ceiling as u32 {
            return None;
        }
        Some((load, ceiling, self.budget.feedback_within(ceiling, motors, commands)))
    }

    const fn motor_count(&self) -> u32 {
        let mut slots = self.slots.as_slice();
        let mut count = 0;
        while let [slot, rest @ ..] = slots {
            if slot.facts().is_some() {
                count += 1;
            }
            slots = rest;
        }
        count
    }
}
