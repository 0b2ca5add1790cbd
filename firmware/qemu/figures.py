#!/usr/bin/env python3
"""Runs the benches under QEMU and compares their figures with the budgets.

figures.py ELF      the runner of `cargo run`: what one image prints
figures.py          builds and runs both benches, compares, and shows the static bound of the stack
  --update          writes the figures into the budgets, the documents that quote them and the documentation of functions
  --quote           writes the documents only, from the budgets, without a run
  --search N [SEED] looks for a dearer tick in N scripts, and keeps what is found in user/dearest.txt
  --where           says in which functions the dearest tick of user/dearest.txt goes
  --json            prints the figures as JSON instead of tables
"""

import bisect
import collections
import concurrent.futures
import dataclasses
import functools
import itertools
import json
import os
import pathlib
import re
import subprocess
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
import image  # noqa: E402

# Whatever CARGO_TARGET_DIR says: these builds share nothing with those of the host.
BUILDS = HERE.parent / "target"
M4, M0 = "thumbv7em-none-eabihf", "thumbv6m-none-eabi"
# The core that executes the code of a target: a Cortex-M3 executes that of a Cortex-M0, with the same timer.
MACHINES = {M4: "mps2-an386", M0: "mps2-an385"}
QEMU = "qemu-system-arm -icount shift=0 -nographic -monitor none -serial null".split()
# How the functions of the rows are called in the image.
MEASURED = ("row_", "call_", "bytes_", "control_", "runner_", "joints_")
IMAGES = ("motor", "runner", "chassis")
DOCUMENTS = ("README.md", "README.zh-CN.md", "docs/figures.md")


@dataclasses.dataclass(frozen=True)
class Build:
    """A column of a table: how an image is built, and for which core."""

    title: str
    profile: str
    target: str = M4


@dataclasses.dataclass(frozen=True)
class Sheet:
    """A bench with its budget; its figures stand in the order of its builds."""

    name: str
    folder: pathlib.Path
    package: str
    programs: tuple
    builds: tuple

    @property
    def budget(self):
        return self.folder / "budget.toml"


USER = Sheet(
    "user",
    HERE.parent / "user",
    "drivetrain-user",
    ("cycle", "image-empty", *(f"image-{name}" for name in IMAGES)),
    (
        Build("3, LTO", "release"),
        Build("3", "plain"),
        Build("s, LTO", "os"),
        Build("z, LTO", "oz"),
        Build("M0: 3, LTO", "release", M0),
    ),
)
CORE = Sheet(
    "core",
    HERE,
    "drivetrain-qemu",
    ("drivetrain-qemu",),
    (Build("3", "release"), Build("2", "o2"), Build("s", "os")),
)
SHEETS = (USER, CORE)


def run(elf, target=M4, *arguments):
    """What an image prints, as lines."""
    semihosting = ["enable=on,target=native", *(f"arg={argument}" for argument in ("bench", *arguments))]
    command = [*QEMU, "-M", MACHINES[target], "-semihosting-config", ",".join(semihosting), "-kernel", elf]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=3_600 if arguments else 300)
    except FileNotFoundError:
        image.fail("qemu-system-arm is not installed; run firmware/run, which installs it")
    except subprocess.TimeoutExpired:
        image.fail("the bench did not end within 300 s")
    if done.returncode:
        image.fail(f"the bench failed:\n{done.stdout}{done.stderr}")
    return done.stdout.splitlines()


def parse(lines):
    """Rows, sizes and stacks that an image printed."""
    found = {"rows": {}, "spread": {}, "sizes": {}, "stack": {}}
    for line in lines:
        kind, *fields = line.split()
        if kind == "row":
            found["rows"][fields[0]] = int(fields[1])
            found["spread"][fields[0]] = [int(fields[2]), int(fields[3])]
        elif kind == "closed_loop":
            found["closed_loop"] = " ".join(fields)
        elif kind != "level":
            found[{"size": "sizes", "stack": "stack"}[kind]][fields[0]] = int(fields[1])
    return found


def measure(sheet, build):
    """Runs the image of one build, twice; returns what it found."""
    folder = BUILDS / build.target / build.profile
    elf = str(folder / sheet.programs[0])
    lines = run(elf, build.target)
    if run(elf, build.target) != lines:
        sys.exit("two runs differ: the counts are not exact")
    found = parse(lines)
    rows = found["rows"]
    if sheet is USER:
        rows["ram_runner"] = found["sizes"]["Runner"]
        empty = image.loaded_bytes(str(folder / "image-empty"))
        for name in IMAGES:
            rows[f"code_{name}"] = image.loaded_bytes(str(folder / f"image-{name}")) - empty
        return found
    graph, _ = image.calls(elf)
    code = image.code_sizes(elf)
    measured = [name for name in graph if name.startswith(MEASURED)]
    found["text"] = {name: code.get(name, 0) for name in sorted(measured)}
    roots = [name for name in measured if name.startswith("row_")]
    rows["text"] = sum(code.get(name, 0) for name in image.reachable(graph, roots))
    rows["stack_tick"] = found["stack"]["row_tick"]
    for name, size in found["sizes"].items():
        rows[f"ram_{name.lower()}"] = size
    return found


def compare(title, column, budget, found, closed_loop):
    """Returns what is wrong with the figures of one build."""
    wrong = []
    for name, row in budget.items():
        figure = found["rows"].get(name)
        if figure is None:
            wrong.append(f"{name} was not measured")
        elif figure > row["budget"][column]:
            wrong.append(f"{name} is {figure}, its budget {row['budget'][column]}")
    for name in found["rows"]:
        if name not in budget and not name.startswith(("constant_", "ram_")):
            wrong.append(f"{name} has no budget")
    for name, (least, most) in found["spread"].items():
        # Means of 1000 calls, rounded: a keep-alive more or less among them, by the phase of its timer, may show as 1.
        if most - least > 1:
            wrong.append(f"{name} is not constant: {least} to {most}")
    if found.get("closed_loop", closed_loop) != closed_loop:
        wrong.append(f"the closed loop gives {found['closed_loop']}, on the host {closed_loop}")
    return [f"{title}: {text}" for text in wrong]


def table(sheet, budget, runs):
    names = list(budget) + [n for n in runs[0]["rows"] if n not in budget]
    print(f"{sheet.name:24}" + "".join(f"{build.title:>12}" for build in sheet.builds))
    for name in names:
        print(f"{name:24}" + "".join(f"{found['rows'].get(name, '-'):>12}" for found in runs))
    for title in ("stack", "text"):
        for name in runs[0].get(title, ()):
            print(f"{title + ' ' + name:36}" + "".join(f"{found[title].get(name, '-'):>8}" for found in runs))


def cell(row, column):
    """A figure, and in brackets its goal where it has one: tests/figures.rs writes it in the same way."""
    goal = row.get("goal", [])[column : column + 1]
    return f"{row['last'][column]} ({goal[0]})" if goal and goal[0] else str(row["last"][column])


def markdown(sheet, budget):
    """Head, rule and rows of a table."""
    columns = range(len(sheet.builds))
    lines = ["| work | " + " | ".join(build.title for build in sheet.builds) + " | others |"]
    lines.append("|---|" + "--:|" * len(sheet.builds) + "---|")
    for row in budget.values():
        figures = " | ".join(cell(row, column) for column in columns)
        lines.append(f"| {row['what']} | {figures} | {row.get('peer', '')} |")
    return lines


def update(sheet, budget, runs):
    text = sheet.budget.read_text()
    for name in budget:
        figures = [found["rows"][name] for found in runs]
        text = re.sub(rf"(?s)(\[{name}\]\n.*?\nlast = )\[[^]]*\]", rf"\g<1>{figures}", text, count=1)
    sheet.budget.write_text(text)


def quote():
    """Writes the figures into the documents: the rows that a document has, and all of them into docs/figures.md."""
    for sheet in SHEETS:
        budget = load(sheet)
        head, rule, *rows = markdown(sheet, budget)
        mark = f"<!-- figures {sheet.name} -->"
        for name in DOCUMENTS:
            path = ROOT / name
            before, *rest = path.read_text().split(mark)
            if not rest:
                continue
            block, after = rest[0].split("<!-- /figures -->", 1)
            had = {line.split("|")[1] for line in block.splitlines() if line.startswith("|")}
            kept = [row for row in rows if name == "docs/figures.md" or row.split("|")[1] in had]
            path.write_text(f"{before}{mark}\n" + "\n".join([head, rule, *kept]) + f"\n<!-- /figures -->{after}")
        for row in budget.values():
            for place in row.get("price", []):
                price(place, row)


def price(place, row):
    """Writes the line with the price into the documentation of a function or a type: `src/dji/bus.rs ingest`, or with its type, `Bus::ingest`."""
    file, name, *case = place.split(" ", 2)
    *owner, name = name.split("::")
    path = ROOT / file
    lines = path.read_text().split("\n")
    item = re.compile(rf"\s*pub (?:const )?(?:fn|struct) {name}\b")
    found, head = [], ""
    for number, line in enumerate(lines):
        head = line if line.startswith("impl") else head
        if item.match(line) and all(re.search(rf"\b{word}\b", head) for word in owner):
            found.append(number)
    if len(found) != 1:
        image.fail(f"{file} has {len(found)} items of the name {name}")
    (end,) = found
    indent = lines[end][: len(lines[end]) - len(lines[end].lstrip())]
    while lines[end - 1].lstrip().startswith(("#[", "// ")):
        end -= 1
    start = end
    while lines[start - 1].lstrip().startswith("///"):
        start -= 1
    said = f"{indent}/// {words(row, *case)}"
    figure = re.compile(r"\s*/// (Costs|Takes) \d+ ")
    prices = [number for number in range(start, end) if figure.match(lines[number])]
    old = [number for number in prices if figure.sub("", lines[number]) == figure.sub("", said)]
    if old:
        lines[old[0]] = said
    elif prices:
        lines[prices[-1] + 1 : prices[-1] + 1] = [f"{indent}///", said]
    else:
        # Before the first heading, or at the end.
        heads = [number for number in range(start, end) if re.match(r"\s*/// # [A-Z][a-z]+$", lines[number])]
        at = heads[0] - 1 if heads else end
        lines[at:at] = [f"{indent}///", said]
    path.write_text("\n".join(lines))


def words(row, case=""):
    """The line itself; tests/figures.rs writes it in the same way."""
    case = f", {case}" if case else ""
    if row.get("unit") == "bytes":
        return f"Takes {row['last'][0]} bytes on a Cortex-M4F{case} (`docs/figures.md`)."
    return f"Costs {row['last'][0]} instructions on a Cortex-M4F{case} (`docs/figures.md`)."


def build(sheet, build, folder=BUILDS, toolchain="", *more):
    command = ["cargo", *toolchain.split(), "build", "--quiet", "--package", sheet.package, "--profile", build.profile]
    command += ["--target", build.target, "--target-dir", str(folder), *more]
    # A panic's place is a string in the image: without this the bytes of code would depend on the folder of the clone.
    command += ["--config", f'target.{build.target}.rustflags=["--remap-path-prefix={ROOT}=."]']
    command += [f"--bin={program}" for program in sheet.programs]
    if subprocess.run(command, cwd=HERE.parent).returncode:
        image.fail(f"the bench does not build with the profile {build.profile}")
    return str(folder / build.target / build.profile / sheet.programs[0])


def static_stack(goal):
    """Prints the bound that the compiler's own frame sizes give, which only a nightly tells; returns what is wrong with it."""
    nightly = (ROOT / ".ci/nightly").read_text().strip()
    flags = f'target.{M4}.rustflags=["-Z", "emit-stack-sizes"]'
    elf = build(CORE, CORE.builds[0], BUILDS / "stack", f"+{nightly}", "--config", flags)
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
    return [name for name, row in budget.items() if row["last"] != [found["rows"].get(name) for found in runs]]


def load(sheet):
    budget = tomllib.loads(sheet.budget.read_text())
    budget.pop("host", None)
    return budget


def search(scripts, seed="1"):
    """Looks for a dearer tick than that of user/dearest.txt."""
    kept = USER.folder / "dearest.txt"
    elf = build(dataclasses.replace(USER, programs=("search",)), USER.builds[0])
    found = [line.split()[1:] for line in run(elf, M4, scripts, seed)]
    (first, _), (most, script) = found[0], max(found, key=lambda one: int(one[0]))
    print(f"dearest tick: {most} instructions, {first} before")
    kept.write_text("\n".join(script[at : at + 56] for at in range(0, len(script), 56)) + "\n")


def where():
    """Prints the instructions of the dearest tick by function: QEMU logs each one that is executed."""
    elf = build(dataclasses.replace(USER, programs=("search",)), USER.builds[0])
    lines = [line.split() for line in image.llvm("llvm-nm", "-n", "--demangle", elf).splitlines()]
    functions = [(int(fields[0], 16) & ~1, " ".join(fields[2:])) for fields in lines if fields[1] in "tT"]
    starts = [start for start, _ in functions]
    name_of = functools.cache(lambda address: functions[bisect.bisect_right(starts, address) - 1][1])
    tick = next(start for start, name in functions if name == "dearest_tick")
    most, counts = collections.Counter(), None
    command = [*QEMU, "-M", MACHINES[M4], "-semihosting-config", "enable=on,target=native,arg=bench,arg=1", "-kernel", elf]
    with subprocess.Popen(
        [*command, "-singlestep", "-d", "exec,nochain"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as qemu:
        # The first run of the script; the others count it.
        for line in itertools.islice(qemu.stderr, 3_000_000):
            if not (found := re.search(r"\[[0-9a-f]+/([0-9a-f]+)/", line)):
                continue
            address = int(found[1], 16)
            name = name_of(address)
            if address == tick:
                counts = collections.Counter()
            elif counts is not None and name.startswith("search::"):
                most, counts = max(most, counts, key=collections.Counter.total), None
            if counts is not None:
                counts[name] += 1
        qemu.kill()
    print(f"{most.total():7} the dearest tick")
    for name, count in most.most_common():
        print(f"{count:7} {name}")


def check(sheet, options):
    """Runs and compares one bench; returns what is wrong."""
    runs = [measure(sheet, one) for one in sheet.builds]
    budget = load(sheet)
    if "--json" in options:
        print(json.dumps({sheet.name: runs}, indent=1))
    else:
        table(sheet, budget, runs)
    host = tomllib.loads(CORE.budget.read_text())["host"]["closed_loop"]
    wrong = []
    for column, (one, found) in enumerate(zip(sheet.builds, runs)):
        wrong += compare(f"{sheet.name}, {one.title}", column, budget, found, host)
    if "--update" in options:
        update(sheet, budget, runs)
    elif others := stale(budget, runs):
        print(f"the documents have other figures (--update writes them anew): {', '.join(others)}")
    return wrong


def main():
    options = [argument for argument in sys.argv[1:] if argument.startswith("--")]
    others = [argument for argument in sys.argv[1:] if not argument.startswith("--")]
    if "--search" in options:
        return search(*others)
    if "--where" in options:
        return where()
    if others:
        print("\n".join(run(others[0])))
        return
    if "--quote" in options:
        return quote()
    # Each spends much of its time on one core.
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda both: build(*both), [(sheet, one) for sheet in SHEETS for one in sheet.builds]))
    wrong = [text for sheet in SHEETS for text in check(sheet, options)]
    if "--update" in options:
        quote()
    if "--json" not in options:
        wrong += static_stack(load(CORE)["stack_tick"]["goal"][0])
    if wrong:
        sys.exit("\n".join(["over budget:", *wrong]))


main()
