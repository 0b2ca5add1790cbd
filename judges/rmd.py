"""Compares the family `rmd` with judges: see README.md."""

import ctypes
import os
import struct
import time

import numpy as np

import lk
from lk import FEEDBACK, FOUND, POSITION, TORQUE, VELOCITY, Frame, require
from program import Conversation

ANSWERS = 0x241
RELEASE, OFF, STOP, READ = 0x77, 0x80, 0x81, 0x9C

# The torque of an ampere of the RMD-X8-120, in Nm.
CONSTANT = 2.4

# The differences that README.md explains.
COARSE = "angles that the judge reads in hundredths of a degree"


class NekoRmd(lk.NekoRmd):
    """NekoRMD: the frames of protocol V3, with answers on the id that it is given. It has no torque but that of its test."""

    codes = [VELOCITY, POSITION]
    feedback = [VELOCITY]
    #: Its largest value and limit: it writes integers.
    most = 2**31 - 1

    def __init__(self):
        super().__init__()
        for part in (self.control, self.control.position, self.control.speed, self.control.Torque, self.telemetry):
            part.motor_address = ANSWERS
        self.verbs = {RELEASE: self.control.unfreeze, STOP: self.control.freeze}

    def commands(self, rows):
        for code, limit, value in rows:
            self.bus.answer = Frame(bytes([code, 0, 0, 0, 0, 0, 0, 0]), ANSWERS)
            if code == VELOCITY:
                # It divides by 0.01 and truncates: the middle between two counts is none of them.
                self.control.speed.set_speed((value + (0.5 if value >= 0 else -0.5)) * 0.01)
            else:
                self.control.position.set_absolute_position(limit, value)
        return b"".join(data for _, data in self.bus.drain())

    def decode(self, frames, _ours):
        read, found = self.telemetry.read_motor_temperature_and_torque, []
        for at in range(0, len(frames), 8):
            self.bus.answer = Frame(frames[at : at + 8], ANSWERS)
            found.append(tuple(read().values()))
        self.bus.drain()
        # Without a sign, as it reads them.
        values = np.array(found, np.uint16).astype("<u2").view("<i2")
        values[:, 0] = values[:, 0].astype(np.uint8).view(np.int8)
        return values.astype(np.int64)

    def frame(self, code):
        self.bus.answer = Frame(bytes([code, 0, 0, 0, 0, 0, 0, 0]), ANSWERS)
        self.verbs[code]()
        return self.bus.drain()[0]

    # The simulated drive

    def connect(self, hear):
        def respond(identifier, data):
            answers = hear(identifier, data)
            return Frame(answers[0][1], answers[0][0]) if answers else None

        self.bus.respond = respond if hear else None

    def turn(self, degrees_s):
        self.control.speed.set_speed(degrees_s)

    def go(self, degrees, limit):
        self.control.position.set_absolute_position(limit, round(degrees * 100))

    def seen(self):
        """The question is a velocity of 0 with it: it brakes the shaft a little."""
        found = self.telemetry.read_motor_temperature_and_torque()
        return [(found[name] + 0x8000) % 0x10000 - 0x8000 for name in ("Speed", "Angle")]

    def tell(self, code):
        answer = self.verbs[code]()
        require(answer is not None and answer.data[0] == code, f"no answer to {code:X}")


class Motorbridge:
    """motorbridge, in Rust as a shared library, over its CAN socket: `socketcan.c` has the other end."""

    name = "motorbridge"
    codes = [VELOCITY, POSITION]
    feedback = [READ, TORQUE, VELOCITY, POSITION]
    #: Its commands are in rad, in single precision.
    most = 2**20
    END = 200

    def __init__(self):
        from motorbridge.abi import CState
        from motorbridge.core import Controller

        self.controller = Controller("can0")
        self.motor = self.controller.add_myactuator_motor(1, ANSWERS, "X8")
        os.set_blocking(self.END, False)
        self.lib, self.state, self.hear = self.motor._abi.lib, CState(), None
        self.verbs = {RELEASE: self.motor.enable, OFF: self.motor.disable, STOP: self.motor.clear_error}
        self.verbs[READ] = self.motor.request_feedback

    def receive(self):
        frames = []
        try:
            while True:
                frames.append(os.read(self.END, 16))
        except BlockingIOError:
            return frames

    def commands(self, rows):
        motor, send, go = self.motor._ptr, self.lib.motor_handle_send_vel, self.lib.motor_handle_send_pos_vel
        count, degree, frames = np.radians(0.01), np.radians(1.0), []
        # A socket holds some hundred.
        for at in range(0, len(rows), 50):
            for code, limit, value in rows[at : at + 50]:
                if code == VELOCITY:
                    send(motor, value * count)
                else:
                    go(motor, value * count, limit * degree)
            frames += self.receive()
        require(all(frame[:4] == b"\x41\x01\0\0" for frame in frames), "another id")
        return b"".join(frame[8:] for frame in frames)

    def decode(self, frames, ours):
        """A thread of its own may have a frame in hand: it is waited for until its first values are there. Ends at a difference."""
        state, read, head = self.state, self.lib.motor_handle_get_state, struct.pack("<IB3x", ANSWERS, 8)
        motor, poll, found = self.motor._ptr, self.lib.motor_controller_poll_feedback_once, []
        controller, end, here = self.controller._require_open(), self.END, ctypes.byref(state)
        for at in range(0, len(frames), 8):
            os.write(end, head + frames[at : at + 8])
            poll(controller)
            temperature, current = ours[at // 8]
            for _ in range(500):
                read(motor, here)
                if state.t_mos == temperature and abs(state.torq * 100 - current) < 0.5:
                    break
                time.sleep(0.0002)
            else:
                at = len(frames)
            found.append((state.t_mos, state.torq, state.vel, state.pos))
            if at == len(frames):
                break
        scale = [1, 100, 180 / np.pi, 18_000 / np.pi]
        return np.rint(np.array(found) * scale).astype(np.int64)

    def frame(self, code):
        self.verbs[code]()
        identifier, data = struct.unpack("<I4x8s", self.receive()[0])
        return identifier, data

    # The simulated drive

    def connect(self, hear):
        self.hear = hear

    def exchange(self):
        for frame in self.receive():
            for identifier, data in self.hear(struct.unpack_from("<I", frame)[0], frame[8:]):
                os.write(self.END, struct.pack("<IB3x", identifier, 8) + data)
                self.controller.poll_feedback_once()
                # A thread of its own may have it in hand. No two answers in a row have the same first byte but those to `turn`.
                for _ in range(5_000):
                    state = self.motor.get_state()
                    if data[0] not in self.feedback or state and state.status_code == data[0]:
                        break
                    time.sleep(0.0002)

    def turn(self, degrees_s):
        self.motor.send_vel(np.radians(degrees_s))
        self.exchange()

    def go(self, degrees, limit):
        self.motor.send_pos_vel(np.radians(degrees), np.radians(limit))
        self.exchange()

    def seen(self):
        self.tell(READ)
        state = self.motor.get_state()
        # Its hundredths are degrees.
        return np.degrees(state.vel), np.degrees(state.pos) * 100

    def tell(self, code):
        self.verbs[code]()
        self.exchange()


class PyLkMotor(lk.PyLkMotor):
    """pylkmotor: LK-TECH's frames, of which torque, off, the question for feedback and feedback itself are those of MyActuator."""

    codes = [TORQUE]
    feedback = [READ, TORQUE, VELOCITY, POSITION, 0xA8]
    #: Its currents have 16 bits.
    most = 32_767

    def __init__(self):
        super().__init__()
        self.verbs = {OFF: self.motor.motor_shutdown, READ: self.motor.read_motor_status_2}

    def commands(self, rows):
        torque = self.motor.torque_loop_control
        for _, _, value in rows:
            torque(value)
        sent = self.bus.drain()
        require(all(identifier == 0x141 for identifier, _ in sent), "another id")
        return b"".join(data for _, data in sent)

    def decode(self, frames, _ours):
        read = self.motor._parse_response_2
        return np.array([read(frames[at : at + 8]) for at in range(0, len(frames), 8)], np.int64)

    def frame(self, code):
        self.verbs[code]()
        return self.bus.drain()[0]

    # The simulated drive

    def connect(self, hear):
        def respond(identifier, data):
            answers = hear(identifier, data)
            return Frame(answers[0][1]) if answers else None

        self.bus.respond = respond if hear else None
        self.bus.answer = None


MASTERS = {judge.name: judge for judge in (Motorbridge, NekoRmd, PyLkMotor)}


class Trial(lk.Trial):
    explained = {
        ("motorbridge", "encode"): set(),
        ("motorbridge", "decode"): {COARSE},
        ("nekormd", "encode"): set(),
        ("nekormd", "decode"): set(),
        ("pylkmotor", "encode"): set(),
        ("pylkmotor", "decode"): set(),
    }

    def encode(self):
        random, judge = self.random, self.judge
        count = self.count
        rows = np.zeros(count, np.dtype([("code", "u1"), ("pad", "u1"), ("limit", "<u2"), ("value", "<i4")]))
        rows["code"] = random.choice(np.array(judge.codes, np.uint8), count)
        values = random.integers(-judge.most, judge.most + 1, count)
        # As often small as large, and the ends.
        values >>= random.integers(0, judge.most.bit_length(), count)
        ends = np.array([0, 1, -1, 255, 256, judge.most, -judge.most])
        rows["value"] = np.where(random.integers(0, 20, count) == 0, random.choice(ends, count), values)
        rows["limit"] = np.where(rows["code"] == POSITION, random.integers(0, 65_536, count), 0)
        ours = np.frombuffer(self.program.run("rmd", "encode", data=rows.tobytes()), np.uint8)
        listed = list(zip(*(rows[name].tolist() for name in ("code", "limit", "value"))))
        theirs = np.frombuffer(judge.commands(listed), np.uint8)
        require(len(ours) == len(theirs) == 8 * count, f"{len(theirs)} bytes")
        apart = np.nonzero((ours != theirs).reshape(-1, 8).any(axis=1))[0]
        if len(apart):
            place = int(apart[0])
            pair = [frames[8 * place : 8 * place + 8].tobytes().hex() for frames in (ours, theirs)]
            raise lk.Difference(f"{rows[place]} is {pair[0]}, with {judge.name} {pair[1]}")
        self.finish("encode", "control commands", count)

    def decode(self):
        judge = self.judge
        count = self.count
        frames = self.random.integers(0, 256, (count, 8), np.uint8)
        frames[:, 0] = self.random.choice(np.array(judge.feedback, np.uint8), count)
        found = np.frombuffer(self.program.run("rmd", "decode", data=frames.tobytes()), FOUND)
        require(len(found) == count and (found["kind"] == FEEDBACK).all(), "no feedback")
        ours = found["values"].astype(np.int64)
        theirs = judge.decode(frames.tobytes(), ours[:, :2].tolist())
        if judge.name == "motorbridge":
            self.note(COARSE, count)
        apart = np.nonzero((ours[: len(theirs)] != theirs).any(axis=1))[0]
        if len(apart):
            place = int(apart[0])
            data = frames[place].tobytes().hex()
            raise lk.Difference(f"{data}: {ours[place]}, with {judge.name} {theirs[place]}")
        require(len(theirs) == count, f"{len(theirs)} answers")
        self.finish("decode", "answers", count)

    def frames(self):
        """The frames of a motor's life that the judge has too."""
        judge = self.judge
        with Conversation([self.program.path, "rmd", "serve", *self.program.plant]) as wire:
            for mode in ("torque", "velocity", "position"):
                sent = wire.frames(f"session 1 {mode}")
                for code in {RELEASE, OFF} & judge.verbs.keys():
                    if code == RELEASE and mode != "torque":
                        continue
                    theirs = judge.frame(code)
                    require(theirs in sent, f"{mode}: {sent}, not {theirs}")
                    self.note("frames that switch")
        for code in judge.verbs:
            row = struct.pack("<BBHi", code, 0, 0, 0)
            ours = self.program.run("rmd", "encode", data=row)
            require(ours == judge.frame(code)[1], f"{code:X}: {ours.hex()}")
            self.note("frames that switch")

    def drive(self):
        """The judge drives the simulated drive, and reads what it answers."""
        judge = self.judge
        with Conversation([self.program.path, "rmd", "serve", *self.program.plant]) as self.wire:
            judge.connect(self.wire.hear)
            try:
                if judge.name == "pylkmotor":
                    return self.drive_by_torques(judge.motor)
                judge.tell(RELEASE)
                for speed in self.random.integers(-300, 300, 20).tolist():
                    judge.turn(speed)
                    self.wire.ask("step 2")
                    turning = np.degrees(self.shaft()[1])
                    self.near(turning, speed, 4, "velocity loop")
                    velocity, angle = judge.seen()
                    self.near(velocity, turning, 1.001, "velocity")
                    self.near(angle, np.degrees(self.shaft()[0]), 1.001, "angle")
                for target in self.random.integers(-720, 720, 20).tolist():
                    judge.go(target, 360)
                    self.wire.ask("step 10")
                    self.near(np.degrees(self.shaft()[0]), target, 0.1, "position loop")
                    self.near(judge.seen()[1], target, 1.1, "angle")
                judge.tell(STOP)
                self.wire.ask("step 1")
                self.near(self.shaft()[1], 0, 1e-3, "velocity when stopped")
                if OFF in judge.verbs:
                    judge.turn(100)
                    self.wire.ask("step 1")
                    judge.tell(OFF)
                    self.wire.ask("step 0.1")
                    self.near(self.shaft()[2], 0, 0, "torque when off")
                    judge.turn(100)
                    self.wire.ask("fail 16")
                    self.wire.ask("step 0.1")
                    self.near(self.shaft()[2], 0, 0, "torque with an error")
            finally:
                judge.connect(None)

    def drive_by_torques(self, motor):
        for current in self.random.integers(-300, 300, 200).tolist():
            motor.torque_loop_control(current)
            self.wire.ask("step 0.01")
            _, found, velocity, angle = motor.read_motor_status_2()
            turned, turning, torque = self.shaft()[:3]
            self.near(found, current, 1, "current")
            self.near(torque, current * CONSTANT / 100, CONSTANT / 100, "torque")
            self.near(velocity, np.degrees(turning), 1.001, "velocity")
            self.near(angle, np.degrees(turned), 1.001, "angle")
        motor.motor_shutdown()
        self.wire.ask("step 0.1")
        self.near(self.shaft()[2], 0, 0, "torque when off")
        motor.torque_loop_control(500)
        self.wire.ask("fail 16")
        self.wire.ask("step 0.1")
        self.near(self.shaft()[2], 0, 0, "torque with an error")


if __name__ == "__main__":
    lk.main(MASTERS, Trial)
