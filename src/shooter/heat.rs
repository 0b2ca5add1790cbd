use crate::wire::referee::BarrelHeat;

/// Heat of the barrel: the larger of the referee system's report and of the sum over released shots.
///
/// Heat of a shot counted twice cools down like any other. Heat of a missed shot is in the next report.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Heat {
    heat: f32,
    limit: Option<u16>,
}

impl Heat {
    pub(super) const fn new() -> Self {
        Self { heat: 0.0, limit: None }
    }

    /// Cools for `dt_s` seconds, and takes a report. Without a report, limit and cooling are those of `without`.
    pub(super) fn update(
        &mut self,
        report: Option<BarrelHeat>,
        without: Option<BarrelHeat>,
        dt_s: f32,
    ) {
        let source = report.or(without);
        self.limit = source.map(|source| source.limit);
        let cooling = source.map_or(0.0, |source| f32::from(source.cooling_per_s));
        self.heat = (self.heat - cooling * dt_s).max(0.0);
        if let Some(report) = report {
            self.heat = self.heat.max(f32::from(report.heat));
        }
    }

    /// Adds the heat of a shot if the sum and the reserve are at most the limit. Returns whether the heat was added.
    pub(super) fn take(&mut self, of_shot: u16, reserve: u16) -> bool {
        let after = self.heat + f32::from(of_shot);
        let fits = self.limit.is_some_and(|limit| after + f32::from(reserve) <= f32::from(limit));
        if fits {
            self.heat = after;
        }
        fits
    }

    pub(super) const fn get(&self) -> f32 {
        self.heat
    }
}
