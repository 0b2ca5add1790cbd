use core::fmt::Debug;
use drivetrain::control::{Pid, PositionActuator, SpeedActuator};

/// What can start anew, from rest or from an output that another has held.
pub trait Restart {
    fn reset(&mut self);
    fn reset_to(&mut self, output: f32);
    fn output(&self) -> f32;
}

macro_rules! restart {
    ($($controller:ty),*) => {$(
        impl Restart for $controller {
            fn reset(&mut self) {
                Self::reset(self);
            }

            fn reset_to(&mut self, output: f32) {
                Self::reset_to(self, output);
            }

            fn output(&self) -> f32 {
                Self::output(self)
            }
        }
    )*};
}

restart!(Pid, SpeedActuator, PositionActuator);

/// A controller or filter under observation, beside a copy that never sees what was refused.
#[derive(Debug)]
pub struct Observed<C> {
    controller: C,
    clean: C,
    output: f32,
    /// The next good step may differ from that of the copy.
    differs: bool,
}

impl<C: Copy + Debug> Observed<C> {
    pub fn new(controller: C) -> Self {
        Self { controller, clean: controller, output: 0.0, differs: false }
    }

    pub fn get(&self) -> &C {
        &self.controller
    }

    /// Does the same to both: a reset, a new output.
    pub fn change(&mut self, mut work: impl FnMut(&mut C) -> f32) {
        self.output = work(&mut self.controller);
        assert_eq!(self.output.to_bits(), work(&mut self.clean).to_bits());
    }

    /// Starts the copy anew from the controller: where a refused step is allowed to show.
    pub fn forgive(&mut self) {
        self.clean = self.controller;
        self.differs = false;
    }

    /// Resets, and lets the copy be a new one from now on, which has to do the same: nothing of before is left (I9).
    pub fn reset(&mut self, fresh: C, work: impl FnMut(&mut C) -> f32) {
        self.change(work);
        self.clean = fresh;
        self.differs = false;
    }

    pub fn differs(&self) -> bool {
        self.differs
    }

    /// Lets the next good step differ: time passed with a sample that was refused, and D rests.
    pub fn rests(&mut self) {
        self.differs = true;
    }

    /// Steps, and checks what holds for any bits: the output is finite and, of a step that was taken, within `range`; a step that
    /// is refused gives the output before and changes nothing (I5); the copy gives the same, bit for bit (I10). Tells whether it was taken.
    pub fn step(
        &mut self,
        range: (f32, f32),
        rejected: impl Fn(&C) -> u16,
        work: impl FnMut(&mut C) -> f32,
    ) -> bool {
        self.step_counted(range, false, rejected, work)
    }

    /// As [`step`](Self::step), of a controller that also counts good steps whose time is too long for the integral: `is_left_out`.
    pub fn step_counted(
        &mut self,
        range: (f32, f32),
        is_left_out: bool,
        rejected: impl Fn(&C) -> u16,
        mut work: impl FnMut(&mut C) -> f32,
    ) -> bool {
        let before = rejected(&self.controller);
        let mut same = self.controller;
        let output = work(&mut self.controller);
        assert_eq!(output.to_bits(), work(&mut same).to_bits(), "I10: {self:?}");
        let taken = is_left_out || rejected(&self.controller) == before;
        let (lower, upper) = range;
        let within = !taken || lower <= output && output <= upper;
        assert!(output.is_finite() && within, "I2: {output} of {self:?}");
        if !taken {
            assert_eq!(output, self.output, "I5: a refused step changes the output: {self:?}");
        } else if self.differs {
            self.forgive();
        } else {
            let clean = work(&mut self.clean);
            assert_eq!(output.to_bits(), clean.to_bits(), "I5: what was refused shows: {self:?}");
        }
        self.output = output;
        taken
    }
}

impl<C: Copy + Debug + Restart> Observed<C> {
    pub fn restart(&mut self, fresh: C) {
        self.reset(fresh, |controller| {
            controller.reset();
            controller.output()
        });
    }

    pub fn restart_at(&mut self, output: f32) {
        self.change(|controller| {
            controller.reset_to(output);
            controller.output()
        });
    }
}
