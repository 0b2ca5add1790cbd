//! Faults that every drive may meet, each driven through every family: the outcome is the cell of the table.

use crate::motors::Family;
use crate::station::{Bend, Drive, Station};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{ArmError, Condition, HealthConfig, Ingest, Link};
use drivetrain::units::Angle;
use embedded_can::{ExtendedId, Frame, Id, StandardId};

/// The outcome, or the reason that the family has no such fault.
type Outcome = Result<String, &'static str>;
type Case = (&'static str, fn(&Family) -> Outcome);

pub(crate) const CASES: &[Case] = &[
    ("F01", |family| Ok(refused(family.station(), |_, frame| shorter(frame)))),
    ("F02", |family| Ok(handed_back(family.station(), |_, frame| remote(frame)))),
    ("F03", |family| Ok(handed_back(family.station(), |_, frame| in_other_format(frame)))),
    ("F04", |family| Ok(unknown_ids(family.station()))),
    ("F05", second_master),
    ("F06", impossible),
    ("F07", |family| Ok(handed_back(family.station(), |drive, frame| drive.of_neighbour(frame)))),
    ("F08", two_drives),
    ("F09", |family| Ok(twice(family))),
    ("F10", |family| Ok(out_of_order(family.station()))),
    ("F11", |family| Ok(burst(family.station()))),
    ("F15", |family| Ok(power_cycle(family.station()))),
    ("F19", |family| Ok(error_code(family.station()))),
    ("F24", |family| Ok(lost_feedback(family.station()))),
    ("F26", |family| Ok(no_targets(family.station()))),
    ("F29", |family| Ok(clock_back(family.station()))),
    ("F30", |family| Ok(unheard(family.station()))),
    ("F31", |family| Ok(bad_step(family.station()))),
    ("F33", |family| Ok(recovery(family.station()))),
    ("F34", |family| Ok(not_finite(family.station()))),
    ("F41", |family| Ok(not_kept(family.station()))),
    ("F42", |family| Ok(soft_limit(family))),
    ("F43", |family| Ok(emergency_stop(family.station()))),
    ("F44", |family| Ok((family.out_of_range)().to_string())),
    ("F46", |family| Ok(two_with_one_id(&family.station()))),
    ("F49", |family| Ok(never_heard(family.station()))),
    ("F51", |family| Ok(blocked(family.station()))),
    ("F68", |family| Ok(arms_each_tick(family.station()))),
    ("F69", |family| Ok(opens(family.station()))),
    ("F72", wrong_setting),
    ("F73", cable_cut),
    ("F74", |family| Ok(drive_error(family))),
    ("F75", |family| Ok(forgets_its_turns(family))),
    ("F76", echo),
];

fn after((rests_ms, trips_ms): (u32, Option<u32>)) -> String {
    let rests = match rests_ms {
        1 => "rest at once".to_owned(),
        ms => format!("rest after {ms} ms"),
    };
    match trips_ms {
        Some(1) => format!("{rests}, tripped"),
        Some(ms) => format!("{rests}, tripped after {ms}"),
        None => rests,
    }
}

/// A start outside of the limits, with an outward torque for 0.1 s, then an inward one.
fn soft_limit(family: &Family) -> String {
    static LIMITS: HealthConfig =
        HealthConfig::new().with_soft_limits(Angle::from_radians(-1.0), Angle::from_radians(1.0));
    let mut station = family.station();
    station.device.set_health(&LIMITS);
    let mut station = station.settled();
    station.device.set_present_angle(1.5).unwrap();
    station.device.arm(station.now()).unwrap();
    let (mut is_pushed, mut is_driven) = (false, false);
    for ms in 0..300 {
        station.device.set(if ms < 100 { 1.0 } else { -1.0 }).unwrap();
        station.step();
        assert!(station.device.conditions().contains(Condition::SoftLimit) || ms > 100);
        // A torque of zero is up to half a count.
        is_pushed |= ms < 100 && station.drive.shaft().torque_nm() > 0.003;
        is_driven |= ms >= 100 && station.drive.shaft().torque_nm() < -0.1;
    }
    match (is_pushed, is_driven) {
        (false, true) => "inward only".to_owned(),
        outcome => format!("pushed outward and driven inward: {outcome:?}"),
    }
}

fn shorter(frame: &CanFrame) -> CanFrame {
    let data = frame.data();
    CanFrame::new(frame.id(), &data[..data.len() - 1]).unwrap()
}

fn remote(frame: &CanFrame) -> CanFrame {
    CanFrame::new_remote(frame.id(), frame.data().len()).unwrap()
}

fn in_other_format(frame: &CanFrame) -> CanFrame {
    let id = match frame.id() {
        Id::Standard(id) => Id::from(ExtendedId::new(id.as_raw().into()).unwrap()),
        Id::Extended(id) => {
            StandardId::new(u16::try_from(id.as_raw() & 0x7FF).unwrap()).unwrap().into()
        }
    };
    CanFrame::new(id, frame.data()).unwrap()
}

fn bent(bend: fn(&dyn Drive, &CanFrame) -> CanFrame) -> Option<Bend> {
    Some(Box::new(move |drive, frame| vec![bend(drive, frame)]))
}

/// Feedback that is bent while the motor is driven keeps nothing fresh.
fn refused(station: Station, bend: fn(&dyn Drive, &CanFrame) -> CanFrame) -> String {
    let mut station = station.driven();
    station.bend = bent(bend);
    for _ in 0..3 {
        station.step();
        assert!(!station.outcomes.contains(&Ingest::Taken), "{:?}", station.outcomes);
    }
    let (rests_ms, trips_ms) = station.fade(200);
    format!("refused, {}", after((rests_ms + 3, trips_ms.map(|ms| ms + 3))))
}

fn handed_back(station: Station, bend: fn(&dyn Drive, &CanFrame) -> CanFrame) -> String {
    let mut station = station.driven();
    station.bend = bent(bend);
    let mut handed_back = 0;
    for _ in 0..3 {
        _ = station.device.set(1.0);
        station.step();
        assert!(station.outcomes.iter().all(|it| *it == Ingest::Unrelated), "{:?}", station.heard);
        handed_back += station.outcomes.len();
    }
    assert!(handed_back > 0);
    let (rests_ms, trips_ms) = station.fade(200);
    format!("handed back, {}", after((rests_ms + 3, trips_ms.map(|ms| ms + 3))))
}

/// Each standard id, and as many extended ids.
fn unknown_ids(station: Station) -> String {
    let mut station = station.driven();
    let claims = station.device.claims();
    let standard = (0..0x800).map(|id| Id::from(StandardId::new(id).unwrap()));
    let extended = (0..0x800_u32).map(|id| ExtendedId::new(id * 262_147 % (1 << 29)).unwrap());
    for id in standard.chain(extended.map(Id::from)) {
        if claims.iter().any(|claim| claim.covers(id)) {
            continue;
        }
        for data in [[0; 8], [0xFF; 8], [1, 2, 3, 4, 5, 6, 7, 8]] {
            let frame = CanFrame::new(id, &data).unwrap();
            assert_eq!(station.device.ingest(&frame, station.now()), Ingest::Unrelated, "{id:?}");
        }
    }
    station.steps(50, |station| station.device.set(1.0).unwrap());
    "handed back, driven on".to_owned()
}

fn second_master(family: &Family) -> Outcome {
    let mut other = family.station().driven();
    let mut station = family.station().driven();
    let mut is_armed = true;
    for _ in 0..50 {
        _ = (other.device.set(1.0), station.device.set(1.0));
        other.step();
        let command = other.frames.iter().copied().find(|frame| !other.drive.is_rest(frame));
        if let Some(command) = command {
            _ = station.device.ingest(&command, station.now());
        }
        station.step();
        is_armed &= station.device.is_armed();
    }
    assert!(station.device.has_rival());
    station.device.disarm();
    let refused = station.device.arm(station.now());
    assert!(matches!(refused, Err(ArmError::SecondMaster(_))), "{refused:?}");
    Ok(if is_armed { "not armed; driven on" } else { "not armed; tripped" }.to_owned())
}

/// Two drives with one id, as delivered, answer each frame twice until one is unplugged.
fn two_drives(family: &Family) -> Outcome {
    let mut station = family.station();
    station.bend = Some(Box::new(|_, frame| vec![*frame, *frame]));
    station.steps(2_200, |_| {});
    let refused = station.device.arm(station.now());
    if refused.is_ok() {
        return Err("such a drive sends feedback by itself, at a rate of its own");
    }
    // The second echo of a drive that echoes commands is one of another node.
    let condition = match refused {
        Err(ArmError::Faulty(_)) => Condition::DuplicateId,
        Err(ArmError::SecondMaster(_)) => Condition::SecondMaster,
        _ => panic!("{refused:?}"),
    };
    assert!(station.device.conditions().contains(condition));
    station.bend = None;
    station.steps(2_200, |_| {});
    station.device.arm(station.now()).unwrap();
    Ok("not armed until one is alone".to_owned())
}

fn impossible(family: &Family) -> Outcome {
    let mut station = family.station().driven();
    let frame = station.drive.impossible()?;
    let outcome = station.device.ingest(&frame, station.now());
    assert!(outcome.is_malformed(), "{outcome:?}");
    Ok("refused".to_owned())
}

/// The commands are those of a bus on which nothing comes twice.
fn twice(family: &Family) -> String {
    let [mut one, mut two] = [family.station(), family.station()].map(Station::driven);
    two.bend = Some(Box::new(|_, frame| vec![*frame, *frame]));
    for ms in 0..300 {
        for station in [&mut one, &mut two] {
            station.device.set(1.0).unwrap();
            station.step();
        }
        assert_eq!(one.frames, two.frames, "{ms} ms");
    }
    "nothing changes".to_owned()
}

/// Each second frame comes after the next one.
fn out_of_order(station: Station) -> String {
    let mut station = station.driven();
    let mut kept = None;
    station.bend = Some(Box::new(move |_, frame| match kept.take() {
        Some(before) => vec![*frame, before],
        None => {
            kept = Some(*frame);
            Vec::new()
        }
    }));
    station.steps(300, |station| station.device.set(1.0).unwrap());
    assert!(station.device.is_armed());
    "driven on".to_owned()
}

/// A loop that stalls for 8 ms finds 64 frames.
fn burst(station: Station) -> String {
    let mut station = station.driven();
    let heard = station.heard.clone();
    station.now_us += 8_000;
    for frame in heard.iter().cycle().take(64) {
        station.deliver(frame);
    }
    assert!(station.outcomes.iter().all(|outcome| *outcome == Ingest::Taken));
    station.steps(50, |station| station.device.set(1.0).unwrap());
    "taken, driven on".to_owned()
}

/// The drive is away for 150 ms, and comes back as it starts.
fn power_cycle(station: Station) -> String {
    let mut station = station.driven();
    station.drive.lose_supply();
    (station.is_cut, station.is_deaf) = (true, true);
    let (rests_ms, trips_ms) = station.fade(150);
    (station.is_cut, station.is_deaf) = (false, false);
    station.drive.lose_supply();
    let (stays, _) = station.fade(500);
    assert_eq!(stays, 1, "driven again by itself");
    after((rests_ms, trips_ms))
}

fn error_code(station: Station) -> String {
    let mut station = station.driven();
    station.drive.fail();
    let mut code = 0;
    station.steps(150, |station| {
        _ = station.device.set(1.0);
        code = station.device.error_code().max(code);
    });
    assert!(!station.device.is_armed() && code > 0);
    format!("code {code}, tripped")
}

fn lost_feedback(station: Station) -> String {
    let mut station = station.driven();
    station.is_deaf = true;
    let fade = station.fade(200);
    assert_eq!(station.device.link(), Link::Offline);
    after(fade)
}

fn no_targets(station: Station) -> String {
    let mut station = station.driven();
    let mut rests_after = 0;
    for ms in 1..=200 {
        station.step();
        if !station.rests() {
            rests_after = ms;
        }
    }
    let armed = if station.device.is_armed() { "stays armed" } else { "tripped" };
    format!("rest after {} ms, {armed}", rests_after + 1)
}

fn clock_back(station: Station) -> String {
    let mut station = station.driven();
    station.now_us -= 5_000;
    _ = station.device.set(1.0);
    station.step_here();
    assert!(station.rests() && !station.device.is_armed(), "{:?}", station.frames);
    assert_eq!(station.fade(100).0, 1);
    "rest at once, tripped".to_owned()
}

/// Longer than a stamp of 32 bits counts.
fn unheard(station: Station) -> String {
    let mut station = station.driven();
    station.is_deaf = true;
    for seconds in [5_000_u64, 4_294, 1] {
        station.now_us += seconds * 1_000_000;
        _ = station.device.set(1.0);
        station.step();
        assert!(station.rests() && station.device.link() == Link::Offline);
    }
    "rest, offline".to_owned()
}

fn bad_step(station: Station) -> String {
    let mut station = station.driven();
    station.dt_s = f32::NAN;
    let (rests_ms, trips_ms) = station.fade(100);
    assert!(rests_ms <= 2 && trips_ms.is_none());
    station.dt_s = 0.001;
    station.steps(100, |station| _ = station.device.set(1.0));
    assert!(station.device.is_armed());
    "the last command once, then rest".to_owned()
}

fn recovery(station: Station) -> String {
    let mut station = station.driven();
    station.is_deaf = true;
    station.fade(200);
    station.is_deaf = false;
    assert_eq!(station.fade(300).0, 1, "driven by itself");
    station.steps(110, |_| {});
    station.device.arm(station.now()).unwrap();
    let mut is_driven = false;
    station.steps(500, |station| {
        is_driven |= !station.rests();
        _ = station.device.set(1.0);
    });
    assert!(is_driven);
    "rest until armed".to_owned()
}

fn not_finite(station: Station) -> String {
    let mut station = station.driven();
    for _ in 0..50 {
        assert!(station.device.set(f32::NAN).is_err());
        station.step();
        assert!(station.rests() && station.device.is_armed(), "{:?}", station.frames);
    }
    "refused, rest at once".to_owned()
}

fn not_kept(station: Station) -> String {
    let mut station = station.settled();
    assert!(station.device.set(1.0).is_err());
    station.device.arm(station.now()).unwrap();
    station.steps(100, |station| assert!(station.rests()));
    "refused, not kept".to_owned()
}

fn emergency_stop(station: Station) -> String {
    let mut station = station.driven();
    station.device.emergency_stop();
    assert_eq!(station.fade(200).0, 1);
    assert_eq!(station.device.arm(station.now()), Err(ArmError::Stopped));
    station.device.clear_emergency_stop();
    station.step();
    assert_eq!(station.device.arm(station.now()), Err(ArmError::NotReleased));
    station.steps(150, |station| assert!(station.rests()));
    assert_eq!(station.device.arm(station.now()), Ok(()));
    "rest at once, until cleared and armed".to_owned()
}

fn two_with_one_id(station: &Station) -> String {
    assert!(matches!(station.twins, Err(ArmError::Clash(..))), "{:?}", station.twins);
    "not armed: both are named".to_owned()
}

fn never_heard(mut station: Station) -> String {
    station.is_deaf = true;
    station.steps(300, |station| {
        assert!(station.device.set(1.0).is_err());
        assert!(station.device.arm(station.now()).is_err());
        assert!(station.rests(), "{:?}", station.frames);
        station.device.disarm();
    });
    "rest, not armed".to_owned()
}

/// The driver gives each frame back, for 5 ms and for 150 ms.
fn blocked(station: Station) -> String {
    let mut station = station.driven();
    station.is_full = true;
    station.steps(5, |station| _ = station.device.set(1.0));
    station.is_full = false;
    station.steps(100, |station| _ = station.device.set(1.0));
    assert!(station.device.is_armed());
    station.is_full = true;
    station.steps(150, |station| _ = station.device.set(1.0));
    station.is_full = false;
    station.step();
    let first = if station.rests() { "rest" } else { "the newest command" };
    format!("driven on after 5 ms; after 150 ms {first}")
}

fn arms_each_tick(station: Station) -> String {
    let mut station = station.driven();
    station.device.emergency_stop();
    station.step();
    station.device.clear_emergency_stop();
    station.steps(300, |station| {
        assert!(station.device.arm(station.now()).is_err());
        _ = station.device.set(1.0);
        assert!(station.rests());
    });
    station.steps(110, |_| {});
    assert_eq!(station.device.arm(station.now()), Ok(()));
    "refused for as long as it asks".to_owned()
}

/// The torque of the shaft rises with the share of the range that is open.
fn opens(station: Station) -> String {
    let mut station = station.armed();
    let mut torques = Vec::new();
    station.steps(600, |station| {
        torques.push(station.drive.shaft().torque_nm().abs());
        station.device.set(1.0).unwrap();
    });
    let most = torques.iter().copied().fold(0.0, f32::max);
    let first = torques.iter().position(|torque| *torque > 0.02 * most).unwrap();
    let full = torques.iter().position(|torque| *torque > 0.98 * most).unwrap();
    assert!(torques[first] < 0.1 * most, "{} of {most} Nm at first", torques[first]);
    let rise_ms = full - first;
    assert!((30..=200).contains(&rise_ms), "{rise_ms} ms");
    "opens from 0".to_owned()
}

/// A drive in another mode; with other ranges; and, where modes are set without being read, one that takes none.
fn wrong_setting(family: &Family) -> Outcome {
    let mut station = family.station();
    station.drive.missets()?;
    let mut text = with_setting(station);
    let mut station = family.station();
    match station.drive.misranges() {
        Ok(()) => text = format!("{text}; {}", with_setting(station)),
        Err(end) => text += end,
    }
    for (name, make) in [("0.6", family.modes[0].1)].iter().chain(family.others) {
        let mut station = make();
        if station.drive.keeps_modes() {
            station.drive.missets()?;
            text = format!("{text}; {name}, mode not taken: {}", with_setting(station));
        }
    }
    Ok(text)
}

fn with_setting(station: Station) -> String {
    let mut station = station.settled();
    let refusal = |station: &mut Station| {
        let refused = station.device.arm(station.now()).err()?;
        assert!(matches!(refused, ArmError::Setting(_)), "{refused}");
        let refused = refused.to_string();
        let (told, _) = refused.split_once(": ").unwrap();
        Some(format!("not armed: {told}"))
    };
    if let Some(told) = refusal(&mut station) {
        return told;
    }
    let mut code = 0;
    let mut is_driven = false;
    station.steps(3_000, |station| {
        _ = station.device.set(1.0);
        code = code.max(station.device.error_code());
        is_driven |= station.drive.shaft().torque_nm() > 0.5;
    });
    match (station.device.is_armed(), is_driven) {
        (true, true) => "set up before it is enabled".to_owned(),
        (true, false) => "armed all the same".to_owned(),
        (false, false) if code == 0 => format!("not driven; {}", refusal(&mut station).unwrap()),
        (false, false) => format!("not driven, code {code}"),
        (false, true) => panic!("driven, code {code}"),
    }
}

fn cable_cut(family: &Family) -> Outcome {
    let mut text = match stops_after(family.station()) {
        Some(ms) => format!("it stops by itself after {ms} ms"),
        None => return Err("no time-out of its own: it goes on"),
    };
    for (name, station) in family.others {
        assert_eq!(stops_after(station()), None);
        text = format!("{text}; {name}: it goes on");
    }
    Ok(text)
}

/// Returns the time in ms from the cut of a cable until the shaft has no torque.
fn stops_after(station: Station) -> Option<u32> {
    let mut station = station.driven();
    (station.is_cut, station.is_deaf) = (true, true);
    let mut stops_after = None;
    for ms in 1..=1_500 {
        _ = station.device.set(1.0);
        station.step();
        if stops_after.is_none() && station.drive.shaft().torque_nm() == 0.0 {
            stops_after = Some(ms);
        }
    }
    stops_after
}

/// Tripped; at rest; and armed only when the error is gone. Times are the longest of 100 moments, a millisecond apart: questions and
/// heartbeats recur.
fn drive_error(family: &Family) -> String {
    let (mut longest, mut again) = ((0, Some(0)), "");
    for phase in 0..100 {
        let mut station = family.station().driven();
        station.steps(phase, |station| station.device.set(1.0).unwrap());
        station.drive.fail();
        let (rests_ms, trips_ms) = station.fade(150);
        longest = (longest.0.max(rests_ms), longest.1.max(trips_ms));
        assert!(trips_ms.is_some());
        assert_eq!(station.fade(500).0, 1, "driven again by itself");
        assert!(station.drive.shaft().torque_nm() == 0.0);
        station.steps(150, |_| {});
        again = match station.device.arm(station.now()) {
            Ok(()) => "cleared",
            Err(ArmError::Faulty(_)) => "not armed with it",
            Err(other) => panic!("{other}"),
        };
    }
    format!("{}; {again}", after(longest))
}

/// In the position mode of the drive, and no farther in any other mode with an angle: but for a VESC, whose tachometer begins at 0 without a
/// word, and which is silent for longer when it starts.
fn forgets_its_turns(family: &Family) -> String {
    let has_angle = |mode: &str| mode.contains("angle") && family.name != "vesc";
    for (_, make) in family.modes.iter().filter(|(mode, _)| has_angle(mode)) {
        forgets_its_turns_in(make());
    }
    forgets_its_turns_in(family.at_position())
}

/// Held at a position more than a turn from where it has started, the drive starts again. The motor keeps its target.
fn forgets_its_turns_in(station: Station) -> String {
    let mut station = station.armed();
    for share in 1..=6_u8 {
        station.steps(1_000, |station| station.device.set(share.into()).unwrap());
    }
    let before = station.drive.shaft().angle_rad();
    assert!((before - 9.0).abs() < 0.3, "{before} rad");
    station.drive.lose_supply();
    let before = station.drive.shaft().angle_rad(); // as the drive counts from now on
    let trips_after = (1..=1_000).find(|_| {
        _ = station.device.set(6.0);
        station.step();
        !station.device.is_armed()
    });
    let moved = (station.drive.shaft().angle_rad() - before).abs();
    assert!(moved < 1.0, "{moved} rad");
    match trips_after {
        Some(ms) => format!("tripped after {ms} ms and {moved:.1} of 9 rad"),
        None => format!("goes on, {moved:.1} of 9 rad away"),
    }
}

fn echo(family: &Family) -> Outcome {
    let mut station = family.station().driven();
    station.drive.echo(&station.frames[0])?;
    station.is_deaf = true;
    let (mut rests_after, mut trips_after) = (0, None);
    for ms in 1..=200 {
        _ = station.device.set(1.0);
        station.step();
        for frame in station.frames.clone() {
            let echo = station.drive.echo(&frame)?;
            _ = station.device.ingest(&echo, station.now());
        }
        if !station.rests() {
            rests_after = ms;
        }
        if trips_after.is_none() && !station.device.is_armed() {
            trips_after = Some(ms);
        }
    }
    Ok(format!("no feedback, {}", after((rests_after + 1, trips_after))))
}
