"""Compares the simulator with MuJoCo: see README.md.

simulator.py PROGRAM mujoco [--seed N] [--count N] [--only run] [--plot FILE.svg]
"""

import argparse
import dataclasses
import math
import pathlib
import subprocess
import sys
import time

import mujoco
import numpy as np

from figures import figure

#: Allowed, as a share of the largest value of this kind in the scenario.
ALLOWED = 0.02
#: The differences that README.md explains, as the most that is allowed.
LISTED = {"skid, high": {"angle": 0.04, "speed": 0.2, "current": 0.8}}
#: The largest value counts as at least this: rad, rad/s and A of motors; m, m/s, rad and rad/s of a chassis.
FLOORS = {"angle": 0.2, "speed": 1.0, "current": 1.0, "place": 0.05, "velocity": 0.1, "heading": 0.1, "turn": 0.2}
STEP_S = 2e-4
#: Friction of a roller across its axis, and of a castor: the least that MuJoCo takes.
FREE = 1e-5
#: m/s: below this slip, the friction of a wheel that slides is a share of the whole.
CREEP = 0.02
#: Time to settle on the floor before a scenario in which wheels slide.
SETTLING_MS = 100
GRAVITY = 9.81
DEFECTS = ["mass", "inertia", "grip", "radius", "friction", "rollers", "command"]


def require(condition, text):
    if not condition:
        sys.exit(f"simulator: {text}")


@dataclasses.dataclass(frozen=True)
class Kind:
    """A motor as its data sheet and the documentation of `sim::MotorConfig` have it, at the output shaft, at 24 V."""

    torque_nm_a: float
    no_load_rpm: float
    most_a: float
    resistance: float
    inertia: float
    dry_nm: float
    viscous: float
    lag_s: float
    in_volts: bool
    #: Counts of the command for an ampere, or a volt.
    counts: float

    @property
    def emf_v_s(self):
        """The back-EMF constant with which the motor has its speed without load at 24 V."""
        speed = self.no_load_rpm * math.tau / 60
        return (24 - self.resistance * (self.dry_nm + self.viscous * speed) / self.torque_nm_a) / speed


KINDS = {
    "m2006": Kind(0.18, 500, 10, 0.46, 2e-3, 0.05, 0.8e-3, 0.5e-3, False, 1000),
    "m3508": Kind(0.3, 482, 20, 0.065, 8e-3, 0.12, 2.2e-3, 0.5e-3, False, 16384 / 20),
    "gm6020": Kind(0.741, 320, 3, 1.8, 0.8e-3, 0.05, 1e-3, 3.2e-3, True, 25000 / 24),
}


@dataclasses.dataclass
class Motor:
    kind: str
    inertia: float = 0.0
    dry_nm: float = 0.0
    stops: tuple = ()
    #: The angle of a steering motor, which nothing commands.
    steers: float | None = None


@dataclasses.dataclass
class Wheel:
    kind: str
    motor: int
    radius: float
    x: float
    y: float
    sign: int = 1
    #: Where an omni wheel rolls to, in rad.
    direction: float = 0.0
    steering: int | None = None

    def held(self):
        """The direction in which the floor holds a wheel with rollers, in the frame of the body."""
        return math.radians(-45 if self.x * self.y > 0 else 45) if self.kind == "mecanum" else self.direction


@dataclasses.dataclass
class Scenario:
    name: str
    ms: int
    motors: list
    #: Time in ms, then ("drive", values), ("load", motor, Nm) or ("push", N, N).
    orders: list
    wheels: list = dataclasses.field(default_factory=list)
    mass: float = 20.0
    inertia: float = 0.8
    grip: float = 0.8
    #: rad, uphill along x.
    slope: float = 0.0
    height: float = 0.1
    #: Where castors carry, in m.
    castors: tuple = ()
    #: Wheels slide: their friction is that of Coulomb, on MuJoCo's loads; see `rub`.
    slides: bool = False


CORNERS = [(0.2, 0.18), (0.2, -0.18), (-0.2, 0.18), (-0.2, -0.18)]


def four(kind, radius=0.076):
    """Front left, front right, rear left, rear right; the motors on the right turn clockwise to drive forward."""
    return [Wheel(kind, motor, radius, x, y, 1 if y > 0 else -1) for motor, (x, y) in enumerate(CORNERS)]


def m3508():
    return [Motor("m3508") for _ in CORNERS]


def forward(*amperes):
    """Currents that drive the four wheels forward."""
    return ("drive", [value * (1 if y > 0 else -1) for value, (_, y) in zip(amperes, CORNERS, strict=True)])


def modules(angles):
    wheels = [Wheel("steered", motor, 0.06, x, y, 1, 0.0, motor + 4) for motor, (x, y) in enumerate(CORNERS)]
    return [*m3508(), *(Motor("gm6020", steers=angle) for angle in angles)], wheels


def scenarios():
    crab, crab_wheels = modules([math.radians(30)] * 4)
    # Each module across the line to the centre.
    ring, ring_wheels = modules([math.atan2(y, x) + math.pi / 2 for x, y in CORNERS])
    three = [
        Wheel("omni", motor, 0.05, 0.2 * math.cos(at), 0.2 * math.sin(at), 1, at + math.pi / 2)
        for motor, at in enumerate(math.radians(degrees) for degrees in (60, 180, -60))
    ]
    two = [Wheel("plain", 0, 0.076, 0, 0.18), Wheel("plain", 1, 0.076, 0, -0.18, -1)]
    heavy = 20 * GRAVITY * math.sin(math.radians(8))
    return [
        Scenario("free run", 600, [Motor("m3508")], [(0, ("drive", [20]))]),
        Scenario("run out", 1500, [Motor("m3508")], [(0, ("drive", [20])), (300, ("drive", [0]))]),
        Scenario("voltage", 900, [Motor("gm6020", 0.02)], [(0, ("drive", [12])), (500, ("drive", [-6]))]),
        Scenario("stall", 900, [Motor("m2006", 0.01, 0.1, (-1, 2))], [(0, ("drive", [4])), (450, ("drive", [-4]))]),
        Scenario(
            "lift", 900, [Motor("m3508", 0.02)], [(0, ("load", 0, -2)), (0, ("drive", [10])), (400, ("drive", [2]))]
        ),
        Scenario("straight", 1200, m3508(), [(0, forward(3, 3, 3, 3)), (600, forward(-3, -3, -3, -3))], four("mecanum")),
        Scenario("curve", 1000, m3508(), [(0, forward(2, 4, 2.5, 3.5))], four("mecanum")),
        Scenario("spin", 1000, m3508(), [(0, forward(-2, 2, -2, 2))], four("mecanum")),
        Scenario("payload", 1000, m3508(), [(0, forward(-4, 4, 4, -4))], four("mecanum"), mass=35.0, inertia=1.5),
        Scenario("skid", 500, m3508(), [(0, forward(20, 20, 20, 20))], four("mecanum"), height=0.0, slides=True),
        Scenario("skid, high", 500, m3508(), [(0, forward(20, 20, 20, 20))], four("mecanum"), slides=True),
        Scenario("omni", 1000, m3508()[:3], [(0, ("drive", [1, 0, -2])), (500, ("drive", [-1, 2, 0]))], three, 12.0, 0.3),
        Scenario("crab", 800, crab, [(0, ("drive", [3, 3, 3, 3]))], crab_wheels),
        Scenario("modules in a ring", 800, ring, [(0, ("drive", [3, 3, 3, 3]))], ring_wheels),
        Scenario(
            "two tyres", 1000, m3508()[:2], [(0, ("drive", [3, -2]))], two, 15.0, 0.5,
            castors=((0.15, 0), (-0.15, 0)),
        ),
        Scenario(
            "slope", 1500, m3508(), [(0, ("push", -heavy, 0)), (0, forward(5, 5, 5, 5)), (500, forward(0, 0, 0, 0))],
            four("plain"), slope=math.radians(8),
        ),
        Scenario("scrubbing", 800, m3508(), [(0, forward(-12, 12, -12, 12))], four("plain"), slides=True),
        Scenario("pushed aside", 600, m3508(), [(0, ("push", 0, 220))], four("plain"), slides=True),
    ]


def words(scenario):
    """The scenario as the program reads it."""
    lines = []
    ids = {}
    for index, motor in enumerate(scenario.motors):
        ids[index] = sum(other.kind == motor.kind for other in scenario.motors[:index]) + 1
        if motor.steers is None:
            stops = " ".join(map(str, motor.stops))
            lines.append(f"motor {motor.kind} {ids[index]} {motor.inertia} {motor.dry_nm} {stops}")
        else:
            lines.append(f"steering {ids[index]} {motor.steers}")
    for wheel in scenario.wheels:
        end = {"omni": f"{wheel.direction}", "steered": f"{wheel.steering}"}.get(wheel.kind, "")
        lines.append(f"wheel {wheel.kind} {wheel.motor} {wheel.radius} {wheel.x} {wheel.y} {wheel.sign} {end}")
    if scenario.wheels:
        lines.append(f"chassis {scenario.mass} {scenario.inertia} {scenario.grip}")
    for ms, (verb, *rest) in scenario.orders:
        if verb == "drive":
            data = [0] * 4
            for motor, value in enumerate(rest[0]):
                data[ids[motor] - 1] = round(value * KINDS[scenario.motors[motor].kind].counts)
            header = "1FF" if scenario.motors[0].kind == "gm6020" else "200"
            lines.append(f"at {ms} frame {header} {' '.join(map(str, data))}")
        else:
            lines.append(f"at {ms} {verb} {' '.join(map(str, rest))}")
    return "\n".join([*lines, f"run {scenario.ms}", ""])


def ours(program, scenario, *plant):
    answer = subprocess.run([program, "simulator", *plant], input=words(scenario), stdout=subprocess.PIPE, text=True, check=True)
    return np.array([line.split() for line in answer.stdout.splitlines()], float)


class World:
    """A scenario in MuJoCo: joints with armature, damping and dry friction; a free body on spheres on a plane."""

    def __init__(self, scenario):
        self.scenario = scenario
        self.model = mujoco.MjModel.from_xml_string(self.xml())
        self.data = mujoco.MjData(self.model)
        self.driven = [index for index, motor in enumerate(scenario.motors) if motor.steers is None]
        joints = [self.model.joint(f"motor{index}") for index in self.driven]
        self.places = np.array([joint.qposadr[0] for joint in joints])
        self.dofs = np.array([joint.dofadr[0] for joint in joints])
        kinds = [KINDS[scenario.motors[index].kind] for index in self.driven]
        column = lambda read: np.array([read(kind) for kind in kinds], float)  # noqa: E731
        self.torque, self.emf = column(lambda kind: kind.torque_nm_a), column(lambda kind: kind.emf_v_s)
        self.resistance, self.most = column(lambda kind: kind.resistance), column(lambda kind: kind.most_a)
        self.in_volts = column(lambda kind: kind.in_volts) > 0
        # Exact over a step in which the command and the speed stay.
        self.share = 1 - np.exp(-STEP_S / column(lambda kind: kind.lag_s))
        self.signs = np.ones(len(self.driven))
        for wheel in scenario.wheels:
            self.signs[wheel.motor] = wheel.sign
        self.current, self.command = np.zeros(len(self.driven)), np.zeros(len(self.driven))
        self.load = np.zeros(len(self.driven))
        self.heading = 0.0
        self.wheel_bodies = [self.model.geom(f"wheel{index}").bodyid[0] for index in range(len(scenario.wheels))]
        self.loads = np.zeros(len(scenario.wheels))
        # Of each shape on the floor: friction along and across, and the direction along if the two differ.
        self.floor = {}
        for index, wheel in enumerate(scenario.wheels):
            rolls = wheel.kind in ("mecanum", "omni")
            across, held = (FREE, wheel.held()) if rolls else (scenario.grip, None)
            self.floor[self.model.geom(f"wheel{index}").id] = scenario.grip, across, held
        for index in range(len(scenario.castors)):
            self.floor[self.model.geom(f"castor{index}").id] = FREE, FREE, None

    def xml(self):
        scenario = self.scenario
        down = (-GRAVITY * math.sin(scenario.slope), 0, -GRAVITY * math.cos(scenario.slope))
        # Frictionless contacts may be soft without slip; those that hold must not.
        contact = '0.01 1" solimp="0.95 0.99 0.001' if scenario.slides else '0.002 1" solimp="0.98 0.99 0.0001'
        bodies = "".join(self.shaft(index, motor) for index, motor in enumerate(scenario.motors)) if not scenario.wheels else self.chassis()
        return f"""<mujoco><compiler angle="radian"/>
<option timestep="{STEP_S}" gravity="{down[0]} {down[1]} {down[2]}" cone="elliptic" impratio="100" solver="Newton" tolerance="1e-10">
<flag island="disable"/></option>
<default><geom solref="{contact}" friction="{scenario.grip} 0 0" condim="{1 if scenario.slides else 3}"/></default>
<worldbody><geom name="floor" type="plane" size="50 50 1"/>{bodies}</worldbody></mujoco>"""

    def joint(self, index, motor, axis):
        kind = KINDS[motor.kind]
        # Hard without bounce, as the documentation of the stops has it.
        stops = f'range="{motor.stops[0]} {motor.stops[1]}" solreflimit="0.0005 5" solimplimit="0.999 0.9999 0.0001"' if motor.stops else ""
        return (
            f'<joint name="motor{index}" axis="{axis}" armature="{kind.inertia}" damping="{kind.viscous}" '
            f'frictionloss="{kind.dry_nm + motor.dry_nm}" solreffriction="0.001 1" solimpfriction="0.999 0.9999 0.001" {stops}/>'
        )

    def shaft(self, index, motor):
        load = max(motor.inertia, 1e-9)
        return (
            f'<body pos="0 0 1">{self.joint(index, motor, "0 0 1")}'
            f'<inertial pos="0 0 0" mass="1" diaginertia="{load} {load} {load}"/></body>'
        )

    def chassis(self):
        scenario = self.scenario
        tiny, wheels = 1e-3, ""
        for place, wheel in enumerate(scenario.wheels):
            rolling = wheel.direction if wheel.steering is None else scenario.motors[wheel.steering].steers
            # To the left of the rolling direction: a turn about it moves the wheel forward.
            axis = f"{-math.sin(rolling)} {math.cos(rolling)} 0"
            wheels += (
                f'<body pos="{wheel.x} {wheel.y} {wheel.radius}">{self.joint(wheel.motor, scenario.motors[wheel.motor], axis)}'
                f'<inertial pos="0 0 0" mass="{tiny}" diaginertia="1e-7 1e-7 1e-7"/><geom name="wheel{place}" size="{wheel.radius}" mass="0"/></body>'
            )
        castors = "".join(
            f'<geom name="castor{place}" pos="{x} {y} 0.03" size="0.03" mass="0"/>' for place, (x, y) in enumerate(scenario.castors)
        )
        mass = scenario.mass - tiny * len(scenario.wheels)
        return (
            f'<body name="chassis"><freejoint/><inertial pos="0 0 {scenario.height}" mass="{mass}" '
            f'diaginertia="{0.6 * scenario.inertia} {0.6 * scenario.inertia} {scenario.inertia}"/>{castors}{wheels}</body>'
        )

    def turn_contacts(self):
        """Turns the tangents of each contact to the direction in which the floor holds the wheel; rollers are free across it."""
        contacts = self.data.contact
        for place, geom in enumerate(contacts.geom[:, 1]):
            along, across, held = self.floor[geom]
            if held is not None:
                sine, cosine = math.sin(self.heading + held), math.cos(self.heading + held)
                contacts.frame[place, 3:] = cosine, sine, 0, -sine, cosine, 0
            contacts.friction[place, :2] = along, across

    def rub(self):
        """Coulomb's friction against the slip of each wheel, with MuJoCo's loads of the step before.

        MuJoCo's own cone is convex: wheels that slide hop, and the force is up to 25 degrees off the slip.
        """
        model, data = self.model, self.data
        mujoco.mj_fwdVelocity(model, data)
        velocity, result = np.zeros(6), np.zeros(model.nv)
        for wheel, body, load in zip(self.scenario.wheels, self.wheel_bodies, self.loads, strict=True):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
            # The lowest point of the wheel.
            x, y = velocity[3] - velocity[1] * wheel.radius, velocity[4] + velocity[0] * wheel.radius
            if wheel.kind in ("mecanum", "omni"):
                sine, cosine = math.sin(self.heading + wheel.held()), math.cos(self.heading + wheel.held())
                along = x * cosine + y * sine
                x, y = along * cosine, along * sine
            share = -self.scenario.grip * load / max(CREEP, math.hypot(x, y))
            point = data.xipos[body] - np.array([0, 0, wheel.radius])
            mujoco.mj_applyFT(model, data, np.array([share * x, share * y, 0]), np.zeros(3), point, body, result)
        data.qfrc_applied += result

    def weigh(self):
        """The loads of the wheels in this step."""
        contacts = self.data.contact
        self.loads[:] = 0
        for geom, row in zip(contacts.geom[:, 1], contacts.efc_address, strict=True):
            if self.model.geom_bodyid[geom] in self.wheel_bodies:
                self.loads[self.wheel_bodies.index(self.model.geom_bodyid[geom])] = self.data.efc_force[row]

    def electric(self):
        """The currents after a step: a winding under a voltage, or a current loop that the supply bounds."""
        generated = self.emf * self.data.qvel[self.dofs] * self.signs
        settled = np.where(self.in_volts, (self.command - generated) / self.resistance, self.command)
        current = self.current + (settled - self.current) * self.share
        current = np.clip(current, (-24 - generated) / self.resistance, (24 - generated) / self.resistance)
        self.current = np.clip(current, -self.most, self.most)

    def follow(self, verb, *rest):
        if verb == "drive":
            self.command[: len(rest[0])] = rest[0]
        elif verb == "load":
            self.load[rest[0]] = rest[1]
        elif self.scenario.slope == 0:
            self.data.xfrc_applied[self.model.body("chassis").id, :2] = rest

    def step(self):
        model, data = self.model, self.data
        self.electric()
        data.qfrc_applied[:] = 0
        data.qfrc_applied[self.dofs] = (self.torque * self.current + self.load) * self.signs
        if not self.scenario.wheels:
            mujoco.mj_step(model, data)
            return
        mujoco.mj_fwdPosition(model, data)
        if self.scenario.slides:
            self.rub()
        else:
            self.turn_contacts()
            mujoco.mj_makeConstraint(model, data)
            mujoco.mj_projectConstraint(model, data)
        mujoco.mj_forwardSkip(model, data, mujoco.mjtStage.mjSTAGE_POS, 1)
        if self.scenario.slides:
            self.weigh()
        mujoco.mj_Euler(model, data)
        w, x, y, z = data.qpos[3:7]
        heading = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        self.heading += math.remainder(heading - self.heading, math.tau)

    def sample(self):
        row = []
        for index, (place, dof, sign) in enumerate(zip(self.places, self.dofs, self.signs, strict=True)):
            row += [sign * self.data.qpos[place], sign * self.data.qvel[dof], self.current[index]]
        if self.scenario.wheels:
            body = self.model.body("chassis").id
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            mujoco.mj_comVel(self.model, self.data)
            velocity = np.zeros(6)
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
            sine, cosine = math.sin(self.heading), math.cos(self.heading)
            vx, vy = velocity[3:5]
            row += [*self.data.xipos[body][:2], self.heading, cosine * vx + sine * vy, cosine * vy - sine * vx, velocity[2]]
        return row

    def run(self):
        if self.scenario.slides:
            for _ in range(round(SETTLING_MS * 1e-3 / STEP_S)):
                self.step()
        rows = [self.sample()]
        for ms in range(self.scenario.ms):
            for _, order in (order for order in self.scenario.orders if order[0] == ms):
                self.follow(*order)
            for _ in range(round(1e-3 / STEP_S)):
                self.step()
            rows.append(self.sample())
        return np.array(rows)


def columns(scenario):
    """Kind and column of each value of a sample of MuJoCo."""
    kinds = ["angle", "speed", "current"] * sum(motor.steers is None for motor in scenario.motors)
    return kinds + (["place", "place", "heading", "velocity", "velocity", "turn"] if scenario.wheels else [])


def without_steering(scenario, table):
    """The samples of the program without the steering motors, which MuJoCo has as fixed."""
    steering = [index for index, motor in enumerate(scenario.motors) if motor.steers is not None]
    return np.delete(table, [3 * index + part for index in steering for part in range(3)], axis=1)


def differences(scenario, found, expected):
    """The largest difference of each kind, as a share of its largest value. A sample may be early or late by one millisecond."""
    # MuJoCo's first row is the start.
    near = np.stack([expected[:-1], expected[1:], np.concatenate([expected[2:], expected[-1:]])])
    require(found.shape == near[0].shape and np.isfinite(found).all(), f"{scenario.name}: samples are missing")
    off = np.maximum(0, np.maximum(near.min(0) - found, found - near.max(0)))
    kinds, shares = np.array(columns(scenario)), {}
    for kind in dict.fromkeys(kinds):
        own = kinds == kind
        shares[kind] = off[:, own].max() / max(FLOORS[kind], np.abs(expected[:, own]).max())
    return shares


def listed(name, kind):
    """The allowed difference: ALLOWED, unless the table of README.md has another for it."""
    return LISTED.get(name, {}).get(kind, ALLOWED)


def verdict(scenario, shares):
    """What is wrong with a scenario: too large a difference, or one that is listed and not there any more."""
    wrong = []
    for kind, share in shares.items():
        most = listed(scenario.name, kind)
        if share > most:
            wrong.append(f"{scenario.name}: {kind} is off by {100 * share:.1f} %, {100 * most:.0f} % is allowed")
        elif most > ALLOWED >= share:
            wrong.append(f"{scenario.name}: {kind} is off by {100 * share:.1f} %: take it off the list")
    return wrong


def picture(curves):
    """An SVG: curves of (title, unit, [(name, values of MuJoCo, values of the simulator)]), a sample each 10 ms."""
    width, height, left, top = 300, 190, 44, 40
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{len(curves) * (width + left) + 20}" height="{height + top + 40}" '
        'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>'
    ]
    for place, (title, unit, lines) in enumerate(curves):
        x0 = place * (width + left) + left
        values = np.concatenate([line for _, *pair in lines for line in pair])
        low, high = min(0, values.min()), max(0, values.max())
        y = lambda value: top + height * (high - value) / (high - low)  # noqa: B023, E731
        parts.append(f'<text x="{x0}" y="18" font-weight="bold">{title}</text><text x="{x0}" y="34">{unit}</text>')
        for value in (low, 0, high):
            parts.append(
                f'<path d="M{x0} {y(value):.1f}H{x0 + width}" stroke="#ccc"/>'
                f'<text x="{x0 - 4}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.1f}</text>'
            )
        for (name, theirs, own), color in zip(lines, ("#c8392b", "#1f5fb4"), strict=False):
            step = max(1, len(theirs) // 100)
            at = lambda index: x0 + width * index / (len(theirs) - 1)  # noqa: B023, E731
            path = "M" + "L".join(f"{at(index):.1f} {y(theirs[index]):.1f}" for index in range(0, len(theirs), step))
            parts.append(f'<path d="{path}" fill="none" stroke="{color}" stroke-width="5" stroke-opacity="0.3"/>')
            path = "M" + "L".join(f"{at(index):.1f} {y(own[index]):.1f}" for index in range(0, len(own), step))
            parts.append(f'<path d="{path}" fill="none" stroke="{color}"/>')
            parts.append(f'<text x="{x0 + width - 4}" y="{y(theirs[-1]) - 6:.1f}" text-anchor="end" fill="{color}">{name}</text>')
        parts.append(f'<text x="{x0}" y="{top + height + 18}">0 to {len(lines[0][1])} ms</text>')
    parts.append(f'<text x="{left}" y="{top + height + 34}">broad: MuJoCo; narrow: the simulator</text></svg>')
    return "\n".join(parts) + "\n"


#: Scenario, title, unit, and name and column of two curves.
PICTURE = [
    ("curve", "mecanum wheels, a curve", "m/s, rad/s", [("forward", -3), ("turn", -1)]),
    ("slope", "up a slope of 8°, and rolled back", "m/s, m", [("forward", -3), ("place", -6)]),
    ("scrubbing", "four tyres turn on the spot, sliding", "rad/s", [("wheel", 4), ("turn", -1)]),
]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge")
    # The scenarios are not random.
    parser.add_argument("--count", type=int)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--only")
    parser.add_argument("--plot")
    options = parser.parse_args()
    if options.only not in (None, "simulator", *(scenario.name for scenario in scenarios())):
        return
    start = time.monotonic()
    print(f"simulator: {options.judge} {mujoco.__version__}")
    wrong, runs, worst = [], {}, {}
    for scenario in scenarios():
        if options.only not in (None, "simulator", scenario.name):
            continue
        expected = World(scenario).run()
        found = without_steering(scenario, ours(options.program, scenario))
        runs[scenario.name] = scenario, expected, found
        shares = differences(scenario, found, expected)
        wrong += verdict(scenario, shares)
        for kind, share in shares.items():
            allowed = listed(scenario.name, kind)
            own = f", {kind} in *{scenario.name}*, listed" if allowed > ALLOWED else ""
            most, names = worst.get((own, allowed), (0.0, set()))
            worst[own, allowed] = max(most, share), names | {scenario.name}
        print(f"  {scenario.name:18}" + ", ".join(f"{kind} {100 * share:.2f} %" for kind, share in shares.items()))
    require(not wrong, "\n  ".join(["differences:", *wrong]))
    for (own, allowed), (share, names) in worst.items():
        figure("simulator", f"largest difference of a scenario, as a share of the largest value{own}", f"MuJoCo {mujoco.__version__}", len(names), allowed, share, "simulator")
    if options.only in (None, "simulator"):
        for defect in DEFECTS:
            found_by = [
                name
                for name, (scenario, expected, _) in runs.items()
                if verdict(scenario, differences(scenario, without_steering(scenario, ours(options.program, scenario, "--plant", defect)), expected))
            ]
            require(found_by, f"the defect {defect} was not found")
            print(f"  found the planted defect {defect} in {len(found_by)} scenarios: {', '.join(found_by[:3])}")
    if options.plot:
        curves = [
            (title, unit, [(name, runs[scenario][1][1:, column], runs[scenario][2][:, column]) for name, column in lines])
            for scenario, title, unit, lines in PICTURE
        ]
        pathlib.Path(options.plot).write_text(picture(curves))
    print(f"  {len(runs)} scenarios, {time.monotonic() - start:.0f} s")


if __name__ == "__main__":
    main()
