"""Compares the efforts that hold an arm with MuJoCo: see README.md.

manipulator.py PROGRAM mujoco [--count N] [--seed N] [--only hold]
"""

import argparse
import subprocess
import sys
import time

import mujoco
import numpy as np

from figures import figure

#: Arms in one model of MuJoCo, under one gravity; poses of each arm.
ARMS, POSES = 50, 4
#: Allowed: of the effort itself, if that is above a hundredth of the load; and of the load in any case. The load of a joint is the
#: weight that it moves, times the size of the arm if it turns: places are `f32` in the frame of the base.
OWN, SMALL = 1e-4, 3e-6
DEFECTS = ["sign", "link", "place", "payload", "gravity"]


def require(condition, text):
    if not condition:
        sys.exit(f"manipulator: {text}")


def text(values):
    return " ".join(f"{value:.17g}" for value in values)


class Arms:
    """Random arms in MuJoCo's own words: frames of bodies in frames of bodies, by quaternions, and joints in these."""

    def __init__(self, random):
        self.random, self.names = random, []
        down = random.normal(size=3)
        gravity = [0, 0, -9.81] if random.random() < 0.5 else random.uniform(1, 12) * down / np.linalg.norm(down)
        arms = "".join(self.arm() for _ in range(ARMS))
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><compiler angle="radian"/><option gravity="{text(gravity)}"><flag contact="disable"/></option>'
            f"<worldbody>{arms}</worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)

    def place(self):
        """A place in a frame up to 0.6 m away along each axis, and a mass of 10 g to 5 kg; a fifth of the places is the origin."""
        return np.zeros(3) if self.random.random() < 0.2 else self.random.uniform(-0.6, 0.6, 3)

    def body(self, joint, inside):
        random = self.random
        mass = 10 ** random.uniform(-2, 0.7)
        inertia = mass * random.uniform(0.01, 0.015, 3)
        return (
            f'<body pos="{text(self.place())}" quat="{text(random.normal(size=4))}">{joint}<inertial pos="{text(self.place())}" '
            f'quat="{text(random.normal(size=4))}" mass="{mass:.17g}" diaginertia="{text(inertia)}"/>{inside}</body>'
        )

    def arm(self):
        """An arm of 1 to 6 joints, a quarter of which slides; half of the arms carry something."""
        joints = self.random.integers(1, 7)
        carries = self.random.random() < 0.5
        self.names.append((joints, carries))
        inside = self.body("", "") if carries else ""
        for _ in range(joints):
            kind = "hinge" if self.random.random() < 0.75 else "slide"
            axis, place = self.random.normal(size=3), self.place()
            inside = self.body(f'<joint type="{kind}" axis="{text(axis)}" pos="{text(place)}"/>', inside)
        return inside

    def describe(self):
        """The arms in the words of drivetrain: axes and masses in the frame of the base, where all positions are 0."""
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        mujoco.mj_forward(model, data)
        rows, joint, body = [], 0, 1
        for joints, carries in self.names:
            links = []
            for index in range(joint, joint + joints):
                turns = model.jnt_type[index] == mujoco.mjtJoint.mjJNT_HINGE
                links += [turns, *data.xaxis[index], *data.xanchor[index], model.body_mass[body], *data.xipos[body]]
                body += 1
            payload = [model.body_mass[body], *data.xipos[body]] if carries else [0, 0, 0, 0]
            body += carries
            rows.append(np.array([joints, *model.opt.gravity, *payload, *links]))
            joint += joints
        require((joint, body) == (model.njnt, model.nbody), "MuJoCo has another number of joints or bodies")
        return rows

    def hold(self, positions):
        """MuJoCo's efforts at rest."""
        model, data = self.model, self.data
        data.qpos[:], data.qvel[:] = positions, 0
        mujoco.mj_forward(model, data)
        return data.qfrc_bias.copy()

    def loads(self, rows):
        """The load of each joint: see SMALL."""
        gravity, loads = np.linalg.norm(self.model.opt.gravity), []
        for row in rows:
            links, payload = row[8:].reshape(-1, 11), row[4:8]
            size = max(1e-3, *(np.linalg.norm(places, axis=1).max() for places in (links[:, 4:7], links[:, 8:11], payload[None, 1:])))
            moved = payload[0] + np.cumsum(links[::-1, 7])[::-1]
            loads.append(gravity * moved * np.where(links[:, 0], size, 1))
        return np.concatenate(loads)


def case(random):
    """The words for the program, MuJoCo's efforts and the loads: of many arms, in their order."""
    arms = Arms(random)
    rows = arms.describe()
    turns = arms.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    positions = random.uniform(-1, 1, (POSES, arms.model.njnt)) * np.where(turns, np.pi, 0.5)
    positions = positions.astype("<f4").astype(float)
    efforts, loads = np.array([arms.hold(pose) for pose in positions]), arms.loads(rows)
    words, expected, scales, joint = [], [], [], 0
    for row, (joints, _) in zip(rows, arms.names, strict=True):
        own = slice(joint, joint + joints)
        words += [row, positions[:, own].ravel()]
        expected.append(efforts[:, own].ravel())
        scales.append(np.tile(loads[own], POSES))
        joint += joints
    return np.concatenate(words), np.concatenate(expected), np.concatenate(scales)


def ours(program, words, *plant):
    command = [program, "manipulator", str(POSES), *plant]
    answer = subprocess.run(command, input=words.astype("<f4").tobytes(), stdout=subprocess.PIPE, check=True).stdout
    return np.frombuffer(answer, "<f4").astype(float)


def errors(found, expected, loads):
    """The differences as shares of the efforts, where these are large, and of the loads."""
    require(found.shape == expected.shape and np.isfinite(found).all(), "efforts are missing")
    off = np.abs(found - expected)
    large = np.abs(expected) > 0.01 * loads
    return (off[large] / np.abs(expected[large])).max(), (off / loads).max(), int(large.sum())


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge")
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    options = parser.parse_args()
    if options.only not in (None, "hold"):
        return
    start = time.monotonic()
    print(f"manipulator: {options.judge} {mujoco.__version__}")
    random = np.random.default_rng([options.seed, 6])
    batches = [case(random) for _ in range(max(1, options.count // ARMS))]
    words, expected, loads = (np.concatenate(parts) for parts in zip(*batches, strict=True))
    own, small, large = errors(ours(options.program, words), expected, loads)
    require(own <= OWN and small <= SMALL, f"an effort is off by {own:.1e} of itself, {small:.1e} of the load")
    name = f"MuJoCo {mujoco.__version__}"
    figure("arms", "effort above a hundredth of the load, as a share of itself", name, large, OWN, own, "hold")
    figure("arms", "any effort, as a share of the load", name, len(expected), SMALL, small, "hold")
    for defect in DEFECTS:
        found = errors(ours(options.program, words, "--plant", defect), expected, loads)
        require(found[0] > OWN or found[1] > SMALL, f"the defect {defect} was not found")
    print(
        f"  hold: {len(batches) * ARMS} arms of 1 to 6 joints, {POSES} poses each, {len(expected)} efforts: within {own:.1e} of "
        f"themselves, {small:.1e} of the load\n  found the planted defects: {', '.join(DEFECTS)}\n"
        f"  {time.monotonic() - start:.0f} s"
    )


main()
