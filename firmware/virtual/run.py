"""Runs the programs of firmware/boards on the virtual board, against each fault, and compares with docs/virtual-board.md."""
import argparse
import hashlib
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import controls
import scenarios
import table
from board.core import Fault
from robots import PROGRAMS, Robot

PAGE = Path(__file__).resolve().parent / "../../docs/virtual-board.md"
# Run twice: the traces have to be equal, bit for bit.
TWICE = "pulled_plug"


def run(task):
    name, scenario, builds, world = task
    began = time.monotonic()
    with Robot(PROGRAMS[name], builds, world) as robot:
        try:
            result = getattr(scenarios, scenario)(robot)
            result["wrong"] = None
        except (scenarios.Wrong, Fault) as error:
            result = {"wrong": str(error)}
        result["trace"] = hashlib.sha256(repr((robot.wire.record, robot.pins, robot.resets)).encode()).hexdigest()
        result["stack"] = robot.core.stack_used()
    result["seconds"] = time.monotonic() - began
    return result


def run_controls(builds, world):
    """Returns how many planted defects no row found."""
    missed = 0
    with ProcessPoolExecutor(2) as pool:
        tasks = [(place, builds, world) for place in range(len(controls.PLANTS))]
        for (name, scenario, defect), said in zip(controls.PLANTS, pool.map(controls.plant, tasks)):
            missed += said is None
            print(f"{name}, {scenario.__name__}, {defect.__name__}: {said or 'NOT FOUND'}")
    print(f"virtual board: {len(controls.PLANTS)} planted defects, {missed} not found")
    return missed


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("builds", help="the folder of the images")
    parser.add_argument("world", help="the program of the motors")
    parser.add_argument("--only", help="part of PROGRAM:FAULT; the table is not compared then")
    parser.add_argument("--update", action="store_true", help="write the table")
    parser.add_argument("--controls", action="store_true", help="plant defects, which the rows have to find")
    options = parser.parse_args()
    if options.controls:
        sys.exit(1 if run_controls(options.builds, options.world) else 0)
    keys = [(name, scenario.__name__) for name, program in PROGRAMS.items() for scenario in scenarios.of(program)]
    if options.only:
        keys = [key for key in keys if options.only in ":".join(key)]
    again = [key for key in keys if key[1] == TWICE]
    tasks = [(*key, options.builds, options.world) for key in keys + again]
    results, wrong = {}, []
    with ProcessPoolExecutor(2) as pool:
        for key, result in zip(keys + again, pool.map(run, tasks)):
            if key in results:
                if results[key]["trace"] != result["trace"]:
                    wrong.append(f"{': '.join(key)}: two runs differ")
                continue
            results[key] = result
            if result["wrong"]:
                wrong.append(f"{': '.join(key)}: {result['wrong']}")
            elif options.only:
                print(f"{': '.join(key)}: {result}")
    if not wrong and not options.only:
        if options.update:
            PAGE.write_text(table.write(results))
        wrong += table.differences(PAGE.read_text(), results)
    for line in wrong:
        print(f"virtual board: {line}", file=sys.stderr)
    seconds = sum(result["seconds"] for result in results.values())
    print(f"virtual board: {len(PROGRAMS)} programs, {len(results)} rows, {len(wrong)} wrong ({seconds:.0f} s of one core)")
    sys.exit(1 if wrong or not results else 0)


if __name__ == "__main__":
    main()
