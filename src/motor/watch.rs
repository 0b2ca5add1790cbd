use super::{
    Condition, Conditions, Guard, Health, HealthConfig, Link, Monitor, MotorName, Sample, Traffic,
    Vitals, elapsed,
};
use crate::time::{Duration, Instant};

/// What is looked for in an own motor unless it says otherwise.
static USUAL: HealthConfig = HealthConfig::new();

/// So long after another node sent the command frame it is forgotten.
const RIVAL_FORGOTTEN: Duration = Duration::from_secs(1);

/// What changes slowly is looked at this often.
const PERIOD: Duration = Duration::from_millis(8);

/// Frames are counted for this long.
const WINDOW: Duration = Duration::from_secs(1);

/// Looks after one motor that is no DJI motor's slot: counts its frames, and looks at what it tells of itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Watch {
    config: &'static HealthConfig,
    monitor: Monitor,
    traffic: Traffic,
    window_from: Instant,
    rival: Option<Instant>,
    saturated: u16,
    error_code: u8,
    looked: Instant,
    /// The time of the next look at what changes slowly.
    next: Instant,
    /// What is left of the output.
    share: f32,
}

impl Watch {
    pub(crate) const fn new() -> Self {
        Self {
            config: &USUAL,
            monitor: Monitor::NEW,
            traffic: Traffic::NONE,
            window_from: Instant::START,
            rival: None,
            saturated: 0,
            error_code: 0,
            looked: Instant::START,
            next: Instant::START,
            share: 1.0,
        }
    }

    pub(crate) fn with_config(self, config: &'static HealthConfig) -> Result<Self, &'static str> {
        config.validate()?;
        Ok(Self { config, ..self })
    }

    /// Feedback came; the guard has not heard of it yet.
    #[inline]
    pub(crate) fn hear(&mut self, guard: &Guard, now: Instant) {
        match guard.gap_us(now) {
            Some(gap_us) => self.traffic.gap(gap_us),
            None => self.window_from = now,
        }
        self.traffic.count();
    }

    /// Another node sent the command frame.
    pub(crate) fn hear_rival(&mut self, now: Instant) {
        if !self.config.ignores(Condition::SecondMaster) {
            self.rival = Some(now);
        }
    }

    pub(crate) const fn has_rival(&self) -> bool {
        self.rival.is_some()
    }

    /// Tells whether the motor must not be armed.
    pub(crate) fn is_faulty(&self, guard: &Guard) -> bool {
        let fault = Conditions::NONE.with(Condition::Fault);
        !guard.conditions().and(fault).and(self.config.relaxing()).is_empty()
    }

    /// The motor is about to be driven.
    pub(crate) fn start(&mut self, guard: &mut Guard, now: Instant) {
        for condition in Monitor::NOTICED_ANEW {
            guard.note(condition, false, now);
        }
        self.monitor = Monitor::NEW;
    }

    /// Looks at the motor, which may be relaxed for what is found; returns the share of the output that it is left with.
    #[inline]
    pub(crate) fn look(
        &mut self,
        guard: &mut Guard,
        vitals: impl Fn() -> Vitals,
        now: Instant,
    ) -> f32 {
        let Vitals { error, error_code, .. } = vitals();
        let is_well = error.is_none()
            && error_code == self.error_code
            && self.rival.is_none()
            && guard.link() == Link::Online
            && guard.conditions().is_empty();
        if is_well && now < self.next {
            return self.share;
        }
        self.look_closely(guard, &vitals(), now)
    }

    #[cold]
    #[inline(never)]
    fn look_closely(&mut self, guard: &mut Guard, vitals: &Vitals, now: Instant) -> f32 {
        let before = guard.conditions();
        self.count_frames(now);
        self.rival = self.rival.filter(|rival| now.since(*rival) <= RIVAL_FORGOTTEN);
        guard.note(Condition::SecondMaster, self.has_rival(), now);
        if guard.link() != Link::Online {
            self.monitor = Monitor::NEW;
        } else {
            self.read_error(guard, vitals, now);
            let since = now.since(self.looked);
            if since >= PERIOD {
                self.looked = now;
                self.next = now + PERIOD;
                self.share = self.look_at(guard, vitals, elapsed(since.micros_u32()), now);
            }
        }
        let begun = guard.conditions().minus(before).and(self.config.relaxing());
        if !begun.is_empty() || self.is_faulty(guard) {
            guard.relax_until_armed();
        }
        self.share
    }

    fn look_at(&mut self, guard: &mut Guard, vitals: &Vitals, elapsed: u8, now: Instant) -> f32 {
        let sample = Sample {
            elapsed,
            fresh: false,
            effort: vitals.effort,
            speed: vitals.speed,
            current: vitals.current,
            word: 0,
            word_change: u8::MAX,
            angle: 0,
            rest: 0,
            temperature: vitals.temperature_c.zip(self.config.temperatures_c()),
        };
        let saturated = guard.is_armed() && vitals.effort.abs() >= 1.0;
        self.saturated = self.saturated.saturating_add(u16::from(saturated));
        let (monitor, config) = (&mut self.monitor, self.config);
        guard.look(now, |latch| monitor.check(latch, &sample, config))
    }

    fn read_error(&mut self, guard: &mut Guard, vitals: &Vitals, now: Instant) {
        let before = core::mem::replace(&mut self.error_code, vitals.error_code);
        let changed = before != vitals.error_code;
        guard.look(now, |latch| latch.report(vitals.error, changed, self.config));
    }

    fn count_frames(&mut self, now: Instant) {
        let window = now.since(self.window_from);
        if window >= WINDOW {
            let units = u16::try_from(window.as_micros() >> 10).unwrap_or(u16::MAX);
            self.traffic.close(units, u32::MAX);
            self.window_from = now;
        }
    }

    pub(crate) fn health(&self, motor: MotorName, guard: &Guard, vitals: &Vitals) -> Health {
        Health {
            feedback_hz: self.traffic.rate_hz(),
            longest_gap: Duration::from_micros(self.traffic.longest_gap_us().into()),
            temperature_c: vitals.temperature_c,
            error_code: vitals.error_code,
            saturated: self.saturated,
            ..guard.health(motor)
        }
    }
}
