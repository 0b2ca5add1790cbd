"""Compares the family `vesc` with judges: see README.md."""

import argparse
import logging
import queue
import subprocess
import sys
import time
import types
from fractions import Fraction

import numpy as np

from program import Conversation

# The scale of each value, and its range.
KINDS = {
    "duty": (10**5, 1.0),
    "current": (10**3, 300.0),
    "brake": (10**3, 300.0),
    "speed": (1, 200_000.0),
    "position": (10**6, 360.0),
    "current-share": (10**5, 1.0),
    "brake-share": (10**5, 1.0),
    "handbrake": (10**3, 300.0),
    "handbrake-share": (10**5, 1.0),
}
PACKETS = dict(zip(KINDS, (0, 1, 2, 3, 4, 10, 11, 12, 13)))
# What the crate has.
OF_CRATE = ("duty", "current", "brake", "speed", "position", "current-share", "handbrake")
# What limits a value here and not in the crate: shares and duties.
LIMITED = ("duty", "current-share", "brake-share", "handbrake-share")

PARTS = {
    "values": ["scale", "order"],
    "positions": ["scale", "order"],
    "statuses": ["scale", "order"],
    "python": ["scale", "order"],
    "frames": ["id", "packet"],
    "drive": ["answer", "ear"],
}
DRIVE = 23
PATIENCE_S = 20.0


class Difference(Exception):
    """A difference that nothing explains."""


def require(condition, what):
    if not condition:
        raise Difference(what)


class Trial:
    def __init__(self, path, defect, count, seed):
        self.path = path
        self.plant = ["--plant", defect] if defect else []
        self.count = count
        self.random = np.random.default_rng(seed)
        self.notes = {}

    def note(self, what, count=1):
        self.notes[what] = self.notes.get(what, 0) + int(count)

    def run(self, *arguments, data=b""):
        done = subprocess.run([self.path, "vesc", *arguments, *self.plant], input=data, capture_output=True)
        if done.returncode != 0:
            raise RuntimeError(f"{arguments}: {done.stderr.decode()}")
        return done.stdout

    def draw(self, kind, count):
        """Values within the range and beyond, at boundaries between counts, and tiny ones."""
        scale, most = KINDS[kind]
        value = self.random.uniform(-1.2 * most, 1.2 * most, count)
        near = np.rint(value * scale) / scale
        choice = self.random.integers(0, 10, count)
        value = np.where(choice < 4, near, value).astype(np.float32)
        value = np.where(choice == 8, np.nextafter(value, np.float32(0)), value)
        return np.where(choice == 9, value * np.float32(1e-4), value).astype(np.float32)

    def ours(self, kind, values):
        data = self.run("encode", kind, data=values.tobytes())
        return np.frombuffer(data, ">i4")

    # The crate `vesc`: values of commands

    def values(self):
        for place, kind in enumerate(OF_CRATE):
            count = self.count // len(OF_CRATE) + (place < self.count % len(OF_CRATE))
            values = self.draw(kind, count)
            limited = np.clip(values, np.float32(-1), np.float32(1)) if kind in LIMITED else values
            theirs = np.frombuffer(self.run("other", kind, data=limited.tobytes()), ">i4")
            found = self.ours(kind, values)
            wrong = np.nonzero(found != theirs)[0]
            require(not len(wrong), f"{kind} {values[wrong[:1]]} is {found[wrong[:1]]}, with the crate {theirs[wrong[:1]]}")
            self.exact(kind, values[:2_000], found[:2_000])
            self.note("values of commands equal", count)
            if kind in LIMITED:
                self.note("duties and shares beyond 1, limited by us", (limited != values).sum())
        for kind in set(KINDS) - set(OF_CRATE):
            values = self.draw(kind, 20_000)
            self.exact(kind, values, self.ours(kind, values))
            self.note("values that the crate does not have, by fractions", 20_000)

    def exact(self, kind, values, counts):
        """Each count is the truncated product, or the product is as near to the next one as the rounding of an f32 reaches."""
        scale, _ = KINDS[kind]
        least = -1.0 if kind in ("duty", "current-share") else 0.0
        for value, count in zip(values.tolist(), counts.tolist()):
            value = min(max(value, least), 1.0) if kind in LIMITED else value
            exact = Fraction(value) * scale
            near = abs(exact) / 2**24
            require(
                int(abs(exact) - near) <= abs(count) <= int(abs(exact) + near) and count * exact >= 0,
                f"{kind} {value} is {count}, exactly {float(exact)}",
            )

    # pyvesc: positions

    def positions(self):
        pack = pyvesc().setters.SetPosition
        base = pyvesc().base.VESCMessage
        values = self.draw("position", self.count)
        found = self.ours("position", values)
        theirs = np.array(
            [int.from_bytes(base.pack(pack(value))[1:], "big", signed=True) for value in values.tolist()]
        )
        apart = np.abs(found - theirs)
        # It multiplies in f64. One rounding of an f32 is half of its last bit.
        most = np.spacing(np.abs(values * np.float32(1e6))) / 2 + 1
        wrong = np.nonzero(apart > most)[0]
        require(not len(wrong), f"{values[wrong[:1]]} is {found[wrong[:1]]}, with pyvesc {theirs[wrong[:1]]}")
        self.note("positions equal", (apart == 0).sum())
        self.note("positions apart by the rounding of an f32", (apart > 0).sum())
        require(self.plant or (apart > 0).any(), "no longer there: the rounding of an f32")

    # Feedback

    def sets(self, count):
        """Status 1 to 5, with ends of their integers."""
        sets = self.random.integers(0, 256, (count, 5, 8), np.uint8)
        ends = self.random.integers(0, 20, (count, 5, 2)) == 0
        for half in range(2):
            place = ends[:, :, half]
            sets[place, 4 * half : 4 * half + 4] = self.random.choice(
                np.array([[0x7F, 0xFF, 0xFF, 0xFF], [0x80, 0, 0, 0], [0xFF] * 4, [0] * 4], np.uint8), place.sum()
            )
        return sets

    def decode(self, sets):
        data = self.run("decode", data=sets.tobytes())
        return np.frombuffer(data, "<f8").reshape(-1, 13)

    def statuses(self):
        sets = self.sets(self.count // 5)
        found = self.decode(sets)
        theirs = np.frombuffer(self.run("decode-other", data=sets.tobytes()), "<f8").reshape(-1, 13)
        # The crate makes an f32 of each: up to two roundings on both sides.
        apart = np.abs(found - theirs)
        wrong = np.argwhere(apart > 3 * 2.0**-24 * np.abs(theirs))
        require(not len(wrong), f"value {wrong[:1]}: {found[tuple(wrong[0])] if len(wrong) else 0}")
        self.note("status frames equal", len(sets) * 5)

    def python(self):
        base, fields = pyvesc().base.VESCMessage, pyvesc().getters.GetValues._field_names
        sets = self.sets(self.count // 5)
        found = self.decode(sets)
        for row, (one, two, three, four, five) in zip(found, (s for s in map(lambda s: [bytes(f) for f in s], sets))):
            zero = bytes(2)
            payload = b"\x04" + one[4:6] + four[0:2] + four[2:4] + four[4:6] + zero * 3 + bytes(8)
            payload += one[6:8] + one[0:4] + five[4:6] + two + three + five[0:4] + bytes(4) + b"\0"
            # Its fields are not aligned, as on the wire.
            message = base.unpack(payload)
            values = {name: getattr(message, name) for name in fields}
            theirs = [values[name] for name in (
                "rpm", "temp_mos1", "duty_now", "amp_hours", "amp_hours_charged", "watt_hours",
                "watt_hours_charged", "temp_mos2", "temp_mos3", "temp_mos4",
            )]
            theirs += [int.from_bytes(four[6:8], "big", signed=True) / 50, values["tachometer"], values["v_in"]]
            for ours, judge in zip(row.tolist(), theirs):
                require(abs(ours - judge) <= 3 * 2.0**-24 * abs(judge), f"{ours}, with pyvesc {judge}")
        self.note("status frames equal", len(sets) * 5)

    # pybldc: ids, questions and answers on CAN

    def frames(self):
        for kind, packet in PACKETS.items():
            lines = self.run("frames", kind, "0.5").decode().split()
            frames = list(zip(lines[::2], lines[1::2]))
            require(len(frames) == 2 * 254, f"{len(frames)} frames")
            for number in range(254):
                value, question = frames[2 * number : 2 * number + 2]
                require(int(value[0], 16) == packet << 8 | number and len(value[1]) == 8, f"{kind} #{number} is {value}")
                require(question[1] == "fe0032000080" + "00", f"#{number} is asked {question}")
                require(int(question[0], 16) == 8 << 8 | number, f"#{number} is asked {question}")
                self.note("ids of commands", 1)
        with Bus(Conversation([self.path, "vesc", "serve", *self.plant])) as bus:
            # It takes ids below 253 and has 253 itself.
            for number in range(0, 253):
                line = self.run("frames", "current", "0").decode().split() if number == 0 else line
                raw, data = line[4 * number + 2 : 4 * number + 4]
                sent = bus.ask(number, False)
                require(sent == (int(raw, 16), bytes([253]) + bytes.fromhex(data)[1:]), f"{sent} and {raw} {data}")
                self.note("questions equal but for the id of the program", 1)

    def drive(self):
        with Bus(Conversation([self.path, "vesc", "serve", *self.plant])) as bus:
            for number in (0, 1, DRIVE, 127, 252):
                bus.tell(f"drive {number}")
                answers = []
                for fault in range(256):
                    bus.tell(f"fail {fault}")
                    found = bus.ask(number, True)
                    require(found == [50, 0, 0, 0x80, 0, fault], f"#{number} with fault {fault} answers {found}")
                    answers.append(bytes([number, 1, *found]))
                    self.note("fault codes of the simulated drive read")
                # What pybldc reads, our motor reads.
                codes = self.run("fault", str(number), data=b"".join(answers))
                require(codes == bytes(range(256)), f"our motor reads {codes}")
                others = [bytes([answer[0] ^ 1]) + answer[1:] for answer in answers]
                require(self.run("fault", str(number), data=b"".join(others)) == b"\xff" * 256, "of another drive")
            self.commands(bus)

    def commands(self, bus):
        """The payloads of the crate `vesc` turn the shaft, in frames whose ids pybldc's rule makes."""
        cases = [("current", 5.0, 0.25), ("brake", 5.0, 0.0), ("duty", 0.2, 60.0), ("speed", 7000.0, 104.7), ("position", 90.0, 1.571)]
        for kind, value, expected in cases:
            bus.tell(f"drive {DRIVE}")
            payload = self.run("other", kind, data=np.float32(value).tobytes())
            bus.tell(f"hear {PACKETS[kind] << 8 | DRIVE:X} {payload.hex()}")
            bus.tell("step 0.9")
            angle, velocity, torque, _ = map(float, bus.tell("shaft"))
            found = {"current": torque, "brake": torque, "position": angle}.get(kind, velocity)
            require(abs(found - expected) < 0.02 * abs(expected) + 1e-4, f"{kind} of {value}: {found}")
            # A second without a command, and it lets go.
            bus.tell("step 0.2")
            require(abs(float(bus.tell("shaft")[2])) < 1e-9, f"{kind}: {bus.tell('shaft')}")
            self.note("commands that the simulated drive follows, and its time-out")


class Bus:
    """pybldc on a virtual bus of python-can, with the simulated drive at its other end."""

    def __init__(self, conversation):
        self.conversation = conversation

    def __enter__(self):
        import can
        from pybldc import PyBldcCan

        log = logging.getLogger("judges")
        log.addHandler(logging.NullHandler())
        log.propagate = False
        self.can = can
        self.master = PyBldcCan(log, 0, interface="virtual", channel="judges")
        self.bus = can.Bus(interface="virtual", channel="judges")
        return self

    def __exit__(self, *_):
        self.master.shutdown()
        self.bus.shutdown()
        self.conversation.__exit__()

    def tell(self, line):
        return self.conversation.ask(line)

    def ask(self, number, is_answered):
        """Has pybldc ask a drive for its fault code: the frame that it sends, or what it makes of the answer."""
        master, bus = self.master, self.bus
        # A master for each drive would wait half a second when it ends.
        master._controller_id = master._can_listener._controller_id = number
        master._send_implementation([50, 0, 0, 0x80, 0], [], timeout=0.0)
        sent = bus.recv(PATIENCE_S)
        require(sent is not None and sent.is_extended_id, f"pybldc sends {sent}")
        if not is_answered:
            return sent.arbitration_id, bytes(sent.data)
        words = self.tell(f"hear {sent.arbitration_id:X} {bytes(sent.data).hex()}")
        require(len(words) == 2, f"no answer: {words}")
        answer = self.can.Message(
            arbitration_id=int(words[0], 16), data=bytes.fromhex(words[1]), is_extended_id=True
        )
        bus.send(answer)
        try:
            return list(master._can_listener.packet_queue.get(timeout=PATIENCE_S))
        except queue.Empty:
            raise Difference(f"pybldc does not take {answer}") from None


def pyvesc():
    """pyvesc's messages. Its packets need a package for their check that no longer exists by that name: not used here."""
    if "PyCRC" not in sys.modules:
        crc = types.ModuleType("PyCRC.CRCCCITT")
        crc.CRCCCITT = None
        sys.modules["PyCRC"] = types.ModuleType("PyCRC")
        sys.modules["PyCRC.CRCCCITT"] = crc
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import pyvesc.messages as messages
        import pyvesc.messages.base, pyvesc.messages.getters, pyvesc.messages.setters  # noqa: E401
    return messages


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge", choices=["vesc"])
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    arguments = parser.parse_args()
    for part, defects in PARTS.items():
        if arguments.only not in (None, part):
            continue
        begin = time.monotonic()
        for defect in defects:
            trial = Trial(arguments.program, defect, 20_000, arguments.seed)
            try:
                getattr(trial, part)()
            except Difference as found:
                print(f"vesc, {part}: finds the planted defect {defect}: {found}")
            else:
                sys.exit(f"vesc, {part}: does not find the planted defect {defect}")
        trial = Trial(arguments.program, None, arguments.count, arguments.seed)
        try:
            getattr(trial, part)()
        except Difference as found:
            sys.exit(f"vesc, {part}: {found}")
        for what, count in trial.notes.items():
            print(f"vesc, {part}: {count} {what}")
        print(f"vesc, {part}: as expected ({time.monotonic() - begin:.1f} s)")


if __name__ == "__main__":
    main()
