//! Conditions of the motors of a bus: begin, end, and consequences.

use super::watching::{Bench, CALM, SOUND, Told};
use super::*;
use crate::motor::{Condition, Conditions, HealthConfig, MotorName};
use crate::time::Edge;

fn hear(bus: &mut Bus, id: u16, ms: u64) {
    assert_eq!(bus.ingest(&feedback(id, 0, 0), at_ms(ms)), Ingest::Taken);
}

fn edges(bus: &mut Bus) -> Vec<Edge<Condition, MotorName>> {
    core::iter::from_fn(|| bus.next_edge()).collect()
}

/// The clock may have run for long before there is a bus.
#[test]
fn the_rate_of_feedback_is_that_of_the_last_second() {
    for start in [1_u64, 300_000, 4_294_000] {
        for (period, hz) in [(1, 970..=1_020), (2, 485..=510)] {
            let mut bus = Bus::new();
            let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
            let mut rates = Vec::new();
            for ms in start..start + 3_100 {
                if ms % period == 0 {
                    hear(&mut bus, 0x201, ms);
                }
                step(&mut bus, ms);
                rates.push(bus.health(wheel).map_or(0, |health| health.feedback_hz));
            }
            assert!(rates[..1_000].iter().all(|rate| *rate == 0), "not known before a second");
            let wrong = rates[1_024..].iter().find(|rate| !hz.contains(*rate));
            assert_eq!(wrong, None, "{hz:?} from {start} ms on");
            bus.detach(wheel);
            assert_eq!(bus.health(wheel).map(|health| health.feedback_hz), None);
        }
    }
}

#[test]
fn a_second_master_is_forgotten_a_second_after_its_last_frame_and_not_earlier() {
    let command = CanFrame::standard(0x200, [0; 8]).unwrap();
    // Each motor is looked at in every twelfth tick: in one of these, just as the second ends.
    for offset in 0..12 {
        let (mut bus, [wheel, _, _]) = armed([1, 2, 3].map(Config::<M3508>::at_once));
        let last_ms = 100 + offset;
        let mut ended = Vec::new();
        for ms in 2..1_300 {
            for id in 0x201..=0x203 {
                // They turn, and nothing else is to be looked at.
                let angle = u16::try_from(14 * ms % 8_192).unwrap();
                assert_eq!(bus.ingest(&feedback(id, angle, 100), at_ms(ms)), Ingest::Taken);
            }
            if ms == 50 || ms == last_ms {
                assert_eq!(bus.ingest(&command, at_ms(ms)), Ingest::Unrelated);
            }
            step(&mut bus, ms);
            if ms == last_ms {
                assert_eq!(bus.conditions(wheel), Conditions::NONE.with(Condition::SecondMaster));
            }
            let changed = edges(&mut bus).into_iter();
            ended.extend(changed.filter(|edge| !edge.began).map(|edge| (edge.source.id(), ms)));
        }
        ended.sort_unstable();
        assert_eq!(ended.iter().map(|(id, _)| *id).collect::<Vec<_>>(), [1, 2, 3]);
        for (id, ms) in ended {
            let after = ms - last_ms;
            assert!((1_001..=1_012).contains(&after), "#{id}: {after} ms after {last_ms}");
        }
        assert_eq!(bus.conditions(wheel), Conditions::NONE);
    }
}

/// As from an interrupt that stamps a frame after the tick has read its clock.
#[test]
fn a_second_master_a_little_ahead_of_the_update_stays() {
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
    let command = CanFrame::standard(0x200, [0; 8]).unwrap();
    for ms in 2..100 {
        hear(&mut bus, 0x201, ms);
        assert_eq!(bus.ingest(&command, at_ms(ms) + Duration::from_micros(50)), Ingest::Unrelated);
        step(&mut bus, ms);
        assert!(bus.conditions(wheel).contains(Condition::SecondMaster), "{ms} ms");
    }
}

#[test]
fn a_driver_that_echoes_is_no_second_master() {
    for (bus, expected) in [(Bus::new(), true), (Bus::new().with_loopback(), false)] {
        let mut bus: Bus = bus;
        let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
        hear(&mut bus, 0x201, 1);
        step(&mut bus, 1);
        let own = bus.next_frame().unwrap();
        assert_eq!(bus.ingest(&own, at_ms(2)), Ingest::Unrelated);
        assert_eq!(bus.conditions(wheel).contains(Condition::SecondMaster), expected);
        assert_eq!(bus.second_master().is_some(), expected);
    }
}

#[test]
fn conditions_are_those_of_the_motor_and_none_of_one_that_is_gone() {
    let (mut bus, [quiet, other]) = armed([1, 2].map(Config::<M3508>::at_once));
    for ms in 2..20 {
        hear(&mut bus, 0x202, ms);
        step(&mut bus, ms);
    }
    assert_eq!(bus.conditions(quiet), Conditions::NONE.with(Condition::Late));
    assert_eq!(bus.conditions(other), Conditions::NONE);
    bus.detach(quiet);
    assert_eq!(bus.conditions(quiet), Conditions::NONE);
}

/// With nobody heard there is nothing to look at for as long as the keep-alive lasts.
#[test]
fn a_motor_that_comes_while_all_is_quiet_is_watched_from_its_first_frame() {
    let mut bus: Bus = Bus::new().with_keep_alive(Duration::from_secs(10));
    let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    for ms in 1..100 {
        step(&mut bus, ms);
    }
    hear(&mut bus, 0x201, 100);
    for ms in 100..250 {
        step(&mut bus, ms);
        let link = match ms {
            ..=110 => Link::Online,
            111..=200 => Link::Late,
            _ => Link::Offline,
        };
        assert_eq!(bus.link(wheel), Some(link), "at {ms} ms");
    }
    // It comes back, but not for long enough.
    for ms in 250..400 {
        if ms < 255 {
            hear(&mut bus, 0x201, ms);
        }
        step(&mut bus, ms);
    }
    assert_eq!(bus.link(wheel), Some(Link::Offline));
}

/// The time of a runaway runs against half of the command on, also where a stall is looked for below.
#[test]
fn the_time_against_less_than_half_of_the_command_is_no_part_of_a_runaway() {
    static WEAK: HealthConfig =
        HealthConfig::new().with_stall(0.3, 0.02, Duration::from_millis(200));
    for (weaker, expected) in [(-6_553, SOUND), (-9_830, SOUND.with(Condition::Runaway))] {
        let mut bench = Bench::new(Config::<M3508>::at_once(1).with_health(&WEAK));
        bench.run(50, CALM, 0);
        for ms in 0..220 {
            let raw = if ms < 170 { weaker } else { -9_830 };
            bench.tick(Told { rpm: 200 + 15 * ms, ..CALM }, raw);
        }
        assert_eq!(bench.bus.conditions(bench.motor), expected, "{weaker}");
    }
}
