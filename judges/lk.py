"""Compares the family `lk` with judges: see README.md."""

import argparse
import sys
import time

import numpy as np

from program import Conversation, Program

SWITCHES = {"off": 0x80, "run": 0x88, "angle": 0x92, "state": 0x9A, "clear": 0x9B, "feedback": 0x9C}
TORQUE, VELOCITY, POSITION = 0xA1, 0xA2, 0xA4
NOTHING, FEEDBACK, STATE, ANGLE = range(4)
FOUND = np.dtype([("kind", "u1"), ("pad", "u1", 3), ("values", "<i2", 4), ("rest", "u1", 4)])
COUNT = 33 / 4096 * 0.32

DEFECTS = {
    "encode": ["nibbles", "scale"],
    "decode": ["nibbles"],
    "frames": ["id"],
    "drive": ["ear", "drive"],
}

# The differences that README.md explains, by their notes: all of them, and no other, have to be seen.
UNSIGNED = "values without a sign that the judge should read with one"
QUESTION = "states without a voltage, refused by us"
SATURATED = "currents beyond 2048, sent by us as the end of the range"
EXPLAINED = {
    ("pylkmotor", "encode"): {SATURATED},
    ("pylkmotor", "decode"): {QUESTION},
    ("nekormd", "encode"): set(),
    ("nekormd", "decode"): {UNSIGNED, QUESTION},
}


class Difference(Exception):
    """A difference that nothing explains."""


def require(condition, what):
    if not condition:
        raise Difference(what)


class Frame:
    """What a judge reads of a message."""

    def __init__(self, data, identifier=0x141):
        self.arbitration_id, self.data, self.timestamp = identifier, data, 0.0


class Bus:
    """Takes what a judge sends, and answers by a function."""

    def __init__(self, address=0x141):
        self.address, self.sent, self.answer = address, [], None
        self.respond = None

    def send(self, message):
        self.put(message.arbitration_id, bytes(message.data))

    def put(self, identifier, data):
        self.sent.append((identifier, data))
        if self.respond:
            self.answer = self.respond(identifier, data)

    def recv(self, _timeout=None):
        return self.answer

    def send_cmd(self, data, _delay):
        """NekoRMD's own bus waits for a fixed time and opens a socket: this stands in for it."""
        self.put(self.address, bytes(data))
        return self.answer

    def drain(self):
        sent, self.sent = self.sent, []
        return sent


class PyLkMotor:
    """pylkmotor: LK-TECH in Python. Its bus is an object in place of that of python-can."""

    name = "pylkmotor"
    codes = [TORQUE, VELOCITY, POSITION]
    feedback = [0x9C, *range(0xA1, 0xA9)]

    def __init__(self):
        from pylkmotor.LKMotor import LKMotor

        self.bus = Bus()
        self.motor = LKMotor.__new__(LKMotor)
        self.motor.motor_id, self.motor.bus = 1, self.bus
        self.switch = {
            "off": self.motor.motor_shutdown,
            "run": self.motor.motor_run,
            "angle": self.motor.read_multi_turn_angle,
            "state": self.motor.read_motor_status_1,
            "clear": self.motor.clear_error_flags,
            "feedback": self.motor.read_motor_status_2,
        }

    def address(self, identifier):
        self.motor.motor_id = identifier

    def command(self, code, limit, value):
        if code == TORQUE:
            self.motor.torque_loop_control(value)
        elif code == VELOCITY:
            self.motor.speed_loop_control(limit, value)
        else:
            self.motor.multi_turn_position_control(value, limit)

    def read_feedback(self, data):
        return self.motor._parse_response_2(data)

    def read_state(self, data):
        temperature, volts, amperes, state, errors = self.motor._parse_response_1(data)
        return temperature, round(volts * 100), round(amperes * 100), state, errors

    def read_angle(self, data):
        return self.motor._byte_to_decimal(data[1:8])


class NekoRmd:
    """NekoRMD: MyActuator's RMD with the older protocol, which is LK's. Its bus is an object in place of its `I_CAN`."""

    name = "nekormd"
    codes = [VELOCITY, POSITION]
    feedback = [VELOCITY]

    def __init__(self):
        from NekoRMD.Control import Control
        from NekoRMD.MotorType import MotorType
        from NekoRMD.Telemetry import Telemetry

        self.bus = Bus()
        kind = next(iter(MotorType))
        self.control = Control(kind, self.bus, 0x141)
        self.telemetry = Telemetry(kind, self.bus, 0x141)
        self.switch = {"state": self.telemetry.read_system_errors}

    def address(self, identifier):
        self.bus.address = 0x140 + identifier

    def command(self, code, limit, value):
        self.bus.answer = Frame(bytes([code, 0, 0, 0, 0, 0, 0, 0]))
        if code == VELOCITY:
            # It divides by 0.01 and truncates: the middle between two counts is none of them.
            self.control.speed.set_speed((value + (0.5 if value >= 0 else -0.5)) * 0.01)
        else:
            self.control.position.set_absolute_position(limit, value)

    def read_feedback(self, data):
        self.bus.answer = Frame(data)
        found = self.telemetry.read_motor_temperature_and_torque()
        return found["Temp"], found["Iq"], found["Speed"], found["Angle"]

    def read_state(self, data):
        self.bus.answer = Frame(data)
        return None, self.telemetry.read_system_errors(), None, None, None

    read_angle = None


MASTERS = {judge.name: judge for judge in (PyLkMotor, NekoRmd)}


class Trial:
    explained = EXPLAINED

    def __init__(self, judge, path, defect=None, count=1_000_000, seed=1):
        self.judge, self.count = judge, count
        self.program = Program(path, defect)
        self.random = np.random.default_rng(seed)
        self.notes = {}

    def note(self, what, count=1):
        self.notes[what] = self.notes.get(what, 0) + int(count)

    def finish(self, part, what, count):
        seen = {note for note, times in self.notes.items() if times}
        explained = self.explained[self.judge.name, part]
        require(seen <= explained, f"not explained: {seen - explained}")
        require(self.count < 100_000 or seen == explained, f"no longer there: {explained - seen}")
        self.note(what, count)

    def encode(self):
        count, random, judge = self.count, self.random, self.judge
        rows = np.zeros(count, np.dtype([("code", "u1"), ("pad", "u1"), ("limit", "<u2"), ("value", "<i4")]))
        rows["code"] = random.choice(np.array(judge.codes, np.uint8), count)
        values = random.integers(-(2**31), 2**31, count)
        # As often small as large, and the ends.
        values >>= random.integers(0, 31, count)
        ends = np.array([0, 1, -1, 255, 256, 2**31 - 1, -(2**31)])
        values = np.where(random.integers(0, 20, count) == 0, random.choice(ends, count), values)
        torque = rows["code"] == TORQUE
        rows["value"] = np.where(torque, np.clip(values, -32_768, 32_767), values)
        # pylkmotor reads the current limit of a velocity as a number with a sign, so it gets those of the range.
        rows["limit"] = np.where(torque, 0, random.integers(0, np.where(rows["code"] == VELOCITY, 2049, 65_536)))
        if judge.name == "nekormd":
            # It has no limit in a velocity command.
            rows["limit"] = np.where(rows["code"] == VELOCITY, 0, rows["limit"])
        frames = self.program.run("lk", "encode", data=rows.tobytes())
        judge.bus.drain()
        command = judge.command
        for code, limit, value in zip(rows["code"].tolist(), rows["limit"].tolist(), rows["value"].tolist()):
            if code == TORQUE and abs(value) > 2048:
                self.note(SATURATED)
                value = 2048 if value > 0 else -2048
            command(code, limit, value)
        sent = judge.bus.drain()
        require(len(sent) == count, f"{judge.name} sends {len(sent)} frames")
        require(all(identifier == 0x141 for identifier, _ in sent), "another id")
        expected = b"".join(data for _, data in sent)
        require(len(expected) == len(frames), f"{len(expected)} bytes")
        if expected != frames:
            pairs = np.frombuffer(expected, np.uint8).reshape(-1, 8), np.frombuffer(frames, np.uint8).reshape(-1, 8)
            place = int(np.nonzero((pairs[0] != pairs[1]).any(axis=1))[0][0])
            row, theirs, ours = rows[place], *(pair[place].tobytes().hex() for pair in pairs)
            raise Difference(f"{row} is {ours}, with {judge.name} {theirs}")
        self.finish("encode", "control commands", count)

    def decode(self):
        judge, count = self.judge, self.count
        frames = self.random.integers(0, 256, (count, 8), np.uint8)
        others = [0x9A] + ([0x92, 0x9B] if judge.read_angle else [])
        codes = np.where(
            self.random.integers(0, 4, count) > 0,
            self.random.choice(np.array(judge.feedback, np.uint8), count),
            self.random.choice(np.array(others, np.uint8), count),
        )
        frames[:, 0] = codes
        # A hundredth of the states has no voltage.
        silent = (self.random.integers(0, 100, count) == 0) & (codes == 0x9A)
        frames[silent, 2:4] = 0
        found = np.frombuffer(self.program.run("lk", "decode", data=frames.tobytes()), FOUND)
        require(len(found) == count, f"{len(found)} answers")
        read_feedback, read_state, read_angle = judge.read_feedback, judge.read_state, judge.read_angle
        angles = found["values"].copy().view("<i8")[:, 0].tolist()
        kinds, values = found["kind"].tolist(), found["values"].tolist()
        data = frames.tobytes()
        unsigned = judge.name == "nekormd"
        masks = (0xFF, 0xFFFF, 0xFFFF, 0xFFFF)
        for place, code in enumerate(codes.tolist()):
            frame = data[8 * place : 8 * place + 8]
            mine = values[place]
            if code in SWITCHES.values() and code != 0x9C:
                if code == 0x92:
                    theirs = read_angle(frame)
                    require(kinds[place] == ANGLE and angles[place] == theirs, f"{frame.hex()}: {theirs}")
                    continue
                temperature, volts, amperes, state, errors = read_state(frame)
                if kinds[place] == NOTHING:
                    require(volts == 0, f"{frame.hex()} is refused")
                    self.note(QUESTION)
                    continue
                require(kinds[place] == STATE, f"{frame.hex()} is {kinds[place]}")
                require(mine[1] & 0xFFFF == volts & 0xFFFF, f"{frame.hex()}: {mine}, {volts}")
                if state is not None:
                    ours = mine[0], mine[2], mine[3] & 1, mine[3] >> 8 & 0xFF
                    theirs = temperature, amperes, int(state == 0), errors
                    require(ours == theirs, f"{frame.hex()}: {ours}, with {judge.name} {theirs}")
                continue
            require(kinds[place] == FEEDBACK, f"{frame.hex()} is {kinds[place]}")
            theirs = read_feedback(frame)
            ours = mine[0], mine[1], mine[2], mine[3] & 0xFFFF
            if unsigned:
                self.note(UNSIGNED, min(ours[:3]) < 0)
            else:
                # The encoder has no sign in the manual; it is read with one.
                theirs = *theirs[:3], theirs[3] & 0xFFFF
            if unsigned:
                ours = tuple(value & mask for value, mask in zip(ours, masks))
            require(ours == tuple(theirs), f"{frame.hex()}: {ours}, with {judge.name} {theirs}")
        self.finish("decode", "answers", count)

    def frames(self):
        """The frames that switch and ask, in the course of a motor's life, and those of the judge."""
        judge = self.judge
        with Conversation([self.program.path, "lk", "serve", *self.program.plant]) as wire:
            for identifier in range(1, 33):
                judge.address(identifier)
                judge.bus.answer = Frame(bytes([0x9A, 0, 0, 0, 0, 0, 0, 0]))
                for mode in ("torque", "velocity", "position"):
                    sent = wire.frames(f"session {identifier} {mode}")
                    verbs = ["off", "run", "state", "clear"] + (["angle"] if mode == "position" else [])
                    require(len(sent) == len(verbs), f"{mode} #{identifier}: {sent}")
                    for verb in verbs:
                        if verb not in judge.switch:
                            continue
                        judge.bus.drain()
                        judge.switch[verb]()
                        (theirs,) = judge.bus.drain()
                        require(theirs in sent, f"{verb} of {mode} #{identifier}: {sent}, not {theirs}")
                        self.note("frames that switch or ask")
            judge.address(1)

    def drive(self):
        """The judge drives the simulated drive, and reads what it answers."""
        judge = self.judge
        with Conversation([self.program.path, "lk", "serve", *self.program.plant]) as self.wire:
            judge.bus.respond = self.respond
            try:
                if judge.name == "pylkmotor":
                    self.drive_all(judge.motor)
                else:
                    self.drive_some(judge)
            finally:
                judge.bus.respond = None

    def respond(self, identifier, data):
        answers = self.wire.frames(f"hear {identifier:X} {data.hex()}")
        return Frame(answers[0][1], answers[0][0]) if answers else None

    def shaft(self):
        return [float(word) for word in self.wire.ask("shaft")]

    def near(self, found, expected, apart, what):
        require(abs(found - expected) <= apart, f"{what}: {found}, expected {expected}")
        self.note("values of the simulated drive compared")

    def drive_all(self, motor):
        step = lambda seconds: self.wire.ask(f"step {seconds}")
        for current in self.random.integers(-300, 300, 200).tolist():
            motor.torque_loop_control(current)
            step(0.01)
            _, iq, speed, encoder = motor.read_motor_status_2()
            angle, velocity, torque, _, _ = self.shaft()
            self.near(iq, current, 1, "current")
            self.near(torque, current * COUNT, COUNT / 100, "torque")
            self.near(speed, np.degrees(velocity), 1.001, "velocity")
            turns = np.degrees(angle) / 360
            self.near((encoder & 0xFFFF) / 65_536, turns - np.floor(turns), 2e-4, "encoder")
            self.near(motor.read_multi_turn_angle(), np.degrees(angle) * 100, 2, "angle")
        motor.speed_loop_control(2048, 9_000)
        step(2)
        self.near(np.degrees(self.shaft()[1]), 90, 2, "velocity loop")
        motor.multi_turn_position_control(72_345, 360)
        step(10)
        self.near(np.degrees(self.shaft()[0]), 723.45, 0.1, "position loop")
        motor.motor_shutdown()
        motor.torque_loop_control(500)
        step(0.1)
        self.near(self.shaft()[2], 0, 0, "torque when off")
        self.near(motor.read_motor_status_1()[3], 0x10, 0, "state when off")
        # Off has cleared the turns.
        self.near(motor.read_multi_turn_angle(), 345, 50, "angle when off")
        motor.motor_run()
        step(0.1)
        self.near(self.shaft()[2], 0, 0, "torque when on again")
        self.wire.ask("fail 9")
        state = motor.read_motor_status_1()
        require(state[3:] == (0, 9), f"state {state}")
        self.near(state[1], 24, 0.01, "supply")
        motor.clear_error_flags()
        require(motor.read_motor_status_1()[4] == 0, "errors are not cleared")

    def drive_some(self, judge):
        for target in self.random.integers(-720, 720, 20).tolist():
            judge.control.position.set_absolute_position(360, target * 100)
            self.wire.ask("step 10")
            self.near(np.degrees(self.shaft()[0]), target, 0.1, "position loop")
            answer = judge.control.position.set_absolute_position(360, target * 100)
            require(answer is not None and answer.data[0] == POSITION, "no answer")
            encoder = int.from_bytes(answer.data[6:8], "little") / 65_536
            apart = (encoder - target / 360 + 0.5) % 1 - 0.5
            self.near(apart, 0, 2e-3, "encoder")
        for speed in self.random.integers(-300, 300, 20).tolist():
            judge.control.speed.set_speed(speed)
            self.wire.ask("step 2")
            turning = np.degrees(self.shaft()[1])
            self.near(turning, speed, 4, "velocity loop")
            found = judge.telemetry.read_motor_temperature_and_torque()["Speed"]
            self.near((found + 0x8000) % 0x10000 - 0x8000, turning, 1.001, "velocity")
        self.near(judge.telemetry.read_system_errors(), 2_400, 0, "supply")


def main(masters, trials):
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge", choices=masters)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    arguments = parser.parse_args()
    judge = masters[arguments.judge]()
    for part, defects in DEFECTS.items():
        if arguments.only not in (None, part):
            continue
        begin = time.monotonic()
        for defect in defects:
            trial = trials(judge, arguments.program, defect, count=20_000, seed=arguments.seed)
            try:
                getattr(trial, part)()
            except Difference as found:
                print(f"{judge.name}, {part}: finds the planted defect {defect}: {found}")
            else:
                sys.exit(f"{judge.name}, {part}: does not find the planted defect {defect}")
        trial = trials(judge, arguments.program, count=arguments.count, seed=arguments.seed)
        try:
            getattr(trial, part)()
        except Difference as found:
            sys.exit(f"{judge.name}, {part}: {found}")
        for what, count in trial.notes.items():
            if count:
                print(f"{judge.name}, {part}: {count} {what}")
        print(f"{judge.name}, {part}: as expected ({time.monotonic() - begin:.1f} s)")


if __name__ == "__main__":
    main(MASTERS, Trial)
