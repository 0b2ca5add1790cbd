use super::{Condition, HealthConfig, Latch, Sample, Timer};

/// Looks for a motor that is driven and does not turn, in either direction, and returns the share of the output that it
/// is left with.
///
/// It is over when the motor turns at twice the speed below which it counts as standing, or when half of what it was
/// left with is not asked for.
pub(super) fn check(
    timer: &mut Timer,
    latch: &mut Latch,
    sample: &Sample,
    config: &HealthConfig,
) -> f32 {
    let (effort, speed) = (sample.effort.abs(), sample.speed.abs());
    let stalled = if latch.has(Condition::Stalled) {
        let (pushed, hold) = (config.stall_effort(), config.stall_hold());
        let least = if pushed < hold { pushed } else { hold };
        effort > 0.0 && effort >= 0.5 * least && speed < 2.0 * config.stall_speed()
    } else {
        let holds = effort >= config.stall_effort() && speed <= config.stall_speed();
        timer.run(holds, sample.elapsed) >= config.stall_window() && holds
    };
    latch.set(Condition::Stalled, stalled);
    if stalled { config.stall_hold() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;

    fn sample(effort: f32, speed: f32) -> Sample {
        Sample { effort, speed, elapsed: 10, ..Sample::AT_REST }
    }

    #[test]
    fn a_stall_begins_after_its_window_in_both_directions() {
        let config = HealthConfig::new().with_stall(0.5, 0.02, Duration::from_micros(100 << 10));
        for direction in [1.0, -1.0] {
            let (mut timer, mut latch) = (Timer::ZERO, Latch::NONE);
            let mut look = |effort, speed| {
                check(&mut timer, &mut latch, &sample(effort, speed), &config);
                latch.has(Condition::Stalled)
            };
            assert!(!look(0.9 * direction, 0.5 * direction), "turns");
            for _ in 0..9 {
                assert!(!look(0.5 * direction, -0.02 * direction));
            }
            assert!(look(0.5 * direction, 0.0));
            assert!(look(0.3 * direction, 0.039), "still pushed, still standing");
            assert!(!look(0.3 * direction, 0.04 * direction), "turns");
            for _ in 0..20 {
                assert!(!look(0.49 * direction, 0.0), "pushed too little");
            }
        }
    }

    #[test]
    fn the_held_output_does_not_end_the_stall_by_itself() {
        let config = HealthConfig::new().with_stall_hold(0.1);
        let (mut timer, mut latch) = (Timer::ZERO, Latch::NONE);
        let mut effort = 1.0;
        for _ in 0..100 {
            effort = check(&mut timer, &mut latch, &sample(effort, 0.0), &config);
        }
        assert_eq!((effort, latch.has(Condition::Stalled)), (0.1, true));
        assert!(check(&mut timer, &mut latch, &sample(0.04, 0.0), &config) >= 1.0);
        // A hold of nothing is over at once, and then looked for again.
        let config = HealthConfig::new().with_stall_hold(0.0);
        assert!(check(&mut timer, &mut latch, &sample(0.0, 0.0), &config) >= 1.0);
    }
}
