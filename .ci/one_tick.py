"""Compares the files whose functions run in each cycle of tests/one_tick.rs, and their calls, with the lists in DESIGN.md, "One tick"."""

import argparse
import collections
import json
import pathlib
import re
import sys

# Half of those of tests/one_tick.rs: what runs in every second cycle counts.
CYCLES = 1000
# The vocabulary, of which each file has a few functions for everybody.
VOCABULARY = {"units", "math", "time", "frame"}
# What calls the first file of each list, and the targets.
PROGRAM = "tests/one_tick.rs"
# The test of each way, its section in DESIGN.md, and its most files without the vocabulary. The bound of a way that grew shorter is
# to be lowered.
WAYS = [
    ("eight_motors_are_driven_in_each_cycle_and_nothing_happens", "One tick", 15),
    ("an_actuator_with_a_speed_loop_is_driven_in_each_cycle_and_nothing_happens", "One tick of an actuator", 15),
    ("joints_follow_their_targets_in_each_cycle_and_nothing_happens", "One tick of joints", 15),
]


def measured(report, root):
    """File of src/ -> functions that ran at least once in two cycles, on average."""
    files = {}
    for function in report["data"][0]["functions"]:
        path = pathlib.Path(function["filenames"][0])
        if function["count"] >= CYCLES and path.is_relative_to(root / "src"):
            name = str(path.relative_to(root / "src"))
            line = function["regions"][0][0]
            text = path.read_text().splitlines()[line - 1].strip()
            files.setdefault(name, {})[line] = text
    return files


def listed(design, section):
    """The files that a section names, in its order."""
    text = re.search(rf"\n## {section}\n(.*?)\n## ", design, re.S)
    if not text:
        sys.exit(f"DESIGN.md has no section '{section}'")
    return re.findall(r"^\| `([^`]+\.rs)` \|", text.group(1), re.M)


def calls(profile, root):
    """(file, file that it calls) -> calls, from a profile of callgrind; inlined instructions count as calls.

    A closure is code of the file that made it, whoever calls it.
    """
    names, homes, edges = {}, {}, collections.Counter()

    def name(table, text):
        number, _, rest = text.partition(" ")
        return names.setdefault((table, number), rest)

    home = place = callee = None
    is_call = False
    for line in profile.splitlines():
        kind, _, text = line.partition("=")
        if kind == "fl":
            home = place = name("file", text)
        elif kind in ("fi", "fe"):
            place = name("file", text)
        elif kind == "fn":
            homes[name("function", text)] = place = home
        elif kind in ("cfi", "cfl"):
            name("file", text)
        elif kind == "cfn":
            callee = name("function", text)
        elif kind == "calls":
            edges[place, callee] += int(text.split()[0])
            is_call = True
        elif line[:1].isdigit() or line[:1] in ("+", "-", "*"):
            # The line after a call has the cost of the callee.
            if not is_call and place != home:
                edges[home, place] += int(line.split()[1])
            is_call = False
    found = collections.Counter()
    for (caller, callee), count in edges.items():
        pair = [pathlib.Path(caller), pathlib.Path(homes.get(callee, callee))]
        if not callee.endswith("{{closure}}") and all(path.is_relative_to(root) for path in pair):
            found[tuple(str(path.relative_to(root)).removeprefix("src/") for path in pair)] += count
    return found


def upward(found, section, root):
    """The calls, in each cycle, of a file that stands above in the list of a section."""
    names = [PROGRAM, *listed((root / "DESIGN.md").read_text(), section)]
    pairs = [pair for pair, count in found.items() if count >= CYCLES and pair[0] in names and pair[1] in names[1:]]
    below = [pair for pair in pairs if names.index(pair[0]) < names.index(pair[1])]
    above = [pair for pair in pairs if names.index(pair[0]) > names.index(pair[1])]
    # Each file is called by one above it, or by the program.
    lone = set(names[1:]) - {callee for _, callee in below}
    print(f"{section}: {len(below)} pairs of files call downward, {len(above)} upward")
    wrong = [f"{caller} calls {callee}, which stands above it" for caller, callee in sorted(above)]
    wrong += [f"no file above {name} was seen to call it" for name in sorted(lone)]
    return [f"'{section}': {line}" for line in wrong]


def compare(files, section, most, root):
    """What is wrong with the list of a section."""
    way = {name for name in files if name.split("/")[0].removesuffix(".rs") not in VOCABULARY}
    names = listed((root / "DESIGN.md").read_text(), section)
    wrong = [f"{name} runs in each tick and is not listed" for name in sorted(way - set(names))]
    wrong += [f"{name} is listed and does not run" for name in names if name not in way]
    wrong += [f"{name} is listed twice" for name in sorted(set(names)) if names.count(name) > 1]
    if len(way) > most:
        wrong.append(f"{len(way)} files run in each tick, {most} are allowed")
    vocabulary = sorted(set(files) - way)
    print(f"{section}: {len(way)} files, and {len(vocabulary)} of the vocabulary ({', '.join(vocabulary)})")
    return [f"'{section}': {line}" for line in wrong]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tests", action="store_true", help="prints the test of each way, and ends")
    parser.add_argument("--reports", type=pathlib.Path, help="the folder with the report and the calls of each test")
    parser.add_argument("--functions", action="store_true", help="lists the functions of each file")
    options = parser.parse_args()
    if options.tests:
        print("\n".join(test for test, *_ in WAYS))
        return
    root, wrong = pathlib.Path.cwd(), []
    for test, section, most in WAYS:
        files = measured(json.loads((options.reports / test).read_text()), root)
        wrong += compare(files, section, most, root)
        wrong += upward(calls((options.reports / f"{test}.calls").read_text(), root), section, root)
        if options.functions:
            for name, functions in sorted(files.items()):
                print(name)
                for line, text in sorted(functions.items()):
                    print(f"  {line:4} {text}")
    if wrong:
        sys.exit("DESIGN.md:\n  " + "\n  ".join(wrong))


main()
