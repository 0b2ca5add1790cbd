//! A family asks the safety core for its rules: link, arming and its gesture, command deadline, edges, second master, opening, and the
//! order of refusals. What shape alone shows of a rule elsewhere is found here; whether a family asks in the right order is not.
//!
//! * A protocol (`damiao`, `lk`, `odrive`, `rmd`, `robstride`, `vesc`) has no clock: it may name a short list of `motor` and `control`, of
//!   `time` a duration for a setting of its drive, and declares few types beside those that it shows.
//! * An age may be compared with nothing, whatever its name, unless the table has the comparison with its reason.
//! * A field that counts is in a table with what it counts: a count of updates is a time too.
//! * A name with a word of the rules is in a table with what it is, each call by which a motor trips and each question for the link with its
//!   reason.

use super::taint::{Seeds, Taint, counting_in, declared_in, words_of};
use super::{FAMILIES, SIZES, definitions, leaves, named_paths, rust_files, sources, tokens};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// What the core alone says: ages and their limits, the gesture, the order of refusals, time that did not move on.
const RULES: [&str; 14] = [
    "late_us",
    "offline_us",
    "command_us",
    "measured_us",
    "good_frames",
    "is_near",
    "Gesture",
    "Condition::Late",
    "ClockFault",
    "ArmError::",
    ".late()",
    ".offline()",
    ".command()",
    ".measured()",
];

/// Times, and all that is calculated from them. Counts of held updates are times.
const AGES: Seeds<'static> = Seeds {
    functions: &[
        "age",
        "begin",
        "dt_s",
        "elapsed",
        "furthest",
        "gap_us",
        "held_steps",
        "last_time",
        "now",
        "since",
        "stamp",
        "stamp_of_measurement",
        "take_age",
        "time_of",
        "updated",
    ],
    names: &["now", "heard"],
    types: &["Instant", "Tick"],
};

/// Ages that a family compares with a limit: of the frames of its drives, none of a link or a target. File, words, reason.
const TIMES_OF_DRIVES: [(&str, &str, &str); 26] = [
    ("dji/outbox.rs", "self . keep_alive_us", "zero frames are sent again"),
    (
        "dji/slot/gap.rs",
        "now . wrapping_sub ( slot . guard . heard",
        "a shaft turns less than half a turn",
    ),
    ("dji/slot/gap.rs", "gap_us < trusted_gap_us", "the same, of a motor whose frames are crowded"),
    ("dji/slot/health.rs", "Traffic :: WINDOW", "the window in which frames are counted is over"),
    ("odrive/bus.rs", "POLL_S", "estimates that a drive does not send are asked for"),
    ("odrive/bus.rs", "HEARTBEAT_S", "the state of an axis without heartbeats is unknown"),
    ("odrive/bus.rs", "INQUIRY_S", "a heartbeat that does not come is asked for"),
    ("pwm/brushed.rs", "dt_s > 0", "two readings of a counter at one time give no speed"),
    ("pwm/rc.rs", "self . arming_time", "an ESC wants neutral for so long before it follows"),
    ("snake/bus.rs", "now < = self . now", "no time passes for a reply"),
    (
        "snake/bus.rs",
        "held > self . reply_timeout",
        "the same, and a held update counts a millisecond",
    ),
    (
        "snake/schedule.rs",
        "asked",
        "a reply answers the register that was asked, kept beside a time",
    ),
    (
        "snake/schedule.rs",
        "held_steps ( ) = = 0",
        "in an update without a step, no time for a reply passes",
    ),
    ("snake/schedule.rs", "passed > timeout", "a reply that does not come is not waited for"),
    ("snake/slot.rs", "REMIND", "a disable or a target is sent again: a drive may have missed it"),
    ("snake/slot.rs", "now < self . told_at", "the same after a set-back of the clock"),
    ("snake/slot/health.rs", "furthest", "a position further away than a joint can have moved"),
    ("snake/slot/health.rs", "RATE_SPAN", "the span of a rate"),
    ("snake/slot/health.rs", "now < since", "the same after a set-back of the clock"),
    ("snake/slot/health.rs", "window", "a joint that does not move, as its configuration says"),
    ("motor/actuator/joint.rs", "furthest", "an angle further away than a shaft can have turned"),
    (
        "motor/actuator/joint.rs",
        "gap_s > known_s",
        "a drive may have started again between two angles",
    ),
    (
        "motor/actuator/mode.rs",
        "self . since",
        "a count of commands, of the name of a time elsewhere",
    ),
    ("motor/actuator/power.rs", "SETTLING", "a drive may report its former state for so long"),
    ("motor/actuator/power.rs", "told", "a frame for the power of a drive is sent again"),
    ("motor/actuator/update.rs", "inquired", "the rate of questions for settings"),
];

/// Fields that count, by folder: what they count.
const COUNTS: [(&str, &str, &[&str]); 24] = [
    ("dji", "no count: gains of a configuration, a current in its unit", &["current", "kd", "ki"]),
    ("lk", "no count: a current in its unit", &["current"]),
    ("snake", "no count: a bit for each joint", &["reads", "returned", "stops", "writes"]),
    ("vesc", "no count: fields of a frame", &["inputs"]),
    (
        "motor/actuator",
        "no count: a target in the direction of the drive",
        &["torque_nm", "velocity"],
    ),
    ("damiao", "frames for the power of a drive, whose ids take turns", &["specials"]),
    (
        "dji",
        "frames and events, for the application",
        &[
            "ambiguous_gaps",
            "bad_field",
            "bad_length",
            "bad_steps",
            "packed",
            "saturated",
            "superseded",
            "unattached",
        ],
    ),
    ("dji", "motors at a place, places, bytes of a text", &["generation", "next", "length"]),
    ("dji", "the length of a round of checks", &["elapsed"]),
    ("lk", "the angle of the rotor, echoes that are due", &["rotor", "echoes"]),
    ("lk", "commands without feedback, until the drive is asked for its angle", &["silent"]),
    ("odrive", "estimates that are asked for", &["age_s", "rests"]),
    ("odrive", "heartbeats that are asked for", &["silence_s"]),
    ("odrive", "frames that clear errors, frames that show a refusal", &["clears", "refused"]),
    ("rmd", "commands without feedback, and writes of a memory that wears", &["silent", "writes"]),
    ("robstride", "questions, and turns of the shaft", &["questions", "turn"]),
    (
        "snake",
        "frames and events, for the application",
        &["bad_replies", "counter", "packed", "position_jumps", "requests", "resets", "superseded"],
    ),
    ("snake", "joints at a place, and the registers in turn", &["generation", "turn"]),
    (
        "vesc",
        "frames since the last angle, orders since a question",
        &["angle_age", "orders", "unanswered"],
    ),
    ("pwm", "counts of an encoder, and the filtered speed", &["counts", "rad_per_s"]),
    ("motor/actuator", "the angle of a joint", &["angle", "zero"]),
    (
        "motor/actuator",
        "no count: gains of an impedance, a quarter of a step larger",
        &["damping", "stiffness"],
    ),
    (
        "motor/actuator",
        "questions in turn, commands since the drive was told",
        &["place", "prepared", "since", "turn"],
    ),
    (
        "motor/actuator",
        "frames that enable a drive, and frames that were replaced",
        &["enabling", "superseded"],
    ),
];

/// The functions by which a motor trips, and those that judge a condition.
const TRIPPING: [&str; 7] =
    ["trip", "relax_until_armed", "fail", "lose_zero", "lose_time", "judge", "react"];

/// Calls by which a motor trips, by file: how many, and why.
const TRIPS: [(&str, usize, &str); 10] = [
    ("dji/device.rs", 1, "the runner trips all motors"),
    (
        "dji/slot/health.rs",
        3,
        "an error, a second master, two motors with one id, a check: as the configuration says",
    ),
    ("motor/actuator/device.rs", 1, "the runner trips the motor"),
    ("motor/actuator/joint.rs", 3, "no trip: the joint has no zero from now on"),
    (
        "motor/actuator/update.rs",
        4,
        "the joint lost its zero, twice; the drive started again, or has a wrong setting",
    ),
    ("snake/device.rs", 1, "the runner trips all joints"),
    ("snake/slot/health.rs", 4, "the joint lost its zero: in a silence, offline, by its drive"),
    ("snake/slot/health.rs", 1, "a drive in an unexpected state is not armed meanwhile"),
    ("snake/bus.rs", 1, "a second master: as the configuration says"),
    (
        "snake/slot/health.rs",
        2,
        "a drive in an unexpected state, a stall: as the configuration says",
    ),
];

/// The other functions that change the state of a motor: its target, its rest, its arming, the open share, the emergency stop.
const ORDERS: [&str; 13] = [
    "clear_emergency_stop",
    "disarm",
    "emergency_stop",
    "engage",
    "forget_target",
    "hear_rival",
    "open",
    "pause",
    "relax",
    "renew_target",
    "reopen",
    "set_stop",
    "take_target",
];

/// The names of the core's parts in a family, and their types.
const CORES: [&str; 5] = ["guard", "rules", "device", "motor", "latch"];
const CORE_TYPES: [&str; 4] = ["Guard", "DeviceGuard", "MotorGuard", "Rules"];

/// The functions of a latch that set a condition, or ask for one alone.
const LATCHING: [&str; 3] = ["has", "report", "set"];

/// Calls of these functions, by file: how many, and for what.
const ORDERED: [(&str, usize, &str); 19] = [
    (
        "dji/attach.rs",
        2,
        "a request to arm, once the motors are fit; which motor has a second master",
    ),
    ("dji/slot.rs", 2, "a target like the one before"),
    ("dji/slot/gap.rs", 2, "turns that may be missed, and a position that is set"),
    ("dji/slot/health.rs", 1, "the error of an ESC"),
    ("dji/slot/health.rs", 2, "no soft limit without a zero; two drives that are one again"),
    (
        "dji/slot/target.rs",
        3,
        "a target, of a new kind or as before, and none, as the application asks",
    ),
    ("dji/targets.rs", 3, "the application disarms, stops, and clears the stop"),
    ("dji/watch.rs", 1, "a command of another node"),
    ("motor/actuator/device.rs", 4, "the application arms, disarms, stops, and clears the stop"),
    ("motor/actuator/joint.rs", 1, "no soft limit without an angle"),
    (
        "motor/actuator/mod.rs",
        2,
        "no target, as the application asks; the drive did not follow before",
    ),
    (
        "motor/actuator/update.rs",
        3,
        "a mode that is no more, an angle that is lost, a drive that counts anew",
    ),
    ("pwm/brushed.rs", 4, "the application arms, disarms, stops, and clears the stop"),
    ("pwm/rc.rs", 4, "the same"),
    (
        "snake/device.rs",
        6,
        "the same; which joint has a second master, and a fault ends with arming",
    ),
    ("snake/slot/health.rs", 1, "a second master counts from its last command"),
    ("snake/bus.rs", 1, "a command of another node"),
    ("snake/slot.rs", 1, "a zero that is set"),
    ("snake/targets.rs", 2, "a target, and none, as the application asks"),
];

/// Where a family asks whether a step is usable, by file: how many times, and for what. The core says what an update without one does.
const STEPS: [(&str, usize, &str); 5] = [
    ("dji/bus.rs", 1, "for the core"),
    ("motor/actuator/update.rs", 2, "for the core, and before an update that changes nothing"),
    ("pwm/brushed.rs", 1, "for the core"),
    ("pwm/rc.rs", 1, "for the core"),
    ("snake/bus.rs", 1, "for the core"),
];

/// Where a family asks for the state of the link, by file: how many times, and for what. The core alone says what follows for the drive.
const LINKS: [(&str, usize, &str); 10] = [
    ("dji/device.rs", 2, "no velocity and no angle of old feedback"),
    ("dji/slot/gap.rs", 10, "how the shaft moved in a gap, and whether the link recovered"),
    ("dji/slot/gap.rs", 2, "a zero at the present position; frames counted without a check"),
    ("dji/slot/health.rs", 2, "old feedback has no fault, and needs a full check"),
    ("dji/slot/health.rs", 2, "no state and no temperature before the first frame"),
    ("motor/actuator/mod.rs", 1, "no values of old feedback"),
    ("motor/actuator/update.rs", 1, "a drive that was silent is asked for its settings again"),
    ("pwm/brushed.rs", 1, "no values of old counts"),
    ("snake/targets.rs", 1, "a zero at the present position"),
    ("snake/slot/health.rs", 5, "a position far from the last one; no stall of old feedback"),
];

/// Words of the rules, as a name begins with them.
const WORDS: [&str; 35] = [
    "age", "arm", "block", "cooldown", "deadline", "debounce", "disarm", "double", "duplic",
    "edge", "expire", "foreign", "fresh", "gate", "gesture", "gone", "grace", "heard", "held",
    "hold", "inhibit", "latch", "late", "lost", "master", "offline", "old", "open", "permit",
    "ramp", "recover", "rival", "silen", "stale", "trip",
];

/// More words, of names that are no rule as often: exact.
const WHOLE_WORDS: [&str; 9] =
    ["armed", "lose", "slew", "stop", "stopped", "stops", "timeout", "timeouts", "watchdog"];

/// Names with such a word, by folder: what they are.
const OWN_NAMES: [(&str, &str, &[&str]); 25] = [
    ("damiao", "the register of the id of feedback", &["master_id", "with_master_id"]),
    ("damiao", "the time-out of the drive, a setting", &["timeout", "with_timeout"]),
    ("damiao", "an error of the drive", &["CommunicationLost"]),
    (
        "dji",
        "calls of the application, which the core answers",
        &[
            "arm",
            "arm_only",
            "clear_emergency_stop",
            "disarm",
            "emergency_stop",
            "is_armed",
            "is_motor_armed",
            "is_stopped",
            "next_edge",
            "with_opening",
            "with_timeouts",
            "opening",
        ],
    ),
    ("dji", "the core is asked for each motor", &["rival_among", "take_edge"]),
    ("dji", "the integral within the share that the core leaves", &["hold_back", "opened_part"]),
    ("dji", "a command frame is opened for a motor", &["open"]),
    ("lk", "a count of commands: see above", &["SILENT", "silent"]),
    ("odrive", "ages of what is asked for: see above", &["age_s", "silence_s"]),
    ("odrive", "the stop of the drive, by its own command", &["Stop", "stop", "stops"]),
    ("odrive", "the watchdog of the drive, a setting", &["enable_watchdog", "watchdog_timeout"]),
    ("odrive", "the code of a drive that disarmed itself", &["DISARMED"]),
    (
        "rmd",
        "the time-out of the drive, a setting",
        &[
            "SetTimeout",
            "TIMEOUT_MS",
            "has_timeout",
            "timeout",
            "timeout_found",
            "with_timeout",
            "without_timeout",
        ],
    ),
    ("rmd", "a report of the drive that its time-out expired", &["EXPIRED"]),
    (
        "rmd",
        "commands of the drive, its brake, its answers",
        &["Stop", "is_brake_open", "is_open", "is_heard", "silent"],
    ),
    (
        "robstride",
        "the time-out of the drive, a setting",
        &["has_timeout", "timeout", "with_timeout"],
    ),
    (
        "snake",
        "calls of the application, which the core answers",
        &["is_joint_armed", "next_edge", "with_timeouts"],
    ),
    ("snake", "the core is asked for each joint", &["foreign_commands", "hold"]),
    ("snake", "the time of the last position", &["heard"]),
    ("snake", "a drive in an unexpected state has lost its zero", &["lose_zero"]),
    (
        "snake",
        "disables go first; the time-out of a reply",
        &["reply_timeout", "stop", "stop_again", "stop_all", "stops", "with_reply_timeout"],
    ),
    ("vesc", "a count of frames: see above", &["angle_age", "has_fresh_angle"]),
    (
        "pwm",
        "calls of the application, which the core answers",
        &[
            "arm",
            "clear_emergency_stop",
            "disarm",
            "emergency_stop",
            "is_armed",
            "next_edge",
            "opening",
            "timeouts",
            "with_opening",
            "with_timeouts",
        ],
    ),
    (
        "pwm",
        "an ESC wants neutral before it follows",
        &["Arming", "arming", "arming_time", "go_on_arming", "with_arming_time"],
    ),
    (
        "motor/actuator",
        "the core is asked, and settings of the drive",
        &[
            "Lost",
            "TimeoutUnits",
            "holds",
            "lose_zero",
            "open",
            "rival",
            "stop",
            "with_opening",
            "with_timeouts",
        ],
    ),
];

/// What a protocol may name of these modules; of `error`, `frame`, `math`, `units` and `wire` everything.
const MAY_NAME: [(&str, &[&str]); 4] = [
    (
        "motor",
        &[
            "Capabilities",
            "Capability",
            "Claim",
            "ControlMode",
            "DriveProtocol",
            "Form",
            "Goal",
            "Impedance",
            "ImpedanceControl",
            "Ingest",
            "Inquiry",
            "MotorName",
            "Order",
            "Preparation",
            "Questions",
            "Role",
            "Settings",
            "Shaft",
            "Target",
            "TimeoutUnits",
            "Told",
            "TorqueLoops",
            "Vitals",
            "WrongSetting",
            "code_from",
            "ingest_eight",
            "inside",
            "lowest_bit",
            "mit_model",
            "models",
            "register_questions",
            "registers",
        ],
    ),
    ("control", &["Pid", "PidConfig"]),
    ("time", &["Duration"]),
    ("encoder", &["GearRatio", "Laps", "Tachometer", "self"]),
];

/// What a protocol may name of `core`.
const OF_CORE: [&str; 2] = ["f32", "mem"];

/// The types of a protocol beside those that it shows, and what they hold.
const TYPES_OF_PROTOCOLS: [(&str, &str, &[&str]); 4] = [
    ("lk", "the scale of a model", &["Scale"]),
    (
        "odrive",
        "the state of the motor, the way to closed loop, endpoints",
        &["State", "Phase", "Endpoint", "Preparations"],
    ),
    ("rmd", "how far the drive is enabled, the angle with turns", &["Enabling", "Track"]),
    (
        "vesc",
        "the kinds of control, and the shaft",
        &["At", "CurrentControl", "DutyControl", "Kind"],
    ),
];

/// The files of a folder: the path below `src`, and the text.
type Files = Vec<(String, String)>;

fn folders() -> impl Iterator<Item = &'static str> {
    FAMILIES.into_iter().chain(["pwm", "motor/actuator"])
}

fn files_of(folder: &str) -> Files {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let name = |file: &Path| file.strip_prefix(&src).unwrap().display().to_string();
    let files = rust_files(&src.join(folder)).into_iter();
    let files = files.map(|file| (name(&file), fs::read_to_string(&file).unwrap()));
    files.filter(|(name, _)| !name.contains("/tests")).collect()
}

fn steps_in(tokens: &[String]) -> usize {
    let asks =
        |call: &&[String]| call[1] == "(" && ["is_hold", "usable"].contains(&call[0].as_str());
    tokens.windows(2).filter(asks).count()
}

fn trips_in(tokens: &[String]) -> usize {
    let trips = |call: &&[String]| {
        let is_call =
            [".", "::"].contains(&call[0].as_str()) && [",", "(", ")"].contains(&call[2].as_str());
        is_call && TRIPPING.contains(&call[1].as_str())
    };
    tokens.windows(3).filter(trips).count()
}

fn orders_in(tokens: &[String]) -> usize {
    let orders = |call: &&[String]| {
        let [of, dot, name, after] = [0, 1, 2, 3].map(|at| call[at].as_str());
        let may_be = if of == "latch" { &LATCHING[..] } else { &ORDERS[..] };
        let is_call = dot == "." && after == "(" && CORES.contains(&of);
        let is_path = dot == "::" && CORE_TYPES.contains(&of);
        (is_call || is_path) && may_be.contains(&name)
    };
    tokens.windows(4).filter(orders).count()
}

fn links_in(tokens: &[String]) -> usize {
    tokens.windows(2).filter(|path| path[0] == "Link" && path[1] == "::").count()
}

/// What is found in a folder. `used` has the rows of the tables that were needed.
fn findings(folder: &str, files: &Files, used: &mut BTreeSet<String>) -> Vec<String> {
    let mut found = Vec::new();
    for (file, text) in files {
        let tokens = tokens(text);
        found.extend(
            own_rules(text).into_iter().map(|line| format!("{file}: a rule of the core, {line}")),
        );
        if makes_refusal(&tokens) {
            found.push(format!("{file} refuses to arm"));
        }
        for (calls, table, what) in [
            (steps_in(&tokens), &STEPS[..], "questions for a usable step"),
            (trips_in(&tokens), &TRIPS, "calls by which a motor trips"),
            (orders_in(&tokens), &ORDERED, "calls that change the state of a motor"),
            (links_in(&tokens), &LINKS, "questions for the link"),
        ] {
            let rows = table.iter().filter(|(name, ..)| name == file);
            if calls != rows.map(|(_, calls, _)| calls).sum() {
                found.push(format!("{file} has {calls} {what}"));
            }
        }
        let mut row = |table: &[(&str, &str, &[&str])], name: &String, is: &str| {
            let listed = |(of, _, names): &&(&str, &str, &[&str])| {
                *of == folder && names.contains(&name.as_str())
            };
            match table.iter().find(listed) {
                Some(_) => _ = used.insert(format!("{is} {folder} {name}")),
                None => found.push(format!("{file}: {is} {name}")),
            }
        };
        for name in counting_in(&tokens) {
            row(&COUNTS, &name, "a count");
        }
        let (items, methods) = definitions(&tokens);
        let names: BTreeSet<_> =
            items.iter().chain(&methods).cloned().chain(declared_in(&tokens)).collect();
        for name in names.iter().filter(|name| is_of_rules(name)) {
            row(&OWN_NAMES, name, "the name");
        }
        if is_protocol(folder) {
            for name in items.iter().filter(|name| is_type(name) && !is_shown(name, files)) {
                row(&TYPES_OF_PROTOCOLS, name, "the type");
            }
            found.extend(
                strange_names(folder, &tokens)
                    .into_iter()
                    .map(|path| format!("{file} names {path}")),
            );
        }
    }
    let taint = Taint::of(AGES, files.iter().map(|(_, text)| tokens(text)));
    for (number, statement) in taint.judgements() {
        let file = &files[number].0;
        let of_drive =
            |(name, words, _): &&(&str, &str, &str)| name == file && statement.contains(words);
        match TIMES_OF_DRIVES.iter().find(of_drive) {
            Some((file, words, _)) => _ = used.insert(format!("a time {file} {words}")),
            None => found.push(format!("{file} compares a time: {statement}")),
        }
    }
    found
}

fn is_protocol(folder: &str) -> bool {
    SIZES.iter().any(|(family, _)| *family == folder)
}

fn is_type(name: &str) -> bool {
    name.starts_with(char::is_uppercase) && name.contains(char::is_lowercase)
}

/// Whether the folder shows a type: its `mod.rs` exports the name.
fn is_shown(name: &str, files: &Files) -> bool {
    let module =
        files.iter().find(|(file, _)| file.ends_with("/mod.rs")).map_or("", |(_, text)| text);
    let exports = module.split("pub use ").skip(1).filter_map(|rest| rest.split_once(';'));
    exports
        .map(|(export, _)| export)
        .any(|export| export.split(|c: char| !c.is_alphanumeric()).any(|word| word == name))
}

fn is_of_rules(name: &str) -> bool {
    words_of(name).iter().any(|word| {
        WORDS.iter().any(|rule| word.starts_with(rule)) || WHOLE_WORDS.contains(&word.as_str())
    })
}

fn own_rules(text: &str) -> Vec<String> {
    let code = super::code(text).filter(|line| !line.trim_start().starts_with("//"));
    let lines = (1..).zip(code).filter(|(_, line)| RULES.iter().any(|rule| line.contains(rule)));
    lines.map(|(number, line)| format!("{number}: {line}")).collect()
}

fn makes_refusal(tokens: &[String]) -> bool {
    tokens.windows(3).any(|path| {
        path[0] == "ArmError" && path[1] == "::" && path[2].starts_with(char::is_uppercase)
    })
}

/// What a protocol names outside of its folder and may not: paths, and words of a clock.
fn strange_names(folder: &str, tokens: &[String]) -> Vec<String> {
    let mut paths = named_paths(tokens);
    for (place, _) in tokens.iter().enumerate().filter(|(_, token)| *token == "use") {
        let end = place + tokens[place..].iter().take_while(|token| *token != ";").count();
        leaves(&tokens[place + 1..end], &[], &mut |path, _| paths.push(path));
    }
    let words = |path: &Vec<String>| path.iter().map(String::as_str).collect::<Vec<_>>().join("::");
    let mut found: Vec<String> =
        paths.iter().filter(|path| !may_name(folder, path)).map(words).collect();
    for pair in tokens.windows(2) {
        let (token, is_call) = (pair[0].as_str(), pair[1] == "(");
        let is_read =
            is_call && AGES.functions.contains(&token) && !["dt_s", "since"].contains(&token);
        if is_read || AGES.types.contains(&token) || token == "TimeStep" {
            found.push(token.to_owned());
        }
    }
    found
}

fn may_name(folder: &str, path: &[String]) -> bool {
    let name = |place: usize| path.get(place).map_or("self", String::as_str);
    match (name(0), name(1)) {
        ("super", "super") | ("std" | "alloc", _) => false,
        ("core", part) => OF_CORE.contains(&part),
        ("crate", module) if module == folder => true,
        ("crate", "error" | "frame" | "math" | "units" | "wire") => true,
        ("crate", "lk") => folder == "rmd",
        ("crate", module) => {
            MAY_NAME.iter().any(|(of, names)| *of == module && names.contains(&name(2)))
        }
        _ => true,
    }
}

#[test]
fn each_name_of_an_age_is_in_the_sources() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let all: BTreeSet<_> = rust_files(&src)
        .iter()
        .flat_map(|file| tokens(&fs::read_to_string(file).unwrap()))
        .collect();
    let names = AGES.functions.iter().chain(AGES.names).chain(AGES.types);
    let names = names.chain(&TRIPPING).chain(&ORDERS).chain(&LATCHING);
    let gone: Vec<_> = names.filter(|name| !all.contains(**name)).collect();
    assert!(gone.is_empty(), "{gone:?}");
}

#[test]
fn no_family_has_a_safety_rule_of_its_own() {
    let (mut found, mut used) = (Vec::new(), BTreeSet::new());
    for folder in folders() {
        found.extend(findings(folder, &files_of(folder), &mut used));
    }
    assert!(found.is_empty(), "{found:#?}");
    let rows = |is: &str, table: &[(&str, &str, &[&str])]| -> Vec<String> {
        let row = |(folder, _, names): &(&str, &str, &[&str])| {
            names.iter().map(|name| format!("{is} {folder} {name}")).collect::<Vec<_>>()
        };
        table.iter().flat_map(row).collect()
    };
    let times = TIMES_OF_DRIVES.iter().map(|(file, words, _)| format!("a time {file} {words}"));
    let listed: BTreeSet<String> = rows("a count", &COUNTS)
        .into_iter()
        .chain(rows("the name", &OWN_NAMES))
        .chain(rows("the type", &TYPES_OF_PROTOCOLS))
        .chain(times)
        .collect();
    let unused: Vec<_> = listed.difference(&used).collect();
    assert!(unused.is_empty(), "exceptions without their lines: {unused:#?}");
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let core = rust_files(&src.join("motor/safety"));
    let of_core = core.iter().map(|file| own_rules(&fs::read_to_string(file).unwrap()).len());
    assert!(of_core.sum::<usize>() > 10, "the rules are somewhere");
}

/// The order of the reasons has one home: nothing but it makes a refusal.
#[test]
fn a_request_to_arm_is_refused_in_one_file() {
    let homes: Vec<String> = sources()
        .into_iter()
        .filter(|(module, path, _)| module != "sim" && !path.iter().any(|part| part == "tests"))
        .filter(|(_, _, text)| makes_refusal(&tokens(text)))
        .map(|(_, path, _)| path.display().to_string())
        .collect();
    assert!(homes.iter().all(|home| home.ends_with("motor/arming.rs")), "{homes:?}");
    assert_eq!(homes.len(), 1);
}

#[path = "planted.rs"]
mod planted;
