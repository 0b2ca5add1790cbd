"""Sums up a report of `cargo llvm-cov --json --branch` for the code of src/, without its tests."""

import argparse
import json
import pathlib
import sys


def tests_from(path):
    """The first line of the tests that stand at the end of a file: they would count as covered."""
    lines = path.read_text().splitlines()
    for number, line in enumerate(lines, 1):
        following = [text for text in lines[number : number + 2] if not text.startswith("#[expect(")]
        if line == "#[cfg(test)]" and following and following[0].startswith("mod ") and following[0].endswith("{"):
            return number
    return len(lines) + 1


def is_test_file(path):
    return path.name == "tests.rs" or "tests" in path.parts


def lines_of(segments, end):
    """Line -> executed or not, from the segments of llvm-cov: (line, column, count, has_count, is_entry, is_gap)."""
    lines = {}
    for here, following in zip(segments, segments[1:]):
        line, _, count, has_count, is_entry, is_gap = here
        if not has_count or is_gap:
            continue
        last = following[0]
        for number in range(line, last + 1):
            # A region that ends where the next begins says nothing about that line, unless it began there.
            if number == last and number != line:
                break
            if number < end:
                lines[number] = max(lines.get(number, 0), count)
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report")
    parser.add_argument("--lines", type=float, default=0.0, help="the least share of lines in percent")
    parser.add_argument("--aim", type=float, default=100.0, help="files below this share are printed")
    parser.add_argument("--missing", action="store_true", help="lists the lines that no test runs")
    options = parser.parse_args()
    root = pathlib.Path.cwd()
    total = {"lines": [0, 0], "branches": [0, 0]}
    rows = []
    for file in json.loads(pathlib.Path(options.report).read_text())["data"][0]["files"]:
        path = pathlib.Path(file["filename"])
        if not path.is_relative_to(root / "src") or is_test_file(path.relative_to(root)):
            continue
        end = tests_from(path)
        documentation = {
            number for number, text in enumerate(path.read_text().splitlines(), 1) if text.lstrip().startswith("//")
        }
        lines = {
            number: count for number, count in lines_of(file["segments"], end).items() if number not in documentation
        }
        # A branch: line, column, end line, end column, times true, times false, ... Instances of a generic are one.
        branches = {}
        for branch in file.get("branches", []):
            if branch[0] < end and branch[0] not in documentation:
                for way, count in enumerate(branch[4:6]):
                    key = (*branch[:4], way)
                    branches[key] = branches.get(key, 0) + count
        hit = [sum(count > 0 for count in lines.values()), len(lines)]
        ways = [sum(count > 0 for count in branches.values()), len(branches)]
        for name, pair in (("lines", hit), ("branches", ways)):
            total[name] = [a + b for a, b in zip(total[name], pair)]
        if lines:
            missing = sorted(number for number, count in lines.items() if count == 0)
            rows.append((100 * hit[0] / hit[1], hit, ways, path.relative_to(root), missing))
    if not rows:
        sys.exit("the report has no file of src/")
    for share, hit, ways, path, missing in sorted(rows):
        if share < options.aim:
            print(f"{share:6.1f} % of {hit[1]:4} lines, {ways[0]:3} of {ways[1]:3} branches  {path}")
        if options.missing and missing:
            print(f"  {path}: {' '.join(map(str, missing))}")
    shares = {name: 100 * hit / all_ for name, (hit, all_) in total.items()}
    print(
        f"coverage of src/ without tests: {shares['lines']:.2f} % of {total['lines'][1]} lines,"
        f" {shares['branches']:.2f} % of {total['branches'][1]} branches; {len(rows)} files, those below"
        f" {options.aim:g} % are above"
    )
    if shares["lines"] < options.lines:
        sys.exit(f"less than {options.lines:g} % of the lines")


main()
