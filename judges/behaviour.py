"""A judge drives the simulated drive, and reads what it answers. The bus is the program's standard input and output."""

DRIVE = 3


class Behaviour:
    """One drive of the model for which all judges have the same ranges."""

    def __init__(self, trial, difference):
        self.trial, self.judge, self.difference = trial, trial.judge, difference
        self.random = trial.random
        from damiao import MODEL

        self.model = MODEL
        self.ranges = trial.models[MODEL]

    def require(self, condition, what):
        if not condition:
            raise self.difference(what)

    def near(self, found, expected, apart, what):
        self.require(abs(found - expected) <= apart, f"{what}: {found}, expected {expected}")

    def run(self):
        with self.trial.program.serve() as self.wire:
            p, v, t = self.ranges
            self.wire.ask(f"drive {DRIVE} {0x10 + DRIVE} {p} {v} {t}")
            # Another one on the bus, which must stay at rest.
            self.wire.ask(f"drive {DRIVE + 1} {0x10 + DRIVE + 1} {p} {v} {t}")
            self.judge.connect(self.model, self.wire.hear)
            try:
                self.registers()
                self.mit()
                self.modes()
                self.errors()
                self.near(self.wire.shaft(DRIVE + 1)[0], 0.0, 0.0, "the other drive")
                self.require(not self.wire.shaft(DRIVE + 1)[3], "the other drive is enabled")
            except TimeoutError as error:
                self.require(False, f"no answer: {error}")
            except Exception as error:
                # What the judges raise for a drive that does not answer.
                self.require(type(error).__name__ not in ("CallError", "RuntimeError"), f"{error!r}")
                raise
            finally:
                self.judge.connect(self.model, lambda identifier, data: [])

    def call(self, method, *arguments):
        return getattr(self.judge, method)(self.model, DRIVE, *arguments)

    def send(self, method, *arguments):
        """Has the judge send something; the drive has heard it afterwards."""
        self.judge.frames_of(lambda: self.call(method, *arguments))

    def shaft(self):
        return self.wire.shaft(DRIVE)

    def step(self, seconds):
        self.wire.ask(f"step {seconds}")

    def check_state(self, status):
        """The feedback that the judge reads is the drive's state, within a count. Threads of the judge may be late."""
        attempts = 50
        for attempt in range(attempts):
            try:
                self.compare_state(status)
                break
            except self.difference:
                if attempt == attempts - 1:
                    raise
        self.trial.note("answers of the simulated drive read")

    def compare_state(self, status):
        angle, velocity, torque, _, _ = self.shaft()
        found = self.call("state")
        if self.judge.tells_status:
            self.require(found[0] == status, f"status {found[0]}, expected {status}")
        counts = (0xFFFF, 0xFFF, 0xFFF)
        for value, real, most, top in zip(found[1:], (angle, velocity, torque), self.ranges, counts):
            real = min(max(real, -most), most)
            self.near(value, real, 2.001 * most / top, "feedback")

    def registers(self):
        p, v, t = self.ranges
        if self.judge.read is None:
            self.send("set_mode", 1)
            return
        expected = {7: 0x10 + DRIVE, 8: DRIVE, 9: 0, 10: 1, 21: p, 22: v, 23: t}
        for number, value in expected.items():
            self.near(self.call("read", number), value, 0.0, f"register {number}")
        # What is written is read, lost with the supply, and kept once it is stored.
        for is_stored in (False, True):
            for number, value in ((9, 4321), (22, 45.5)):
                self.send("write", number, value)
                self.near(self.call("read", number), value, 0.0, f"register {number}")
            if is_stored:
                self.send("switch", "store")
            self.wire.ask(f"supply {DRIVE}")
            kept = {9: 4321, 22: 45.5} if is_stored else {9: 0, 22: v}
            for number, value in kept.items():
                self.near(self.call("read", number), value, 0.0, f"register {number}")
            self.trial.note("registers of the simulated drive written and read", 4)
        for number, value in ((9, 0), (22, v)):
            self.send("write", number, value)
        self.send("switch", "store")

    def mit(self):
        p, v, t = self.ranges
        self.send("set_mode", 1)
        self.check_state(0)
        self.send("switch", "enable")
        self.check_state(1)
        self.require(self.shaft()[3], "not enabled")
        counts = 2 * p / 0xFFFF, 2 * v / 0xFFF, 500 / 0xFFF, 5 / 0xFFF, 2 * t / 0xFFF
        for _ in range(100):
            angle, velocity, _, _, _ = self.shaft()
            position, speed = (float(x) for x in self.random.uniform(-0.5, 0.5, 2) * (p, v))
            kp, kd = (float(x) for x in self.random.uniform(0, 1, 2) * (20, 2))
            torque = float(self.random.uniform(-t, t)) / 2
            self.send("command", "mit", [position, speed, kp, kd, torque])
            # One short step: the torque is that of the command at the angle and velocity of before.
            self.step(1e-4)
            expected = kp * (position - angle) + kd * (speed - velocity) + torque
            apart = kp * counts[0] + kd * counts[1] + abs(position - angle) * counts[2]
            apart += abs(speed - velocity) * counts[3] + counts[4] + 1e-3
            self.near(self.shaft()[2], min(max(expected, -t), t), apart, "torque of an MIT command")
            # Then it comes to rest near zero.
            self.send("command", "mit", [0.0, 0.0, 10.0, 1.0, 0.0])
            self.step(0.05)
            self.check_state(1)
            self.trial.note("MIT commands that the simulated drive follows")
        self.step(2.0)
        self.near(self.shaft()[0], 0.0, 0.01, "angle that is held")
        self.send("switch", "disable")
        self.step(0.01)
        self.check_state(0)
        self.near(self.shaft()[2], 0.0, 0.0, "torque of a disabled drive")
        self.send("switch", "zero")
        self.near(self.shaft()[0], 0.0, 1e-3, "angle that was made zero")

    def modes(self):
        commands = {
            "position-velocity": (2, [1.0, 5.0], 0, 1.0),
            "velocity": (3, [2.0], 1, 2.0),
            "force-position": (4, [-1.0, 5.0, 0.5], 0, -1.0),
        }
        for mode, (number, values, place, expected) in commands.items():
            self.send("set_mode", number)
            self.send("switch", "zero")
            self.send("switch", "enable")
            self.send("command", mode, values)
            self.step(3.0)
            self.near(self.shaft()[place], expected, 0.05, mode)
            self.check_state(1)
            # To the id of another mode: ignored.
            other = "velocity" if mode != "velocity" else "position-velocity"
            self.send("command", other, commands[other][1])
            self.step(1.0)
            self.near(self.shaft()[place], expected, 0.05, f"{other} in {mode}")
            self.send("switch", "disable")
            self.require(not self.shaft()[3], "not disabled")
            self.step(5.0)
            self.trial.note("other modes that the simulated drive follows")
        self.send("set_mode", 1)

    def errors(self):
        if not self.judge.tells_status:
            return
        for error in range(8, 15):
            self.send("switch", "enable")
            self.wire.ask(f"fail {DRIVE} {error}")
            self.check_state(error)
            self.send("switch", "clear")
            self.check_state(0)
            self.trial.note("errors of the simulated drive read and cleared")
        # It gives up when nobody speaks.
        self.send("set_timeout", 100)
        self.send("switch", "enable")
        self.check_state(1)
        self.step(0.09)
        self.check_state(1)
        self.step(0.11)
        self.check_state(13)
        self.send("switch", "clear")
        self.send("set_timeout", 0)
        self.check_state(0)
