//! Devices made of devices: each reason to refuse, in each of the parts.

use crate::own::{Mine, faulty, healthy, own, rival};
use crate::{PAUSE_MS, RIVAL_MS, at_ms};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Devices;
use drivetrain::motor::{Actuator, ArmError, Condition, Ingest, TargetError, VelocityDrive};
use drivetrain::time::Tick;
use drivetrain::units::AngularVelocity;

/// Motors of one's own with the numbers from 1 on, combined in some way.
struct Bench<D> {
    device: D,
    count: u8,
    part: fn(&mut D, u8) -> &mut Actuator<Mine>,
    ms: u64,
}

impl<D: Devices> Bench<D> {
    fn numbers(&self) -> impl Iterator<Item = u8> + use<D> {
        1..=self.count
    }

    /// A millisecond in which each motor sends what it is given, and one that is given nothing is silent.
    fn step(&mut self, feedback: impl Fn(u8) -> Option<CanFrame>) {
        self.ms += 1;
        for frame in self.numbers().filter_map(feedback) {
            assert_eq!(self.device.ingest(&frame, at_ms(self.ms)), Ingest::Taken);
        }
        self.device.update(Tick::new(at_ms(self.ms), 0.001));
        while self.device.next_frame(0).is_some() {}
    }

    fn wait(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.step(|number| Some(healthy(number))));
    }

    fn arm(&mut self) -> Result<(), String> {
        self.device.arm(at_ms(self.ms)).map_err(|error| error.to_string())
    }

    fn armed(&mut self) -> Vec<bool> {
        let part = self.part;
        let armed = self.numbers().map(|number| part(&mut self.device, number).guard().is_armed());
        let armed: Vec<bool> = armed.collect();
        assert_eq!(self.device.is_armed(), armed.iter().all(|armed| *armed), "{armed:?}");
        armed
    }

    /// Nothing is armed, takes a target or is driven.
    fn assert_rests(&mut self, case: &str) {
        assert!(self.armed().iter().all(|armed| !armed), "{case}");
        let part = self.part;
        for number in self.numbers() {
            let motor = part(&mut self.device, number);
            let outcome = motor.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
            assert_eq!(outcome, Err(TargetError::Disarmed), "{case}");
        }
        self.wait(2);
        for number in self.numbers() {
            assert_eq!(part(&mut self.device, number).motor().runs, 0, "{case}");
        }
    }

    /// Every change of a motor that was not read yet.
    fn edges(&mut self) -> Vec<(u8, Condition, bool)> {
        let edges = std::iter::from_fn(|| self.device.next_edge());
        edges.map(|edge| (edge.source.id(), edge.condition, edge.began)).collect()
    }

    fn drive(&mut self) {
        let part = self.part;
        for number in self.numbers() {
            _ = part(&mut self.device, number)
                .set_velocity((), AngularVelocity::from_rad_per_s(1.0));
        }
    }

    /// Everything is armed, and every part is driven.
    fn assert_runs(&mut self, case: &str) {
        assert!(self.armed().iter().all(|armed| *armed), "{case}");
        let part = self.part;
        for number in self.numbers() {
            let motor = part(&mut self.device, number);
            motor.set_velocity((), AngularVelocity::from_rad_per_s(1.0)).unwrap();
        }
        self.wait(2);
        for number in self.numbers() {
            assert!(part(&mut self.device, number).motor().runs > 0, "{case}");
        }
    }
}

/// Checks one combination in every way.
fn check<D: Devices>(
    name: &str,
    count: u8,
    make: fn() -> D,
    part: fn(&mut D, u8) -> &mut Actuator<Mine>,
) {
    let new = || Bench { device: make(), count, part, ms: 1_000 };
    for number in 1..=count {
        let case = |why: &str| format!("{name}: {why} in part {number}");
        missing(new(), number, &case("a silent motor"));
        unheard(new(), number, &case("a motor that was never heard"));
        second_master(new(), number, &case("a second master"));
        fault(new(), number, &case("a fault"));
        tripped(new(), number, &case("a fault while it runs"));
        stopped(new(), number, &case("a stop"));
        one_is_disarmed(new(), number, &case("disarmed"));
    }
    stop_of_all(new(), name);
    disarm_of_all(new(), name);
}

fn unheard<D: Devices>(mut bench: Bench<D>, number: u8, case: &str) {
    bench.step(|other| (other != number).then(|| healthy(other)));
    assert_eq!(bench.arm(), Err(format!("no feedback from mine #{number}")), "{case}");
    bench.assert_rests(case);
    bench.wait(PAUSE_MS);
    assert_eq!(bench.arm(), Ok(()), "{case}");
    bench.assert_runs(case);
}

fn missing<D: Devices>(mut bench: Bench<D>, number: u8, case: &str) {
    bench.wait(20);
    for _ in 0..11 {
        bench.step(|other| (other != number).then(|| healthy(other)));
    }
    assert_eq!(bench.arm(), Err(format!("no feedback from mine #{number}")), "{case}");
    bench.assert_rests(case);
    bench.wait(PAUSE_MS);
    assert_eq!(bench.arm(), Ok(()), "{case}");
    bench.assert_runs(case);
}

fn second_master<D: Devices>(mut bench: Bench<D>, number: u8, case: &str) {
    bench.wait(20);
    assert_eq!(bench.device.ingest(&rival(number), at_ms(bench.ms)), Ingest::Unrelated, "{case}");
    let refused = format!(
        "another node sends the command of mine #{number} on 0x{:X}",
        0x100 + u16::from(number)
    );
    assert_eq!(bench.arm(), Err(refused), "{case}");
    bench.assert_rests(case);
    bench.wait(RIVAL_MS);
    assert_eq!(bench.arm(), Ok(()), "{case}");
    bench.assert_runs(case);
}

fn fault<D: Devices>(mut bench: Bench<D>, number: u8, case: &str) {
    bench.wait(20);
    bench.step(|other| Some(if other == number { faulty(other) } else { healthy(other) }));
    assert_eq!(
        bench.arm(),
        Err(format!("not fit to be driven, see health(): mine #{number} (ESC fault)")),
        "{case}"
    );
    bench.assert_rests(case);
    bench.wait(PAUSE_MS);
    assert_eq!(bench.arm(), Ok(()), "{case}");
    bench.assert_runs(case);
}

/// The others run on, and the whole does not count as armed.
fn tripped<D: Devices>(mut bench: Bench<D>, number: u8, case: &str) {
    bench.wait(20);
    bench.arm().unwrap();
    bench.assert_runs(case);
    bench.step(|other| Some(if other == number { faulty(other) } else { healthy(other) }));
    let expected: Vec<bool> = bench.numbers().map(|other| other != number).collect();
    assert_eq!(bench.armed(), expected, "{case}");
    assert_eq!(bench.edges(), [(number, Condition::Fault, true)], "{case}");
    assert_eq!(
        bench.arm(),
        Err(format!("not fit to be driven, see health(): mine #{number} (ESC fault)")),
        "{case}"
    );
    bench.step(|other| Some(healthy(other)));
    assert_eq!(bench.edges(), [(number, Condition::Fault, false)], "{case}");
    for _ in 0..PAUSE_MS {
        bench.drive();
        bench.step(|other| Some(healthy(other)));
    }
    assert_eq!(bench.armed(), expected, "{case}: it waits to be armed");
    assert_eq!(bench.arm(), Ok(()), "{case}");
    bench.assert_runs(case);
}

// A combination that counted as stopped only when all of its parts are was armed around the one that is: no test noticed.
fn stopped<D: Devices>(mut bench: Bench<D>, number: u8, case: &str) {
    bench.wait(20);
    let part = bench.part;
    part(&mut bench.device, number).emergency_stop();
    assert!(bench.device.is_stopped(), "{case}");
    assert_eq!(bench.device.arm(at_ms(bench.ms)), Err(ArmError::Stopped), "{case}");
    bench.assert_rests(case);
    assert!(bench.device.is_stopped(), "{case}: it stays");
    bench.device.clear_emergency_stop();
    assert!(!bench.device.is_stopped(), "{case}");
    assert!(
        bench.numbers().all(|number| !part(&mut bench.device, number).guard().is_stopped()),
        "{case}"
    );
    bench.wait(PAUSE_MS);
    assert_eq!(bench.arm(), Ok(()), "{case}");
    bench.assert_runs(case);
}

fn one_is_disarmed<D: Devices>(mut bench: Bench<D>, number: u8, case: &str) {
    bench.wait(20);
    bench.arm().unwrap();
    let part = bench.part;
    part(&mut bench.device, number).disarm();
    let expected: Vec<bool> = bench.numbers().map(|other| other != number).collect();
    assert_eq!(bench.armed(), expected, "{case}");
    bench.wait(PAUSE_MS);
    assert_eq!(bench.arm(), Ok(()), "{case}");
    bench.assert_runs(case);
}

fn stop_of_all<D: Devices>(mut bench: Bench<D>, case: &str) {
    bench.wait(20);
    bench.arm().unwrap();
    bench.device.emergency_stop();
    let part = bench.part;
    for number in bench.numbers() {
        assert!(part(&mut bench.device, number).guard().is_stopped(), "{case}: part {number}");
    }
    assert!(bench.device.is_stopped(), "{case}");
    assert_eq!(bench.device.arm(at_ms(bench.ms)), Err(ArmError::Stopped), "{case}");
    bench.assert_rests(case);
    bench.device.clear_emergency_stop();
    bench.assert_rests(case);
    bench.wait(PAUSE_MS);
    assert_eq!(bench.arm(), Ok(()), "{case}");
    bench.assert_runs(case);
}

fn disarm_of_all<D: Devices>(mut bench: Bench<D>, case: &str) {
    bench.wait(20);
    bench.arm().unwrap();
    bench.device.disarm();
    bench.assert_rests(case);
    bench.wait(PAUSE_MS);
    assert_eq!(bench.arm(), Ok(()), "{case}");
    bench.assert_runs(case);
}

/// A motor that somebody else owns, for as long as the test program runs.
fn lent(number: u8) -> &'static mut Actuator<Mine> {
    Box::leak(Box::new(own(number)))
}

#[test]
fn a_borrowed_device_refuses_what_the_device_refuses() {
    check("&mut", 1, || lent(1), |device, _| device);
}

#[test]
fn an_array_refuses_what_one_of_its_parts_refuses() {
    check("[_; 1]", 1, || [own(1)], |device, number| &mut device[usize::from(number) - 1]);
    check("[_; 2]", 2, || [1, 2].map(own), |device, number| &mut device[usize::from(number) - 1]);
    check(
        "[_; 3]",
        3,
        || [1, 2, 3].map(own),
        |device, number| &mut device[usize::from(number) - 1],
    );
    check(
        "[&mut _; 3]",
        3,
        || [1, 2, 3].map(lent),
        |device, number| &mut *device[usize::from(number) - 1],
    );
}

#[test]
fn a_tuple_refuses_what_one_of_its_parts_refuses() {
    check(
        "(_, _)",
        2,
        || (own(1), own(2)),
        |device, number| match number {
            1 => &mut device.0,
            _ => &mut device.1,
        },
    );
    check(
        "(_, _, _)",
        3,
        || (own(1), own(2), own(3)),
        |device, number| match number {
            1 => &mut device.0,
            2 => &mut device.1,
            _ => &mut device.2,
        },
    );
    check(
        "(_, _, _, _)",
        4,
        || (own(1), own(2), own(3), own(4)),
        |device, number| match number {
            1 => &mut device.0,
            2 => &mut device.1,
            3 => &mut device.2,
            _ => &mut device.3,
        },
    );
    check(
        "(&mut _, &mut _)",
        2,
        || (lent(1), lent(2)),
        |device, number| match number {
            1 => device.0,
            _ => device.1,
        },
    );
}

#[test]
fn a_combination_of_combinations_refuses_what_one_of_its_parts_refuses() {
    check(
        "([_; 2], _)",
        3,
        || ([own(1), own(2)], own(3)),
        |device, number| match number {
            3 => &mut device.1,
            _ => &mut device.0[usize::from(number) - 1],
        },
    );
    check(
        "[(_, _); 2]",
        4,
        || [(own(1), own(2)), (own(3), own(4))],
        |device, number| match number {
            1 => &mut device[0].0,
            2 => &mut device[0].1,
            3 => &mut device[1].0,
            _ => &mut device[1].1,
        },
    );
}

#[test]
fn two_parts_with_one_id_clash_wherever_they_stand() {
    let clashes = |error: Result<(), ArmError>| matches!(error, Err(ArmError::Clash(..)));
    for (one, other) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
        let mut numbers = [1, 2, 3, 4];
        numbers[other] = numbers[one];
        let [a, b, c, d] = numbers;
        let (mut array, mut tuple) = (numbers.map(own), (own(a), own(b), own(c), own(d)));
        for number in numbers {
            for part in &mut array {
                _ = part.ingest(&healthy(number), at_ms(1));
            }
            _ = tuple.0.ingest(&healthy(number), at_ms(1));
            _ = tuple.1.ingest(&healthy(number), at_ms(1));
            _ = tuple.2.ingest(&healthy(number), at_ms(1));
            _ = tuple.3.ingest(&healthy(number), at_ms(1));
        }
        assert!(clashes(array.arm(at_ms(1))) && !array.is_armed(), "{one} {other}");
        assert!(clashes(tuple.arm(at_ms(1))) && !tuple.is_armed(), "{one} {other}");
        for part in &mut array {
            assert!(!part.is_armed(), "{one} {other}");
        }
    }
}
