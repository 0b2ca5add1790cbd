#!/usr/bin/env python3
"""Computes the golden sequences of `control::LoadObserver` by python-control: `python3 tests/data/observer/compute.py`.

Needs `pip install control==0.10.2`. The gains come from its pole placement and the sequences from its simulation of the estimator, both
in double precision; the formulas of the crate do not occur. `tests/control_golden.rs` compares. `.ci/goldens` does not run this file, since
the packages (numpy, scipy, control) are no part of CI; the file that it writes only changes together with this one.
"""
import pathlib
import struct

import control
import numpy as np

assert control.__version__ == "0.10.2", control.__version__
RNG = np.random.default_rng(24)


def f32(value):
    return struct.unpack("f", struct.pack("f", value))[0]


def sequence(inertia, bandwidth, dt, steps):
    # State: speed and load, both held over a step; input: the torque; output: the speed. The inertia divides torque and load.
    plant = control.ss([[0, 1 / inertia], [0, 0]], [[1 / inertia], [0]], [[1, 0]], [[0]])
    model = control.sample_system(plant, dt, method="zoh")
    pole = 1 / (1 + bandwidth * dt)
    # The estimator of the current state, x = x' + L (y - C x'), has the error dynamics A - L C A. `place` takes no double
    # pole, `acker` does.
    gain = np.reshape(control.acker(model.A.T, (model.C @ model.A).T, [pole, pole]), (2, 1))
    correct = np.eye(2) - gain @ model.C
    # As a system with the inputs torque and measured speed. Its state before a step is the estimate after the step before.
    estimator = control.ss(correct @ model.A, np.hstack([correct @ model.B, gain]), correct @ model.A,
                           np.hstack([correct @ model.B, gain]), dt)
    time = np.arange(steps) * dt
    torque = np.where(time % 0.05 < 0.025, 0.8, -0.6) + 0.05 * RNG.standard_normal(steps)
    load = np.where(time > 0.04, -1.0, 0.0)
    true = control.forced_response(control.sample_system(
        control.ss([[0]], [[1 / inertia, 1 / inertia]], [[1]], [[0, 0]]), dt, method="zoh"), time, np.vstack([torque, load])).outputs.ravel()
    torque = np.array([f32(value) for value in torque])
    measured = np.array([f32(value) for value in true + 0.02 * RNG.standard_normal(steps)])
    # The crate takes the mean torque of two feedbacks, and the first speed as it is.
    mean = np.concatenate([[0], (torque[1:] + torque[:-1]) / 2])
    estimate = control.forced_response(estimator, time[1:] - dt, np.vstack([mean, measured])[:, 1:], [measured[0], 0]).outputs
    estimate = np.hstack([[[measured[0]], [0]], estimate])
    return [(inertia, bandwidth, dt, torque[k], measured[k], *estimate[:, k]) for k in range(steps)]


rows = []
for inertia, bandwidth, dt, steps in ((0.008, 200, 0.001, 120), (0.0008, 50, 0.002, 60), (0.03, 900, 0.0005, 160)):
    rows += sequence(f32(inertia), f32(bandwidth), f32(dt), steps)
header = "inertia_kg_m2,bandwidth_rad_per_s,dt_s,torque_nm,measured_rad_per_s,velocity_rad_per_s,load_nm"
lines = [header] + [",".join(f"{cell:.9g}" for cell in row) for row in rows]
(pathlib.Path(__file__).parent / "observer.csv").write_text("\n".join(lines) + "\n")
