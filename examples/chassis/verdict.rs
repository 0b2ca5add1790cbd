//! What a drive in a mode came to, in figures, and whether that is what the mode is for.

use super::modes::{BUFFER_J, Drive, Outcome, ROTOR_RAD_S, Sample};
use drivetrain::chassis::ChassisMode;
use std::fmt::Write as _;

/// The figures, and what is wrong with them.
pub(crate) struct Verdict {
    pub(crate) text: String,
    pub(crate) faults: Vec<String>,
}

impl Verdict {
    pub(crate) fn of(drive: &Drive, outcome: &Outcome) -> Self {
        let mut verdict = Self { text: String::new(), faults: Vec::new() };
        let samples = &outcome.samples;
        match drive.mode {
            ChassisMode::FollowGimbal => verdict.follow(drive, samples),
            ChassisMode::Rotor => verdict.rotor(drive, samples),
            ChassisMode::Independent => verdict.independent(samples),
            ChassisMode::Relax => verdict.relax(samples),
        }
        verdict.motion(samples);
        verdict.power(drive, outcome);
        verdict
    }

    fn demand(&mut self, holds: bool, what: &str) {
        if !holds {
            self.faults.push(what.to_owned());
        }
    }

    /// The chassis faces as the gimbal does, but for a second after the gimbal turned.
    fn follow(&mut self, drive: &Drive, samples: &[Sample]) {
        let turns = drive.seconds / 3.0;
        let settled = samples.iter().filter(|s| !(turns..turns + 1.5).contains(&s.time_s));
        let off = largest(settled.map(|s| s.heading_deg - s.gimbal_deg));
        _ = writeln!(self.text, "follow       {off:.1} degrees from the gimbal at most, settled");
        self.demand(off < 4.0, "the chassis does not follow the gimbal");
    }

    /// It spins, always the same way, and still goes where the gimbal looks.
    fn rotor(&mut self, drive: &Drive, samples: &[Sample]) {
        let spinning = || samples.iter().filter(|s| s.time_s > 1.0).map(|s| s.wz_rad_s);
        let mean = spinning().sum::<f32>() / spinning().count().max(1) as f32;
        let slowest = spinning().fold(f32::MAX, f32::min);
        _ = writeln!(self.text, "rotor        {mean:.2} rad/s on average, {slowest:.2} at least");
        self.demand(slowest > 0.0, "the rotor stopped or turned around");
        // A power limit slows the rotor, too.
        let floor = if drive.power_limit_w.is_some() { 0.3 } else { 0.9 };
        self.demand(mean > floor * ROTOR_RAD_S, "the rotor is too slow");
    }

    /// The gimbal turns, and the chassis does not care.
    fn independent(&mut self, samples: &[Sample]) {
        let off = largest(samples.iter().map(|s| s.heading_deg));
        _ = writeln!(self.text, "independent  {off:.1} degrees off its own heading at most");
        self.demand(off < 4.0, "the chassis turned");
    }

    /// From half-time on no motor is told anything.
    fn relax(&mut self, samples: &[Sample]) {
        let relaxed = || samples.iter().filter(|s| s.acting == ChassisMode::Relax);
        let loud = relaxed().filter(|s| !s.is_quiet).count();
        let since = relaxed().next().map_or(0.0, |s| s.time_s);
        _ = writeln!(
            self.text,
            "relax        from {since:.2} s on, {loud} ms of them with a current"
        );
        self.demand(relaxed().count() > 100 && loud == 0, "a relaxed motor was driven");
    }

    fn motion(&mut self, samples: &[Sample]) {
        let speed = largest(samples.iter().map(|s| s.speed_m_s));
        let way: f32 = samples.iter().map(|s| s.speed_m_s * 1e-3).sum();
        _ = writeln!(self.text, "motion       {way:.2} m driven, {speed:.2} m/s at most");
        self.demand(way > 1.0, "the robot hardly moved");
    }

    /// The referee cuts the supply when the buffer is empty.
    fn power(&mut self, drive: &Drive, outcome: &Outcome) {
        let samples = &outcome.samples;
        let peak = samples.iter().map(|s| s.power_w).fold(f32::MIN, f32::max);
        let mean = samples.iter().map(|s| s.power_w).sum::<f32>() / samples.len().max(1) as f32;
        _ = writeln!(self.text, "power        {mean:.1} W on average, {peak:.0} W at most");
        let Some(limit_w) = drive.power_limit_w else { return };
        let lowest = samples.iter().map(|s| s.buffer_j).fold(BUFFER_J, f32::min);
        let cut = samples.iter().filter(|s| s.scale < 1.0).count();
        _ = writeln!(
            self.text,
            "limit        {limit_w:.0} W; the buffer of {BUFFER_J:.0} J fell to {lowest:.1} J; outputs cut for {cut} ms"
        );
        _ = writeln!(self.text, "fitted       {:.3?}", outcome.fitted);
        self.demand(lowest > 0.0, "the referee's buffer ran empty");
    }
}

fn largest(values: impl Iterator<Item = f32>) -> f32 {
    values.fold(0.0, |largest, value| largest.max(value.abs()))
}
