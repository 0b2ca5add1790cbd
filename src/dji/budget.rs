//! Load of the bus.

use crate::motor::BusLoad;

/// Rates for the computation of the load.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    pub(super) bit_rate: u32,
    pub(super) tick_hz: u32,
    pub(super) ceiling_percent: Option<u16>,
}

impl Budget {
    pub(super) const fn new() -> Self {
        Self { bit_rate: 1_000_000, tick_hz: 1_000, ceiling_percent: None }
    }

    /// Sets the ceiling of the load, a share, to whole percent.
    pub(super) const fn set_ceiling(&mut self, ceiling: f32) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, NaN gives 0: nothing can be attached"
        )]
        let percent = (ceiling * 100.0 + 0.5) as u16;
        self.ceiling_percent = Some(percent);
    }

    pub(super) const fn load(&self, motors: u32, feedback_hz: u32, commands: u32) -> BusLoad {
        BusLoad::new(self.bit_rate)
            .with_frames(motors, feedback_hz)
            .with_frames(commands, self.tick_hz)
    }

    /// Returns the highest feedback rate that fits below a ceiling beside the commands.
    const fn feedback_within(&self, percent: u16, motors: u32, commands: u32) -> u32 {
        let fits = BusLoad::new(self.bit_rate).frames_within(percent as f32 / 100.0);
        let left = fits.saturating_sub(self.tick_hz.saturating_mul(commands));
        let motors = if motors == 0 { 1 } else { motors };
        left / motors
    }

    /// Returns the load, the ceiling and the highest feedback rate that fits, if the load is above the ceiling.
    pub(super) const fn overload(
        &self,
        motors: u32,
        feedback_hz: u32,
        commands: u32,
    ) -> Option<(BusLoad, u16, u32)> {
        let Some(ceiling) = self.ceiling_percent else { return None };
        let load = self.load(motors, feedback_hz, commands);
        if load.worst_percent() <= ceiling as u32 {
            return None;
        }
        Some((load, ceiling, self.feedback_within(ceiling, motors, commands)))
    }
}
