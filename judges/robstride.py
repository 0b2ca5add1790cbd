"""Compares the family `robstride` with judges: see README.md."""

import argparse
import contextlib
import ctypes
import math
import os
import struct
import sys
import threading
import time

import numpy as np

from exact import DOUBLE, SINGLE, Field, Rule
from program import Program

HOST = 0xFD
FEEDBACK = 0x0280_0000 | 1 << 8 | HOST
#: What a public program writes and reads: index, kind of motorbridge, value.
PARAMETERS = [
    (0x7005, "i8", 2),
    (0x7006, "f32", 1.5),
    (0x700A, "f32", -3.25),
    (0x700B, "f32", 6.0),
    (0x7016, "f32", 0.75),
    (0x7017, "f32", 5.5),
    (0x7018, "f32", 7.0),
    (0x7028, "u32", 4321),
]

#: Which comparison has to find which planted defect.
DEFECTS = {
    "operation": ["nibbles", "scale", "rounded"],
    "feedback": ["nibbles", "scale"],
    "frames": ["id", "number", "kind"],
    "drive": ["drive", "ear", "answer"],
}

#: Ranges of the judges that are not ours: position, velocity, torque, kp, kd.
OTHER_RANGES = {
    "RS00": (None, 50.0, 17.0, 500.0, 5.0),
    "RS03": (None, 50.0, 60.0, 5000.0, 100.0),
    "RS05": (None, 33.0, 17.0, 500.0, 5.0),
    "RS06": (None, 20.0, 60.0, 5000.0, 100.0),
    "CyberGear": (None, 30.0, 12.0, 500.0, 5.0),
}

RANGES = "model(s) with other ranges"
SPAN = "fields of 65534 counts by the judge, one less than ours"
STATE = "frames with a state that no drive has, refused by us"
COLD = "temperatures below zero, above 6500 C to the judge"


GAINS = "gains a count apart: f32 here, f64 or another order of operations there"
PROVED = "counts proved by exact arithmetic"
#: The differences that README.md explains: all of them, and no other, have to be seen.
EXPLAINED = {
    ("robstride-dynamics", "operation"): {RANGES, SPAN, GAINS, PROVED},
    ("robstride-dynamics", "feedback"): {RANGES, SPAN, STATE, COLD},
    ("motorbridge", "operation"): {SPAN, GAINS, PROVED},
    ("motorbridge", "feedback"): {SPAN, STATE, COLD},
    ("cybergeardriver", "operation"): {RANGES, GAINS, PROVED},
    ("cybergeardriver", "feedback"): {RANGES, STATE, COLD},
    ("python-cybergear", "operation"): {RANGES, GAINS, PROVED},
    ("python-cybergear", "feedback"): {RANGES, STATE, COLD},
}


class Difference(Exception):
    """A difference that nothing explains."""


def require(condition, what):
    if not condition:
        raise Difference(what)


def fields_of(ranges, top=65_535):
    """Position, velocity, kp, kd and torque. Signed fields of two judges span twice 0x7FFF."""
    p, v, t, kp, kd = ranges
    signed = [Field(-end, end, top) for end in (p, v)]
    return [*signed, Field(0.0, kp, 65_535), Field(0.0, kd, 65_535), Field(-t, t, top)]


class Message:
    """A frame as python-can has it."""

    def __init__(self, arbitration_id, data, is_extended_id=True):
        self.arbitration_id, self.data = arbitration_id, data


class CyberGear:
    """A judge for the CyberGear alone, in Python: its bus is an object with `send`."""

    models = ["CyberGear"]
    parameters = [row for row in PARAMETERS if row[0] != 0x7028]
    top = 65_535
    rule = Rule(False, DOUBLE)

    def __init__(self):
        self.sent, self.respond = [], None
        self.motor = self.new(1)

    def ranges(self, _model):
        owner = self.constants
        return tuple(float(getattr(owner, f"{name}_MAX")) for name in ("P", "V", "T", "KP", "KD"))

    def take(self, frame):
        """A frame is sent."""
        self.sent.append(frame)
        if self.respond:
            for answer in self.respond(*frame):
                self.receive(*answer)

    def encode(self, _model, values):
        self.sent, control = [], self.control
        for p, v, kp, kd, t in values.tolist():
            control(p, v, kp, kd, t)
        return np.array([(i, *data) for i, data in self.sent], np.uint32)

    def decode(self, _model, frames):
        found = []
        for identifier, data in frames:
            self.receive(identifier & 0xFFFF_FF00 | self.host, data)
            found.append(self.seen())
        return np.array(found)

    def frames(self, identifier):
        self.motor = self.new(identifier)
        for words, action in (("enable", "enable"), ("disable", "disable"), ("zero", "zero")):
            self.sent = []
            self.switch(action)
            yield [words], self.sent[-1]
        for index, kind, value in self.parameters:
            self.sent = []
            self.write(index, kind, value)
            yield ["write", str(index), str(value)], self.sent[-1]
            self.sent = []
            self.ask(index)
            yield ["read", str(index)], self.sent[-1]
        self.motor = self.new(1)

    # The simulated drive

    def start(self, respond):
        self.respond = respond

    def command(self, values):
        p, v, kp, kd, t = values
        self.control(p, v, kp, kd, t)

    def read(self, index, _kind):
        self.ask(index)
        return self.found(index)

    def state(self):
        """Disabling answers with feedback, and so does enabling."""
        self.switch("enable")
        return self.seen()[:3]

    def close(self):
        self.respond, self.sent = None, []


class CyberGearDriver(CyberGear):
    name = "cybergeardriver"
    #: Enabling names no host, which is host 0.
    host = 0
    #: By their names it writes the limits of the parameter table, with a frame of the maker's tool.
    parameters = [row for row in CyberGear.parameters if row[0] not in (0x700B, 0x7017, 0x7018)]
    NAMES = {
        0x7005: "run_mode",
        0x7006: "iq_ref",
        0x700A: "spd_ref",
        0x7016: "loc_ref",
    }

    def __init__(self):
        from CyberGearDriver import constants, motor_controller

        self.constants = constants
        # It waits after each frame.
        motor_controller.time = type("Time", (), {"sleep": staticmethod(lambda seconds: None)})
        self.Motor = motor_controller.CyberGearMotor
        super().__init__()

    def new(self, identifier):
        return self.Motor(identifier, lambda m: self.take((m.arbitration_id, bytes(m.data))), self.host)

    def control(self, p, v, kp, kd, t):
        self.motor.control(p, v, t, kp, kd)

    def receive(self, identifier, data):
        self.motor.message_received(Message(identifier, data))

    def seen(self):
        state = self.motor.state
        return state["position"], state["velocity"], state["torque"], state["temperature"]

    def switch(self, verb):
        {"enable": self.motor.enable, "disable": self.motor.stop, "zero": self.motor.set_zero_position}[verb]()

    def write(self, index, _kind, value):
        self.motor.set_parameter(self.NAMES[index], value)

    def ask(self, index):
        self.motor.request_parameter(self.NAMES[index])

    def found(self, index):
        return self.motor.params[self.NAMES[index]]


class PythonCyberGear(CyberGear):
    name = "python-cybergear"
    host = HOST

    def __init__(self):
        from cybergear import cybergear

        # A message of python-can takes most of the time.
        cybergear.logger.disabled = True
        cybergear.can = type("Can", (), {"Message": Message})
        self.module, self.Motor = cybergear, cybergear.CyberGearMotor
        self.constants = self.Motor
        super().__init__()

    def new(self, identifier):
        motor = object.__new__(self.Motor)
        motor.can_id, motor.host_can_id, motor._send_timeout = identifier, self.host, 0
        motor._bus, motor._feedback = self, self.module.MotorFeedback()
        motor._parameters, motor._commanded = {}, {}
        motor._feedback_listeners = motor._parameter_listeners = motor._fault_listeners = []
        return motor

    def send(self, message, timeout):
        self.take((message.arbitration_id, bytes(message.data)))

    def control(self, p, v, kp, kd, t):
        self.motor.motor_control(t, p, v, kp, kd)

    def receive(self, identifier, data):
        self.motor._on_message_received(Message(identifier, data))

    def seen(self):
        feedback = self.motor._feedback
        return feedback.position, feedback.velocity, feedback.torque, feedback.temperature

    def switch(self, verb):
        motor = self.motor
        {"enable": motor.enable, "disable": motor.disable, "zero": motor.reset_zero_position}[verb]()

    def write(self, index, _kind, value):
        name = self.module.ParameterIndex(index).name
        setattr(self.motor, name, self.module.RunMode(value).name if name == "run_mode" else value)

    def ask(self, index):
        """It asks for all at once."""
        self.sent, kept = [], self.sent
        self.motor._fetch_parameter_list()
        self.sent = kept + [frame for frame in self.sent if struct.unpack_from("<H", frame[1])[0] == index]

    def found(self, index):
        return self.motor._parameters[self.module.ParameterIndex(index).name]


class RobstrideDynamics:
    """robstride-dynamics, the SDK of the maker, in Python. Its bus is an object with `send` and `recv`."""

    name = "robstride-dynamics"
    models = [f"RS0{number}" for number in range(7)]
    parameters = PARAMETERS
    top = 65_534
    host = 0xFF
    rule = Rule(False, DOUBLE)

    def __init__(self):
        from robstride_dynamics import bus, protocol, table

        class Fast:
            """numpy's `clip` takes most of the time for one number."""

            def __getattr__(self, name):
                return getattr(np, name)

            @staticmethod
            def clip(value, low, high):
                return min(max(value, low), high)

        bus.np = Fast()
        bus.print = lambda *_, **__: None
        # It would disable its motors when Python ends.
        bus.RobstrideBus.__del__ = lambda _: None
        self.types, self.table = protocol, table
        names = [f"rs-0{number}" for number in range(7)]
        motors = {name: bus.Motor(1, name) for name in names}
        motors |= {f"#{number}": bus.Motor(number, "rs-02") for number in (1, 2, 55, 127)}
        self.bus = bus.RobstrideBus("judges", motors)
        self.bus.channel_handler = self
        self.sent, self.queue = [], []
        self.respond = lambda identifier, data: []

    # The bus, as python-can has it.
    def send(self, message):
        frame = message.arbitration_id, bytes(message.data)
        self.sent.append(frame)
        self.queue += self.respond(*frame)

    def recv(self, timeout=None):
        import can

        if not self.queue:
            return None
        identifier, data = self.queue.pop(0)
        return can.Message(arbitration_id=identifier, data=data, is_extended_id=True)

    def shutdown(self):
        pass

    def ranges(self, model):
        name = f"rs-0{model[-1]}"
        tables = ("POSITION", "VELOCITY", "TORQUE", "KP", "KD")
        return tuple(float(getattr(self.table, f"MODEL_MIT_{kind}_TABLE")[name]) for kind in tables)

    def encode(self, model, values):
        name, self.sent = f"rs-0{model[-1]}", []
        write = self.bus.write_operation_frame
        for p, v, kp, kd, t in values.tolist():
            write(name, p, kp, kd, v, t)
        return np.array([(i, *data) for i, data in self.sent], np.uint32)

    def decode(self, model, frames):
        name, receive = f"rs-0{model[-1]}", self.bus.receive_status_frame
        found = []
        for identifier, data in frames:
            self.queue = [(identifier, data)]
            found.append(receive(name))
        return np.array(found)

    def frames(self, identifier):
        """Each frame that it has: our words for it, and the frame."""
        name = f"#{identifier}"
        self.respond = lambda sent, data: [(FEEDBACK, bytes(8))]
        for words, action in (
            (["enable"], lambda: self.bus.enable(name)),
            (["disable"], lambda: self.bus.disable(name)),
        ):
            self.sent = []
            action()
            yield words, self.sent[0]
        kinds = {np.uint8: int, np.int8: int, np.uint16: int, np.uint32: int, np.float32: float}
        for word in vars(self.types.ParameterType).values():
            if not isinstance(word, tuple) or word[0] < 0x7000:
                continue
            index, kind, _ = word
            answer = struct.pack("<HHI", index, 0, 0)
            self.sent, self.respond = [], lambda sent, data: [(0x1100_01FD, answer)]
            self.bus.read(name, word)
            yield ["read", str(index)], self.sent[0]
            self.sent, self.respond = [], lambda sent, data: [(FEEDBACK, bytes(8))]
            value = 2.5 if kinds[kind] is float else 3
            self.bus.write(name, word, value)
            yield ["write", str(index), str(value)], self.sent[0]

    # The simulated drive

    def start(self, respond):
        self.respond = respond

    def switch(self, verb):
        {"enable": self.bus.enable, "disable": self.bus.disable}[verb]("#1")

    def command(self, values):
        p, v, kp, kd, t = values
        self.bus.write_operation_frame("#1", p, kp, kd, v, t)
        self.bus.receive_status_frame("#1")

    def word(self, index):
        words = vars(self.types.ParameterType).values()
        return next(word for word in words if isinstance(word, tuple) and word[0] == index)

    def write(self, index, kind, value):
        self.bus.write("#1", self.word(index), value)

    def read(self, index, kind):
        return self.bus.read("#1", self.word(index))

    def state(self):
        """Disabling answers with feedback; the drive is enabled again."""
        self.bus.transmit(self.types.CommunicationType.ENABLE, HOST, 1)
        return self.bus.receive_status_frame("#1")[:3]

    def close(self):
        self.respond, self.queue = (lambda identifier, data: []), []


class Motorbridge:
    """motorbridge, in Rust as a shared library, over its CAN socket: `socketcan.c` has the other end."""

    name = "motorbridge"
    models = [f"RS0{number}" for number in range(7)]
    parameters = PARAMETERS
    top = 65_534
    host = HOST
    rule = Rule(False, SINGLE)

    def __init__(self):
        assert os.environ["MOTORBRIDGE_TX_GAP_US"] == "0"
        from motorbridge.abi import CState
        from motorbridge.core import Controller
        from motorbridge.errors import CallError

        self.error, self.new_state = CallError, CState
        self.new_controller, self.opened = Controller, 0
        self.controllers, self.motors, self.ends = {}, {}, {}
        self.respond = None
        self.lock = threading.Lock()

    def motor(self, model, identifier=1):
        """Each motor has a controller and a socket of its own."""
        key = model, identifier
        if key not in self.motors:
            controller = self.new_controller(f"{model}{identifier}")
            name = f"rs-0{model[-1]}"
            self.motors[key] = controller.add_robstride_motor(identifier, HOST, name)
            self.controllers[key] = controller
            self.ends[key] = 200 + self.opened
            os.set_blocking(self.ends[key], False)
            self.opened += 1
        return self.motors[key]

    def receive(self, key):
        frames = []
        with contextlib.suppress(BlockingIOError):
            while True:
                frames.append(os.read(self.ends[key], 16))
        return frames

    def feed(self, key, identifier, data):
        os.write(self.ends[key], struct.pack("<IB3x", identifier | 1 << 31, 8) + data)

    def ranges(self, model):
        """It tells those of feedback by what is at their ends; those of the gains by commands that are at theirs."""
        ends = self.decode(model, [(FEEDBACK, bytes([0xFF] * 6 + [0, 0]))])[0]
        p, v, t = (round(end * 0x7FFF / 0x8000, 4) for end in ends[:3])
        gains = []
        for place, top in ((2, 5000.0), (3, 100.0)):
            values = np.zeros((1, 5), np.float32)
            values[0, place] = top / 20
            frame = self.encode(model, values)[0]
            counts = int(frame[1 + 2 * place]) << 8 | int(frame[2 + 2 * place])
            # Truncated, so a little more; all of them end with a zero or are one digit.
            gains.append(round(top / 20 / (counts / 65_535), -1 if place == 2 else 0))
        return 4 * math.pi if abs(p - 4 * math.pi) < 1e-3 else p, v, t, *gains

    def encode(self, model, values):
        key, send, frames = (model, 1), self.motor(model).send_mit, []
        # A socket holds some hundred.
        for at in range(0, len(values), 50):
            for row in values[at : at + 50].tolist():
                send(*row)
            frames += self.receive(key)
        raw = np.frombuffer(b"".join(frames), np.uint8).reshape(-1, 16)
        ids = raw[:, :4].copy().view("<u4")[:, 0] & 0x1FFF_FFFF
        return np.column_stack([ids, raw[:, 8:]]).astype(np.uint32)

    def decode(self, model, frames):
        motor, key = self.motor(model), (model, 1)
        controller, state, found = self.controllers[key], self.new_state(), []
        read = motor._abi.lib.motor_handle_get_state
        for identifier, data in frames:
            self.feed(key, identifier, data)
            controller.poll_feedback_once()
            # A thread of its own may have the frame in hand.
            for _ in range(5_000):
                require(read(motor._ptr, ctypes.byref(state)) == 0, "no state")
                expected = struct.unpack(">H", data[6:])[0] / 10
                seen = state.arbitration_id == identifier and abs(state.t_mos - expected) < 0.06
                if seen or abs(state.t_mos - expected + 6553.6) < 0.06:
                    break
                time.sleep(0.0002)
            found.append((state.pos, state.vel, state.torq, state.t_mos))
        return np.array(found, np.float64)

    def frames(self, identifier):
        motor, key = self.motor("RS02", identifier), ("RS02", identifier)

        def first(action):
            # It waits for answers that nobody gives, and tries other hosts then.
            with contextlib.suppress(self.error):
                action()
            frame = self.receive(key)[0]
            return struct.unpack_from("<I", frame)[0] & 0x1FFF_FFFF, frame[8:]

        yield ["enable"], first(motor.enable)
        if identifier == 1:
            yield ["disable"], first(motor.disable)
            yield ["clear"], first(motor.clear_error)
            yield ["zero"], first(motor.set_zero_position)
            yield ["store"], first(motor.store_parameters)
        for index, kind, value in PARAMETERS:
            write = getattr(motor, f"robstride_write_param_{kind}")
            yield ["write", str(index), str(value)], first(lambda: write(index, value))
        yield ["read", "28694"], first(lambda: motor.robstride_get_param_f32(0x7016, 5))

    # The simulated drive

    def start(self, respond):
        self.respond = respond
        self.motor("RS02")
        self.is_open = True
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        """It waits for answers, so a thread is the bus."""
        while self.is_open:
            self.flush()
            time.sleep(0.0005)

    def flush(self):
        with self.lock:
            for frame in self.receive(("RS02", 1)):
                identifier = struct.unpack_from("<I", frame)[0] & 0x1FFF_FFFF
                for answer in self.respond(identifier, frame[8:]):
                    self.feed(("RS02", 1), *answer)

    def switch(self, verb):
        motor = self.motor("RS02")
        {
            "enable": motor.enable,
            "disable": motor.disable,
            "clear": motor.clear_error,
            "zero": motor.set_zero_position,
            "store": motor.store_parameters,
        }[verb]()
        self.flush()

    def command(self, values):
        self.motor("RS02").send_mit(*values)
        self.flush()

    def write(self, index, kind, value):
        getattr(self.motor("RS02"), f"robstride_write_param_{kind}")(index, value)
        self.flush()

    def read(self, index, kind):
        return getattr(self.motor("RS02"), f"robstride_get_param_{kind}")(index, 2_000)

    def state(self):
        self.motor("RS02").enable()
        self.flush()
        time.sleep(0.01)
        self.controllers["RS02", 1].poll_feedback_once()
        state = self.motor("RS02").get_state()
        return state.pos, state.vel, state.torq

    def close(self):
        self.is_open = False
        self.thread.join()
        self.receive(("RS02", 1))


MASTERS = {
    judge.name: judge for judge in (RobstrideDynamics, Motorbridge, CyberGearDriver, PythonCyberGear)
}


class Trial:
    """A judge and the program."""

    def __init__(self, judge, path, defect=None, count=1_000_000, seed=1):
        self.judge, self.count, self.is_whole = judge, count, count >= 1_000_000
        self.program = Program(path, defect)
        self.random = np.random.default_rng(seed)
        self.models = {
            name: tuple(map(float, ranges[:5]))
            for name, *ranges in self.program.lines("robstride", "models")
            if name in judge.models
        }
        self.our_rule = Rule(False, SINGLE)
        self.notes = {}

    def note(self, what, count=1):
        self.notes[what] = self.notes.get(what, 0) + int(count)

    def all_ranges(self):
        """Each model with the judge's ranges; that they are not ours has to be known."""
        for model, ours in self.models.items():
            theirs = self.judge.ranges(model)
            is_same = np.allclose(ours, theirs, rtol=1e-6)
            if not is_same:
                known = OTHER_RANGES.get(model)
                require(
                    known and np.allclose(known[1:], theirs[1:], rtol=1e-6),
                    f"{model}: {theirs}, ours are {ours}",
                )
                self.note(RANGES)
            singles = tuple(float(np.float32(end)) for end in theirs)
            # 4 pi is no f32.
            yield model, singles, singles if self.judge.rule.error > 1e-10 else theirs

    def share(self, place):
        """How many of the samples a model gets."""
        number = len(self.models)
        return self.count * (place + 1) // number - self.count * place // number

    def operation(self):
        for place, (model, ranges, exact) in enumerate(self.all_ranges()):
            ours, theirs = fields_of(ranges), fields_of(exact, self.judge.top)
            values = self.values(ours, self.share(place))
            words = [repr(end) for end in ranges]
            data = self.program.run("robstride", "encode", *words, data=values.tobytes())
            raw = np.frombuffer(data, np.uint8).reshape(-1, 12)
            ids = raw[:, :4].copy().view("<u4")[:, 0]
            found = counts_of(np.column_stack([ids, raw[:, 4:]]).astype(np.uint32))
            judged = self.judge.encode(model, values)
            require(judged.shape == (len(values), 9), f"{model}: {judged.shape} frames")
            other = counts_of(judged)
            require((ids & 0x1F00_00FF == 0x0100_0001).all(), "the id of a command")
            require((judged[:, 0] & 0x1F00_00FF == 0x0100_0001).all(), "the id of the judge's")
            for column, (field, their_field) in enumerate(zip(ours, theirs)):
                self.compare(model, field, values[:, column], found[:, column], self.our_rule)
                self.compare(
                    model, their_field, values[:, column], other[:, column], self.judge.rule
                )
                apart = np.abs(found[:, column].astype(int) - other[:, column])
                # Truncated, fields of one count less are at most one count apart; so are two precisions.
                require((apart <= 2).all(), f"{model}: {apart.max()} counts apart")
                is_short = field.lower < 0 and self.judge.top < 65_535
                self.note(SPAN if is_short else GAINS, (apart > 0).sum())
        self.nan()
        self.finish("operation", "operation commands")

    def nan(self):
        """A command with a field that is no number is rest here."""
        words = [repr(end) for end in next(iter(self.models.values()))]
        for place in range(5):
            values = np.ones((1, 5), np.float32)
            values[0, place] = np.nan
            data = self.program.run("robstride", "encode", *words, data=values.tobytes())
            rest = struct.pack("<I", 0x017F_FF01) + bytes.fromhex("7fff7fff00000000")
            planted = self.program.plant
            require(data == rest or planted, f"NaN is {data.hex()}")
        if self.judge.name == "motorbridge" and not self.program.plant:
            # The lower end of the position, pulled to with the gains of the command.
            frame = self.judge.encode("RS02", np.array([[np.nan, 1, 1, 1, 1]], np.float32))[0]
            require(not frame[1:3].any() and frame[5:9].any(), f"NaN is {frame} to motorbridge")

    def finish(self, part, what):
        """Looks whether the differences are those that are explained; a short run does not see all of them."""
        seen = {note for note, times in self.notes.items() if times}
        explained = EXPLAINED[self.judge.name, part]
        require(seen <= explained, f"not explained: {seen - explained}")
        require(not self.is_whole or seen == explained, f"no longer there: {explained - seen}")
        self.note(what, self.count)

    def values(self, fields, count):
        """Commands inside, at and outside the ranges, and at the boundaries between counts."""
        random, columns = self.random, []
        for field in fields:
            span = field.upper - field.lower
            value = field.lower + span * (1.2 * random.random(count) - 0.1)
            boundary = field.lower + random.integers(0, field.top + 1, count) * span / field.top
            step = random.integers(-1, 2, count).astype(np.float32)
            boundary = boundary.astype(np.float32)
            near = np.where(step == 0, boundary, np.nextafter(boundary, np.float32(3e38) * step))
            kind = random.integers(0, 100, count)
            value = np.where(kind < 5, near, value)
            ends = np.array([field.lower, field.upper, 0.0, -0.0, 1e-30, -1e-30, 1e9, -1e9])
            value = np.where(kind >= 95, ends[random.integers(0, len(ends), count)], value)
            columns.append(value.astype(np.float32))
        return np.ascontiguousarray(np.column_stack(columns), np.float32)

    def compare(self, model, field, values, counts, rule):
        """Each count is right, or proved to be so near to a boundary that the precision reaches over it."""
        at_end = (values >= field.upper) & (counts == field.top) | (values <= field.lower) & (counts == 0)
        for place in np.flatnonzero(~rule.are_surely_right(field, values, counts) & ~at_end):
            value, count = float(values[place]), int(counts[place])
            require(
                rule.is_right(field, value, count) or self.is_sum(field, value, count, rule),
                f"{model}: {value!r} of {field.lower}..{field.upper} is {count}",
            )
            self.note(PROVED)

    @staticmethod
    def is_sum(field, value, count, rule):
        """The judges divide by the range and add 1: near the lower end the sum loses what the quotient had."""
        exact = field.exact(value)
        unit = float(rule.error) / 3
        return abs(float(exact) - round(float(exact))) <= 3 * unit * field.top and abs(
            count - float(exact)
        ) <= 1 + 3 * unit * field.top

    def feedback(self):
        count = self.count
        models = list(self.all_ranges())
        for place, (model, ranges, _) in enumerate(models):
            number = count * (place + 1) // len(models) - count * place // len(models)
            data = self.random.integers(0, 256, (number, 8), np.uint8)
            states = self.random.integers(0, 256, number)
            ids = (0x0200_0000 | states << 16 | 1 << 8 | HOST).astype("<u4")
            frames = np.column_stack([ids.view(np.uint8).reshape(-1, 4), data])
            words = [repr(end) for end in ranges]
            answer = self.program.run("robstride", "decode", *words, data=frames.tobytes())
            raw = np.frombuffer(answer, np.uint8).reshape(-1, 20)
            ours = raw[:, :16].copy().view("<f4").astype(np.float64)
            status, faults, motor = raw[:, 16], raw[:, 17], raw[:, 18]
            refused = states >> 6 == 3
            require(((status == 255) == refused).all(), "which frames are refused")
            self.note(STATE, refused.sum())
            kept = ~refused
            require((status[kept] == (states >> 6)[kept]).all(), "the state")
            require((faults[kept] == (states & 0x3F)[kept]).all(), "the faults")
            require((motor[kept] == 1).all(), "the id")
            rows = [(int(i), bytes(d)) for i, d in zip(ids, data)]
            theirs = self.judge.decode(model, rows)
            counts = data[:, :6].astype(int)
            counts = counts[:, ::2] << 8 | counts[:, 1::2]
            for column, end in enumerate(ranges[:3]):
                # A count of theirs is a 65534th of the range, of ours a 65535th.
                apart = end * counts[:, column] * (65_535 - self.judge.top) / (32_767 * 65_535)
                error = np.abs(theirs[:, column] - ours[:, column] - apart)[kept]
                require((error <= 6e-7 * end).all(), f"{model}: {error.max()} of {end}")
            self.note(SPAN, 3 * kept.sum() * (65_535 - self.judge.top))
            cold = data[:, 6] >= 0x80
            shift = np.where(cold & (theirs[:, 3] > 3_276.7), 6_553.6, 0.0)
            error = np.abs(theirs[:, 3] - shift - ours[:, 3])[kept]
            require((error < 1e-3).all(), f"temperature: {error.max()}")
            self.note(COLD, (shift[kept] > 0).sum())
        self.finish("feedback", "feedback frames")

    def frames(self):
        table = {int(index) for index, *_ in self.program.lines("robstride", "registers")}
        with self.program.serve("robstride") as wire:
            for identifier in (1, 2, 55, 127):
                for words, frame in self.judge.frames(identifier):
                    if words[0] in ("read", "write"):
                        require(int(words[1]) in table, f"no parameter {words[1]}")
                    line = f"frame {self.judge.host} {identifier} {' '.join(words)}"
                    ours = wire.frames(line)
                    require(ours == [frame], f"{line}: {ours}, judge {frame}")
                    self.note("frames that switch, read or write")

    def drive(self):
        """The judge drives the simulated drive."""
        ranges = self.judge.ranges("RS02")  # those of a CyberGear, where the judge has no other
        p, v, t, most_kp, most_kd = ranges
        with self.program.serve("robstride") as wire:
            for drive in (1, 2):
                wire.ask(f"drive {drive} {' '.join(str(np.float32(end)) for end in ranges)}")
            self.judge.start(wire.hear)
            try:
                self.parameters(wire)
                self.judge.switch("enable")
                require(shaft(wire)[3] == 1, "not enabled")
                for _ in range(60):
                    angle, velocity, *_ = shaft(wire)
                    position, speed = (float(x) for x in self.random.uniform(-0.5, 0.5, 2) * (p, v))
                    kp, kd = (float(x) for x in self.random.uniform(0, 1, 2) * (20, 2))
                    torque = float(self.random.uniform(-t, t)) / 2
                    self.judge.command([position, speed, kp, kd, torque])
                    wire.ask("step 1e-4")
                    expected = kp * (position - angle) + kd * (speed - velocity) + torque
                    expected = min(max(expected, -t), t)
                    found = shaft(wire)[2]
                    # Two counts of each field, one truncated and one less in its span, times what it is multiplied by.
                    apart = 4 * (kp * p + kd * v + t) / 65_534 + 1e-3
                    apart += (abs(position - angle) * most_kp + abs(speed - velocity) * most_kd) / 65_535
                    require(abs(found - expected) < apart, f"{found} Nm, expected {expected}")
                    self.judge.command([0.0, 0.0, 10.0, 1.0, 0.0])
                    wire.ask("step 0.05")
                    self.state(wire, p, v, t)
                    self.note("commands that the simulated drive follows")
                self.judge.switch("disable")
                wire.ask("step 0.01")
                require(shaft(wire)[2:4] == [0.0, 0.0], "the drive is disabled")
                if self.judge.parameters == PARAMETERS:
                    self.times_out(wire)
                require(shaft(wire, 2)[:4] == [0.0, 0.0, 0.0, 0.0], "the other drive")
            except (RuntimeError, AssertionError) as error:
                raise Difference(f"{error!r}") from error
            finally:
                self.judge.close()

    def times_out(self, wire):
        """A CyberGear has no time-out."""
        self.judge.write(0x7028, "u32", 2_000)
        self.judge.switch("enable")
        wire.ask("step 0.09")
        require(shaft(wire)[3] == 1, "90 ms after the last command")
        wire.ask("step 0.02")
        require(shaft(wire)[3] == 0, "110 ms after the last command")

    def parameters(self, wire):
        for index, kind, value in self.judge.parameters:
            self.judge.write(index, kind, value)
            found = self.judge.read(index, kind)
            require(found == value, f"parameter {index:X}: {found}, written {value}")
            self.note("parameters of the simulated drive written and read")
        wire.ask("supply 1")
        require(self.judge.read(0x7005, "i8") == 0, "the run mode is lost with the supply")

    def state(self, wire, *ends):
        attempts = 50
        for attempt in range(attempts):
            found = self.judge.state()
            pairs = zip(found, shaft(wire), ends)
            if all(abs(value - real) <= 2.1 * end / 32_767 for value, real, end in pairs):
                self.note("answers of the simulated drive read")
                return
        raise Difference(f"feedback {found}, the shaft {shaft(wire)}")


def counts_of(frames):
    """Position, velocity, kp, kd and torque of frames: an id and eight bytes."""
    pairs = frames[:, 1::2] << 8 | frames[:, 2::2]
    return np.column_stack([pairs, frames[:, 0] >> 8 & 0xFFFF]).astype(np.int64)


def shaft(wire, drive=1):
    return [float(word) for word in wire.ask(f"shaft {drive}")]


def run(judge, path, parts, count, seed):
    started, name, judge = time.process_time(), judge, MASTERS[judge]()
    for part in parts:
        for defect in DEFECTS[part]:
            trial = Trial(judge, path, defect, min(count, 2_000), seed)
            try:
                getattr(trial, part)()
            except Difference:
                continue
            raise Difference(f"{part}: the planted defect {defect} is not found")
        trial = Trial(judge, path, None, count, seed)
        getattr(trial, part)()
        told = ", ".join(f"{times} {what}" for what, times in sorted(trial.notes.items()))
        print(f"{name}: {part}: {told}; found {', '.join(DEFECTS[part])}")
    print(f"{name}: {time.process_time() - started:.1f} s of processor")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge", choices=MASTERS)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    options = parser.parse_args()
    parts = [part for part in DEFECTS if options.only in (None, part)]
    if not parts:
        return
    try:
        run(options.judge, options.program, parts, options.count, options.seed)
    except Difference as difference:
        print(f"{options.judge}: {difference}")
        sys.stdout.flush()
        os._exit(1)
    sys.stdout.flush()
    # Threads of motorbridge would go on.
    os._exit(0)


if __name__ == "__main__":
    main()
