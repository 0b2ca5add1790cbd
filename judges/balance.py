"""Lets a robot that balances stand in MuJoCo, which runs the physics: see README.md.

balance.py PROGRAM mujoco [--count N] [--seed N] [--only balance] [--picture FILE.svg]

The program has the whole controller, and hears and says only frames: of two M3508 wheels, of four DM-J8009P joints, of a HiPNUC IMU.
Robots run together, a program each: while one calculates, the physics of the others goes on.
"""

import argparse
import binascii
import collections
import itertools
import math
import struct
import subprocess
import sys
import time

import mujoco
import numpy as np

from figures import figure

#: Seconds that it has to stand, once it stands; after which it is pushed over. The pilot asks at the start.
STAND_S, FALL_S = 20.0, 3.0
#: The seeds, and their share of a run without `--count`: another tenth in each turn of the stage, which has a turn in seven days.
SEEDS, SHARE, TURN_S = 100, 10, 7 * 86_400
#: When it is pushed, by how much: s, m/s of the whole robot.
PUSHES = ((8.0, 0.5), (14.0, 0.5))
#: When it is thrown up, in s; by how much in m/s; the time in which both changes are to be noticed, in s.
HOP, NOTICE_S = (17.0, 1.0), 0.03
#: The push that no robot stands, in m/s.
OVER = 3.5
TICK_S, SUBSTEPS = 0.001, 2
#: Ticks from a measurement to the program, and from the program to the motors: 2 ms together.
DELAY = 1
#: Roll or pitch of a fall, in rad, and the time in which each motor has to be off.
FALL, OFF_S = 0.7, 0.02
#: Longest time until it stands, in s.
RISE_S = 4.7
#: Largest lean of the body while it stands, in rad; way in m and speed in m/s at the end.
LEAN, FAR, SPEED = 0.5, 1.5, 0.1
HIP, UPPER, LOWER, RADIUS = 0.075, 0.15, 0.27, 0.075
GEAR = 3591 / 187
#: Names of the joints in the order of the frames: bus, id.
JOINTS = [("lf", 1, 1), ("lr", 1, 2), ("rf", 2, 1), ("rr", 2, 2)]
WHEELS = [("lw", 1, 1), ("rw", 2, -1)]
#: PMAX, VMAX, TMAX of a DM-J8009P.
RANGES = (12.5, 45.0, 54.0)
DEFECTS = ("late", "reversed")


def fail(text):
    sys.exit(f"balance: {text}")


def angles(length, lean):
    """Angles of the front and the rear joint, by the cosine rule."""
    wheel = np.array([-length * math.sin(lean), -length * math.cos(lean)])
    found = []
    for hip, outward in ((HIP, 1), (-HIP, -1)):
        way = wheel - (hip, 0)
        distance = np.hypot(*way)
        inner = math.acos((UPPER**2 + distance**2 - LOWER**2) / (2 * UPPER * distance))
        found.append(math.atan2(-way[1], way[0]) - outward * inner)
    return found


def leg(side, y):
    stop = angles(0.10, 0.0)
    front, rear = math.degrees(stop[0]), math.degrees(stop[1])
    link = '<geom type="capsule" fromto="0 0 0 {0} 0 0" size="0.012" mass="{1}" contype="0" conaffinity="0"/>'
    return f"""
    <body name="{side}fu" pos="{HIP} {y} 0">
      <joint name="{side}f" axis="0 1 0" range="{front} 110" armature="0.02" damping="0.05" frictionloss="0.2"/>{link.format(UPPER, 0.3)}
      <body name="{side}fl" pos="{UPPER} 0 0">
        <joint name="{side}fk" axis="0 1 0" damping="0.01"/>{link.format(LOWER, 0.25)}
        <site name="{side}a" pos="{LOWER} 0 0"/>
        <body name="{side}wheel" pos="{LOWER} 0 0">
          <joint name="{side}w" axis="0 1 0" armature="0.0024" damping="0.002" frictionloss="0.1"/>
          <geom name="{side}tyre" type="cylinder" size="{RADIUS} 0.02" euler="90 0 0" mass="0.8" friction="0.9 0.005 0.0001"/>
        </body>
      </body>
    </body>
    <body name="{side}ru" pos="{-HIP} {y} 0">
      <joint name="{side}r" axis="0 1 0" range="70 {rear}" armature="0.02" damping="0.05" frictionloss="0.2"/>{link.format(UPPER, 0.3)}
      <body name="{side}rl" pos="{UPPER} 0 0">
        <joint name="{side}rk" axis="0 1 0" damping="0.01"/>{link.format(LOWER, 0.25)}
        <site name="{side}b" pos="{LOWER} 0 0"/>
      </body>
    </body>"""


def scene(slope, toward):
    """The robot on a plane that falls by `slope` rad toward the direction `toward`, from its x axis."""
    normal = f"{math.sin(slope) * math.cos(toward)} {math.sin(slope) * math.sin(toward)} {math.cos(slope)}"
    return f"""
<mujoco>
  <compiler autolimits="true"/>
  <option timestep="{TICK_S / SUBSTEPS}" integrator="implicitfast" cone="elliptic"/>
  <default><geom solref="0.005 1"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="20 20 0.1" zaxis="{normal}" friction="0.9 0.005 0.0001"/>
    <body name="body" pos="0 0 0.3">
      <freejoint name="free"/>
      <inertial pos="0 0 0.03" mass="14" diaginertia="0.22 0.25 0.3"/>
      <geom name="box" type="box" size="0.2 0.15 0.11" pos="0 0 -0.045" mass="0" friction="0.9 0.005 0.0001"/>
      <site name="imu"/>{leg("l", 0.21)}{leg("r", -0.21)}
    </body>
  </worldbody>
  <equality>
    <connect site1="la" site2="lb" solref="0.002 1"/>
    <connect site1="ra" site2="rb" solref="0.002 1"/>
  </equality>
  <actuator>{"".join(f'<motor name="{name}" joint="{name}"/>' for name, *_ in JOINTS + WHEELS)}</actuator>
  <sensor><accelerometer name="acc" site="imu"/><gyro name="gyro" site="imu"/></sensor>
</mujoco>"""


def field(value, most, bits):
    top = (1 << bits) - 1
    return int((min(max(value, -most), most) + most) * top / (2 * most))


class Joint:
    """A drive of Damiao in MIT mode, from its manual: registers, enabling, time-out, a frame for each that it hears."""

    def __init__(self, id):
        self.id, self.is_on, self.error, self.silence, self.command = id, False, 0, 0, (0.0,) * 5
        self.registers = {7: 0x10 + id, 8: id, 9: 0, 10: 1, 21: RANGES[0], 22: RANGES[1], 23: RANGES[2]}

    def hear(self, id, data, angle, rate):
        if id == 0x7FF:
            return self.inquiry(data, angle, rate) if data[0] | data[1] << 8 == self.id else None
        if id != self.id:
            return None
        self.silence = 0
        if data[:7] == b"\xff" * 7 and data[7] >= 0xFB:
            self.switch(data[7])
        else:
            bits = int.from_bytes(data, "big")
            self.command = (
                (2 * (bits >> 48) / 0xFFFF - 1) * RANGES[0],
                (2 * (bits >> 36 & 0xFFF) / 0xFFF - 1) * RANGES[1],
                (bits >> 24 & 0xFFF) / 0xFFF * 500,
                (bits >> 12 & 0xFFF) / 0xFFF * 5,
                (2 * (bits & 0xFFF) / 0xFFF - 1) * RANGES[2],
            )
        return self.feedback(angle, rate)

    def switch(self, verb):
        if verb == 0xFC:
            self.is_on = not self.error
        elif verb == 0xFD:
            self.is_on = False
        elif verb == 0xFB:
            self.error = 0

    def inquiry(self, data, angle, rate):
        verb, number = data[2], data[3]
        if verb == 0xCC:
            return self.feedback(angle, rate)
        if number not in self.registers or verb not in (0x33, 0x55):
            return None
        form = "<f" if number >= 21 else "<I"
        if verb == 0x55:
            (self.registers[number],) = struct.unpack(form, data[4:8])
        return bytes([self.id, 0, verb, number]) + struct.pack(form, self.registers[number])

    def feedback(self, angle, rate):
        status = self.error or int(self.is_on)
        bits = (status << 4 | self.id) << 56 | field(angle, RANGES[0], 16) << 40 | field(rate, RANGES[1], 12) << 28
        return (bits | field(self.torque(angle, rate), RANGES[2], 12) << 16 | 35 << 8 | 30).to_bytes(8, "big")

    def torque(self, angle, rate):
        if not self.is_on:
            return 0.0
        position, velocity, kp, kd, torque = self.command
        return min(max(kp * (position - angle) + kd * (velocity - rate) + torque, -RANGES[2]), RANGES[2])

    def tick(self):
        self.silence += 1
        limit = self.registers[9] * 0.05
        if self.is_on and limit and self.silence > limit:
            self.is_on, self.error = False, 0xD


class Robot:
    """A robot in MuJoCo, its motors and its IMU, with the program that drives it."""

    def __init__(self, program, seed, *plant):
        self.random = random = np.random.default_rng([28, seed])
        self.slope = math.radians(10)
        self.toward = random.uniform(-math.pi, math.pi)
        self.mass = random.choice([0.8, 1.2])
        self.model = mujoco.MjModel.from_xml_string(scene(self.slope, self.toward))
        body = self.model.body("body").id
        self.model.body_mass[body] *= self.mass
        self.model.body_inertia[body] *= self.mass
        self.total = self.model.body_mass.sum()
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))
        self.data = mujoco.MjData(self.model)
        self.body = body
        self.tyres = {self.model.geom(side + "tyre").id for side in "lr"}
        self.gyro, self.acc = (self.data.sensor(name).data for name in ("gyro", "acc"))
        self.place = [self.model.joint(name).qposadr[0] for name, *_ in JOINTS + WHEELS]
        self.rate = [self.model.joint(name).dofadr[0] for name, *_ in JOINTS + WHEELS]
        self.joints = [Joint(id) for _, _, id in JOINTS]
        self.legs = {bus: [at for at, joint in enumerate(JOINTS) if joint[1] == bus] for bus in (1, 2)}
        self.current = [0.0, 0.0]
        self.bias = np.radians(random.uniform(-0.3, 0.3, 2))
        self.put_down()
        self.program = subprocess.Popen([program, "balance", *plant], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.words = collections.deque([[] for _ in range(DELAY)])
        self.commands = collections.deque([[] for _ in range(DELAY)])
        self.ticks, self.phase, self.slips, self.push = 0, 0, 0, None
        self.samples = []

    def put_down(self):
        """Lies on its wheels and on the front or the rear edge of its body."""
        tilt = math.radians(self.random.choice([-10, 10]))
        q = self.data.qpos
        q[2] = 0.28
        q[3:7] = [math.cos(tilt / 2), 0, math.sin(tilt / 2), 0]
        front, rear = angles(0.14, 0.0)
        for side in "lr":
            upper = self.model.joint(side + "f").qposadr[0], self.model.joint(side + "r").qposadr[0]
            knees = self.model.joint(side + "fk").qposadr[0], self.model.joint(side + "rk").qposadr[0]
            wheel = np.array([0, -0.14])
            for at, knee, hip, angle in zip(upper, knees, (HIP, -HIP), (front, rear)):
                q[at] = angle
                way = wheel - (hip + UPPER * math.cos(angle), -UPPER * math.sin(angle))
                q[knee] = math.atan2(-way[1], way[0]) - angle
        mujoco.mj_forward(self.model, self.data)

    def tilt(self):
        w, x, y, z = self.data.qpos[3:7].tolist()
        return math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), math.asin(max(-1, min(1, 2 * (w * y - z * x))))

    def imu(self):
        noise = self.random.normal(0, 1, 5)
        # The attitude, and a small turn after it.
        w, x, y, z = self.data.qpos[3:7].tolist()
        i, j = ((self.bias + 5e-4 * noise[:2]) / 2).tolist()
        turned = w - x * i - y * j, w * i + x - z * j, w * j + y + z * i, z + x * j - y * i
        size = math.hypot(*turned)
        turned = [part / size for part in turned]
        gyro = np.degrees(self.gyro + 0.005 * noise[2:]).tolist()
        acc = (self.acc / 9.80665).tolist()
        roll, pitch = self.tilt()
        fields = [*acc, *gyro, 0, 0, 0, math.degrees(roll), math.degrees(pitch), 0.0, *turned]
        payload = struct.pack("<BHbfI16f", 0x91, 0, 30, 101_325.0, self.ticks, *fields)
        head = b"\x5a\xa5" + struct.pack("<H", len(payload))
        return head + struct.pack("<H", binascii.crc_hqx(head + payload, 0)) + payload

    def shafts(self):
        """Angles and rates of joints and wheels."""
        return self.data.qpos[self.place].tolist(), self.data.qvel[self.rate].tolist()

    def is_off(self):
        """Whether no motor gets a torque."""
        angle, rate = self.shafts()
        torques = [joint.torque(angle[at], rate[at]) for at, joint in enumerate(self.joints)]
        # Half a count of a Damiao is its zero.
        return all(abs(torque) < 0.03 for torque in torques) and not any(self.current)

    def tick(self, *orders):
        """A millisecond: frames of before reach the program and the motors, then the physics goes on. Yields while the program works."""
        angle, rate = self.shafts()
        words = []
        for bus, id, data in self.commands.popleft():
            if bus == 0:
                if id == 0x200:
                    raw = struct.unpack(">4h", data)
                    self.current = [raw[id - 1] * 20 / 16384 for _, id, _ in WHEELS]
                continue
            for at in self.legs[bus]:
                if answer := self.joints[at].hear(id, data, angle[at], rate[at]):
                    words.append(f"{bus}:{self.joints[at].registers[7]:X}#{answer.hex()}")
        for number, (_, id, sign) in enumerate(WHEELS):
            turned, rpm = sign * angle[4 + number] * GEAR, sign * rate[4 + number] * GEAR * 30 / math.pi
            counts = int(turned / (2 * math.pi) * 8192) % 8192
            current = int(self.current[number] / 20 * 16384)
            words.append(f"0:{0x200 + id:X}#{struct.pack('>HhhBx', counts, round(rpm), current, 35).hex()}")
        if self.ticks % 2 == 0:
            words.append("i:" + self.imu().hex())
        self.words.append(words)
        line = [str(1000 * (self.ticks + 1)), *self.words.popleft(), *orders]
        self.program.stdin.write(" ".join(line) + "\n")
        self.program.stdin.flush()
        yield
        answer = self.program.stdout.readline().split()
        if not answer:
            fail("the program ended")
        self.phase, self.slips = int(answer[0]), self.slips + int(answer[1])
        frames = []
        for word in answer[2:]:
            bus, rest = word.split(":")
            id, digits = rest.split("#")
            frames.append((int(bus), int(id, 16), bytes.fromhex(digits)))
        self.commands.append(frames)
        self.physics()
        self.ticks += 1

    def physics(self):
        data = self.data
        data.xfrc_applied[self.body, :3] = 0
        if self.push is not None:
            force, left = self.push
            data.xfrc_applied[self.body, :3] = force
            self.push = (force, left - 1) if left > 1 else None
        for joint in self.joints:
            joint.tick()
        for _ in range(SUBSTEPS):
            angle, rate = self.shafts()
            torque = [joint.torque(angle[at], rate[at]) for at, joint in enumerate(self.joints)]
            for number, (_, _, sign) in enumerate(WHEELS):
                # A driven M3508 has no torque left at its no-load speed.
                speed = sign * rate[4 + number]
                share = min(1.0, max(0.0, (50 - abs(speed)) / 10)) if speed * self.current[number] > 0 else 1.0
                torque.append(sign * 0.3 * self.current[number] * share)
            data.ctrl[:] = torque
            mujoco.mj_step(self.model, data)

    def shove(self, speed, direction=None):
        """Gives the whole robot a speed within 50 ms: up without a direction."""
        ticks = 50
        force = self.total * speed / (ticks * TICK_S)
        way = (0, 0, 1) if direction is None else (math.cos(direction), math.sin(direction), 0)
        self.push = (np.array(way) * force, ticks)

    def flies(self):
        """Whether no wheel touches the floor."""
        return self.tyres.isdisjoint(self.data.contact.geom.ravel().tolist())

    def sample(self):
        q = self.data.qpos
        legs = [self.data.body(side + "wheel").xpos.copy() for side in "lr"]
        knees = [self.data.body(name).xpos.copy() for name in ("lfl", "lrl")]
        roll, pitch = self.tilt()
        self.samples.append((self.ticks * TICK_S, q[:3].copy(), q[3:7].copy(), legs, knees, roll, pitch, self.phase))

    def close(self):
        self.program.stdin.close()
        self.program.wait()


def together(runs):
    """Steps runs in turn, and returns their results."""
    runs = dict(enumerate(runs))
    results = [None] * len(runs)
    while runs:
        for place, run in list(runs.items()):
            try:
                next(run)
            except StopIteration as end:
                results[place] = end.value
                del runs[place]
    return results


def stand(program, seed, *plant, seconds=None, picture=False):
    """Returns what went wrong, or None; the largest lean, the way, the time until the motors were off. Falls after so many seconds."""
    robot = Robot(program, seed, *plant)
    figures = {"mass": robot.mass, "toward": math.degrees(robot.toward), "lean": 0.0, "slips": 0, "flight": 0}
    try:
        text = yield from watched(robot, seconds, picture, figures)
        return text, figures, robot.samples
    finally:
        robot.close()


def watched(robot, seconds, picture, figures):
    stood, start, flown, landed = None, None, 0, 0
    pushes = [(at, speed, robot.random.uniform(-math.pi, math.pi)) for at, speed in PUSHES]
    for tick in itertools.count():
        now = tick * TICK_S
        if now >= (seconds or (math.inf if stood is None else stood + STAND_S)):
            break
        for at, speed, direction in pushes:
            if abs(now - at) < TICK_S / 2:
                robot.shove(speed, direction)
        if abs(now - HOP[0]) < TICK_S / 2:
            robot.shove(HOP[1])
        yield from robot.tick(*(["start"] if tick == 300 else []))
        if picture and tick % 20 == 0:
            robot.sample()
        roll, pitch = robot.tilt()
        if stood is None and robot.phase == 2:
            stood, start = now, robot.data.qpos[:2].copy()
            figures["rises"] = now - 0.3
        if stood is None and now > 0.3 + RISE_S:
            return "does not rise"
        if stood is not None:
            figures["lean"] = max(figures["lean"], abs(pitch), abs(roll))
            flies = robot.flies()
            flown, landed = (flown + 1, 0) if flies else (0, landed + 1)
            for name, ticks, wrong in (("lift-off", flown, robot.phase != 3), ("landing", landed, robot.phase == 3)):
                if wrong and ticks:
                    figures[name] = max(figures.get(name, 0), ticks)
            figures["flight"] = max(figures["flight"], flown)
            if robot.phase == 0:
                return f"disarmed at {now:.2f} s"
            if max(abs(roll), abs(pitch)) > LEAN:
                return f"leans by {max(abs(roll), abs(pitch)):.2f} rad at {now:.2f} s"
    if stood is None:
        return "does not rise"
    figures["slips"] = robot.slips
    figures["way"] = float(np.hypot(*(robot.data.qpos[:2] - start)))
    figures["speed"] = float(np.hypot(*robot.data.qvel[:2]))
    for name in ("lift-off", "landing"):
        if figures.get(name, 0) * TICK_S > NOTICE_S:
            return f"the {name} was noticed after {figures[name]} ms"
    if not seconds and figures["flight"] * TICK_S < 2 * NOTICE_S:
        return "was not thrown up"
    if figures["way"] > FAR:
        return f"moved by {figures['way']:.2f} m"
    if figures["speed"] > SPEED:
        return f"moves with {figures['speed']:.2f} m/s at the end"
    return (yield from fallen(robot, picture, figures))


def fallen(robot, picture, figures):
    """Pushes it over, and times the motors."""
    yaw = 2 * math.atan2(robot.data.qpos[6], robot.data.qpos[3])
    robot.shove(OVER, yaw + robot.random.choice([0, math.pi]))
    fell = None
    for tick in range(int(FALL_S / TICK_S)):
        yield from robot.tick()
        if picture and tick % 20 == 0:
            robot.sample()
        if fell is None and max(map(abs, robot.tilt())) > FALL:
            fell = tick
        if fell is not None and robot.is_off():
            figures["off_ms"] = tick - fell
            return None if (tick - fell) * TICK_S <= OFF_S else f"the motors were off after {tick - fell} ms"
    return "the motors were never off" if fell else "does not fall"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge", choices=["mujoco"])
    parser.add_argument("--count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    parser.add_argument("--picture")
    options = parser.parse_args()
    if options.only not in (None, "balance"):
        return
    first, count = options.seed, min(options.count or SHARE, SEEDS)
    if not options.count:
        first += int(time.time() // TURN_S) % (SEEDS // SHARE) * SHARE
    start = time.monotonic()
    print(f"balance: MuJoCo {mujoco.__version__}")
    runs = together(stand(options.program, options.seed, "--plant", defect, seconds=5.0) for defect in DEFECTS)
    for defect, (text, *_) in zip(DEFECTS, runs):
        if not text:
            fail(f"the defect {defect} was not found")
    print("  found the planted defects")
    wrong, worst = [], collections.defaultdict(float)
    seeds = range(first, first + count)
    for begin in range(0, count, SHARE):
        part = seeds[begin : begin + SHARE]
        runs = together(stand(options.program, seed, picture=bool(options.picture) and seed == first) for seed in part)
        for seed, (text, figures, samples) in zip(part, runs):
            if samples:
                draw(options.picture, samples)
            for name, value in figures.items():
                worst[name] = max(worst[name], value)
            if text or count <= SHARE:
                print(f"  seed {seed}: {text or 'stands'}: " + ", ".join(f"{name} {value:.3g}" for name, value in figures.items()))
            if text:
                wrong.append(seed)
    print(f"  {count - len(wrong)} of {count} stand {STAND_S:.0f} s; most: " + ", ".join(f"{name} {value:.3g}" for name, value in worst.items()))
    name = f"MuJoCo {mujoco.__version__}"
    for what, allowed, value in (
        (f"seeds of which the robot does not stand {STAND_S:.0f} s", 0, len(wrong)),
        ("time from the pilot's wish to standing, s", RISE_S, worst["rises"]),
        ("tilt while it stands, degrees", math.degrees(LEAN), math.degrees(worst["lean"])),
        ("distance from where it stood up, at the end, m", FAR, worst["way"]),
        ("speed at the end, m/s", SPEED, worst["speed"]),
        ("lift-off noticed after, ms", 1000 * NOTICE_S, worst["lift-off"]),
        ("landing noticed after, ms", 1000 * NOTICE_S, worst["landing"]),
        ("a fall: every motor off after, ms", 1000 * OFF_S, worst["off_ms"]),
    ):
        figure("balance", what, name, count, allowed, value, f"balance --count {SEEDS}", SEEDS)
    print(f"  {time.monotonic() - start:.0f} s")
    if wrong:
        fail(f"seeds {wrong} fell")


def draw(path, samples):
    """A film strip of the left leg, and below it pitch and roll, way and height over time."""
    times = np.array([sample[0] for sample in samples])
    q = samples[len(samples) // 2][2]
    yaw = 2 * math.atan2(q[3], q[0])
    heading = np.array([math.cos(yaw), math.sin(yaw), 0])
    start = samples[0][1]
    moments = [0.3, 0.7, 1.5, 6.0, 8.1, 8.4, 17.15, 17.4, 19.9, times[-1]]
    width, lines = 100, []
    for number, moment in enumerate(moments):
        sample = samples[int(np.abs(times - moment).argmin())]
        now, place, quat, legs, knees, roll, pitch, phase = sample
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, quat)
        matrix = matrix.reshape(3, 3)

        def at(point):
            away = point - place
            return 50 + width * number + 130 * (heading @ away), 110 - 130 * away[2]

        def line(points, colour, thick):
            text = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(at, points))
            lines.append(f'<polyline points="{text}" fill="none" stroke="{colour}" stroke-width="{thick}"/>')

        corner = [place + matrix @ np.array([x, 0, z]) for x, z in ((0.2, -0.155), (0.2, 0.065), (-0.2, 0.065), (-0.2, -0.155), (0.2, -0.155))]
        line(corner, "#888", 1.5)
        wheel = legs[0]
        for hip, knee in zip((HIP, -HIP), knees):
            line([place + matrix @ np.array([hip, 0.21, 0]), knee, wheel], "#1f6fb4", 3)
        x, y = at(wheel)
        lines.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{130 * RADIUS:.1f}" fill="none" stroke="#222" stroke-width="2"/>')
        lines.append(f'<text x="{50 + width * number}" y="14" text-anchor="middle">{now:.2f} s</text>')
    series = (
        ("pitch (blue) and roll (red) of the body, degrees", (("#1f6fb4", np.degrees([s[6] for s in samples])), ("#c33", np.degrees([s[5] for s in samples])))),
        ("way along the heading at the middle, m", (("#1f6fb4", np.array([heading @ (s[1] - start) for s in samples])),)),
        ("hip above the wheels, m", (("#1f6fb4", np.array([s[1][2] - (s[3][0][2] + s[3][1][2]) / 2 for s in samples])),)),
    )
    for number, (title, curves) in enumerate(series):
        top = 200 + 130 * number
        least = min(curve.min() for _, curve in curves)
        most = max(curve.max() for _, curve in curves)
        lines.append(f'<text x="10" y="{top}">{title}: {least:.2f} to {most:.2f}</text>')
        for colour, curve in curves:
            points = " ".join(f"{10 + 980 * now / times[-1]:.1f},{top + 105 - 95 * (value - least) / (most - least):.1f}" for now, value in zip(times, curve))
            lines.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1"/>')
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1000 590" font-family="sans-serif" font-size="11"><rect width="1000" height="590" fill="white"/>'
    with open(path, "w", encoding="ascii") as file:
        file.write(head + "\n".join(lines) + "</svg>\n")


if __name__ == "__main__":
    main()
