"""The program of drivetrain, by its standard input and output."""

import subprocess
import threading


class Program:
    """Starts the program, with a planted defect where one is named."""

    def __init__(self, path, defect=None):
        self.path = path
        self.plant = ["--plant", defect] if defect else []

    def run(self, *arguments, data=b""):
        done = subprocess.run([self.path, *arguments, *self.plant], input=data, capture_output=True)
        if done.returncode != 0:
            raise RuntimeError(f"{arguments}: {done.stderr.decode()}")
        return done.stdout

    def lines(self, *arguments):
        return [line.split() for line in self.run(*arguments).decode().splitlines()]

    def serve(self, *family):
        return Conversation([self.path, *family, "serve", *self.plant])


class Conversation:
    """A line there and a line back, from any thread."""

    def __init__(self, command):
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self.lock = threading.Lock()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()

    def ask(self, line):
        with self.lock:
            self.process.stdin.write(line + "\n")
            answer = self.process.stdout.readline()
        if not answer:
            raise RuntimeError(f"no answer to {line!r}")
        return answer.split()

    def frames(self, line):
        """Asks for frames: pairs of an id and eight bytes."""
        words = self.ask(line)
        return [(int(i, 16), bytes.fromhex(d)) for i, d in zip(words[::2], words[1::2])]

    def hear(self, identifier, data):
        return self.frames(f"hear {identifier:X} {data.hex()}")

    def shaft(self, drive):
        angle, velocity, torque, enabled, error = map(float, self.ask(f"shaft {drive}"))
        return angle, velocity, torque, bool(enabled), int(error)
