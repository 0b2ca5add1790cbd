//! Holds the floors of the house: a module uses only floors below its own, and no file grows past 400 lines.

#![cfg(test)]

#[path = "floors/rules.rs"]
mod rules;
#[path = "floors/taint.rs"]
mod taint;

use std::collections::{BTreeMap, BTreeSet};
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
    let sources = sources();
    let (path, lines) = sources
        .iter()
        .filter(|(_, path, _)| path.file_name().is_some_and(|name| name != "tests.rs"))
        .map(|(_, path, text)| (path, code(text).count()))
        .max_by_key(|(_, lines)| *lines)
        .unwrap();
    println!("longest: {}", path.display());
    hold("lines of the longest file", lines, LONGEST_FILE);
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

/// Everyday verbs for which the glossary of `DESIGN.md` has words of the field.
const VERBS: [&str; 7] = ["attend", "examine", "glance", "look", "relent", "see", "settle"];

#[test]
fn no_function_has_a_verb_for_which_the_glossary_has_another() {
    let mut found = Vec::new();
    for (_, path, text) in sources() {
        for (line, name) in text.lines().filter_map(|line| Some((line, line.split_once("fn ")?.1)))
        {
            let verb = name.split(|c: char| !c.is_alphabetic()).next().unwrap_or_default();
            if VERBS.contains(&verb) && !line.trim_start().starts_with("//") {
                found.push(format!("{}: {}", path.display(), line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
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

/// Whether a place of the guide names a family, where and as it has to: the word alone may stand elsewhere by accident.
fn names(path: &str, text: &str, family: &str) -> bool {
    let between = |begin: &str, end: &str| {
        let rest = text.split_once(begin).map_or("", |(_, rest)| rest);
        rest.split_once(end).map_or("", |(part, _)| part).to_lowercase()
    };
    let has_word = |text: &str| text.split(|c: char| !c.is_alphanumeric()).any(|it| it == family);
    let quoted = format!("`{family}`");
    match path {
        "tests/floors/rules.rs" => text.contains(&format!("(\"{family}\", \"")),
        "tests/face.rs" => {
            has_word(&between("const FAMILIES:", "];"))
                && between("const SIMULATED:", "];").contains(&format!("\"{family}drive\""))
        }
        // A sentence below the table names the joints.
        "README.md" | "README.zh-CN.md" if family == "snake" => text.contains(&quoted),
        "README.md" | "README.zh-CN.md" => {
            text.lines().any(|line| line.split(" | ").nth(1) == Some(&quoted))
        }
        "DESIGN.md" => has_word(&between("\nF3 ", "\nF4 ")),
        ".ci/quick" => has_word(&between("case $module in", ")")),
        _ => text.contains(family),
    }
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
    let beside = section("Beside an actuator");
    assert!(paths(&inside).count() == 6 && paths(&around).count() == 14);
    assert_eq!(paths(&beside).count(), 5);
    let check = |path: &str, family: &str| {
        let text = text_of(&root.join(path));
        assert!(names(path, &text, family), "{path} does not name {family}");
    };
    for (family, _) in SIZES {
        paths(&beside).for_each(|path| check(path, family));
    }
    for family in FAMILIES {
        for path in paths(&inside).map(|path| path.replace("FAMILY", family)) {
            assert!(root.join(&path).exists(), "{path} is not there");
        }
        paths(&around).for_each(|path| check(path, family));
    }
    let floor: Vec<&str> = FLOORS
        .iter()
        .filter(|(_, floor)| [30, 31].contains(floor))
        .map(|(name, _)| *name)
        .collect();
    let on_pins = |name: &&&str| **name != "pwm";
    assert_eq!(floor.iter().filter(on_pins).copied().collect::<Vec<_>>(), FAMILIES);
    let mut sized: Vec<&str> =
        SIZES.iter().chain(&SIZES_WITH_A_BUS).map(|(family, _)| *family).collect();
    sized.sort_unstable();
    assert_eq!(sized, FAMILIES, "each family has a size");
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

/// The families with a bus of their own, with the most lines of code in all of their folders: those of today.
const SIZES_WITH_A_BUS: [(&str, usize); 2] = [("dji", 3325), ("snake", 1473)];

/// A figure of the house and its bound; `.ci/size` prints these lines.
fn hold(what: &str, value: usize, most: usize) {
    println!("size: {what:56} {value:5} of {most}");
    assert!(value <= most, "{what}: {value}, at most {most} are allowed");
}

/// Compares a figure with the table of CONTRIBUTING.
fn is_told(row: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("CONTRIBUTING.md");
    assert!(fs::read_to_string(path).unwrap().contains(row), "CONTRIBUTING.md has no {row}");
}

/// The lines that count; below the first `#[cfg(test)]` of a file none does, exports of a `mod.rs` among them.
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
    files.iter().filter(|file| file.parent() == Some(folder)).map(|file| lines_in(file)).sum()
}

fn lines_in(file: &Path) -> usize {
    let text = fs::read_to_string(file).unwrap();
    text.lines().take_while(|line| !is_test(line)).filter(|line| is_code(line)).count()
}

/// The rules; the [`Guard`](../src/motor/guard.rs) of a motor outside of a bus asks them, as the families do.
const MOST_LINES_OF_THE_CORE: usize = 600;

#[test]
fn the_safety_core_can_be_read_in_one_sitting() {
    let core = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/motor/safety");
    let lines = lines_of(&core);
    assert!(lines > 300, "{lines} lines");
    hold("lines of the safety core", lines, MOST_LINES_OF_THE_CORE);
    is_told(&format!("| lines of the safety core, `src/motor/safety` | {lines} |"));
}

#[test]
fn a_family_has_at_most_so_many_lines_and_types() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut largest = 0;
    for (family, most) in SIZES {
        let lines = lines_of(&src.join(family));
        assert!(lines > 100, "{family} has {lines} lines of code");
        largest = largest.max(lines);
        hold(&format!("lines of {family}"), lines, most);
        let types = shown(&fs::read_to_string(src.join(family).join("mod.rs")).unwrap());
        assert!((3..=MOST_TYPES).contains(&types), "{family} shows {types} types");
    }
    is_told(&format!("| lines of each of the six families, the most | {largest} |"));
    let buses = SIZES_WITH_A_BUS.map(|(family, most)| {
        let files = rust_files(&src.join(family));
        let is_test = |file: &Path| file.iter().any(|part| part == "tests");
        let lines = files.iter().filter(|file| !is_test(file)).map(|file| lines_in(file)).sum();
        hold(&format!("lines of {family}, with its bus"), lines, most);
        lines.to_string()
    });
    is_told(&format!("| lines of `dji`, and of `snake` | {} |", buses.join(", ")));
    assert_eq!(shown("mod a;\npub use a::A;\npub use b::{B, C,\n    d};\n"), 3);
}

/// Half of the lines and about a quarter of the stepping functions of the two controllers that the PID replaced: 1090 and 17.
const MOST_OF_THE_PID: (usize, usize) = (545, 4);

#[test]
fn the_pid_is_half_of_the_controllers_that_it_replaced() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/control/pid");
    let lines = lines_of(&folder);
    let law = fs::read_to_string(folder.join("law.rs")).unwrap();
    let (law, _) = law.split_once("#[cfg(test)]").unwrap();
    // Private functions count too, if they take a time step and return one number: the output.
    let is_step = |function: &&str| {
        let (head, _) = function.split_once(" {\n").unwrap();
        let returns = ["-> f32", "-> Result<f32", "-> Option<f32"];
        head.contains("&TimeStep") && returns.iter().any(|it| head.contains(it))
    };
    let steps = law.split("fn ").skip(1).filter(is_step).count();
    assert!(lines > 300 && steps > 1, "{lines} lines, {steps} functions");
    hold("lines of the PID", lines, MOST_OF_THE_PID.0);
    hold("functions of the PID that step", steps, MOST_OF_THE_PID.1);
    is_told(&format!("that step | {lines}, {steps} |"));
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
    let mut files = BTreeMap::<(String, String), Vec<String>>::new();
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
    let ((_, name), most) = files.iter().max_by_key(|(_, files)| files.len()).unwrap();
    println!("most files: {name} in {most:?}");
    hold("most files of a type's methods", most.len(), MOST_FILES_OF_A_TYPE);
}

#[test]
fn an_inherent_impl_is_told_from_that_of_a_trait() {
    assert_eq!(inherent("impl<B, const N: usize> Bus<B, N> {"), ["Bus"]);
    assert_eq!(inherent("impl<M: Model<Command = Current>> Config<M> {"), ["Config"]);
    assert_eq!(inherent("impl super::Slot {\n}\nimpl Default for Bus {"), ["Slot"]);
    assert!(inherent("impl<D: Devices> Devices for &mut D {\nfn impl_it() {}").is_empty());
}

/// Words and signs of a text, without comments, strings, lifetimes and tests.
fn tokens(text: &str) -> Vec<String> {
    let text: String = code(text).flat_map(|line| [line, "\n"]).collect();
    let letters: Vec<char> = text.chars().collect();
    let at = |place: usize| letters.get(place).copied().unwrap_or('\n');
    let (mut found, mut place) = (Vec::new(), 0);
    while place < letters.len() {
        let (begin, is_word) = (place, |c: char| c.is_alphanumeric() || c == '_');
        match at(place) {
            '/' if at(place + 1) == '/' => {
                while at(place) != '\n' {
                    place += 1;
                }
            }
            '"' => {
                place += 1;
                while place < letters.len() && at(place) != '"' {
                    place += if at(place) == '\\' { 2 } else { 1 };
                }
                place += 1;
            }
            '\'' if at(place + 1) == '\\' => place += 4,
            '\'' if at(place + 2) == '\'' => place += 3,
            '\'' => place += 1,
            ':' if at(place + 1) == ':' => place += 2,
            letter if is_word(letter) => {
                while is_word(at(place)) {
                    place += 1;
                }
            }
            _ => place += 1,
        }
        let token: String = letters[begin..place.min(letters.len())].iter().collect();
        if !token.starts_with(['/', '"', '\'']) && !token.trim().is_empty() || token == "/" {
            found.push(token);
        }
    }
    found
}

/// What stands around a definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Around {
    /// An inherent `impl`, or a trait.
    Methods,
    /// The `impl` of a trait: its methods are defined by the trait.
    OfTrait,
    Module,
    Body,
}

/// The items that a file defines, and the methods of its inherent `impl`s and traits.
fn definitions(tokens: &[String]) -> (BTreeSet<String>, BTreeSet<String>) {
    let (mut items, mut methods) = (BTreeSet::new(), BTreeSet::new());
    let (mut around, mut next) = (Vec::new(), Around::Body);
    for (place, token) in tokens.iter().enumerate() {
        let word = |ahead: usize| tokens.get(place + ahead).map_or("", String::as_str);
        let is_outside = around.iter().all(|around| *around == Around::Module);
        let is_method = around.last() == Some(&Around::Methods);
        match token.as_str() {
            "impl" if is_outside => {
                let header = tokens[place..].iter().take_while(|token| *token != "{");
                let is_of_trait = header.into_iter().any(|token| token == "for");
                next = if is_of_trait { Around::OfTrait } else { Around::Methods };
            }
            "trait" | "struct" | "enum" | "type" | "static" if is_outside => {
                items.insert(word(1).to_owned());
                next = if token == "trait" { Around::Methods } else { Around::Body };
            }
            "const" if is_outside && !["fn", "{", "_"].contains(&word(1)) => {
                items.insert(word(1).to_owned());
            }
            "macro_rules" if is_outside => {
                items.insert(word(2).to_owned());
            }
            "fn" => {
                if is_outside {
                    items.insert(word(1).to_owned());
                } else if is_method {
                    methods.insert(word(1).to_owned());
                }
                next = Around::Body;
            }
            "mod" if is_outside => next = Around::Module,
            "{" => around.push(core::mem::replace(&mut next, Around::Body)),
            "}" => _ = around.pop(),
            ";" => next = Around::Body,
            _ => {}
        }
    }
    (items, methods)
}

/// The paths that a file names: those of each `use`, one for each leaf, and those in its code. Of a re-export, none.
fn named_paths(tokens: &[String]) -> Vec<Vec<String>> {
    let is_word = |token: &str| token.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    let (mut paths, mut place) = (Vec::new(), 0);
    while place < tokens.len() {
        if tokens[place] == "use" {
            let end = place + tokens[place..].iter().take_while(|token| *token != ";").count();
            let is_shown = place > 0 && (tokens[place - 1] == "pub" || tokens[place - 1] == ")");
            if !is_shown {
                leaves(&tokens[place + 1..end], &[], &mut |path, _| paths.push(path));
            }
            place = end;
        } else if is_word(&tokens[place]) {
            let (begin, mut path) = (place, vec![tokens[place].clone()]);
            while tokens.get(place + 1).is_some_and(|token| token == "::")
                && tokens.get(place + 2).is_some_and(|token| is_word(token))
            {
                place += 2;
                path.push(tokens[place].clone());
            }
            // `pub(in crate::dji)` names no item.
            if path.len() > 1 && !(begin > 0 && tokens[begin - 1] == "in" && path[0] == "crate") {
                paths.push(path);
            }
        }
        place += 1;
    }
    paths
}

/// Hands on each path of a tree of a `use`, and the name it brings in.
fn leaves(tree: &[String], before: &[String], take: &mut dyn FnMut(Vec<String>, String)) {
    let mut depth = 0;
    let branches = tree.split(|token| {
        depth += i32::from(token == "{") - i32::from(token == "}");
        depth == 0 && token == ","
    });
    for branch in branches.filter(|branch| !branch.is_empty()) {
        let open = branch.iter().position(|token| token == "{");
        let (way, inner) = branch.split_at(open.unwrap_or(branch.len()));
        let steps = way.iter().take_while(|token| *token != "as");
        let mut path = before.to_vec();
        path.extend(steps.filter(|token| *token != "::").cloned());
        match inner {
            [_, inner @ .., _] => leaves(inner, &path, take),
            _ => {
                path.pop_if(|last| last == "self");
                let name = way.last().filter(|name| *name != "self").or(path.last()).cloned();
                take(path, name.unwrap_or_default());
            }
        }
    }
}

/// The path of a module below the crate: `dji/slot/gap`. Empty for `lib.rs`.
type Module = Vec<String>;

/// The file of a module.
#[derive(Debug, Default)]
struct File {
    tokens: Vec<String>,
    items: BTreeSet<String>,
    methods: BTreeSet<String>,
    /// The types with inherent methods here.
    types: BTreeSet<String>,
    /// The names brought in by a `use`, each with its path in the file.
    brought: BTreeMap<String, Vec<String>>,
}

impl File {
    fn of(text: &str) -> Self {
        let tokens = tokens(text);
        let (items, methods) = definitions(&tokens);
        let mut brought = BTreeMap::new();
        for (place, _) in tokens.iter().enumerate().filter(|(_, token)| *token == "use") {
            let end = place + tokens[place..].iter().take_while(|token| *token != ";").count();
            leaves(&tokens[place + 1..end], &[], &mut |path, name| _ = brought.insert(name, path));
        }
        Self { items, methods, types: inherent(text).into_iter().collect(), brought, tokens }
    }
}

/// The place of a module below a folder: the first step of the way there, or `.` for the folder itself.
fn node<'a>(folder: &[String], module: &'a Module) -> Option<&'a str> {
    Some(module.strip_prefix(folder)?.first().map_or(".", String::as_str))
}

/// The files of a crate, by module.
struct House(BTreeMap<Module, File>);

impl House {
    fn of<'a>(files: impl Iterator<Item = (Module, &'a str)>) -> Self {
        Self(files.map(|(module, text)| (module, File::of(text))).collect())
    }

    fn of_crate() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let is_test = |path: &Path| path.iter().any(|part| part == "tests" || part == "tests.rs");
        let files = sources().into_iter().filter(|(_, path, _)| !is_test(path));
        let files: Vec<(Module, String)> = files
            .map(|(_, path, text)| {
                let way = path.strip_prefix(&root).unwrap().with_extension("");
                let way = way.iter().map(|part| part.to_string_lossy().into_owned());
                (way.filter(|part| part != "mod" && part != "lib").collect(), text)
            })
            .collect();
        Self::of(files.iter().map(|(module, text)| (module.clone(), text.as_str())))
    }

    /// The path from the root of the crate of a path in a file; `None` for a path of another crate.
    fn absolute(&self, module: &[String], path: &[String]) -> Option<Module> {
        let [first, rest @ ..] = path else { return None };
        let mut here = module.to_vec();
        match first.as_str() {
            "crate" => return Some(rest.to_vec()),
            "self" => {}
            "super" => {
                let ups = path.iter().take_while(|step| *step == "super").count();
                here.truncate(module.len().checked_sub(ups)?);
                return Some([&here, &path[ups..]].concat());
            }
            _ => {
                let child = [module, &path[..1]].concat();
                if self.0.contains_key(&child) {
                    return Some([module, path].concat());
                }
                let way = self.0[module].brought.get(first).filter(|way| *way != path)?;
                let way = self.absolute(module, way)?;
                return Some([way.as_slice(), rest].concat());
            }
        }
        Some([here.as_slice(), rest].concat())
    }

    /// The module whose file defines the item of a path from the root, through any number of re-exports.
    fn home(&self, path: &[String]) -> Option<Module> {
        let depth = (0..=path.len()).rev().find(|depth| self.0.contains_key(&path[..*depth]))?;
        let (module, rest) = path.split_at(depth);
        let Some(item) = rest.first() else { return Some(module.to_vec()) };
        let file = &self.0[module];
        if file.items.contains(item) {
            return Some(module.to_vec());
        }
        let way = self.absolute(module, file.brought.get(item)?)?;
        if way == path { None } else { self.home(&way) }
    }

    /// Which module names an item, or calls a method, of which other.
    fn edges(&self) -> BTreeSet<(Module, Module)> {
        let mut of_method = BTreeMap::<&String, Vec<&Module>>::new();
        for (module, file) in &self.0 {
            file.methods
                .iter()
                .for_each(|method| of_method.entry(method).or_default().push(module));
        }
        let mut found = BTreeSet::new();
        for (module, file) in &self.0 {
            let paths = named_paths(&file.tokens);
            let homes = paths.iter().filter_map(|path| self.home(&self.absolute(module, path)?));
            let mut used: BTreeSet<Module> = homes.collect();
            for call in file.tokens.windows(4) {
                let [of, dot, method, open] = call else { continue };
                let is_call = (dot == "." || dot == "::") && open == "(";
                let Some(homes) = of_method.get(method).filter(|_| is_call) else { continue };
                let is_own = of == "self" || of == "Self";
                if is_own && !file.methods.contains(method) {
                    let shares = |other: &&&Module| !self.0[**other].types.is_disjoint(&file.types);
                    used.extend(homes.iter().filter(shares).map(|home| (*home).clone()));
                } else if let ([home], false) = (homes.as_slice(), is_own) {
                    // Between modules the floors decide.
                    let is_near = home.first() == module.first();
                    if is_near && dot == "." && !METHODS_OF_CORE.contains(&method.as_str()) {
                        used.insert((*home).clone());
                    }
                }
            }
            found.extend(
                used.into_iter()
                    .filter(|other| other != module)
                    .map(|other| (module.clone(), other)),
            );
        }
        found
    }

    /// The circles among the files of each folder: the folder, and the files that use each other, directly or by others. A file counts
    /// with the folder of its name; the file of the folder itself is `.`.
    fn circles(&self) -> Vec<(String, String)> {
        let edges = self.edges();
        let mut circles = Vec::new();
        let folders =
            self.0.keys().flat_map(|module| (0..=module.len()).map(|depth| &module[..depth]));
        for folder in folders.collect::<BTreeSet<_>>() {
            let mut reached = BTreeSet::new();
            for (one, other) in &edges {
                if let (Some(one), Some(other)) = (node(folder, one), node(folder, other)) {
                    reached.insert((one, other));
                }
            }
            loop {
                let further: Vec<_> = reached
                    .iter()
                    .flat_map(|(one, by)| {
                        let next = reached.iter().filter(move |(from, _)| from == by);
                        next.map(move |(_, other)| (*one, *other))
                    })
                    .collect();
                let before = reached.len();
                reached.extend(further);
                if reached.len() == before {
                    break;
                }
            }
            let nodes: BTreeSet<&str> = reached.iter().map(|(one, _)| *one).collect();
            let with = |one: &str| -> Vec<&str> {
                let both = |other: &&&str| {
                    reached.contains(&(one, **other)) && reached.contains(&(**other, one))
                };
                nodes.iter().filter(both).copied().collect()
            };
            let groups: BTreeSet<Vec<&str>> = nodes.iter().map(|one| with(one)).collect();
            let groups = groups.into_iter().filter(|group| group.len() > 1);
            circles.extend(groups.map(|group| (folder.join("/"), group.join(" "))));
        }
        circles
    }
}

/// Names of methods of `core`: a call of one is no sign of the file that has such a method too.
const METHODS_OF_CORE: [&str; 47] = [
    "abs",
    "add",
    "all",
    "and",
    "any",
    "as_str",
    "chain",
    "clear",
    "contains",
    "count",
    "fill",
    "filter",
    "find",
    "first",
    "fold",
    "get",
    "get_mut",
    "index",
    "insert",
    "is_empty",
    "is_finite",
    "iter",
    "last",
    "len",
    "map",
    "matches",
    "max",
    "min",
    "next",
    "nth",
    "or",
    "peek",
    "pop",
    "position",
    "push",
    "remove",
    "replace",
    "rev",
    "saturating_add",
    "set",
    "skip",
    "sort",
    "sum",
    "swap",
    "take",
    "then",
    "zip",
];

#[test]
fn the_files_of_a_folder_use_each_other_in_one_direction() {
    let found = House::of_crate().circles();
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn a_circle_is_found_by_items_by_paths_and_by_methods() {
    let circles = |files: &[(&str, &str)]| {
        let files =
            files.iter().map(|(path, text)| (path.split('/').map(String::from).collect(), *text));
        House::of(files).circles()
    };
    let circle = [("bus".to_owned(), "one two".to_owned())];
    let one = "use super::two::Two;\npub struct One(Two);";
    assert_eq!(
        circles(&[("bus/one", one), ("bus/two", "use super::one::One;\nstruct Two;")]),
        circle
    );
    // By the name that the folder shows, by a path in the code, by a nested `use`.
    let folder = ("bus", "mod one;\nmod two;\npub use one::One;");
    assert_eq!(
        circles(&[folder, ("bus/one", one), ("bus/two", "struct Two;\nfn f(_: super::One) {}")]),
        circle
    );
    let nested = "use crate::{bus::{self, one}, other};\nstruct Two(one::One);";
    assert_eq!(circles(&[folder, ("bus/one", one), ("bus/two", nested)]), circle);
    // By a method of its type in the other file, and by a method that nothing else has.
    let own = "use super::two::Two;\nimpl Two {\n    pub fn turn(&self) {}\n}";
    let two = |call| format!("pub struct Two;\nimpl Two {{\n    fn f(&self) {{ {call} }}\n}}");
    assert_eq!(circles(&[("bus/one", own), ("bus/two", &two("self.turn()"))]), circle);
    assert_eq!(circles(&[("bus/one", own), ("bus/two", &two("other.turn()"))]), circle);
    // A file with the folder of its name.
    let inner = [
        ("bus/slot", "mod part;\nuse part::Part;\nstruct Slot(Part);"),
        ("bus/slot/part", "use super::Slot;\nstruct Part;"),
    ];
    assert_eq!(circles(&inner), [("bus/slot".to_owned(), ". part".to_owned())]);
    // One direction, a test, a comment, and a type of the same name elsewhere are none.
    let test = "struct Two;\n// super::one::One\n#[cfg(test)]\nmod tests {\n    use super::super::one::One;\n}";
    let elsewhere = "use crate::motor::One;\nstruct Two(One);";
    for two in ["struct Two;", test, elsewhere] {
        assert!(circles(&[folder, ("bus/one", one), ("bus/two", two)]).is_empty(), "{two}");
    }
}
