use core::fmt::Debug;

/// A controller or filter under observation, beside a copy that never sees what was refused.
#[derive(Debug)]
pub struct Observed<C> {
    controller: C,
    clean: C,
    output: f32,
}

impl<C: Copy + Debug> Observed<C> {
    pub fn new(controller: C) -> Self {
        Self { controller, clean: controller, output: 0.0 }
    }

    pub fn get(&self) -> &C {
        &self.controller
    }

    /// Does the same to both: a reset, a change of gains.
    pub fn change(&mut self, mut work: impl FnMut(&mut C) -> f32) {
        self.output = work(&mut self.controller);
        assert_eq!(self.output.to_bits(), work(&mut self.clean).to_bits());
    }

    /// Starts the copy anew from the controller: where a refused step is allowed to show.
    pub fn forgive(&mut self) {
        self.clean = self.controller;
    }

    /// Steps, and checks what holds for any bits: the output is finite and within `range`; a step that is refused gives
    /// the output before and changes nothing (I5); the copy gives the same, bit for bit (I10).
    pub fn step(
        &mut self,
        range: (f32, f32),
        rejected: impl Fn(&C) -> u16,
        mut work: impl FnMut(&mut C) -> f32,
    ) -> f32 {
        let before = rejected(&self.controller);
        let output = work(&mut self.controller);
        let (lower, upper) = range;
        assert!(output.is_finite() && lower <= output && output <= upper, "{output} of {self:?}");
        if rejected(&self.controller) == before {
            let clean = work(&mut self.clean);
            assert_eq!(output.to_bits(), clean.to_bits(), "what was refused shows: {self:?}");
        } else {
            assert_eq!(output, self.output, "a refused step changes the output: {self:?}");
        }
        self.output = output;
        output
    }
}
