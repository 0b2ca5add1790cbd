//! Texts of errors and handles, each of which names the parameter at fault; and the pages: Chinese beside English, and links.

#![cfg(test)]

use drivetrain::chassis::{ChassisLimits, Mecanum, ModeConfig, Modes, PowerBuffer, PowerModel};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Current, M3508};
use drivetrain::error::ConfigError;
use drivetrain::geometry::Vec2;
use drivetrain::motor::{Claim, MotorName};
use drivetrain::runner::FrameQueue;
use drivetrain::time::ExtendedCounter;
use embedded_can::StandardId;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

fn says(text: &impl std::fmt::Display, words: &[&str]) {
    let text = text.to_string();
    for word in words {
        assert!(text.contains(word), "\"{text}\" does not say {word}");
    }
}

#[test]
fn chassis_errors_name_the_value() {
    says(&Mecanum::new(0.0, Vec2::new(0.2, 0.2)).unwrap_err(), &["wheel_radius_m"]);
    says(&drivetrain::chassis::Differential::new(f32::NAN, 0.2).unwrap_err(), &["wheel_radius_m"]);
    says(&PowerModel::new(1.0, 1.0, -1.0, 0.0).unwrap_err(), &["k2", "zero or more"]);
    let limits = ChassisLimits::new().with_command_timeout(0.0);
    says(&limits.validate().unwrap_err(), &["command timeout", "more than zero"]);
    let limits = ChassisLimits::new().with_command_timeout(f32::INFINITY);
    says(&limits.validate().unwrap_err(), &["command timeout in s", "at most 1 is"]);
    let swing = ModeConfig::new(PidConfig::new(1.0, 0.0, 0.0)).with_rotor(1.0, 2.0, 1.0);
    says(&Modes::new(swing).unwrap_err(), &["swing", "base"]);
    let spoilt = ModeConfig::new(PidConfig::new(f32::NAN, 0.0, 0.0));
    says(&Modes::new(spoilt).unwrap_err(), &["follow loop", "kp"]);
}

#[test]
fn the_power_buffer_names_its_loop_or_its_value() {
    let pid = PidConfig::new(2.0, 0.0, 0.0);
    says(&PowerBuffer::new(-1.0, pid).unwrap_err(), &["reserve_j"]);
    let buffer = PowerBuffer::new(20.0, pid).unwrap();
    let error = buffer.with_blind_share(f32::NAN).unwrap_err();
    assert!(matches!(error, ConfigError::Negative(_)));
    says(&error, &["blind_share"]);
    let spoilt = PowerBuffer::new(20.0, PidConfig::new(-1.0, 0.0, 0.0)).unwrap_err();
    says(&spoilt, &["buffer's loop", "kp"]);
    let mut half = buffer.with_blind_share(0.5).unwrap();
    assert!((half.allowance_w(80.0, None, 0.001) - 40.0).abs() < 1e-4);
}

#[test]
fn loop_errors_say_what_is_missing() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
    let pid = PidConfig::new(1.0, 0.0, 0.0);
    let error = bus.set_speed_loop(wheel, pid).unwrap_err();
    says(&error, &["without this loop"]);
    says(&ConfigError::Unusable("kp"), &["kp is not usable"]);
    bus.detach(wheel);
    says(&bus.set_position_loop(wheel, pid).unwrap_err(), &["detached"]);
}

#[test]
fn handles_show_model_and_slot_and_are_equal_to_themselves() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
    let yaw = bus.attach(Config::<Gm6020Current>::new(3)).unwrap();
    assert_eq!(format!("{wheel:?}"), "Handle(M3508 in slot 0)");
    assert_eq!(format!("{:?}", yaw.erase()), "AnyHandle(slot 6)"); // 0x207 is the seventh from 0x201
    assert_eq!(wheel.erase(), wheel.into());
    assert_ne!(wheel.erase(), yaw.erase());
}

#[test]
fn claims_and_counters_say_who_and_what() {
    let id = StandardId::new(0x123).unwrap();
    let claim = Claim::command(id, MotorName::new("pump", 4));
    assert_eq!((claim.is_feedback(), claim.motor().id()), (false, 4));
    says(&claim, &["pump", "4", "123"]);
    says(&ExtendedCounter::new_16_bit(999_983).unwrap_err(), &["999983 Hz", "rounder frequency"]);
}

#[test]
fn both_ends_of_a_queue_say_how_many_frames_wait() {
    let mut queue = FrameQueue::<8>::default();
    let (mut sender, receiver) = queue.split();
    let frame = drivetrain::frame::CanFrame::standard(0x201, [0; 8]).unwrap();
    assert!(sender.push(&frame, drivetrain::time::Instant::START));
    assert_eq!(format!("{sender:?}"), "FrameSender(1 waiting)");
    assert_eq!(format!("{receiver:?}"), "FrameReceiver(1 waiting)");
}

fn page(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// Every odd part of a text split at its marks.
fn between(text: &str, mark: char) -> impl Iterator<Item = &str> {
    text.split(mark).skip(1).step_by(2)
}

/// The headings of a page by their level, its table rows by their cells, code and figures, and its blocks of code without comments.
fn outline(page: &str) -> Vec<String> {
    let (mut outline, mut is_code) = (Vec::new(), false);
    for line in page.lines() {
        if line.starts_with("```") {
            is_code = !is_code;
            outline.push(line.to_owned());
        } else if is_code {
            outline.push(line.split("//").next().unwrap_or_default().trim_end().to_owned());
        } else if line.starts_with('#') {
            outline.push(line.chars().take_while(|sign| *sign == '#').collect());
        } else if line.starts_with('|') {
            let mut words: Vec<&str> = between(line, '`').collect();
            words.extend(
                line.split(|sign: char| !sign.is_ascii_digit()).filter(|part| !part.is_empty()),
            );
            words.sort_unstable();
            outline.push(format!("{} cells: {}", line.matches('|').count() - 1, words.join(" ")));
        }
    }
    outline
}

/// Compares two pages by their outlines; returns how many lines an outline has.
fn compare(english: &str, chinese: &str) -> usize {
    let (ours, theirs) = (outline(&page(english)), outline(&page(chinese)));
    for (ours, theirs) in ours.iter().zip(&theirs) {
        assert_eq!(ours, theirs, "{chinese}");
    }
    assert_eq!(ours.len(), theirs.len(), "{chinese}");
    ours.len()
}

#[test]
fn the_chinese_readme_has_the_headings_tables_and_code_of_the_english_one() {
    let lines = compare("README.md", "README.zh-CN.md");
    assert!(lines > 120, "{lines} lines");
}

/// The names of the files of a folder with this extension, sorted.
fn names(folder: &str, extension: &str) -> Vec<String> {
    let entries = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.filter(|name| name.ends_with(extension)).collect();
    names.sort_unstable();
    names
}

#[test]
fn each_chinese_chapter_has_the_headings_tables_and_code_of_the_english_one() {
    let chapters = names("docs/guide", ".md");
    assert_eq!(chapters, names("docs/guide/zh-CN", ".md"));
    assert_eq!(chapters.len(), 8, "seven chapters and their list");
    for name in chapters {
        let lines = compare(&format!("docs/guide/{name}"), &format!("docs/guide/zh-CN/{name}"));
        assert!(lines > 20, "{name}: {lines} lines");
    }
}

/// Later chapters include the files; a reader has the chapters alone.
#[test]
fn each_file_of_the_robot_of_the_guide_is_a_block_of_code_of_one_chapter() {
    let chapters = names("docs/guide", ".md").into_iter();
    let chapters: Vec<_> = chapters.map(|name| page(&format!("docs/guide/{name}"))).collect();
    let files = names("docs/guide/robot", ".rs");
    for name in &files {
        let block = format!("{}```\n", page(&format!("docs/guide/robot/{name}")));
        let shown = chapters.iter().filter(|chapter| chapter.contains(&block)).count();
        assert_eq!(shown, 1, "{name}");
    }
    let blocks: usize = chapters.iter().map(|chapter| chapter.matches("```rust").count()).sum();
    assert_eq!(blocks, files.len());
}

#[test]
fn an_outline_sees_a_heading_a_row_a_figure_and_a_line_of_code_but_no_comment() {
    let outline_of =
        |row: &str, code: &str| outline(&format!("# A\n| {row} |\n```\n{code}\n```\n"));
    let english = outline_of("`arm` | within 10 ms", "arm(); // once");
    assert_eq!(english, outline_of("`arm` | 10 ms 之内", "arm(); // 一次"));
    for (row, code) in [
        ("`arm`, within 10 ms", "arm();"),
        ("`disarm` | within 10 ms", "arm();"),
        ("`arm` | within 20 ms", "arm();"),
        ("`arm` | within 10 ms", "disarm();"),
    ] {
        assert_ne!(english, outline_of(row, code));
    }
    assert_ne!(outline("# A"), outline("## A"));
}

#[test]
fn each_readme_has_at_most_200_lines() {
    for path in ["README.md", "README.zh-CN.md"] {
        let lines = page(path).lines().count();
        assert!(lines <= 200, "{path} has {lines} lines");
    }
}

/// The addresses of the links in the text of a page, without those to other sites and to headings of the page.
fn inline(page: &str) -> Vec<&str> {
    let addresses = page.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    addresses.filter(|address| !address.starts_with('#') && !address.contains("://")).collect()
}

/// The labels in square brackets that stand for a link definition.
fn references(page: &str) -> Vec<&str> {
    let mut is_code = false;
    let lines = page.lines().filter(|line| {
        is_code ^= line.starts_with("```");
        !is_code
    });
    let used = lines.flat_map(|line| line.split("][").skip(1));
    used.filter_map(|rest| rest.split(']').next()).collect()
}

/// The link definitions of a text: labels and addresses.
fn definitions(text: &str) -> Vec<(&str, &str)> {
    text.lines().filter_map(|line| line.strip_prefix('[')?.split_once("]: ")).collect()
}

/// The id of a heading, on the web page of a repository and on a documentation site.
fn id(heading: &str) -> String {
    let signs = heading.trim_start_matches('#').trim().chars();
    let signs = signs.map(|sign| if sign == ' ' { '-' } else { sign.to_ascii_lowercase() });
    signs.filter(|sign| sign.is_alphanumeric() || ['-', '_'].contains(sign)).collect()
}

/// The module of each page, by the rows of the macro that includes it.
fn modules() -> BTreeMap<String, String> {
    let whole = [
        ("README.md", "crate"),
        ("README.zh-CN.md", "crate::pages::chinese"),
        ("docs/guide/README.md", "crate::guide"),
        ("docs/guide/zh-CN/README.md", "crate::guide::chinese"),
    ];
    let mut modules: BTreeMap<_, _> =
        whole.into_iter().map(|(path, module)| (path.to_owned(), module.to_owned())).collect();
    for name in ["pages", "guide"] {
        let mut module = format!("crate::{name}");
        for line in page(&format!("src/{name}.rs")).lines() {
            if line.starts_with("pub mod chinese") {
                module += "::chinese";
            } else if let Some((name, path)) = line.trim().split_once(": \"../") {
                modules
                    .insert(path.trim_end_matches("\",").to_owned(), format!("{module}::{name}"));
            }
        }
    }
    modules
}

/// On a documentation site, the labels lead to the modules in `docs/site.txt`: a label stands for one address in all pages.
#[test]
fn every_link_of_the_pages_leads_to_a_file_and_every_page_is_linked() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = |folder: &str, extension| {
        let names = names(folder, extension).into_iter();
        names.map(|name| format!("{folder}/{name}")).collect::<Vec<_>>()
    };
    let folders = ["docs", "docs/guide", "docs/guide/zh-CN"];
    let docs = folders.map(|folder| files(folder, ".md")).concat();
    let (site, modules, mut seen) = (page("docs/site.txt"), modules(), BTreeMap::new());
    let site: BTreeMap<_, _> = definitions(&site).into_iter().collect();
    let top = ["README.md", "README.zh-CN.md", "CONTRIBUTING.md", "DESIGN.md"];
    for path in top.map(ToOwned::to_owned).into_iter().chain(docs.iter().cloned()) {
        let text = page(&path);
        assert_eq!(inline(&text), Vec::<&str>::new(), "{path}: give it a label of docs/site.txt");
        let (used, defined) = (references(&text), definitions(&text));
        for name in &used {
            let is_defined = defined.iter().any(|(label, _)| label == name);
            assert!(is_defined, "{path}: [{name}] is not defined");
        }
        for (label, address) in defined {
            assert!(used.contains(&label), "{path}: [{label}] is not used");
            let (file, part) = address.split_once('#').unwrap_or((address, ""));
            let file = root.join(&path).with_file_name(file).canonicalize();
            let file = file.unwrap_or_else(|_| panic!("{path}: {address} is not there"));
            if !part.is_empty() {
                let text = fs::read_to_string(&file).unwrap();
                let mut headings = text.lines().filter(|line| line.starts_with('#'));
                assert!(headings.any(|line| id(line) == part), "{path}: {address}");
            }
            let there = site.get(label).unwrap_or_else(|| panic!("docs/site.txt: no [{label}]"));
            let name = file.strip_prefix(root.canonicalize().unwrap()).unwrap().to_str().unwrap();
            if !name.ends_with(".svg") {
                let module = modules.get(name).unwrap_or_else(|| panic!("no module has {name}"));
                let site =
                    if part.is_empty() { module.clone() } else { format!("{module}#{part}") };
                assert_eq!(*there, site, "docs/site.txt: [{label}]");
            }
            let target = (file, part.to_owned());
            let first = seen.entry(label.to_owned()).or_insert_with(|| target.clone());
            assert_eq!(*first, target, "{path}: [{label}] leads elsewhere too");
        }
    }
    for label in site.keys() {
        assert!(seen.contains_key(*label), "docs/site.txt: no page has a link [{label}]");
    }
    for path in docs.into_iter().chain(files("docs", ".svg")) {
        let file = root.join(&path).canonicalize().unwrap();
        let is_linked = seen.values().any(|(linked, _)| *linked == file);
        assert!(is_linked, "no page links {path}");
    }
    assert_eq!(inline("[a](docs/a.md#part), [b](https://b), [c](#c)"), ["docs/a.md#part"]);
    assert_eq!(references("[a][b], [c](d)\n```\ne[1][2]\n```\n[f][g]"), ["b", "g"]);
    assert_eq!(definitions("[a]\n[b]: c.md#d"), [("b", "c.md#d")]);
    assert_eq!(id("## Left out, with the `reasons`"), "left-out-with-the-reasons");
}

/// The names of a list, each before the first mark.
fn keys<'a>(list: &'a str, mark: &str) -> Vec<&'a str> {
    let lines = list.lines().filter_map(|line| line.split_once(mark));
    lines.map(|(name, _)| name).filter(|name| !name.starts_with('#')).collect()
}

/// The text between two marks.
fn part<'a>(text: &'a str, start: &str, end: &str) -> &'a str {
    let (_, rest) = text.split_once(start).unwrap();
    rest.split_once(end).map_or(rest, |(inside, _)| inside)
}

#[test]
fn the_table_of_features_has_those_of_the_manifest() {
    let (manifest, porting) = (page("Cargo.toml"), page("docs/porting.md"));
    let declared = part(&manifest, "[features]\n", "\n[");
    let table = part(&porting, "\n## Features\n", "\n## ");
    let rows: Vec<Vec<&str>> =
        table.lines().map(|line| line.split('|').map(str::trim).collect()).collect();
    let features = |wanted: fn(&str) -> bool| {
        let rows = rows.iter().filter(|row| row.len() > 3 && wanted(row[2]));
        let mut found: Vec<&str> = rows.flat_map(|row| row[1].split('`')).collect();
        found.retain(|name| {
            name.starts_with(|c: char| c.is_ascii_lowercase()) && *name != "feature"
        });
        found.sort_unstable();
        found
    };
    let mut expected = keys(declared, " = ");
    expected.retain(|name| *name != "default");
    expected.sort_unstable();
    assert_eq!(features(|_| true), expected);
    let default = part(declared, "default = [", "]");
    let mut on: Vec<&str> = default.split(',').map(|name| name.trim().trim_matches('"')).collect();
    on.sort_unstable();
    assert_eq!(features(|mark| mark == "yes"), on);
}
