"""Compares the files whose functions run in each cycle of tests/one_tick.rs with the list in DESIGN.md, "One tick"."""

import argparse
import json
import pathlib
import re
import sys

# Half of those of tests/one_tick.rs: what runs in every second cycle counts.
CYCLES = 1000
# The vocabulary, of which each file has a few functions for everybody.
VOCABULARY = {"units", "math", "time", "frame"}
MOST_FILES = 15


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


def listed(design):
    """The files that the section names, in its order."""
    section = re.search(r"\n## One tick\n(.*?)\n## ", design, re.S)
    if not section:
        sys.exit("DESIGN.md has no section 'One tick'")
    return re.findall(r"^\| `([^`]+\.rs)` \|", section.group(1), re.M)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report")
    parser.add_argument("--functions", action="store_true", help="lists the functions of each file")
    options = parser.parse_args()
    root = pathlib.Path.cwd()
    files = measured(json.loads(pathlib.Path(options.report).read_text()), root)
    if options.functions:
        for name, functions in sorted(files.items()):
            print(name)
            for line, text in sorted(functions.items()):
                print(f"  {line:4} {text}")
    way = {name for name in files if name.split("/")[0].removesuffix(".rs") not in VOCABULARY}
    names = listed((root / "DESIGN.md").read_text())
    wrong = [f"{name} runs in each tick and is not listed" for name in sorted(way - set(names))]
    wrong += [f"{name} is listed and does not run" for name in names if name not in way]
    wrong += [f"{name} is listed twice" for name in sorted(set(names)) if names.count(name) > 1]
    if len(way) > MOST_FILES:
        wrong.append(f"{len(way)} files run in each tick, {MOST_FILES} are allowed")
    vocabulary = sorted(set(files) - way)
    print(f"one tick: {len(way)} files, and {len(vocabulary)} of the vocabulary ({', '.join(vocabulary)})")
    if wrong:
        sys.exit("DESIGN.md, 'One tick':\n  " + "\n  ".join(wrong))


main()
