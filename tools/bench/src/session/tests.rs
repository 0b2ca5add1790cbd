use super::*;
use crate::identifying::{Identified, Limits};
use crate::link::Simulated;
use crate::motors;
use crate::options::{Options, usual};

/// All families, three at a time: at 1 kHz eight motors are more than a bus of 1 Mbit/s carries.
const GROUPS: [&str; 3] = [
    "m3508:1,gm6020:5,damiao4310:1",
    "mg4005e-i10:2,rmd-x8-90:3,rs02:4",
    "odrive0.5:5,odrive0.6:7,vesc7:6",
];

fn session(list: &str) -> Session {
    let specs = motors::parse(list).unwrap();
    let link = Link::Simulated(Simulated::new(&specs, 1).unwrap());
    Session::new(Robot::new(&specs, false).unwrap(), link, Pace::Fast(Time::manual()), Vec::new())
}

/// Does something at each tick.
struct Each<F>(u64, F);

impl<F: FnMut(&mut Session, u64) -> bool> Pilot for Each<F> {
    fn goes_on(&mut self, _: &mut Session) -> bool {
        true
    }

    fn ticked(&mut self, session: &mut Session) -> bool {
        self.0 += 1;
        (self.1)(session, self.0)
    }

    fn take_messages(&mut self, _: &mut Session) {}
}

fn run(session: &mut Session, each: impl FnMut(&mut Session, u64) -> bool) {
    session.run(&End::none(), &mut Each(0, each));
}

fn simulated(session: &mut Session) -> &mut Simulated {
    match &mut session.tap().link {
        Link::Simulated(simulated) => simulated,
        _ => panic!("not simulated"),
    }
}

fn is_at_rest(session: &mut Session) -> bool {
    let count = session.robot().len();
    let simulated = simulated(session);
    (0..count).all(|motor| simulated.is_at_rest(motor))
}

/// Armed, at 10 rad/s for so long, and then `then`.
fn driven(session: &mut Session, ms: u64, mut then: impl FnMut(&mut Session) -> bool) {
    run(session, |session, tick| {
        if tick == 1 {
            for motor in 0..session.robot().len() {
                session.start_program(motor, Program::Speed(10.0));
            }
            session.arm(None);
        }
        tick < ms || then(session)
    });
}

#[test]
fn motors_of_each_family_turn_and_are_left_at_rest() {
    for group in GROUPS {
        let mut session = session(group);
        let mut reached = Vec::new();
        driven(&mut session, 4_000, |session| {
            let count = session.robot().len();
            let simulated = simulated(session);
            reached = (0..count).map(|motor| simulated.velocity(motor)).collect();
            false
        });
        assert!(!session.has_failed(), "{:?}", session.messages());
        let is_there = |rad_per_s: &f32| (rad_per_s - 10.0).abs() < 0.5;
        assert!(reached.len() == 3 && reached.iter().all(is_there), "{group}: {reached:?}");
        assert!(is_at_rest(&mut session));
    }
}

#[test]
fn nothing_is_sent_without_arming() {
    for group in GROUPS {
        let mut session = session(group);
        run(&mut session, |_, tick| tick < 1_000);
        let sent = session.counts().into_iter().find(|(name, _)| *name == "sent");
        assert_eq!(sent, Some(("sent", 0)));
    }
    let mut session = session("m3508:1");
    run(&mut session, |_, tick| tick < 100);
    assert!(session.robot().reading(0).is_some_and(|reading| reading.is_heard()));
}

#[test]
fn a_pilot_that_panics_leaves_the_motors_at_rest() {
    let mut session = session("m3508:1,damiao4310:1");
    driven(&mut session, 1_000, |session| {
        assert!(!is_at_rest(session), "driven");
        panic!("a defect of the pilot")
    });
    assert!(session.has_failed() && is_at_rest(&mut session));
    assert_eq!(session.messages(), ["a defect of this program; all stop"]);
}

#[test]
fn a_signal_leaves_the_motors_at_rest() {
    let mut session = session("m3508:1,damiao4310:1");
    let end = End::none();
    let mut pilot = Each(0, |session: &mut Session, tick| {
        if tick == 1 {
            session.start_program(0, Program::Speed(10.0));
            session.arm(None);
        } else if tick == 500 {
            end.ask();
        }
        true
    });
    session.run(&end, &mut pilot);
    assert_eq!(pilot.0, 500);
    assert!(!session.has_failed() && is_at_rest(&mut session));
}

#[test]
fn a_motor_that_is_lost_stops_all() {
    for motor in 0..2 {
        let mut session = session("m3508:1,damiao4310:1");
        let mut stopped = None;
        let mut ticks = 0;
        driven(&mut session, 1_000, |session| {
            ticks += 1;
            if ticks == 1 {
                simulated(session).silence(motor, Duration::from_millis(400));
            }
            if session.has_failed() && stopped.is_none() {
                stopped = Some(ticks);
            }
            stopped.is_none_or(|at| ticks < at + 20)
        });
        assert!(stopped.is_some_and(|ticks| ticks < 150), "{stopped:?} ms");
        assert!(is_at_rest(&mut session));
        let said = session.messages();
        let name = session.robot().names().nth(motor).unwrap().to_string();
        assert!(
            said.iter().any(|text| text.contains("all stop") && text.contains(&name)),
            "{said:?}"
        );
    }
}

#[test]
fn after_a_lost_motor_it_is_armed_again_by_a_request() {
    let mut session = session("m3508:1,damiao4310:1");
    let mut armed_again = None;
    driven(&mut session, 1_000, |session| {
        let ms = session.elapsed().as_micros() / 1_000;
        match (session.stage(), session.has_failed()) {
            (Stage::Armed, false) => simulated(session).silence(0, Duration::from_millis(400)),
            (Stage::Listening, true) => session.arm(Some(Duration::from_secs(3))),
            (Stage::Armed, true) => armed_again = armed_again.or(Some(ms)),
            _ => {}
        }
        armed_again.is_none() && ms < 10_000
    });
    assert!(armed_again.is_some(), "{:?}", session.messages());
}

// It turned red after each stop, and each re-arming was a tick overrun.
#[test]
fn a_drive_that_nobody_asks_is_idle_and_a_pause_is_no_overrun() {
    let mut session = session("m3508:1,damiao4310:1,vesc7:6");
    let (mut links, mut was_armed, mut edges) = (Vec::new(), false, Vec::new());
    run(&mut session, |session, tick| {
        match tick {
            1 | 2_500 => session.arm(None),
            1_000 => session.stop(),
            2_400 => {
                let motors = crate::snapshot::of(session).motors;
                links = motors.into_iter().map(|it| (it.link, it.conditions)).collect();
            }
            _ => {}
        }
        was_armed = session.stage() == Stage::Armed;
        edges.extend(session.edges().into_iter().map(|(_, text)| text));
        tick < 4_000
    });
    let expected = ["Online", "Idle", "Online"].map(|link| (link.to_owned(), Vec::new()));
    assert_eq!(links, expected);
    assert!(was_armed, "{:?}", session.refusal());
    let is_silence =
        |text: &String| ["late", "offline", "overrun"].iter().any(|it| text.contains(it));
    assert!(!edges.iter().any(is_silence), "{edges:?}");
}

#[test]
fn motors_that_are_not_there_are_named_and_nothing_is_left_behind() {
    let present = motors::parse("m3508:1").unwrap();
    let link = Link::Simulated(Simulated::new(&present, 1).unwrap());
    let robot = Robot::new(&motors::parse("m3508:1-2").unwrap(), false).unwrap();
    let mut session = Session::new(robot, link, Pace::Fast(Time::manual()), Vec::new());
    run(&mut session, |session, tick| {
        if tick == 1 {
            session.arm(Some(Duration::from_millis(500)));
        }
        tick == 1 || session.stage() != Stage::Listening
    });
    assert_eq!(session.messages(), ["not armed: no feedback from M3508 #2"]);
}

/// Runs a program that measures the first motor until its result.
fn measured(
    session: &mut Session,
    mut begin: impl FnMut(&mut Session) -> Result<(), String>,
) -> Result<Outcome, String> {
    let mut outcome = None;
    driven(session, 1, |session| {
        if session.stage() == Stage::Armed && matches!(session.program(0), Some(Program::Speed(_)))
        {
            begin(session).unwrap();
        }
        outcome = session.outcomes().pop();
        let is_late = session.elapsed() > Duration::from_secs(20);
        outcome.is_none() && !session.has_failed() && !is_late
    });
    outcome.unwrap_or(Err("no outcome".into()))
}

#[test]
fn tuning_finds_gains_that_settle_faster() {
    for list in ["m3508:1", "gm6020:1", "damiao4310:1"] {
        let mut session = session(list);
        let outcome = measured(&mut session, |session| {
            let plan = crate::commands::plan(session, 0, &usual());
            session.start_tuning(0, plan)
        });
        let outcome = outcome.unwrap_or_else(|error| panic!("{list}: {error}"));
        let (rust, toml) = (outcome.rust(), outcome.toml());
        assert!(rust.starts_with("PidConfig::new(") && rust.contains(".with_output_limit("));
        assert!(toml.contains("\nkp = ") && toml.contains("\nultimate_gain = "), "{toml}");
        let Outcome::Tuned(tuned) = outcome else { panic!("{outcome:?}") };
        let period_s = tuned.ultimate_period_s;
        assert!(period_s > 0.005 && period_s < 0.5, "{list}: {tuned:?}");
        let after = tuned.after;
        assert!(after.settled_s.is_some_and(|s| s < 0.6), "{list}: {tuned:?}");
        assert!(after.overshoot < 0.3 && after.steady_error.abs() < 0.5, "{list}: {tuned:?}");
        assert_eq!(session.robot().gains(0), after.gains);
        assert!(is_at_rest(&mut session));
    }
}

#[test]
fn a_relay_beyond_the_limit_is_reckoned_with_as_far_as_it_acts() {
    let gain = |amplitude: Option<f32>| {
        let mut session = session("m3508:1");
        let outcome = measured(&mut session, |session| {
            let options = Options { amplitude, ..usual() };
            let plan = crate::commands::plan(session, 0, &options);
            session.start_tuning(0, plan)
        });
        match outcome {
            Ok(Outcome::Tuned(tuned)) => tuned.ultimate_gain,
            other => panic!("{other:?}"),
        }
    };
    let (usual, largest) = (gain(None), gain(Some(6.0)));
    assert_eq!(gain(Some(100.0)), largest);
    assert!((largest / usual - 1.0).abs() < 0.3, "{largest} and {usual}");
}

fn identified(list: &str, change: impl Fn(&mut Limits)) -> (Session, Result<Identified, String>) {
    let mut session = session(list);
    let outcome = measured(&mut session, |session| {
        let mut limits = crate::commands::limits(session, 0, &usual());
        change(&mut limits);
        session.start_identifying(0, limits)
    });
    assert!(is_at_rest(&mut session), "{list}");
    let identified = outcome.map(|outcome| match outcome {
        Outcome::Identified(identified) => identified,
        Outcome::Tuned(_) => panic!("{outcome:?}"),
    });
    (session, identified)
}

/// Inertia in kg m² and dry friction in Nm of the simulated shaft, and the resistance in Nm s/rad where it is known.
#[test]
fn identification_finds_the_shaft_of_the_simulator_and_a_loop_for_it() {
    // 3 Nm, 30 % of 10 Nm, bring the shaft of a DM-J4310 to 30 rad/s in half a second.
    for (list, inertia, friction, resistance) in
        [("m3508:1", 0.008, 0.12, None), ("damiao4310:1", 3.0 / 60.0, 0.0, Some(3.0 / 300.0))]
    {
        let (mut session, identified) = identified(list, |_| {});
        let identified = identified.unwrap_or_else(|error| panic!("{list}: {error}"));
        let (found_inertia, found_friction) = identified.mechanism().unwrap();
        assert!((found_inertia / inertia - 1.0).abs() < 0.05, "{list}: {identified:?}");
        assert!((found_friction - friction).abs() < 0.01, "{list}: {identified:?}");
        if let Some(resistance) = resistance {
            assert!((identified.plant.kv / resistance - 1.0).abs() < 0.1, "{identified:?}");
        }
        // The gains stay, and those that were found hold a speed.
        assert_eq!(session.robot().gains(0), self::session(list).robot().gains(0));
        session.robot_mut().set_gains(0, identified.speed.gains()).unwrap();
        let mut reached = 0.0;
        driven(&mut session, 1_500, |session| {
            reached = simulated(session).velocity(0);
            false
        });
        assert!((reached - 10.0).abs() < 0.1, "{list}: {reached} rad/s");
    }
}

/// 0.741 Nm/A are 0.741 V s/rad.
#[test]
fn a_gm6020_by_voltage_has_a_load_that_lets_it_be_identified() {
    let (_, identified) = identified("gm6020:5", |_| {});
    let plant = identified.unwrap().plant;
    assert!((plant.kv / 0.741 - 1.0).abs() < 0.03 && plant.ks.abs() < 0.1, "{plant:?}");
}

#[test]
fn identification_that_meets_a_limit_stops_and_says_which() {
    let (_, fast) = identified("damiao4310:1", |limits| limits.speed = 0.05);
    assert_eq!(fast.unwrap_err(), "stopped: the speed is beyond its limit");
    let (_, far) = identified("m3508:1", |limits| limits.way = 0.01);
    assert_eq!(far.unwrap_err(), "stopped: the way is beyond its limit");
    let mut session = session("m3508:1");
    let limits = Limits { effort: 0.0, ..crate::commands::limits(&session, 0, &usual()) };
    assert!(session.start_identifying(0, limits).unwrap_err().contains("effort_limit"));
}

#[test]
fn a_motor_that_is_lost_ends_its_identification() {
    let mut session = session("m3508:1");
    let outcome = measured(&mut session, |session| {
        simulated(session).silence(0, Duration::from_millis(400));
        let limits = crate::commands::limits(session, 0, &usual());
        session.start_identifying(0, limits)
    });
    assert_eq!(outcome, Err("no outcome".to_owned()));
    assert!(session.has_failed() && is_at_rest(&mut session));
}
