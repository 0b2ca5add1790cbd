"""Compares motions from any state with Ruckig: see README.md.

motion.py PROGRAM ruckig|ruckig-again [--count N] [--seed N] [--only plan|step] [--golden]
"""

import argparse
import pathlib
import subprocess
import sys
import time

import numpy as np
import ruckig

from figures import figure

GOLDEN = pathlib.Path(__file__).parent.parent / "tests/data/motion/ruckig.csv"
#: Moments of a motion that are looked at, beside its start.
SAMPLES = 24
#: Motions in one run of the program: bounds the memory.
BLOCK = 50_000
#: Largest difference of a duration, in seconds or of the duration where it is longer than a second; and of a limit, as a share of it.
DURATION, LIMIT = 1e-5, 1e-5
#: Largest difference of position, velocity and acceleration within a motion, as a share of the largest: they are `f32`.
ROUNDING = 5e-6
DEFECTS = ["slow", "velocity", "acceleration", "jerk", "end"]


def require(condition, text):
    if not condition:
        sys.exit(f"motion: {text}")


def states(random, count):
    """Rows of position, velocity, acceleration, target position and velocity, limits of velocity, acceleration and jerk.

    A fifth of the targets is near, half of them move, and 56 % of the states are outside of their limits or will be.
    """
    rows = np.empty((count, 8))
    rows[:, [0, 3]] = random.normal(0, 4, (count, 2))
    rows[:, [1, 2]] = random.normal(0, 0.8, (count, 2))
    rows[:, 5:] = 10 ** random.uniform(-1, 1.2, (count, 3))
    rows[:, 4] = np.where(random.random(count) < 0.5, 0, random.uniform(-1, 1, count) * rows[:, 5])
    near = random.random(count) < 0.2
    rows[near, 3] = rows[near, 0] + random.normal(0, 0.05, near.sum())
    rows = rows.astype("<f4")
    rows[:, 4] = np.clip(rows[:, 4], -rows[:, 5], rows[:, 5])
    return rows


def theirs(rows, axes=1):
    """The durations of Ruckig, in `f64` from the same `f32`; of so many rows together. NaN where Ruckig itself finds no plan.

    Ruckig 0.19.4 ends some calculations of axes in step with -101 (a duration beyond its numerical limits), which its Python
    package does not know as a result, or with an error in its second step, of one axis for the duration of another.
    """
    planner, task, motion = ruckig.Ruckig(axes), ruckig.InputParameter(axes), ruckig.Trajectory(axes)
    found = np.empty(len(rows) // axes)
    for place, row in enumerate(rows.astype(float).reshape(-1, axes, 8).transpose(0, 2, 1).tolist()):
        (
            task.current_position, task.current_velocity, task.current_acceleration, task.target_position,
            task.target_velocity, task.max_velocity, task.max_acceleration, task.max_jerk,
        ) = row
        try:
            result = planner.calculate(task, motion)
        except (ValueError, ruckig.RuckigError) as error:
            is_known = "-101" in str(error) or "error in step 2" in str(error)
            require(axes > 1 and is_known, f"Ruckig has no plan for {row}: {error}")
            found[place] = np.nan
            continue
        require(result == ruckig.Result.Working, f"Ruckig has no plan for {row}: {result}")
        found[place] = motion.duration
    return found.repeat(axes)


def ours(program, rows, verb, *plant):
    command = [program, "motion", verb, str(SAMPLES), *plant]
    answer = subprocess.run(command, input=rows.tobytes(), stdout=subprocess.PIPE, check=True).stdout
    table = np.frombuffer(answer, "<f4").astype(float).reshape(len(rows), -1)
    return table[:, 0], table[:, 1:].reshape(len(rows), SAMPLES + 1, 5)


def judge(rows, expected, durations, samples):
    """Returns the largest error of each kind as a share of what is allowed."""
    rows = rows.astype(float)
    start, target, limits = rows[:, :3], rows[:, 3:5], rows[:, 5:]
    times, values, jerks = samples[:, :, 0], samples[:, :, 1:4], samples[:, :, 4]
    jerk = limits[:, [2]]
    worst = {"duration": np.nanmax(np.abs(durations - expected) / np.maximum(1, expected)) / DURATION}
    # A state beyond its limits, or that will be when its acceleration has fallen to zero, must not go any further.
    at_rest = start[:, 1] + np.abs(start[:, 2]) * start[:, 2] / (2 * limits[:, 2])
    most = np.max([limits[:, 0], np.abs(start[:, 1]), np.abs(at_rest)], 0)
    worst["velocity"] = (np.abs(values[:, :, 1]) / most[:, None] - 1).max() / LIMIT
    most = np.maximum(limits[:, 1], np.abs(start[:, 2]))
    worst["acceleration"] = (np.abs(values[:, :, 2]) / most[:, None] - 1).max() / LIMIT
    worst["jerk"] = (np.nan_to_num(np.abs(jerks)) / jerk - 1).max() / LIMIT  # in step, only seen by what jumps
    worst["end"] = np.abs(np.concatenate([values[:, -1, :2] - target, values[:, -1, 2:]], 1)).max() / 1e-6
    worst["start"] = np.abs(values[:, 0] - start).max() / 1e-6
    # Between two moments nothing jumps: each value is what those below make of it, but for the jerk in between.
    step = np.diff(times, axis=1)
    size = np.maximum(1, np.abs(values).max(1))
    position, velocity, acceleration = (values[:, :, place] for place in range(3))
    before = position[:, :-1] + step * (velocity[:, :-1] + step * acceleration[:, :-1] / 2)
    jumps = {
        "position jumps": (np.abs(position[:, 1:] - before) - jerk * step**3 / 6, size[:, [0]]),
        "velocity jumps": (
            np.abs(velocity[:, 1:] - velocity[:, :-1] - step * acceleration[:, :-1]) - jerk * step**2 / 2, size[:, [1]]
        ),
        "acceleration jumps": (np.abs(np.diff(acceleration, axis=1)) - jerk * step, size[:, [2]]),
    }
    for name, (jump, whole) in jumps.items():
        worst[name] = (jump / whole).max() / ROUNDING
    return worst


def compare(program, random, count, verb, axes):
    worst, differences = {}, []
    for begin in range(0, count, BLOCK):
        rows = states(random, axes * min(BLOCK, count - begin))
        expected = theirs(rows, axes)
        durations, samples = ours(program, rows, verb)
        for name, value in judge(rows, expected, durations, samples).items():
            worst[name] = max(value, worst.get(name, 0))
        differences.append(np.abs(durations - expected) / np.maximum(1, expected))
    for name, value in worst.items():
        require(value <= 1, f"{verb}: {name} is off by {value:.2f} times what is allowed")
    differences = np.concatenate(differences)
    unknown = np.isnan(differences)
    require(unknown.mean() < 1e-3, f"{verb}: Ruckig has no plan for {unknown.sum()} rows")
    if unknown.any():
        print(f"  {verb}: {unknown.sum()} rows without a plan of Ruckig, with one of ours")
    differences = differences[~unknown]
    name, judged = f"Ruckig {ruckig.__version__}", "" if axes == 1 else f", {axes} axes in step"
    limits = LIMIT * max(worst[name] for name in ("velocity", "acceleration", "jerk"))
    figure("motion", f"duration, in seconds or of the duration if that is longer than 1 s{judged}", name, count, DURATION, differences.max(), verb)
    # The program reports no jerk of axes in step: see `src/motion.rs`.
    kinds = "velocity, acceleration" + ", jerk" * (axes == 1)
    figure("motion", f"{kinds} beyond the limit, as a share of it{judged}", name, count, LIMIT, max(0, limits), verb)
    figure("motion", f"state at the end{judged}", name, count, 1e-6, 1e-6 * worst["end"], verb)
    print(
        f"  {verb}: {count} motions of {axes}: durations within {differences.max():.1e} (99.99 %: {np.quantile(differences, 0.9999):.1e}), "
        f"limits within {limits:.1e}"
    )


def plant(program, random):
    rows = states(random, 3_000)
    for verb, axes in (("plan", 1), ("step", 3)):
        expected = theirs(rows, axes)
        for defect in DEFECTS:
            worst = judge(rows, expected, *ours(program, rows, verb, "--plant", defect))
            require(max(worst.values()) > 1, f"{verb}: the defect {defect} was not found")
    print(f"  found the planted defects: {', '.join(DEFECTS)}")


def golden():
    """The sample that the tests of the crate have: Ruckig's durations, with nine digits, which give an `f32` back exactly."""
    rows = states(np.random.default_rng(28), 300)
    lines = ["position,velocity,acceleration,target,target_velocity,max_velocity,max_acceleration,max_jerk,duration_s"]
    for row, duration in zip(rows, theirs(rows), strict=True):
        lines.append(",".join(f"{value:.9g}" for value in (*row, duration)))
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge")
    parser.add_argument("--count", type=int, default=500_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    parser.add_argument("--golden", action="store_true", help="only writes the sample anew")
    options = parser.parse_args()
    if options.golden:
        GOLDEN.write_text(golden())
        return
    if options.only not in (None, "plan", "step"):
        return
    start = time.monotonic()
    print(f"motion: {options.judge} {ruckig.__version__}")
    require(GOLDEN.read_text() == golden(), f"{GOLDEN} is not what --golden writes")
    random = np.random.default_rng([options.seed, options.judge == "ruckig-again"])
    plant(options.program, random)
    for verb, axes, share in (("plan", 1, 1), ("step", 3, 20)):
        if options.only in (None, verb):
            compare(options.program, random, options.count // share, verb, axes)
    print(f"  {time.monotonic() - start:.0f} s")


main()
