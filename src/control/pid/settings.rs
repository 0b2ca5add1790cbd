use super::config::PidConfig;
use super::gate::{CLOSED, gate, limit_of, open_gate};

const ASYMMETRIC: u16 = 1;
const INTEGRAL_WEIGHT: u16 = 1 << 1;
const DEAD_BAND: u16 = 1 << 2;
pub(super) const FEED_FORWARD: u16 = 1 << 3;
pub(super) const SLEW_LIMIT: u16 = 1 << 4;
pub(super) const CIRCLE: u16 = 1 << 5;
pub(super) const DERIVATIVE_FILTER: u16 = 1 << 6;
pub(super) const DERIVATIVE_ON_ERROR: u16 = 1 << 7;
/// The options that the plain path does not know.
pub(super) const NOT_PLAIN: u16 = 0xFF;
pub(super) const WIND_UP: u16 = 1 << 8;
/// Set by a refused sample until the next good step: how far the measurement came in that time is not known.
pub(super) const REST_DERIVATIVE: u16 = 1 << 9;
/// Set by `reset_to` until the first step after it.
pub(super) const TRACK_OUTPUT: u16 = 1 << 10;
pub(super) const BACK_CALCULATION: u16 = 1 << 11;

/// A [`PidConfig`] in the form in which a step reads it, and no larger: what is on or off is in the options.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub(super) struct Settings {
    /// Closed while an option is on.
    pub(super) integral_gate: u32,
    /// Of the output; while an option is on, of half the period.
    pub(super) output_gate: u32,
    pub(super) kp: f32,
    pub(super) ki: f32,
    pub(super) kd: f32,
    pub(super) output_lower: f32,
    pub(super) output_upper: f32,
    pub(super) integral_limit_gate: u32,
    /// The smaller one of `integral_separation` and `full_rate_below`.
    pub(super) full_weight_gate: u32,
    /// The larger one: the separation; or the full rate, negative, so that every error is beyond it.
    pub(super) other_edge: f32,
    pub(super) no_rate_above: f32,
    pub(super) dead_band_gate: u32,
    pub(super) static_gain: f32,
    pub(super) velocity_gain: f32,
    pub(super) slew_per_s: f32,
    pub(super) derivative_time_s: f32,
    pub(super) tracking_time_s: f32,
}

impl Settings {
    /// Takes a configuration that was checked, and its options.
    pub(super) const fn new(config: &PidConfig, options: u16) -> Self {
        let (separation, full_rate) = (config.integral_separation, config.full_rate_below);
        let inside = separation < full_rate;
        let plain = options & NOT_PLAIN == 0;
        Self {
            integral_gate: if plain { gate(config.integral_limit) } else { CLOSED },
            output_gate: if plain {
                gate(config.output_upper)
            } else {
                open_gate(0.5 * config.period)
            },
            kp: config.kp,
            ki: config.ki,
            kd: config.kd,
            output_lower: config.output_lower,
            output_upper: config.output_upper,
            integral_limit_gate: gate(config.integral_limit),
            full_weight_gate: gate(if inside { separation } else { full_rate }),
            other_edge: if inside { -full_rate } else { separation },
            no_rate_above: config.no_rate_above,
            dead_band_gate: open_gate(config.dead_band),
            static_gain: config.static_gain,
            velocity_gain: config.velocity_gain,
            slew_per_s: config.slew_per_s,
            derivative_time_s: config.derivative_time_s,
            tracking_time_s: config.tracking_time_s,
        }
    }

    /// Returns the configuration as it was given.
    pub(super) const fn config(&self, options: u16) -> PidConfig {
        let (first, other) = (limit_of(self.full_weight_gate), self.other_edge);
        let (integral_separation, full_rate_below) =
            if other < 0.0 { (first, -other) } else { (other, first) };
        PidConfig {
            kp: self.kp,
            ki: self.ki,
            kd: self.kd,
            output_lower: self.output_lower,
            output_upper: self.output_upper,
            integral_limit: limit_of(self.integral_limit_gate),
            integral_separation,
            full_rate_below,
            no_rate_above: self.no_rate_above,
            dead_band: limit_of(self.dead_band_gate),
            static_gain: self.static_gain,
            velocity_gain: self.velocity_gain,
            slew_per_s: self.slew_per_s,
            period: if options & CIRCLE != 0 { self.period() } else { 0.0 },
            derivative_time_s: self.derivative_time_s,
            tracking_time_s: self.tracking_time_s,
            derivative_on_error: options & DERIVATIVE_ON_ERROR != 0,
            wind_up: options & WIND_UP != 0,
        }
    }

    /// Opens the plain path again to a controller without options.
    pub(super) const fn reopen(&mut self, options: u16) {
        if options & NOT_PLAIN == 0 {
            self.integral_gate = self.integral_limit_gate;
        }
    }

    /// Returns the period, on a circle.
    #[inline]
    pub(super) const fn period(&self) -> f32 {
        2.0 * limit_of(self.output_gate)
    }

    /// Returns the period with the sign of `way`, on a circle.
    #[inline]
    pub(super) const fn period_towards(&self, way: f32) -> f32 {
        const SIGN: u32 = 1 << 31;
        const DOUBLED: u32 = 1 << 23; // one more in the exponent
        f32::from_bits((way.to_bits() & SIGN | self.output_gate >> 1) + DOUBLED)
    }
}

impl PidConfig {
    /// Returns the options that are in use.
    pub(super) const fn options(&self) -> u16 {
        const OFF: f32 = PidConfig::OFF;
        const fn set(option: u16, is_on: bool) -> u16 {
            if is_on { option } else { 0 }
        }
        set(DERIVATIVE_ON_ERROR, self.derivative_on_error)
            | set(INTEGRAL_WEIGHT, self.integral_separation < OFF || self.no_rate_above < OFF)
            | set(DEAD_BAND, self.dead_band > 0.0)
            | set(FEED_FORWARD, self.static_gain > 0.0 || self.velocity_gain > 0.0)
            | set(SLEW_LIMIT, self.slew_per_s < OFF)
            | set(CIRCLE, self.period > 0.0)
            | set(DERIVATIVE_FILTER, self.derivative_time_s > 0.0)
            | set(ASYMMETRIC, self.output_lower + self.output_upper != 0.0)
            | set(WIND_UP, self.wind_up)
            | set(BACK_CALCULATION, self.tracking_time_s > 0.0 && self.ki > 0.0)
    }
}
