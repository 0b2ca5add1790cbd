"""Compares the family `odrive` with judges: see README.md."""

import argparse
import importlib.util
import pathlib
import struct
import sys
import time
from fractions import Fraction

import numpy as np

from program import Conversation, Program

# Kind, and the message of the DBC with its signals, `None` for one that has none; then how many of the words are floats.
COMMANDS = [
    ("Estop", []),
    ("Set_Axis_State", ["Axis_Requested_State"]),
    ("Set_Controller_Mode", ["Control_Mode", "Input_Mode"]),
    ("Set_Input_Pos", ["Input_Pos", "Vel_FF", "Torque_FF"]),
    ("Set_Input_Vel", ["Input_Vel", "Input_Torque_FF"]),
    ("Set_Input_Torque", ["Input_Torque"]),
    ("Set_Limits", ["Velocity_Limit", "Current_Limit"]),
    ("Set_Traj_Vel_Limit", ["Traj_Vel_Limit"]),
    ("Set_Traj_Accel_Limits", ["Traj_Accel_Limit", "Traj_Decel_Limit"]),
    ("Clear_Errors", []),
]
STATE, MODE, POSITION = 1, 2, 3

DEFECTS = {
    "encode": ["halves", "truncated", "node"],
    "decode": ["halves", "firmware"],
    "session": ["rest"],
    "drive": ["drive", "ear"],
}

SHORT = "commands that the DBC fills up with zeros"
HALF = "with thousandths at half a count"
REFUSED = "feedback that is not finite, refused by us"
UNKNOWN = "heartbeats with bits that 0.5 never sets, refused by us"
CLIPPED = "with thousandths beyond 16 bits, which saturate here"
CLEAR = "clears with the byte of 0.6"
# The differences that README.md explains: all of them have to be seen.
EXPLAINED = {
    ("odrive-can 0.5.6", "encode"): {SHORT, HALF, CLIPPED, CLEAR},
    ("odrive-can 0.6.10", "encode"): {SHORT, HALF, CLIPPED},
    ("pyodrivecan", "encode"): {HALF, CLIPPED},
    ("odrive-can 0.5.6", "decode"): {REFUSED, UNKNOWN},
    ("odrive-can 0.6.10", "decode"): {REFUSED},
    ("pyodrivecan", "decode"): {REFUSED},
}


class Difference(Exception):
    pass


def require(holds, what):
    if not holds:
        raise Difference(what)


class Dbc:
    """The DBC of a firmware from odrive-can, read by cantools."""

    def __init__(self, digit, version):
        import cantools

        folder = importlib.util.find_spec("odrive_can").submodule_search_locations[0]
        path = pathlib.Path(folder) / "dbc" / f"odrive-cansimple-{version}.dbc"
        self.name, self.digit = f"odrive-can {version}", digit
        self.database = cantools.database.load_file(str(path))
        self.messages = {m.frame_id: m for m in self.database.messages}
        self.by_name = {m.name.partition("_")[::2]: m for m in self.database.messages}
        self.nodes = 8
        self.kinds = [k for k in range(10) if ("Axis0", COMMANDS[k][0]) in self.by_name]

    def encode(self, kind, node, values):
        name, signals = COMMANDS[kind]
        message = self.by_name[f"Axis{node}", name]
        fields = dict(zip(signals, values))
        if name == "Clear_Errors" and message.length:
            fields = {"Identify": 0}
        return message.frame_id, message.encode(fields, strict=False)

    def estimates(self, data):
        read = self.messages[9].decode(data)
        return read["Pos_Estimate"], read["Vel_Estimate"]

    def heartbeat(self, data):
        """Axis error, state, three errors, procedure result, done."""
        read = self.messages[1].decode(data, decode_choices=False)
        errors = [read.get(f"{part}_Error_Flag", 0) for part in ("Motor", "Encoder", "Controller")]
        return (
            read["Axis_Error"],
            read["Axis_State"],
            *errors,
            read.get("Procedure_Result", 0),
            read["Trajectory_Done_Flag"],
        )

    def read(self, identifier, data):
        message = self.messages[identifier]
        return message.name.partition("_")[2], message.decode(data.ljust(message.length, b"\0"), decode_choices=False)


class Bus:
    """In place of the bus of python-can."""

    def __init__(self):
        self.sent = []
        self.hear = self.sent.append
        self.come = lambda timeout: None

    def send(self, message, timeout=None):
        self.hear(message)

    def recv(self, timeout=None):
        return self.come(timeout)


class Master:
    """pyodrivecan: its methods, with an object in place of its bus."""

    name, digit, nodes = "pyodrivecan", 6, 63
    kinds = [0, 2, 3, 4, 5, 6, 7, 8, 9]
    modes = ["voltage_control", "torque_control", "velocity_control", "position_control"]
    inputs = ["inactive", "pass_through", "vel_ramp", "pos_filter", "mix_channels", "trap_traj"]

    def __init__(self):
        import pyodrivecan.pyodrivecan as module

        # It tells a person what it does.
        module.print = lambda *_: None
        self.axis = module.ODriveCAN.__new__(module.ODriveCAN)
        self.axis.nodeID, self.axis.canBus = 0, Bus()

    def encode(self, kind, node, values):
        axis = self.axis
        axis.nodeID = node
        axis.canBus.sent.clear()
        if kind == MODE:
            axis.set_controller_mode(self.modes[values[0]], self.inputs[values[1]])
        elif kind == POSITION:
            axis.set_position(values[0], *(round(value * 1000) for value in values[1:]))
        else:
            verbs = {
                0: axis.estop,
                4: axis.set_velocity,
                5: axis.set_torque,
                6: axis.set_limits,
                7: axis.set_traj_vel_limit,
                8: axis.set_traj_accel_limits,
                9: lambda: axis.clear_errors(identify=False),
            }
            verbs[kind](*values)
        require(len(axis.canBus.sent) == 1, f"{self.name} sends {axis.canBus.sent} for {COMMANDS[kind][0]}")
        message = axis.canBus.sent[0]
        return message.arbitration_id, bytes(message.data)

    class Message:
        arbitration_id, data = 9, b""

    def estimates(self, data):
        self.axis.nodeID, self.Message.data = 0, data
        self.axis.process_can_message(self.Message)
        return self.axis.position, self.axis.velocity

    heartbeat = None


class Trial:
    def __init__(self, judge, path, defect=None, count=1_000_000, seed=1):
        self.judge, self.path, self.defect, self.count = judge, path, defect, count
        self.program = Program(path, defect)
        self.random = np.random.default_rng(seed)
        self.notes = {}

    def note(self, what, count=1):
        self.notes[what] = self.notes.get(what, 0) + int(count)

    # Commands

    def commands(self):
        random, count, judge = self.random, self.count, self.judge
        kinds = random.choice(judge.kinds, count)
        nodes = random.integers(0, judge.nodes, count)
        floats = random.normal(0, 20, (count, 3)).astype(np.float32)
        # One in four has any bits but those of NaN, one in ten lies at half a thousandth.
        any_bits = random.integers(0, 2**32, (count, 3), np.uint32).view(np.float32)
        any_bits[np.isnan(any_bits)] = 0
        floats = np.where(random.integers(0, 4, (count, 1)) == 0, any_bits, floats)
        halves = ((random.integers(-40_000, 40_000, (count, 3)) + 0.5) / 1000).astype(np.float32)
        floats = np.where(random.integers(0, 10, (count, 1)) == 0, halves, floats)
        words = floats.view(np.uint32).copy()
        whole = random.integers(0, 2**32, (count, 3), np.uint32)
        whole[:, 0] = np.where(kinds == MODE, random.integers(0, 4, count), whole[:, 0])
        whole[:, 1] = np.where(kinds == MODE, random.integers(0, 6, count), whole[:, 1])
        is_whole = np.isin(kinds, (STATE, MODE))[:, None]
        words = np.where(is_whole, whole, words)
        kind = np.dtype([("kind", "u1"), ("node", "u1"), ("pad", "<u2"), ("words", "<u4", 3)])
        data = np.zeros(count, kind)
        data["kind"], data["node"], data["words"] = kinds, nodes, words
        return kinds.tolist(), nodes.tolist(), whole.tolist(), floats.astype(np.float64).tolist(), data.tobytes()

    def encode(self):
        kinds, nodes, whole, floats, data = self.commands()
        frames = self.program.run("odrive", "encode", data=data)
        judge, notes = self.judge, [0, 0, 0]
        for place, (kind, node) in enumerate(zip(kinds, nodes)):
            width = len(COMMANDS[kind][1])
            values = (whole if kind in (STATE, MODE) else floats)[place][:width]
            given = values
            if kind == POSITION:
                given = [values[0], *(min(max(value, -32.768), 32.767) for value in values[1:])]
                notes[0] += given != values
            identifier, theirs = judge.encode(kind, node, given)
            own, length = struct.unpack_from("<IB", frames, 16 * place)
            ours = frames[16 * place + 8 : 16 * place + 8 + length]
            what = f"{COMMANDS[kind][0]} {values} of {node} is {own:X} {ours.hex()}, with {judge.name} {identifier:X} {theirs.hex()}"
            require(own == identifier, what)
            if ours == theirs:
                continue
            if len(ours) < len(theirs) and ours + bytes(len(theirs) - len(ours)) == theirs:
                notes[1] += 1
                continue
            # The same length, or a clear without the byte that the DBC of 0.5 does not have.
            if kind == 9 and theirs == b"" and ours == b"\0":
                self.note(CLEAR)
                continue
            require(kind == POSITION and ours[:4] == theirs[:4] and len(ours) == len(theirs), what)
            for value, mine, other in zip(given[1:], struct.unpack("<hh", ours[4:]), struct.unpack("<hh", theirs[4:])):
                exact = Fraction(value) * 1000
                slack = Fraction(1, 2) + abs(exact) * Fraction(1, 2**23) + Fraction(1, 2**23)
                require(max(abs(mine - exact), abs(other - exact)) <= slack, what)
            notes[2] += 1
        for text, count in zip((CLIPPED, SHORT, HALF), notes):
            self.note(text, count)
        self.nan()
        self.note("commands", self.count)

    def nan(self):
        """A position with NaN beside it: zero there."""
        data = struct.pack("<BBHfff", POSITION, 1, 0, 1.0, float("nan"), float("nan"))
        frame = self.program.run("odrive", "encode", data=data)
        require(self.defect or frame[12:] == bytes(4), f"NaN is {frame.hex()}")

    # Feedback

    def decode(self):
        judge, count = self.judge, self.count
        is_heartbeat = self.random.integers(0, 2, count) == 1
        if judge.heartbeat is None:
            is_heartbeat[:] = False
        data = self.random.integers(0, 256, (count, 8), np.uint8)
        # Nineteen of twenty heartbeats of 0.5 have bits that it sets.
        if judge.digit == 5:
            keep = is_heartbeat & (self.random.integers(0, 20, count) > 0)
            data[keep] &= np.array([255] * 5 + [1, 1, 0x81], np.uint8)
        frames = np.zeros((count, 12), np.uint8)
        frames[:, 0] = np.where(is_heartbeat, 1, 9)
        frames[:, 1] = judge.digit
        frames[:, 4:] = data
        read = self.program.run("odrive", "decode", data=frames.tobytes())
        refused = [0, 0]
        for place, beats in enumerate(is_heartbeat.tolist()):
            raw = data[place].tobytes()
            row = read[16 * place : 16 * place + 16]
            if beats:
                error, state, a, b, c, taken, result, done = struct.unpack_from("<IBBBBBBB", row)
                theirs = judge.heartbeat(raw)
                is_known = judge.digit == 6 or raw[5] < 2 and raw[6] < 2 and not raw[7] & 0x7E
                refused[0] += not is_known
                what = f"heartbeat {raw.hex()} reads {row.hex()}, with {judge.name} {theirs}"
                require(taken == is_known, what)
                require(not taken or (error, state, a, b, c, result, done) == theirs, what)
            else:
                turns, velocity, taken = struct.unpack_from("<ffB", row)
                theirs = judge.estimates(raw)
                is_known = all(abs(value) < float("inf") for value in theirs)
                refused[1] += not is_known
                what = f"estimates {raw.hex()} read {turns} {velocity}, with {judge.name} {theirs}"
                require(taken == is_known and (not taken or (turns, velocity) == theirs), what)
        self.note(UNKNOWN, refused[0])
        self.note(REFUSED, refused[1])
        self.note("frames of feedback", count)

    # What the motor sends, read by the DBC

    def session(self):
        if not isinstance(self.judge, Dbc):
            return
        with Conversation([self.path, "odrive", "serve", *self.program.plant]) as ours:
            for mode in ("torque", "impedance", "velocity", "position"):
                for end in ("disarm", "stop", "target", "feedback"):
                    words = ours.ask(f"session {mode} {self.judge.digit} {end}")
                    bar = words.index("|")
                    self.driven(mode, frames_of(words[:bar]))
                    self.rests(mode, end, frames_of(words[bar + 1 :]))

    def driven(self, mode, frames):
        reads = [self.judge.read(i, data) for i, length, data in frames if length != "R"]
        states = [read["Axis_Requested_State"] for name, read in reads if name == "Set_Axis_State"]
        require(states.count(8) == 1, f"{mode}: requests {states}")
        request = next(p for p, (_, read) in enumerate(reads) if read.get("Axis_Requested_State") == 8)
        before = {name for name, _ in reads[:request]}
        require({"Set_Controller_Mode", "Set_Limits"} <= before, f"{mode}: {before}")
        number = {"torque": 1, "impedance": 1, "velocity": 2, "position": 3}[mode]
        for name, read in reads:
            if name == "Set_Controller_Mode":
                require(read["Control_Mode"] == number, f"{mode}: {read}")
            if name == "Set_Limits":
                require(0 < read["Current_Limit"] <= 2.0 / (8.27 / 150) * 1.000001, f"{mode}: {read}")
            if name == "Set_Input_Torque":
                require(abs(read["Input_Torque"]) <= 2.0, f"{mode}: {read}")
        self.note("frames of driven motors read", len(reads))

    def rests(self, mode, end, frames):
        for identifier, length, data in frames:
            if length == "R":
                continue
            name, read = self.judge.read(identifier, data)
            is_rest = read.get("Axis_Requested_State") == 1 or read.get("Input_Torque") == 0
            require(is_rest and name in ("Set_Axis_State", "Set_Input_Torque"), f"{mode}, {end}: {name} {read}")
            self.note("frames of motors at rest read")

    # The simulated axis

    def drive(self):
        if not isinstance(self.judge, Master):
            return
        axis = self.judge.axis
        axis.canBus, axis.nodeID = Bus(), 5
        for digit in (5, 6):
            with Conversation([self.path, "odrive", "serve", *self.program.plant]) as ours:
                ours.ask(f"drive 5 {digit}")
                self.behave(axis, ours, digit)

    def behave(self, axis, ours, digit):
        waiting = []

        def keep(words):
            for identifier, _, data in frames_of(words):
                message = Master.Message()
                message.arbitration_id, message.data = identifier, data
                waiting.append(message)
                axis.process_can_message(message) if identifier & 0x1F == 9 else None

        def hear(message):
            data = bytes(message.data)
            keep(ours.ask(f"hear {message.arbitration_id:X} {len(data)} {data.ljust(8, bytes(1)).hex()}"))

        def come(timeout):
            # No time passes while it empties its queue.
            if timeout:
                keep(ours.ask("step 0.1"))
            return waiting.pop(0) if waiting else None

        def near(found, expected, what, tolerance=0.02):
            require(abs(found - expected) <= tolerance, f"{what} is {found}, not {expected}")

        def shaft():
            return [float(word) for word in ours.ask("shaft")]

        def wait(seconds):
            keep(ours.ask(f"step {seconds}"))
            waiting.clear()

        axis.canBus.hear, axis.canBus.come = hear, come
        axis.clear_errors(identify=False)
        axis.set_limits(10.0, 20.0)
        axis.set_controller_mode("velocity_control", "pass_through")
        axis.setAxisState("closed_loop_control")
        near(shaft()[3], 8, "the state")
        axis.set_velocity(3.0)
        wait(1.0)
        near(shaft()[1], 3.0, "the velocity", 0.1)
        near(axis.velocity, shaft()[1], "the estimate of it")
        near(axis.position, shaft()[0], "the estimate of the position", 0.05)
        axis.setAxisState("idle")
        wait(0.01)
        near(shaft()[2], 0.0, "the torque at rest", 0.0)
        for name in ("pass_through", "pos_filter", "trap_traj"):
            axis.set_controller_mode("position_control", name)
            axis.set_traj_vel_limit(5.0)
            axis.set_traj_accel_limits(10.0, 10.0)
            axis.setAxisState("closed_loop_control")
            goal = round(shaft()[0]) + 1.0
            axis.set_position(goal)
            wait(3.0)
            near(shaft()[0], goal, f"the position by {name}")
        axis.setAxisState("idle")
        axis.set_controller_mode("torque_control", "pass_through")
        axis.setAxisState("closed_loop_control")
        axis.set_torque(0.2)
        wait(0.001)
        near(shaft()[2], 0.2, "the torque", 1e-6)
        axis.set_limits(10.0, 2.0)
        wait(0.001)
        near(shaft()[2], 0.1, "the torque at the current limit", 1e-6)
        axis.estop()
        wait(0.001)
        near(shaft()[2], 0.0, "the torque after a stop", 0.0)
        near(shaft()[4], {5: 0x4000, 6: 0x0200_0000}[digit], "the error", 0)
        axis.clear_errors(identify=False)
        near(shaft()[4], 0, "the error", 0)
        self.note("simulated axes driven")


def frames_of(words):
    """Triples of an id, a length and the data."""
    triples = zip(words[::3], words[1::3], words[2::3])
    return [(int(i, 16), n, bytes.fromhex(d)[: 8 if n == "R" else int(n)]) for i, n, d in triples]


JUDGES = {
    "odrive-can-0.5": lambda: Dbc(5, "0.5.6"),
    "odrive-can-0.6": lambda: Dbc(6, "0.6.10"),
    "pyodrivecan": Master,
}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge", choices=JUDGES)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    arguments = parser.parse_args()
    judge = JUDGES[arguments.judge]()
    for part, defects in DEFECTS.items():
        is_dbc = isinstance(judge, Dbc)
        if arguments.only not in (None, part) or part == ("drive" if is_dbc else "session"):
            continue
        begin = time.monotonic()
        for defect in defects:
            # It has no heartbeats, and takes thousandths as whole numbers that are rounded before it.
            if defect == "firmware" and not is_dbc:
                continue
            trial = Trial(judge, arguments.program, defect, 5_000, arguments.seed)
            try:
                getattr(trial, part)()
            except Difference as found:
                print(f"{judge.name}, {part}: finds the planted defect {defect}: {found}")
            else:
                sys.exit(f"{judge.name}, {part}: does not find the planted defect {defect}")
        trial = Trial(judge, arguments.program, None, arguments.count, arguments.seed)
        try:
            getattr(trial, part)()
        except Difference as found:
            sys.exit(f"{judge.name}, {part}: {found}")
        seen = {what for what, count in trial.notes.items() if count}
        if missing := EXPLAINED.get((judge.name, part), set()) - seen:
            sys.exit(f"{judge.name}, {part}: no longer there, see README.md: {missing}")
        for what, count in trial.notes.items():
            if count:
                print(f"{judge.name}, {part}: {count} {what}")
        print(f"{judge.name}, {part}: as expected ({time.monotonic() - begin:.1f} s)")


if __name__ == "__main__":
    main()
