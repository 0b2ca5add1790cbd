//! Writes what loom runs: the sources of the queue with loom's types in the place of core's, as they are and once more with
//! each of the defects.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// Replaces `from` in `file`, where it stands that many `times`, by `to`.
struct Exchange {
    file: &'static str,
    times: usize,
    from: &'static str,
    to: &'static str,
}

/// A change of `file` with which `model` has to panic with `panic`.
struct Defect {
    name: &'static str,
    file: &'static str,
    from: &'static str,
    to: &'static str,
    model: &'static str,
    panic: &'static str,
}

/// The types only; each access to a slot is tracked until the end of its statement.
#[rustfmt::skip]
const EXCHANGES: [Exchange; 18] = [
    Exchange { file: "storage", times: 1, from: "use crate::spsc;", to: "use super::spsc;" },
    // The other queue of heapless.
    Exchange { file: "storage", times: 7, from: "target_has_atomic = \"8\"", to: "any()" },
    Exchange { file: "spsc", times: 1, from: "use crate::storage::", to: "use super::storage::" },
    Exchange { file: "spsc", times: 1, from: "use core::sync::atomic;", to: "use crate::atomic;" },
    Exchange { file: "spsc", times: 1, from: "use core::{borrow::Borrow, cell::UnsafeCell,",
        to: "use loom::cell::UnsafeCell;\nuse core::{borrow::Borrow," },
    Exchange { file: "spsc", times: 1, from: "pub const fn new()", to: "pub fn new()" },
    Exchange { file: "spsc", times: 1, from: "head: AtomicUsize::new(0)", to: "head: AtomicUsize::of_task(0)" },
    Exchange { file: "spsc", times: 1, from: "tail: AtomicUsize::new(0)", to: "tail: AtomicUsize::of_interrupt(0)" },
    Exchange { file: "spsc", times: 1, from: "[const { UnsafeCell::new(MaybeUninit::uninit()) }; N]",
        to: "core::array::from_fn(|_| UnsafeCell::new(MaybeUninit::uninit()))" },
    Exchange { file: "spsc", times: 2, from: ".get()).write(", to: ".get_mut().with(|slot| slot)).write(" },
    Exchange { file: "spsc", times: 5, from: ".get() as *const T", to: ".get().with(|slot| slot) as *const T" },
    Exchange { file: "spsc", times: 2, from: ".get().cast::<T>()", to: ".get_mut().with(|slot| slot).cast::<T>()" },
    Exchange { file: "queue", times: 1, from: "use core::sync::atomic::", to: "use crate::atomic::" },
    Exchange { file: "queue", times: 1, from: "use crate::frame::", to: "use drivetrain::frame::" },
    Exchange { file: "queue", times: 1, from: "use crate::time::", to: "use drivetrain::time::" },
    Exchange { file: "queue", times: 1, from: "pub const fn new()", to: "pub fn new()" },
    Exchange { file: "queue", times: 1, from: "AtomicU32::new(0)", to: "AtomicU32::of_interrupt(0)" },
    Exchange { file: "queue", times: 1, from: "use heapless::spsc;", to: "use super::spsc;" },
];

const RACE: &str = "Causality violation: Concurrent read and write accesses";

/// In the words of the sources, before the exchange.
const DEFECTS: [Defect; 9] = [
    Defect {
        name: "tail_stored_relaxed",
        file: "spsc",
        from: "self.tail.store(next_tail, Ordering::Release)",
        to: "self.tail.store(next_tail, Ordering::Relaxed)",
        model: "Exchange",
        panic: RACE,
    },
    Defect {
        name: "tail_loaded_relaxed",
        file: "spsc",
        from: "if current_head == self.tail.load(Ordering::Acquire)",
        to: "if current_head == self.tail.load(Ordering::Relaxed)",
        model: "Exchange",
        panic: RACE,
    },
    Defect {
        name: "head_stored_relaxed",
        file: "spsc",
        from: ".store(self.increment(current_head), Ordering::Release);\n\n            Some(v)",
        to: ".store(self.increment(current_head), Ordering::Relaxed);\n\n            Some(v)",
        model: "Exchange",
        panic: RACE,
    },
    Defect {
        name: "head_loaded_relaxed",
        file: "spsc",
        from: "if next_tail == self.head.load(Ordering::Acquire)",
        to: "if next_tail == self.head.load(Ordering::Relaxed)",
        model: "Exchange",
        panic: RACE,
    },
    Defect {
        name: "slot_written_after_the_store_of_tail",
        file: "spsc",
        from:
            "(self.buffer.borrow().get_unchecked(current_tail).get()).write(MaybeUninit::new(val));
            self.tail.store(next_tail, Ordering::Release);",
        to: "self.tail.store(next_tail, Ordering::Release);
            (self.buffer.borrow().get_unchecked(current_tail).get()).write(MaybeUninit::new(val));",
        model: "Exchange",
        panic: RACE,
    },
    Defect {
        name: "refused_frame_not_counted",
        file: "queue",
        from: "dropped.saturating_add(1)",
        to: "dropped",
        model: "Exchange",
        panic: "kept and dropped are all",
    },
    Defect {
        name: "both_ends_write_the_count",
        file: "queue",
        from: "self.frames.dequeue()",
        to: "{ self.dropped.store(self.dropped(), Ordering::Relaxed); self.frames.dequeue() }",
        model: "Count",
        panic: "one end writes what is the other's",
    },
    Defect {
        name: "a_frame_too_many_waiting",
        file: "queue",
        from: "\"FrameReceiver({} waiting)\", self.frames.len()",
        to: "\"FrameReceiver({} waiting)\", self.frames.len() + 1",
        model: "Views",
        panic: "fewer frames than were waiting",
    },
    Defect {
        name: "a_frame_too_few_waiting",
        file: "queue",
        from: "\"FrameSender({} waiting)\", self.frames.len()",
        to: "\"FrameSender({} waiting)\", self.frames.len().saturating_sub(1)",
        model: "Views",
        panic: "fewer places than were free",
    },
];

/// Never in silence: what is not replaced would not be run by loom.
fn replace(text: &str, times: usize, from: &str, to: &str, path: &Path) -> String {
    let found = text.matches(from).count();
    assert!(
        found == times,
        "{} has changed: {from:?} stands there {found} times, not {times}; loom/build.rs has to follow",
        path.display()
    );
    text.replace(from, to)
}

/// The folder of the sources of heapless, in the version that the crate is built with.
fn heapless(root: &Path) -> PathBuf {
    let output = Command::new(env::var_os("CARGO").unwrap())
        .args(["metadata", "--locked", "--format-version", "1", "--all-features"])
        .args(["--filter-platform", &env::var("TARGET").unwrap(), "--manifest-path"])
        .arg(root.join("Cargo.toml"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata = String::from_utf8(output.stdout).unwrap();
    let paths: Vec<_> = metadata
        .split("\"name\":\"heapless\",\"src_path\":\"")
        .skip(1)
        .filter_map(|rest| rest.split_once('"'))
        .collect();
    let [(path, _)] = paths[..] else {
        panic!("cargo metadata names {} libraries heapless, not one", paths.len())
    };
    Path::new(path).parent().unwrap().to_owned()
}

/// A file by its name in the tables, with the place where it was found.
struct Source {
    file: &'static str,
    path: PathBuf,
    code: String,
}

/// The sources as modules with loom's types, and the defect where there is one.
fn modules(sources: &[Source], defect: Option<&Defect>) -> String {
    let module = |Source { file, path, code }: &Source| {
        let planted = defect.filter(|it| it.file == *file).map(|it| (1, it.from, it.to));
        let exchanges = EXCHANGES.iter().filter(|it| it.file == *file);
        let code = planted
            .into_iter()
            .chain(exchanges.map(|it| (it.times, it.from, it.to)))
            .fold(code.clone(), |code, (times, from, to)| replace(&code, times, from, to, path));
        assert!(
            !code.contains("core::sync"),
            "{}: an atomic that loom does not see",
            path.display()
        );
        format!("mod {file} {{\n{code}}}\n")
    };
    sources.iter().map(module).collect()
}

fn main() {
    // What heapless asks for and its own build may set.
    println!("cargo::rustc-check-cfg=cfg(has_atomic_load_store)");
    println!("cargo::rustc-check-cfg=cfg(feature, values(\"portable-atomic\", \"mpmc_large\"))");
    let here = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap());
    let root = here.parent().unwrap();
    let read = |path: &Path| {
        println!("cargo::rerun-if-changed={}", path.display());
        fs::read_to_string(path).unwrap()
    };
    // Says which heapless it is.
    read(&root.join("Cargo.lock"));
    let heapless = heapless(root);
    let sources = [
        ("storage", heapless.join("storage.rs")),
        ("spsc", heapless.join("spsc.rs")),
        ("queue", root.join("src/runner/queue.rs")),
    ]
    .map(|(file, path)| {
        let text = read(&path);
        // Without its tests.
        let code = text.split("#[cfg(test)]").next().unwrap().to_owned();
        Source { file, path, code }
    });
    let models = read(&here.join("src/models.rs"));
    let mut written = modules(&sources, None);
    for defect @ Defect { name, model, panic, .. } in &DEFECTS {
        written += &format!(
            "mod {name} {{
                {}
                mod models {{ {models} }}
                #[test]
                #[should_panic(expected = {panic:?})]
                fn is_found() {{ models::run::<2>(crate::Model::{model}); }}
            }}\n",
            modules(&sources, Some(defect))
        );
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap());
    fs::write(out.join("sources.rs"), written).unwrap();
}
