//! Rules of a family's own, planted in its files: each is found, whatever its names and statements; what is no rule is not.

use super::{files_of, findings};
use std::collections::BTreeSet;

/// What is found in a file's folder once some lines stand at the head of the file.
fn found_with(file: &str, lines: &str) -> Vec<String> {
    let (folder, _) = file.rsplit_once('/').unwrap();
    let folder =
        if folder.starts_with("motor/") { folder } else { folder.split('/').next().unwrap() };
    let mut files = files_of(folder);
    let (_, text) = files.iter_mut().find(|(name, _)| name == file).unwrap();
    text.insert_str(0, lines);
    findings(folder, &files, &mut BTreeSet::new())
}

/// File, and a rule.
const RULES: [(&str, &str); 59] = [
    // A motor trips by a flag.
    (
        "motor/actuator/update.rs",
        "fn f(guard: &mut Guard, is_wrong: bool, now: Instant) { if is_wrong { guard.lose_zero(now) } }",
    ),
    (
        "dji/slot/target.rs",
        "fn f(slot: &mut Slot, is_wrong: bool) { if is_wrong { slot.guard.trip() } }",
    ),
    (
        "snake/slot/health.rs",
        "fn f(slot: &mut Slot, is_wrong: bool) { if is_wrong { slot.guard.relax_until_armed() } }",
    ),
    (
        "snake/slot.rs",
        "impl Slot { fn f(&mut self, now: Instant) { self.guard.change(now, |motor| motor.trip()); } }",
    ),
    // By the link, with and without a name for it.
    (
        "dji/slot/target.rs",
        "fn f(slot: &mut Slot) { if slot.guard.link() != Link::Online { slot.asked = Action::Rest } }",
    ),
    (
        "snake/slot.rs",
        "fn f(slot: &mut Slot) { if matches!(slot.guard.link(), Link::Recovering) { slot.speed = 0 } }",
    ),
    // Ages of two statements, under other names, in a field, of a function, as an argument.
    (
        "damiao/bus.rs",
        "fn f(now: Instant, heard: Instant) { let age = now.since(heard); let too_old = LIMIT; if age > too_old { rest() } }",
    ),
    (
        "dji/watch.rs",
        "fn f(now: Instant, last: Instant) { let x = now.since(last); let y = x; if y >= WAIT { rest() } }",
    ),
    (
        "dji/watch.rs",
        "fn f(now: u32, last: u32) { let passed = now.wrapping_sub(last); if passed > 30_000 { rest() } }",
    ),
    (
        "snake/bus.rs",
        "impl Joints { fn f(&mut self, now: Instant) { self.quiet = now.since(self.begun); } fn g(&self) -> bool { self.quiet > LIMIT } }",
    ),
    (
        "snake/bus.rs",
        "fn quiet(now: Instant, then: Instant) -> Duration { now.since(then) }\nfn g(slot: &Slot, now: Instant) -> bool { quiet(now, slot.begun) > LIMIT }",
    ),
    (
        "pwm/rc.rs",
        "fn too_long(passed: Duration) -> bool { passed > LIMIT }\nfn g(now: Instant, then: Instant) -> bool { too_long(now.since(then)) }",
    ),
    (
        "motor/actuator/update.rs",
        "fn f(now: Instant, then: Instant) { let gap = now.since(then); let (long, _) = (gap, 0); if LIMIT < long { rest() } }",
    ),
    (
        "snake/bus.rs",
        "fn f(slot: &mut Slot, gap_s: f32) { if motor::furthest(gap_s, 0.0, (0.0, 0.0)) > 0.4 { slot.guard.relax() } }",
    ),
    // A deadline, a remainder, a range, a match, an order.
    (
        "snake/slot.rs",
        "impl Slot { fn f(&mut self, now: Instant) { self.until = now + LIMIT; } fn g(&self, other: Instant) -> bool { other > self.until } }",
    ),
    (
        "dji/slot/gap.rs",
        "fn f(now: u32, then: u32) -> bool { now.wrapping_sub(then).checked_sub(LIMIT).is_some() }",
    ),
    (
        "motor/actuator/power.rs",
        "fn f(now: Instant, then: Instant) -> bool { let gap = now.since(then).as_micros(); (0..30_000).contains(&gap) }",
    ),
    (
        "pwm/brushed.rs",
        "fn f(now: Instant, then: Instant) { match now.since(then).as_micros() { 0..30_000 => drive(), _ => rest() } }",
    ),
    (
        "snake/slot/health.rs",
        "fn f(now: Instant, then: Instant) -> bool { now.since(then).cmp(&LIMIT) == Ordering::Greater }",
    ),
    (
        "motor/actuator/joint.rs",
        "fn f(now: Instant, then: Option<Instant>) -> bool { then.is_none_or(|at| now.since(at) > LIMIT) }",
    ),
    (
        "pwm/rc.rs",
        "enum Waits { No, From(Instant) }\nfn f(waits: Waits, end: Instant) -> bool { match waits { Waits::From(at) => end > at, Waits::No => false } }",
    ),
    // An update without a usable step, a fault.
    (
        "vesc/bus.rs",
        "fn f(order: Order, last: CanFrame) -> CanFrame { if order.step.is_hold() { last } else { rest() } }",
    ),
    (
        "pwm/rc.rs",
        "impl RcPwm { fn f(&mut self, is_wrong: bool, now: Instant) { if is_wrong { self.guard.fail(now, &USUAL) } } }",
    ),
    (
        "pwm/rc.rs",
        "fn f(tick: Tick, pulse_us: f32) -> f32 { if TimeStep::of(tick.dt_s()).is_hold() { pulse_us } else { 0.0 } }",
    ),
    // Time in steps, and updates that are counted.
    (
        "vesc/bus.rs",
        "impl Motor { fn f(&mut self, order: Order) { self.quiet_s += order.step.dt_s(); } fn g(&self) -> bool { self.quiet_s > 0.03 } }",
    ),
    (
        "lk/bus.rs",
        "impl Motor { fn f(&mut self) -> bool { self.missed = self.missed.saturating_add(1); self.missed > 30 } }",
    ),
    ("rmd/bus.rs", "impl Motor { fn f(&mut self) -> bool { self.left -= 1; self.left == 0 } }"),
    (
        "dji/slot.rs",
        "impl Slot { fn f(&mut self) -> bool { self.held_steps += 1; self.held_steps > 1 } }",
    ),
    (
        "snake/slot.rs",
        "impl Slot { fn f(&mut self) { *self = Self { missed: self.missed + 1, ..*self }; } }",
    ),
    // By an equation, a quotient, a register of bits.
    (
        "damiao/bus.rs",
        "fn f(now: Instant, then: Instant) -> bool { now.since(then).as_micros() / 30_000 != 0 }",
    ),
    (
        "dji/slot/target.rs",
        "fn f(now: u32, then: u32) -> bool { now.wrapping_sub(then).min(30_000) == 30_000 }",
    ),
    (
        "damiao/bus.rs",
        "impl Motor { fn f(&mut self) -> bool { self.history <<= 1; self.history == 0 } }",
    ),
    // A ramp, with and without its name.
    (
        "snake/slot.rs",
        "impl Slot { fn f(&mut self) -> f32 { self.part = (self.part * 1.05).min(1.0); self.part } }",
    ),
    ("damiao/bus.rs", "impl Motor { fn f(&mut self) { self.part *= 1.05; } }"),
    (
        "damiao/bus.rs",
        "impl Motor { fn f(&mut self) -> f32 { self.part = (self.part + 0.01).min(1.0); self.part } }",
    ),
    ("dji/slot.rs", "struct Ramp { part: f32 }"),
    (
        "pwm/brushed.rs",
        "impl Brushed { fn f(&mut self, rate: f32, step: &TimeStep) { self.part += rate * step.dt_s(); } }",
    ),
    // A gate, a latch, an arming, edges.
    (
        "damiao/bus.rs",
        "struct Door { shut: bool }\nimpl Door { fn f(&mut self, fault: bool) -> bool { self.shut |= fault; self.shut } }",
    ),
    ("dji/bus.rs", "struct Gate(bool);"),
    ("robstride/bus.rs", "impl Motor { fn latch_fault(&mut self) { self.bad = true; } }"),
    ("odrive/bus.rs", "enum Arming { Off, On }"),
    ("motor/actuator/update.rs", "struct Own { is_armed: bool }"),
    (
        "snake/slot.rs",
        "fn may_arm(stopped: bool) -> Result<(), ArmError> { if stopped { Err(ArmError::Stopped) } else { Ok(()) } }",
    ),
    // Calls that change the state of a motor.
    ("lk/bus.rs", "fn f(slot: &mut Slot) { slot.guard.relax(); }"),
    ("pwm/rc.rs", "fn f(slot: &mut Slot) { slot.guard.disarm(); }"),
    ("snake/bus.rs", "fn f(slot: &mut Slot, now: Instant) { slot.guard.engage(now); }"),
    ("dji/bus.rs", "fn f(guard: &mut Guard) { guard.set_stop(true); }"),
    ("pwm/brushed.rs", "fn f(guard: &mut Guard) { guard.clear_emergency_stop(); }"),
    ("dji/bus.rs", "fn f(slot: &mut Slot, now: u32) { slot.guard.renew_target(now); }"),
    ("dji/slot.rs", "fn f(slot: &mut Slot) { slot.guard.latch.set(Condition::Runaway, false); }"),
    ("snake/bus.rs", "fn f(slot: &mut Slot) -> bool { slot.guard.latch.has(Condition::Fault) }"),
    ("snake/slot.rs", "fn f(slot: &mut Slot, now: u32) { slot.guard.open(now); }"),
    ("pwm/rc.rs", "fn f(dt_s: f32) -> bool { TimeStep::usable(dt_s, 0.02).is_none() }"),
    // A second master.
    (
        "snake/slot/health.rs",
        "struct Others { at: Instant }\nfn f(others: &Others, end: Instant) -> bool { end.since(others.at) < SECOND }",
    ),
    ("lk/config.rs", "struct Seen { second_master: u32 }"),
    // The core's own parts, by an import, by a module, by a path, by a way around.
    ("robstride/bus.rs", "use crate::motor::Guard;"),
    ("vesc/config.rs", "use crate::{motor, time};"),
    (
        "odrive/config.rs",
        "fn f(link: crate::motor::Link) -> bool { link == crate::motor::Link::Online }",
    ),
    ("lk/codec.rs", "use super::super::motor::MotorGuard;"),
];

#[test]
fn a_rule_in_a_family_is_found() {
    let is_missed = |(file, rule): &(&str, &str)| found_with(file, &format!("{rule}\n")).is_empty();
    let missed: Vec<_> = RULES.into_iter().filter(is_missed).collect();
    assert!(missed.is_empty(), "{missed:#?}");
}

/// File, and what is no rule.
const OTHERS: [(&str, &str); 10] = [
    (
        "damiao/bus.rs",
        "/// ArmError::Stopped, and an age > LIMIT\nfn f(torque_nm: f32, most_nm: f32) -> bool { torque_nm.abs() > most_nm }",
    ),
    (
        "lk/bus.rs",
        "fn f(counts: i32) -> i16 { if counts > i32::from(i16::MAX) { i16::MAX } else { 0 } }",
    ),
    ("vesc/config.rs", "use crate::motor::{Order, Vitals};\nuse crate::units::Angle;"),
    (
        "odrive/codec.rs",
        "fn f(data: &[u8; 8]) -> Option<u8> { match data { [0..=9, code, ..] => Some(*code), _ => None } }",
    ),
    (
        "dji/watch.rs",
        "fn f(motors: &mut Motors<8>, now: Instant) -> bool { let before = motors.guard.begin(now); motors.guard.is_quiet(before, now) }",
    ),
    (
        "dji/watch.rs",
        "fn f(slot: &mut Slot, hold: Hold) -> bool { slot.guard.output(Some(hold)) == Output::Repeat }",
    ),
    (
        "snake/bus.rs",
        "fn f(slot: &mut Slot, now: Instant) -> bool { slot.guard.drives() && slot.speed > 0 }",
    ),
    (
        "pwm/brushed.rs",
        "fn f(now: Instant, then: Instant, threshold: u8) -> f32 { let dt_s = now.since(then).as_secs_f32(); let is_more = threshold > 1; if is_more { dt_s } else { 0.0 } }",
    ),
    (
        "motor/actuator/joint.rs",
        "fn f(order: Order, velocity: f32) -> bool { let way = velocity * order.step.dt_s(); way > 0.5 }",
    ),
    (
        "motor/actuator/update.rs",
        "fn f(guard: &mut Guard, now: Instant) -> Option<f32> { guard.drives(now).then(|| guard.share()) }",
    ),
];

#[test]
fn what_is_no_rule_is_not_found() {
    for (file, other) in OTHERS {
        assert_eq!(found_with(file, &format!("{other}\n")), [""; 0], "{file}: {other}");
    }
}
