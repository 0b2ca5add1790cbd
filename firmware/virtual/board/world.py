"""The motors on the other side: a process with drivetrain's own simulator, in step with the board."""
import subprocess

STEP_US = 100
"""A command reaches the motors at the next step: at most so late. What they send keeps its own time."""


class World:
    def __init__(self, program, motors, clock, wire):
        self.clock, self.wire = clock, wire
        self.commands = []
        self.process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.count = len(motors)
        for motor in motors:
            self.ask(f"motor {motor}")
        wire.listeners.append(self._hear)
        self.until = 0
        self._step()

    def ask(self, line):
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
        rpm, amperes, word = self.ask(f"state {motor}").split()
        return float(rpm), float(amperes), int(word)

    def _hear(self, sent):
        if sent.sender in ("board", "foreign") and len(sent.data) == 8:
            self.commands.append(f"{sent.id:03X}#{sent.data.hex()}")

    def _step(self):
        """Runs the motors one step ahead of the board."""
        self.until += STEP_US
        words = self.ask(f"run {self.until} {' '.join(self.commands)}").split()
        self.commands.clear()
        for at, frame in zip(words[::2], words[1::2]):
            identifier, data = frame.split("#")
            self._send_at(int(at), int(identifier, 16), bytes.fromhex(data))
        self.clock.at(self.clock.cycles(self.until), self._step)

    def _send_at(self, at_us, identifier, data):
        self.clock.at(self.clock.cycles(at_us), lambda: self.wire.offer(f"motor {identifier:03X}", identifier, data))
