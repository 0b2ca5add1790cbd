"""Runs the programs of firmware/boards on the virtual board, against each fault, and compares with docs/virtual-board.md."""
import argparse
import hashlib
import os
import pickle
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import controls
import rows
import table
from board.core import Fault
from robots import PROGRAMS

PAGE = Path(__file__).resolve().parent / "../../docs/virtual-board.md"
# Run a second time, from power-on: the traces have to be equal, bit for bit.
TWICE = {"pulled_plug", "second_plug"}


def run(robot, row):
    """Runs one row on a robot that is where the row begins."""
    began = time.process_time()
    try:
        result = row(robot)
        result["wrong"] = None
    except (rows.Wrong, Fault) as error:
        result = {"wrong": str(error)}
    record = [wire.record for wire in robot.wires]
    result["trace"] = hashlib.sha256(repr((record, robot.pins, robot.resets)).encode()).hexdigest()
    result["stack"] = robot.core.stack_used()
    result["seconds"] = time.process_time() - began
    return result


def copied(robot, row):
    """Runs the row on a copy of the robot, in a process of its own."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            robot.world.again()
            with robot, os.fdopen(writer, "wb") as out:
                pickle.dump(run(robot, row), out)
            status = 0
        finally:
            os._exit(status)
    os.close(writer)
    with os.fdopen(reader, "rb") as answer:
        data = answer.read()
    os.waitpid(child, 0)
    return pickle.loads(data) if data else {"wrong": "the process ended", "trace": "", "stack": 0, "seconds": 0.0}


def run_group(task):
    """Rows that begin alike: the robot is driven to the fault once, and each row goes on from there on a copy of it."""
    name, names, builds, world = task
    program, results = PROGRAMS[name], {}
    group = [row for row in rows.of(program) if row.__name__ in names]
    if group[0].setup == "fresh" or len(group) == 1:
        for row in group:
            with program.robot(builds, world, row) as robot:
                results[name, row.__name__] = run(robot, row)
        return results
    began = time.process_time()
    with program.robot(builds, world, group[0]) as robot:
        robot.run(program.fault_at_us)
        results = {(name, row.__name__): copied(robot, row) for row in group}
    results[name, group[0].__name__]["seconds"] += time.process_time() - began
    return results


def groups(keys):
    """Tasks of up to sixteen rows that begin alike; those that begin at power-on one by one."""
    found = {}
    for name, row in keys:
        setup = row.setup if row.setup != "fresh" else row.__name__
        found.setdefault((name, setup), []).append(row.__name__)
    for (name, _), names in found.items():
        for at in range(0, len(names), 16):
            yield name, names[at : at + 16]


def run_controls(builds, world):
    """Returns how many planted defects no row found."""
    missed = 0
    with ProcessPoolExecutor(2) as pool:
        tasks = [(place, builds, world) for place in range(len(controls.PLANTS))]
        for (name, row, defect), said in zip(controls.PLANTS, pool.map(controls.plant, tasks)):
            missed += said is None
            print(f"{name}, {row.__name__}, {defect.__name__}: {said or 'NOT FOUND'}")
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
    keys = [(name, row) for name, program in PROGRAMS.items() for row in rows.of(program)]
    if options.only:
        keys = [key for key in keys if options.only in f"{key[0]}:{key[1].__name__}"]
    again = [(name, [row.__name__]) for name, row in keys if row.__name__ in TWICE]
    tasks = [(name, names, options.builds, options.world) for name, names in [*groups(keys), *again]]
    # The longest first, so that neither core waits at the end.
    tasks.sort(key=lambda task: len(task[1]) * PROGRAMS[task[0]].fault_at_us, reverse=True)
    found, wrong = {}, []
    began = time.monotonic()
    with ProcessPoolExecutor(2) as pool:
        for group in pool.map(run_group, tasks):
            for key, result in group.items():
                if key in found:
                    if found[key]["trace"] != result["trace"]:
                        wrong.append(f"{': '.join(key)}: two runs differ")
                    continue
                found[key] = result
                if result["wrong"]:
                    wrong.append(f"{': '.join(key)}: {result['wrong']}")
                elif options.only:
                    print(f"{': '.join(key)}: {result}", flush=True)
    results = {key: found[key] for key in ((name, row.__name__) for name, row in keys)}
    if not wrong and not options.only:
        if options.update:
            PAGE.write_text(table.write(results))
        wrong += table.differences(PAGE.read_text(), results)
    for line in wrong:
        print(f"virtual board: {line}", file=sys.stderr)
    spent, took = sum(result["seconds"] for result in found.values()), time.monotonic() - began
    print(f"virtual board: {len(PROGRAMS)} programs, {len(results)} rows, {len(wrong)} wrong; {took:.0f} s ({spent:.0f} s of one core)")
    sys.exit(1 if wrong or not results else 0)


if __name__ == "__main__":
    main()
