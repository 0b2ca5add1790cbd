//! Holds the floors of the house: a module uses only floors below its own, and no file grows past 400 lines.

#![cfg(test)]

use std::fs;
use std::path::{Path, PathBuf};

/// Module and floor, as `DESIGN.md` draws them. Modules of one floor do not know each other.
const FLOORS: [(&str, u32); 23] = [
    ("error", 0),
    ("units", 2),
    ("time", 1),
    ("math", 1),
    ("frame", 1),
    ("encoder", 10),
    ("control", 10),
    ("geometry", 10),
    ("manipulator", 11),
    ("motor", 20),
    ("wire", 19),
    ("chassis", 21),
    ("shooter", 21),
    ("damiao", 30),
    ("dji", 30),
    ("lk", 30),
    ("odrive", 30),
    ("rmd", 31),
    ("robstride", 30),
    ("snake", 30),
    ("vesc", 30),
    ("pwm", 30),
    ("runner", 40),
];

/// The simulator stands on the devices' side of the wire: it takes their facts and nothing else of their code.
const SIM_FLOOR: u32 = 31;

const LONGEST_FILE: usize = 400;

fn floor(module: &str) -> Option<u32> {
    if module == "sim" {
        return Some(SIM_FLOOR);
    }
    FLOORS.iter().find(|(name, _)| *name == module).map(|(_, floor)| *floor)
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

/// The lines before the tests: before `#[cfg(test)]` in front of a module with a body.
fn code(text: &str) -> impl Iterator<Item = &str> {
    let mut lines = text.lines().peekable();
    std::iter::from_fn(move || {
        let line = lines.next()?;
        let next = lines.peek().copied().unwrap_or_default().trim();
        let tests =
            line.trim() == "#[cfg(test)]" && next.starts_with("mod ") && next.ends_with('{');
        // An `#[expect]` may stand between the two.
        let tests_below = line.trim() == "#[cfg(test)]" && next.starts_with("#[expect(");
        (!tests && !tests_below).then_some(line)
    })
}

/// The text of a `use` that runs over several lines, in one.
fn joined(text: &str) -> Vec<(usize, String)> {
    let mut lines: Vec<(usize, String)> = Vec::new();
    let mut open = false;
    for (number, line) in (1..).zip(code(text)) {
        if line.trim_start().starts_with("//") {
            continue;
        }
        match lines.last_mut() {
            Some((_, last)) if open => last.push_str(line.trim()),
            _ => lines.push((number, line.to_string())),
        }
        let last = lines.last().map_or("", |(_, last)| last.as_str());
        open = last.contains("use crate::{") && !last.contains(';');
    }
    lines
}

/// The modules that a line of code names as `crate::module`, alone or in braces.
fn named(line: &str) -> Vec<String> {
    if line.trim_start().starts_with("//") {
        return Vec::new();
    }
    let word = |text: &str| {
        text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()
    };
    let mut modules = Vec::new();
    for rest in line.split("crate::").skip(1) {
        match rest.strip_prefix('{') {
            Some(list) => modules.extend(list.split(',').map(|item| word(item.trim()))),
            None => modules.push(word(rest)),
        }
    }
    modules
}

/// Names of the driver that the simulator may use: the table of facts, not the code.
const FACTS: [&str; 10] = [
    "Facts",
    "Gm6020Current",
    "Gm6020Voltage",
    "M2006",
    "M3508",
    "Model",
    "self",
    "model",
    "as",
    "dji",
];

/// The same of the families with simulated drives: the models.
const DRIVE_FACTS: [&str; 1] = ["Model"];

/// The same of the joints.
const JOINT_FACTS: [&str; 4] = ["IDS", "PULSES_PER_TURN", "Register", "self"];

fn strangers(text: &str) -> Vec<String> {
    let mut found = other_than("dji", &FACTS, text);
    found.extend(other_than("snake", &JOINT_FACTS, text));
    for family in ["damiao", "lk", "odrive", "rmd", "robstride", "vesc"] {
        found.extend(other_than(family, &DRIVE_FACTS, text));
    }
    found
}

fn other_than(family: &str, facts: &[&str], text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (number, line) in joined(text) {
        for rest in line.split(&format!("crate::{family}::")).skip(1) {
            let list = rest.split(&['}', ';', '(', '<', ' '][..]).next().unwrap_or_default();
            let words = list
                .split(|c: char| !c.is_alphanumeric() && c != '_')
                .filter(|word| !word.is_empty());
            found.extend(
                words
                    .filter(|word| !facts.contains(word))
                    .map(|word| format!("line {number}: {family}::{word}")),
            );
        }
    }
    found
}

fn violations(own: &str, text: &str) -> Vec<String> {
    let own_floor = floor(own).unwrap_or(u32::MAX);
    let mut found = Vec::new();
    for (number, line) in joined(text) {
        for module in named(&line) {
            match floor(&module) {
                Some(other) if module != own && other >= own_floor => {
                    found.push(format!(
                        "line {number}: {own} (floor {own_floor}) uses {module} (floor {other})"
                    ));
                }
                _ => {}
            }
        }
    }
    found
}

fn sources() -> Vec<(String, PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    rust_files(&root)
        .into_iter()
        .map(|path| {
            let module = path
                .strip_prefix(&root)
                .unwrap()
                .iter()
                .next()
                .unwrap()
                .to_string_lossy()
                .trim_end_matches(".rs")
                .to_owned();
            let text = fs::read_to_string(&path).unwrap();
            (module, path, text)
        })
        .collect()
}

#[test]
fn a_module_uses_only_floors_below_its_own() {
    let mut found = Vec::new();
    for (module, path, text) in sources() {
        if !["lib", "guide", "pages"].contains(&module.as_str()) {
            assert!(
                floor(&module).is_some(),
                "{module} has no floor: give it one here and in DESIGN.md"
            );
            found.extend(
                violations(&module, &text).into_iter().map(|v| format!("{}: {v}", path.display())),
            );
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn the_simulator_takes_facts_from_the_driver_and_no_code() {
    let found: Vec<String> = sources()
        .iter()
        .filter(|(module, ..)| module == "sim")
        .flat_map(|(_, path, text)| {
            strangers(text).into_iter().map(move |v| format!("{}: {v}", path.display()))
        })
        .collect();
    assert!(found.is_empty(), "{found:#?}");
}

/// Its floor and the kinematics under test derive the same motion, each by its own way.
#[test]
fn the_simulator_knows_nothing_of_the_chassis() {
    let found: Vec<String> = sources()
        .iter()
        .filter(|(module, ..)| module == "sim")
        .flat_map(|(_, path, text)| {
            let chassis = joined(text).into_iter().filter(|(_, line)| knows_chassis(line));
            chassis.map(move |(number, line)| format!("{}:{number}: {line}", path.display()))
        })
        .collect();
    assert!(found.is_empty(), "{found:#?}");
}

fn knows_chassis(line: &str) -> bool {
    named(line).iter().any(|module| module == "chassis")
}

#[test]
fn no_file_is_longer_than_400_lines_without_its_tests() {
    let long: Vec<String> = sources()
        .iter()
        .filter(|(_, path, _)| path.file_name().is_some_and(|name| name != "tests.rs"))
        .map(|(_, path, text)| (path, code(text).count()))
        .filter(|(_, lines)| *lines > LONGEST_FILE)
        .map(|(path, lines)| format!("{}: {lines} lines", path.display()))
        .collect();
    assert!(long.is_empty(), "{long:#?}");
}

#[test]
fn the_check_itself_finds_what_it_should() {
    assert_eq!(violations("encoder", "use crate::dji::Bus;").len(), 1);
    assert_eq!(violations("encoder", "use crate::{units::Angle, motor::Link};").len(), 1);
    assert_eq!(violations("dji", "let x = crate::runner::Nb(can);").len(), 1);
    assert_eq!(violations("chassis", "use crate::dji::Bus;").len(), 1);
    assert!(knows_chassis("use crate::{geometry::Vec2, chassis::Mecanum};"));
    assert!(!knows_chassis("use super::chassis::Chassis;"));
    assert_eq!(strangers("use crate::snake::{Joints, Register};").len(), 1);
    assert_eq!(strangers("use crate::dji::{Bus, Facts};").len(), 1);
    assert_eq!(strangers("use crate::lk::{Feedback, Model};").len(), 1);
    assert!(
        violations(
            "dji",
            "use crate::encoder::Shaft;\n/// crate::runner\n#[cfg(test)]\nmod tests {\nuse crate::runner;"
        )
        .is_empty()
    );
}

#[test]
fn the_decisions_are_numbered_in_their_order() {
    let design = Path::new(env!("CARGO_MANIFEST_DIR")).join("DESIGN.md");
    let design = fs::read_to_string(design).unwrap();
    let section = design.split("\n## ").find(|section| section.starts_with("Decisions")).unwrap();
    let number = |line: &str| line.split_once(". **").and_then(|(number, _)| number.parse().ok());
    let numbers: Vec<usize> = section.lines().filter_map(number).collect();
    assert!(numbers.len() > 20);
    assert_eq!(numbers, (1..=numbers.len()).collect::<Vec<_>>());
}

/// The device families on CAN.
const FAMILIES: [&str; 8] = ["damiao", "dji", "lk", "odrive", "rmd", "robstride", "snake", "vesc"];

/// The first column of each table row of a text that begins with a path.
fn paths(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next())
}

/// All text of a file, or of the files below a folder.
fn text_of(path: &Path) -> String {
    if path.is_file() {
        return fs::read_to_string(path).unwrap();
    }
    rust_files(path).iter().map(|file| fs::read_to_string(file).unwrap()).collect()
}

#[test]
fn each_family_has_the_files_of_the_guide_and_is_named_around_its_folder() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let guide = fs::read_to_string(root.join("docs/adding-a-family.md")).unwrap();
    let section = |title: &str| {
        let mut sections = guide.split("\n## ");
        sections.find(|section| section.starts_with(title)).unwrap().to_owned()
    };
    let (inside, around) = (section("The folder"), section("Around the folder"));
    let beside = section("Beside an own motor");
    assert!(paths(&inside).count() == 6 && paths(&around).count() == 10);
    assert_eq!(paths(&beside).count(), 4);
    for (family, _) in SIZES {
        for path in paths(&beside) {
            assert!(text_of(&root.join(path)).contains(family), "{path} does not name {family}");
        }
    }
    for family in FAMILIES {
        for path in paths(&inside).map(|path| path.replace("FAMILY", family)) {
            assert!(root.join(&path).exists(), "{path} is not there");
        }
        for path in paths(&around) {
            assert!(text_of(&root.join(path)).contains(family), "{path} does not name {family}");
        }
    }
    let floor: Vec<&str> = FLOORS
        .iter()
        .filter(|(_, floor)| [30, 31].contains(floor))
        .map(|(name, _)| *name)
        .collect();
    let on_pins = |name: &&&str| **name != "pwm";
    assert_eq!(floor.iter().filter(on_pins).copied().collect::<Vec<_>>(), FAMILIES);
}

/// The families that `docs/adding-a-family.md` describes, with the most lines of code without tests and documentation.
const SIZES: [(&str, usize); 6] = [
    ("damiao", 600),
    ("lk", 600),
    ("odrive", 600),
    ("rmd", 600),
    ("robstride", 600),
    ("vesc", 600),
];

const MOST_TYPES: usize = 8;

/// The lines that count: as the command in `docs/checks.md` has them.
fn is_code(line: &str) -> bool {
    let line = line.trim();
    !line.is_empty() && !line.starts_with("//")
}

fn is_test(line: &str) -> bool {
    line.starts_with("#[cfg(") && line.contains("test")
}

/// The types that a family shows: the names that its `mod.rs` exports.
fn shown(module: &str) -> usize {
    let exports = module.split("pub use ").skip(1).filter_map(|rest| rest.split_once(';'));
    let names = exports.flat_map(|(export, _)| export.split(['{', '}', ',', ' ', '\n', ':']));
    names.filter(|name| name.starts_with(|letter: char| letter.is_ascii_uppercase())).count()
}

/// Lines of code in the files of a folder, without its subfolders.
fn lines_of(folder: &Path) -> usize {
    let files = rust_files(folder);
    let own = files.iter().filter(|file| file.parent() == Some(folder));
    let texts = own.map(|file| fs::read_to_string(file).unwrap());
    texts
        .map(|text| {
            text.lines().take_while(|line| !is_test(line)).filter(|line| is_code(line)).count()
        })
        .sum()
}

/// The rules; the [`Guard`](../src/motor/guard.rs) of a motor outside of a bus asks them, as the families do.
const MOST_LINES_OF_THE_CORE: usize = 600;

#[test]
fn the_safety_core_can_be_read_in_one_sitting() {
    let core = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/motor/safety");
    let lines = lines_of(&core);
    assert!((300..=MOST_LINES_OF_THE_CORE).contains(&lines), "{lines} lines");
}

#[test]
fn a_family_has_at_most_so_many_lines_and_types() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for (family, most) in SIZES {
        let lines = lines_of(&src.join(family));
        assert!((100..=most).contains(&lines), "{family} has {lines} lines of code");
        let types = shown(&fs::read_to_string(src.join(family).join("mod.rs")).unwrap());
        assert!((3..=MOST_TYPES).contains(&types), "{family} shows {types} types");
    }
    assert_eq!(shown("mod a;\npub use a::A;\npub use b::{B, C,\n    d};\n"), 3);
}

/// A family asks the safety core, and has no rule of its own about these.
const RULES: [&str; 9] = [
    "late_us",
    "offline_us",
    "command_us",
    "measured_us",
    "good_frames",
    "is_near",
    "Gesture",
    "Condition::Late",
    "Condition::ClockFault, true",
];

fn own_rules(text: &str) -> Vec<String> {
    let code = code(text).filter(|line| !line.trim_start().starts_with("//"));
    let lines = (1..).zip(code).filter(|(_, line)| RULES.iter().any(|rule| line.contains(rule)));
    lines.map(|(number, line)| format!("{number}: {line}")).collect()
}

#[test]
fn no_family_has_a_safety_rule_of_its_own() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for family in
        ["damiao", "dji", "lk", "odrive", "rmd", "robstride", "snake", "vesc", "pwm", "motor/own"]
    {
        let files = rust_files(&src.join(family));
        for file in
            files.iter().filter(|file| !file.components().any(|part| part.as_os_str() == "tests"))
        {
            let found = own_rules(&fs::read_to_string(file).unwrap());
            assert!(found.is_empty(), "{}: {found:?}", file.display());
        }
    }
    let core = rust_files(&src.join("motor/safety"));
    let of_core = core.iter().map(|file| own_rules(&fs::read_to_string(file).unwrap()).len());
    assert!(of_core.sum::<usize>() > 10, "the rules are somewhere");
}

/// The types whose inherent methods stand in at most this many files.
const MOST_FILES_OF_A_TYPE: usize = 2;

/// The types that have an inherent `impl` in a text.
fn inherent(text: &str) -> Vec<String> {
    let name = |line: &str| {
        let rest = line.strip_prefix("impl")?;
        if line.contains(" for ") {
            return None;
        }
        let rest = match rest.strip_prefix('<') {
            // The list of parameters ends with the bracket that closes its own.
            Some(list) => {
                let mut depth = 1;
                let end = list.find(|c| {
                    depth += i32::from(c == '<') - i32::from(c == '>');
                    depth == 0
                })?;
                &list[end + 1..]
            }
            None => rest,
        };
        let path = rest.trim_start().split(|c: char| !(c.is_alphanumeric() || "_:".contains(c)));
        path.into_iter().next()?.rsplit("::").next().map(String::from)
    };
    code(text).filter_map(name).filter(|name| !name.is_empty()).collect()
}

#[test]
fn the_inherent_methods_of_a_type_stand_in_at_most_two_files() {
    let mut files = std::collections::BTreeMap::<(String, String), Vec<String>>::new();
    for (module, path, text) in sources() {
        if path.components().any(|part| part.as_os_str() == "tests") {
            continue;
        }
        for name in inherent(&text) {
            let of_type = files.entry((module.clone(), name)).or_default();
            let file = path.display().to_string();
            if !of_type.contains(&file) {
                of_type.push(file);
            }
        }
    }
    assert!(files.len() > 100, "the check finds the types");
    files.retain(|_, files| files.len() > MOST_FILES_OF_A_TYPE);
    assert!(files.is_empty(), "{files:#?}");
}

#[test]
fn an_inherent_impl_is_told_from_that_of_a_trait() {
    assert_eq!(inherent("impl<B, const N: usize> Bus<B, N> {"), ["Bus"]);
    assert_eq!(inherent("impl<M: Model<Command = Current>> Config<M> {"), ["Config"]);
    assert_eq!(inherent("impl super::Slot {\n}\nimpl Default for Bus {"), ["Slot"]);
    assert!(inherent("impl<D: Devices> Devices for &mut D {\nfn impl_it() {}").is_empty());
}
