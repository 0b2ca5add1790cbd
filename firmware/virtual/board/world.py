"""The motors on the other side: a process with drivetrain's own simulator, in step with the board."""
import subprocess

STEP_US = 100
"""A command reaches the motors at the next step: at most so late. What they send keeps its own time."""


class World:
    """`things` are the lines that attach what is there, as in the head of `firmware/virtual/world`."""

    def __init__(self, program, things, clock, wires):
        self.clock, self.wires, self.program = clock, wires, program
        self.commands, self.told = [], []
        self._start()
        for thing in things:
            self.ask(thing)
        for place, wire in enumerate(wires, 1):
            # Without a node on it nobody acknowledges.
            wire.is_plugged = any(thing.startswith("joint") and place == 1 or f" can{place}" in thing for thing in things)
            wire.listeners.append(lambda sent, place=place: self._hear(place, sent))
        self.until = 0
        self._step()

    def _start(self):
        self.process = subprocess.Popen([self.program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def again(self):
        """For a copy of this process, which shares the motors with the original: motors of its own, that lived the same."""
        told, self.told = self.told, []
        self._start()
        for line in told:
            self.ask(line)

    def ask(self, line):
        self.told.append(line)
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the world ended at: {line}")
        return answer.strip()

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()

    def fault(self, kind, motor, from_us, until_us):
        self.ask(f"fault {kind} {motor} {int(from_us)} {int(until_us)}")

    def state(self, motor):
        """Velocity of the output shaft in rpm, current in A, command word."""
        rpm, amperes, word, *_ = self.ask(f"state {motor}").split()
        return float(rpm), float(amperes), int(word)

    def degrees(self, motor):
        return float(self.ask(f"state {motor}").split()[3])

    def is_enabled(self, motor):
        return self.ask(f"state {motor}").split()[4] == "1"

    def pose(self):
        """Heading in degrees, speed ahead and to the left in m/s, turning in degrees a second."""
        return tuple(map(float, self.ask("pose").split()))

    def heat(self, motor, celsius):
        self.ask(f"heat {motor} {celsius}")

    def _hear(self, place, sent):
        if sent.sender in ("board", "foreign"):
            self.commands.append(f"{place}:{sent.id:03X}#{sent.data.hex()}")

    def _step(self):
        """Runs the motors one step ahead of the board."""
        self.until += STEP_US
        words = self.ask(f"run {self.until} {' '.join(self.commands)}").split()
        self.commands.clear()
        for at, frame in zip(words[::2], words[1::2]):
            place, rest = frame.split(":")
            identifier, data = rest.split("#")
            self._send_at(int(place), int(at), int(identifier, 16), bytes.fromhex(data))
        self.clock.at(self.clock.cycles(self.until), self._step)

    def _send_at(self, place, at_us, identifier, data):
        wire = self.wires[place - 1]
        self.clock.at(self.clock.cycles(at_us), lambda: wire.offer(f"motor {identifier:03X}", identifier, data))
