"""Compares the fit of a chassis' power model with a least-squares solution of numpy: see README.md.

power.py PROGRAM numpy [--count N] [--seed N] [--only power]
"""

import argparse
import subprocess
import sys
import time

import numpy as np

from figures import figure

#: Steps of a drive, and its wheels.
STEPS, WHEELS = 2_000, 4
#: The scales of the coefficients k0, k2, k3 in the crate, and how uncertain each one is at first: they weigh the model to start from.
SCALES, UNCERTAIN = np.array([1.0, 1.0, 1e-3]), 100.0
#: Allowed: of the largest of the three powers; and of each true coefficient, with noise of a hundredth of the power.
SAME, TRUE = 1e-4, 0.05
DEFECTS = ["wheel", "torque", "forgets", "mechanical"]


def require(condition, text):
    if not condition:
        sys.exit(f"power: {text}")


def drive(random):
    """The numbers for the program, numpy's three powers and the true ones."""
    truth = np.array([random.uniform(0.5, 3), 1, random.uniform(0.5, 4), random.uniform(0.002, 0.02)])
    start = np.array([random.uniform(0, 3), 1, random.uniform(0, 4), random.uniform(0, 0.02)]).astype("<f4").astype(float)
    # Torque and speed of each wheel are drawn anew every 20 steps.
    hold = lambda scale: np.repeat(random.normal(0, scale, (STEPS // 20, WHEELS)), 20, axis=0)
    torque, speed = (values.astype("<f4").astype(float) for values in (hold(1.5), hold(20.0)))
    features = np.stack([np.full(STEPS, float(WHEELS)), (torque**2).sum(axis=1), (speed**2).sum(axis=1)], axis=1)
    mechanical = (torque * speed).sum(axis=1)
    power = features @ truth[[0, 2, 3]] + mechanical
    measured = (power + random.normal(0, 0.01 * np.abs(power).mean(), STEPS)).astype("<f4").astype(float)
    weights = np.eye(3) / np.sqrt(UNCERTAIN)
    rows = np.concatenate([features * SCALES, weights])
    right = np.concatenate([measured - mechanical, weights @ (start[[0, 2, 3]] / SCALES)])
    fitted = np.maximum(np.linalg.lstsq(rows, right, rcond=None)[0], 0) * SCALES
    loads = np.stack([torque, speed], axis=2).reshape(STEPS, 2 * WHEELS)
    words = np.concatenate([start, np.column_stack([loads, measured]).ravel()])
    return words, powers(fitted), powers(truth[[0, 2, 3]])


def powers(losses):
    """The power of a wheel at rest, at 1 Nm, at 30 rad/s."""
    k0, k2, k3 = losses
    return np.array([k0, k0 + k2, k0 + 900 * k3])


def ours(program, words, *plant):
    command = [program, "power", str(STEPS), *plant]
    answer = subprocess.run(command, input=words.astype("<f4").tobytes(), stdout=subprocess.PIPE, check=True).stdout
    return np.frombuffer(answer, "<f4").astype(float).reshape(-1, 3)


def error(found, expected):
    """The largest difference, as a share of the largest of the three powers."""
    require(found.shape == expected.shape and np.isfinite(found).all(), "a fit is missing")
    return (np.abs(found - expected).max(axis=1) / expected.max(axis=1)).max()


def coefficients(found):
    """k0, k2 and 900 times k3."""
    return found - np.stack([np.zeros(len(found)), found[:, 0], found[:, 0]], axis=1)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    options = parser.parse_args()
    if options.only not in (None, "power"):
        return
    start = time.monotonic()
    print(f"power: {options.judge} {np.__version__}")
    random = np.random.default_rng([options.seed, 7])
    # Each drive is 72 kB of numbers for the program: a thousand is enough.
    drives = [drive(random) for _ in range(min(1_000, max(1, options.count)))]
    words = np.concatenate([words for words, *_ in drives])
    expected, truth = (np.array(parts) for parts in list(zip(*drives, strict=True))[1:])
    found = ours(options.program, words)
    same = error(found, expected)
    true = (np.abs(coefficients(found) - coefficients(truth)) / coefficients(truth)).max()
    require(same <= SAME and true <= TRUE, f"a fit is off by {same:.1e} of numpy's, {true:.1e} of a true coefficient")
    name = f"numpy {np.__version__}"
    figure("power", "powers of a wheel, fitted to a drive of 2000 steps, as a share of the largest", name, len(drives), SAME, same, "power")
    figure("power", "each coefficient against the truth, noise of 1 % of the power", "the drawn model", len(drives), TRUE, true, "power")
    for defect in DEFECTS:
        require(error(ours(options.program, words, "--plant", defect), expected) > SAME, f"the defect {defect} was not found")
    print(
        f"  power: {len(drives)} drives of {STEPS} steps: within {same:.1e} of numpy's fit, {true:.1e} of the true coefficients\n"
        f"  found the planted defects: {', '.join(DEFECTS)}\n  {time.monotonic() - start:.0f} s"
    )


main()
