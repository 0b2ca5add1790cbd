#!/usr/bin/env python3
"""Runs the bench under QEMU and compares its figures with budget.toml.

figures.py ELF      the runner of `cargo run`: one level, compared
figures.py          builds and runs the three levels, compares, and shows the static bound of the stack
  --update          writes the figures into budget.toml and the documents that quote them
  --json            prints them as JSON instead of a table
  --markdown        prints the block for README from budget.toml, without a run
"""

import json
import pathlib
import re
import subprocess
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import image  # noqa: E402

BUDGET = HERE / "budget.toml"
# Whatever CARGO_TARGET_DIR says: these builds share nothing with those of the host.
BUILDS = HERE.parent / "target"
HOST = {}
TARGET = "thumbv7em-none-eabihf"
PROFILES = {"3": "release", "2": "o2", "s": "os"}
LEVELS = list(PROFILES)
# How the functions of the rows are called in the image.
MEASURED = ("row_", "call_", "bytes_", "control_", "runner_", "joints_")
QEMU = "qemu-system-arm -M mps2-an386 -icount shift=0 -nographic -monitor none -serial null".split()
QEMU += ["-semihosting-config", "enable=on,target=native", "-kernel"]


def measure(elf):
    """Runs an image; returns its level, rows, sizes and stacks."""
    try:
        run = subprocess.run([*QEMU, elf], capture_output=True, text=True, timeout=300)
    except FileNotFoundError:
        image.fail("qemu-system-arm is not installed; run firmware/run, which installs it")
    except subprocess.TimeoutExpired:
        image.fail("the bench did not end within 300 s")
    if run.returncode:
        image.fail(f"the bench failed:\n{run.stdout}{run.stderr}")
    found = {"rows": {}, "spread": {}, "sizes": {}, "stack": {}}
    for line in run.stdout.splitlines():
        kind, *fields = line.split()
        if kind == "level":
            found["level"] = fields[0]
        elif kind == "row":
            found["rows"][fields[0]] = int(fields[1])
            found["spread"][fields[0]] = [int(fields[2]), int(fields[3])]
        elif kind == "closed_loop":
            found["closed_loop"] = " ".join(fields)
        else:
            found[{"size": "sizes", "stack": "stack"}[kind]][fields[0]] = int(fields[1])
    graph, _ = image.calls(elf)
    code = image.code_sizes(elf)
    measured = [name for name in graph if name.startswith(MEASURED)]
    found["text"] = {name: code.get(name, 0) for name in sorted(measured)}
    roots = [name for name in measured if name.startswith("row_")]
    found["rows"]["text"] = sum(code.get(name, 0) for name in image.reachable(graph, roots))
    found["rows"]["stack_tick"] = found["stack"]["row_tick"]
    for row, kind in {"ram_bus": "Bus", "ram_bus_8": "Bus8", "ram_bus_1": "Bus1"}.items():
        found["rows"][row] = found["sizes"][kind]
    return found


def compare(budget, found):
    """Returns what is wrong with the figures of one level."""
    level = LEVELS.index(found["level"])
    wrong = []
    for name, row in budget.items():
        figure = found["rows"].get(name)
        if figure is None:
            wrong.append(f"{name} was not measured")
        elif figure > row["budget"][level]:
            wrong.append(f"{name} is {figure}, its budget {row['budget'][level]}")
    for name, (least, most) in found["spread"].items():
        # Means of 1000 calls, rounded: a keep-alive more or less among them, by the phase of its timer, may show as 1.
        if most - least > 1:
            wrong.append(f"{name} is not constant: {least} to {most}")
    if found["closed_loop"] != HOST["closed_loop"]:
        wrong.append(f"the closed loop gives {found['closed_loop']}, on the host {HOST['closed_loop']}")
    return [f"opt-level {found['level']}: {text}" for text in wrong]


def table(budget, runs):
    names = list(budget) + [n for n in runs[0]["rows"] if n not in budget]
    print(f"{'':22}{'goal':>6}" + "".join(f"{'O' + run['level']:>7}" for run in runs))
    for name in names:
        figures = "".join(f"{run['rows'].get(name, '-'):>7}" for run in runs)
        row = budget.get(name, {})
        print(f"{name:22}{row.get('goal', '-'):>6}{figures}  {row.get('peer', '')}")
    for title in ("stack", "text", "sizes"):
        for name in runs[0][title]:
            figures = "".join(f"{run[title].get(name, '-'):>7}" for run in runs)
            print(f"{title + ' ' + name:28}{figures}")


def markdown(budget):
    lines = ["| work | goal | O3 | O2 | Os | others |", "|---|--:|--:|--:|--:|---|"]
    for row in budget.values():
        figures = " | ".join(str(figure) for figure in row["last"])
        lines.append(f"| {row['what']} | {row.get('goal', '')} | {figures} | {row.get('peer', '')} |")
    return "\n".join(lines)


def update(budget, runs):
    text = BUDGET.read_text()
    for name in budget:
        figures = [run["rows"][name] for run in runs]
        text = re.sub(rf"(?s)(\[{name}\]\n.*?\nlast = )\[[^]]*\]", rf"\g<1>{figures}", text, count=1)
    BUDGET.write_text(text)
    quote(tomllib.loads(text))


def quote(budget):
    """Writes the figures into the documents: the rows that a document has, and all of them into docs/figures.md."""
    budget.pop("host")
    head, rule, *rows = markdown(budget).split("\n")
    for name in ("README.md", "README.zh-CN.md", "docs/figures.md"):
        path = HERE.parent.parent / name
        before, rest = path.read_text().split("<!-- figures -->")
        block, after = rest.split("<!-- /figures -->")
        had = {line.split("|")[1] for line in block.splitlines() if line.startswith("|")}
        kept = [row for row in rows if name == "docs/figures.md" or row.split("|")[1] in had]
        table = "\n".join([head, rule, *kept])
        path.write_text(f"{before}<!-- figures -->\n{table}\n<!-- /figures -->{after}")


def build(profile, folder, toolchain="", *more):
    command = ["cargo", *toolchain.split(), "build", "--profile", profile, "--quiet", "--target-dir", str(folder)]
    if subprocess.run([*command, *more], cwd=HERE).returncode:
        image.fail(f"the bench does not build with the profile {profile}")
    return str(folder / TARGET / profile / "drivetrain-qemu")


def static_stack(goal):
    """Prints the bound that the compiler's own frame sizes give, which only a nightly tells; returns what is wrong with it."""
    nightly = (HERE.parent.parent / ".ci/nightly").read_text().strip()
    flags = f'target.{TARGET}.rustflags=["-Z", "emit-stack-sizes"]'
    elf = build("release", BUILDS / "stack", f"+{nightly}", "--config", flags)
    (graph, indirect), sizes = image.calls(elf), image.frames(elf)
    bounds = {}
    for root in ("row_decode", "row_update", "row_tick"):
        bounds[root], unknown = image.stack_bound(graph, sizes, root)
        unknown |= image.reachable(graph, [root]) & indirect
        note = f", without {', '.join(sorted(unknown))}" if unknown else ""
        print(f"static stack bound of {root}: {bounds[root]} bytes{note}")
    tick = bounds["row_tick"]
    return [f"the stack of a tick may take {tick} bytes, its goal is {goal}"] if tick > goal else []


def stale(budget, runs):
    """Names the rows that were measured otherwise when the documents were written: another compiler, or a change of the code."""
    return [name for name, row in budget.items() if row["last"] != [run["rows"].get(name) for run in runs]]


def main():
    options = [argument for argument in sys.argv[1:] if argument.startswith("--")]
    elves = [argument for argument in sys.argv[1:] if not argument.startswith("--")]
    budget = tomllib.loads(BUDGET.read_text())
    HOST.update(budget.pop("host"))
    if "--markdown" in options:
        print(markdown(budget))
        return
    if not elves:
        elves = [build(profile, BUILDS) for profile in PROFILES.values()]
    runs = [measure(elf) for elf in elves]
    if [measure(elf) for elf in elves] != runs:
        sys.exit("two runs differ: the counts are not exact")
    if "--json" in options:
        print(json.dumps(runs, indent=1))
    else:
        table(budget, runs)
    wrong = [text for run in runs for text in compare(budget, run)]
    if len(runs) == len(LEVELS) and "--json" not in options:
        wrong += static_stack(budget["stack_tick"]["goal"])
        if "--update" in options:
            update(budget, runs)
        elif others := stale(budget, runs):
            print(f"the documents have other figures (--update writes them anew): {', '.join(others)}")
    elif "--update" in options:
        image.fail("--update needs all levels")
    if wrong:
        sys.exit("\n".join(["over budget:", *wrong]))


main()
