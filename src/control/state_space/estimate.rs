use super::system::LinearSystem;
use crate::control::matrix::{Grid, apply, is_finite};
use crate::control::wide::Wide;

/// The estimated states of an observer, in twice the precision of `f32`, and the steps that it refused.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Estimate<const N: usize> {
    states: [Wide; N],
    rejected: u16,
}

impl<const N: usize> Estimate<N> {
    pub(super) const ZERO: Self = Self { states: [Wide::ZERO; N], rejected: 0 };

    pub(super) fn set(&mut self, states: &[f32; N]) {
        self.states = states.map(Wide::of);
    }

    /// Returns the states after one time step.
    pub(super) fn predicted<const M: usize>(
        &self,
        plant: &LinearSystem<N, M>,
        u: &[f32; M],
    ) -> [Wide; N] {
        plant.predict_exactly(&self.states, u)
    }

    /// Returns the states, moved by the gain towards a measurement.
    #[inline]
    pub(super) fn corrected<const P: usize>(
        &self,
        c: &Grid<Wide, P, N>,
        gain: &Grid<Wide, N, P>,
        y: &[f32; P],
    ) -> [Wide; N] {
        let mut residual = y.map(Wide::of);
        for (residual, expected) in residual.iter_mut().zip(apply(c, &self.states)) {
            *residual = *residual - expected;
        }
        let mut result = self.states;
        for (state, change) in result.iter_mut().zip(apply(gain, &residual)) {
            *state = *state + change;
        }
        result
    }

    /// Takes states that are finite, and counts others. Returns whether the states were taken.
    pub(super) fn take(&mut self, states: Option<[Wide; N]>) -> bool {
        let taken = states.filter(|states| is_finite(&[*states]));
        match taken {
            Some(states) => self.states = states,
            None => self.rejected = self.rejected.saturating_add(1),
        }
        taken.is_some()
    }

    pub(super) fn states(&self) -> [f32; N] {
        self.states.map(Wide::narrow)
    }

    pub(super) const fn rejected(&self) -> u16 {
        self.rejected
    }
}
