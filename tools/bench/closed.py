"""Takes the terminal away from a bench that drives a simulated motor, in each way in which a terminal goes, and checks that the
bench ends in time, with its exit code, a whole recording, and zeros as its last commands. Called by `try`: closed.py BENCH"""

import os
import pty
import select
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time
from fcntl import ioctl
from pathlib import Path

BENCH = Path(sys.argv[1]).resolve()
# The bench is gone so many seconds after its terminal; docs/tools.md promises 1 s where all motors are heard.
GONE_S = 1.0
# A loaded machine gets so much more.
SLACK_S = 1.0
WINDOW = ["--motors", "m3508:1-2", "--seed", "1", "--log", "drive.mcap"]
SPIN = ["spin", "--rpm", "100", "--arm", "--seconds", "60", *WINDOW]


class Failed(Exception):
    """A rule that does not hold."""


def open_terminal(arguments, has_deaf_leader):
    """Starts the bench in a terminal of its own, and returns the process and the far end of the terminal. A deaf leader of the
    session takes the terminal's SIGHUP and passes none on, as an ssh or a make between the terminal and the program does."""
    near, far = pty.openpty()
    ioctl(far, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 140, 0, 0))
    code = "code=$?; echo $code >code.part; mv code.part code"
    # The bench resets SIGHUP for itself; the leader ignores it.
    line = f'trap "" HUP; "$@"; {code}' if has_deaf_leader else 'exec "$@"'
    leader = subprocess.Popen(
        ["sh", "-c", line, "sh", str(BENCH), *arguments],
        stdin=far, stdout=far, stderr=far, start_new_session=True,
        preexec_fn=lambda: ioctl(0, termios.TIOCSCTTY, 0), env={**os.environ, "TERM": "xterm-256color"},
    )
    os.close(far)
    return leader, near


def read_until(near, text, seconds=20):
    """Reads the terminal until a text comes."""
    seen, until = b"", time.monotonic() + seconds
    while text.encode() not in seen:
        if time.monotonic() > until:
            raise Failed(f'"{text}" does not come: {seen[-300:]!r}')
        if select.select([near], [], [], 0.1)[0]:
            seen += os.read(near, 65536)


def drain(near, seconds):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if select.select([near], [], [], 0.05)[0]:
            os.read(near, 65536)


def drive(near, is_window):
    """Has the motors turn."""
    if is_window:
        read_until(near, "Online")
        os.write(near, b"A")
        read_until(near, "ARMED")
        os.write(near, b"\x1b[1;2C")
        drain(near, 1.0)
    else:
        # The speed is said each half second.
        read_until(near, " 99.")


def await_end(leader, has_deaf_leader):
    """Waits for the end of the bench; returns its exit code and the seconds that it took."""
    begun = time.monotonic()
    while leader.poll() is None:
        if time.monotonic() - begun > GONE_S + SLACK_S:
            raise Failed(f"the bench lives {GONE_S + SLACK_S} s after its terminal")
        time.sleep(0.01)
    code = int(Path("code").read_text()) if has_deaf_leader else leader.returncode
    return code, time.monotonic() - begun


def check_recording():
    """The commands turned the motors, and were zero at the end; the recording has its end."""
    data = Path("drive.mcap").read_bytes()
    if not data.endswith(b"\x89MCAP0\r\n"):
        raise Failed("the recording has no end")
    subprocess.run([BENCH, "replay", "drive.mcap", "--output", "drive.log"], check=True, stdout=subprocess.DEVNULL)
    commands = [line.split("200#")[1] for line in Path("drive.log").read_text().splitlines() if " 200#" in line]
    zero = "0" * 16
    if len(commands) < 500 or all(command == zero for command in commands):
        raise Failed(f"{len(commands)} commands, and no motor was driven")
    zeros = len(commands) - max(at for at, command in enumerate(commands) if command != zero) - 1
    if zeros < 3:
        raise Failed(f"the last command is {commands[-1]}, after {zeros} zeros")
    return zeros


def stall(near, seconds):
    """Takes nothing of what is drawn, and has much drawn: the buffer fills, and the window waits in the midst of a picture."""
    until = time.monotonic() + seconds
    lines = 40
    while time.monotonic() < until:
        lines = 81 - lines
        ioctl(near, termios.TIOCSWINSZ, struct.pack("HHHH", lines, 140, 0, 0))
        time.sleep(0.06)


def case(name, arguments, has_deaf_leader, stall_s):
    """One way in which a terminal goes."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        leader, near = open_terminal(arguments, has_deaf_leader)
        try:
            drive(near, arguments is WINDOW)
            stall(near, stall_s)
            os.close(near)
            code, seconds = await_end(leader, has_deaf_leader)
            if code != 1:
                raise Failed(f"exit code {code}")
            zeros = check_recording()
        finally:
            # The bench and its leader are a process group of their own.
            try:
                os.killpg(leader.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
            os.chdir("/")
    print(f"closed: {name}: gone after {seconds:.2f} s with exit code {code}, {zeros} zeros last")


def main():
    cases = [
        ("a window whose terminal is closed", WINDOW, False, 0.0),
        ("a window whose terminal is closed without a signal", WINDOW, True, 0.0),
        ("a window whose terminal takes nothing for 1 s and is closed", WINDOW, True, 1.0),
        ("a window whose terminal takes nothing for 4 s and is closed", WINDOW, True, 4.0),
        ("a command whose terminal is closed", SPIN, False, 0.0),
        ("a command whose terminal is closed without a signal", SPIN, True, 0.0),
    ]
    failures = []
    for name, *rest in cases:
        try:
            case(name, *rest)
        except (Failed, OSError, subprocess.CalledProcessError) as failure:
            failures.append(f"closed: {name}: {failure}")
    if failures:
        sys.exit("\n".join(failures))


main()
