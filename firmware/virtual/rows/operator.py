"""What goes wrong with the one who drives: remote control, key, IMU."""
import random

from board.imu import frame
from robots import ARM_AT_US, CYCLE_US, FAULT_AT_US
from rows.judge import BRAKING_US, REMOTE_LOST_US, STANDS_RPM, drives_again, driving, goes_on, must, rested, rests, row

# A chassis of 20 kg brakes from half its speed within 300 ms, and an IMU is lost after 50 ms.
STOP_US, LOOK_US = 350_000, 5_000
# After so long the robot without a remote control is disarmed for certain.
DISARMED_US = REMOTE_LOST_US + BRAKING_US + 20_000


@row("F41")
def let_go(robot):
    """The switch is turned away, or the key let go: it rests within a frame of the remote control."""
    driving(robot)
    robot.ask_to_arm(False)
    robot.run(FAULT_AT_US + 50_000)
    result = rested(robot, FAULT_AT_US, 14_000 + 18 * 120 + 11 * CYCLE_US, "at rest")
    rests(robot, FAULT_AT_US + 30_000, FAULT_AT_US + 50_000)
    return result


@row("F68", "fresh")
def on_at_power_on(robot):
    """The switch is at the top, or the key down, before the supply is on: nothing moves."""
    robot.at(0, lambda: robot.ask_to_arm(True))
    robot.run(120_000)
    must(robot.commands() and not robot.driven(), "it drives, though nobody turned the switch")
    return {"zero_us": robot.commands()[0].us, "stale": 0, "note": "at rest"}


@row("F58", needs="remote")
def remote_cut(robot):
    """The line of the remote control is cut in the middle of a frame."""
    driving(robot)
    robot.remote.cut_after = 7

    def hear():
        robot.remote.cut_after, robot.remote.is_heard = None, True

    # Heard again with the switch still at the top and the stick held: nothing moves before it is turned anew.
    robot.at(FAULT_AT_US + 600_000, hear)
    result = _without_remote(robot, "brakes, is disarmed a second later; drives again when armed again")
    drives_again(robot, FAULT_AT_US + DISARMED_US)
    return result


@row("F59", needs="remote")
def remote_noise(robot):
    """Two bits of each byte of the remote control are inverted: no frame is plausible."""
    driving(robot)
    robot.remote.spoil = lambda place, byte: byte ^ 0x5A if place < 6 else byte
    return _without_remote(robot, "brakes, is disarmed a second later")


@row("F59", needs="remote")
def remote_flips(robot):
    """A bit of one byte of each third frame of the remote control is inverted, in a channel that is at rest."""
    driving(robot)
    count = [0]

    def spoil(place, byte):
        count[0] += place == 0
        return byte ^ 0x10 if place == 9 and count[0] % 3 == 0 else byte

    robot.remote.spoil = spoil
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 70_000, "goes on")


@row("F57", needs="remote")
def remote_drops(robot):
    """A byte of each second frame of the remote control is lost: those frames are thrown away, the next counts."""
    driving(robot)
    count = [0]

    def drop(place, byte):
        count[0] += place == 0
        return None if place == 5 and count[0] % 2 else byte

    robot.remote.spoil = drop
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 110_000, "half of its frames count; goes on")


@row("F58", needs="remote")
def remote_away(robot):
    """The remote control is silent for 60 ms: shorter than its deadline."""
    driving(robot)
    robot.remote.is_heard = False
    robot.run(FAULT_AT_US + 60_000)
    robot.remote.is_heard = True
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 90_000, "goes on")


@row("F59", needs="remote")
def remote_storm(robot):
    """The line of the remote control carries noise without a pause, for 130 ms."""
    driving(robot)
    robot.remote.is_heard = False
    drawn = random.Random(7)

    def noise():
        robot.remote.byte(drawn.randrange(256))
        if robot.clock.us() < FAULT_AT_US + 130_000:
            robot.clock.after(robot.clock.cycles(120), noise)

    noise()
    return _without_remote(robot, "brakes, is disarmed a second later")


@row("F41", "fresh", needs="remote")
def armed_with_a_stick(robot):
    """The switch is turned to the top while a stick is held: it does not arm."""
    robot.stick(0.5)
    robot.run(120_000)
    must(robot.commands() and not robot.driven(), "it was armed with a stick that is held")
    return {"zero_us": robot.commands()[0].us, "stale": 0, "note": "arming needs sticks at rest"}


@row("F58", "imu", needs="remote")
def imu_cut(robot):
    """The line of the IMU is cut in the middle of a frame while a stick is held: the robot stops until the sticks are let go."""
    driving(robot)
    robot.imu.cut_after = 40
    result = _without_imu(robot, "stands; drives when the stick is let go and pushed again")
    # Heard again while the stick is still held: nothing moves before it is let go.
    robot.imu.cut_after = None
    robot.run(FAULT_AT_US + 520_000)
    must(_fastest_rpm(robot) < STANDS_RPM, f"the wheels turn with {_fastest_rpm(robot)} rpm before the stick is let go")
    robot.stick(0.0)
    robot.run(FAULT_AT_US + 560_000)
    robot.stick(0.5)
    robot.run(FAULT_AT_US + 760_000)
    must(abs(robot.world.state(0)[0]) > 20, "it does not drive after the stick was let go and pushed again")
    must(not robot.resets, "it was reset")
    return result


def _fastest_rpm(robot):
    return max(abs(robot.world.state(motor)[0]) for motor in range(4))


def _without_remote(robot, note):
    """The wheels stand in time; a second after the loss the robot is disarmed."""
    result = _stands(robot, REMOTE_LOST_US + STOP_US, DISARMED_US, note)
    zero = robot.zero_after(FAULT_AT_US)
    must(zero is not None and zero < REMOTE_LOST_US + BRAKING_US, f"no zeros after {zero} us")
    rests(robot, FAULT_AT_US + zero + 1, FAULT_AT_US + DISARMED_US)
    return result


def _without_imu(robot, note):
    return _stands(robot, STOP_US, 450_000, note)


def _stands(robot, limit_us, end_us, note):
    """The wheels stand in time, and stay there."""
    turning = []

    def look():
        if _fastest_rpm(robot) >= STANDS_RPM:
            turning.append(robot.clock.us())

    for us in range(0, end_us, LOOK_US):
        robot.at(FAULT_AT_US + us, look)
    robot.run(FAULT_AT_US + end_us)
    stands_us = turning[-1] + LOOK_US - FAULT_AT_US
    must(stands_us < limit_us, f"the wheels turn {stands_us:.0f} us after the loss")
    must(not robot.resets, "it was reset")
    return {"zero_us": stands_us, "stale": len(robot.stale(FAULT_AT_US)), "note": note}


@row("F59", "imu", needs="remote")
def imu_garbage(robot):
    """A byte of each frame of the IMU is inverted: no checksum holds."""
    driving(robot)
    robot.imu.spoil = lambda place, byte: byte ^ 0xFF if place == 40 else byte
    return _without_imu(robot, "stands")


@row("F63", "imu", needs="remote")
def imu_frozen(robot):
    """The IMU repeats one frame: its time stands."""
    driving(robot)
    robot.imu.frozen = frame(200)
    return _without_imu(robot, "stands")


# Of the board's firmware/boards/pilot: the gains of a robot of 20 kg, and the least that a PC may set.
USUAL_KP, LEAST_KP = 1.92, 0.2
NONSENSE = (b"wheel_kp=400", b"wheel_kp=nan", b"wheel_kp=-1", b"wheel_ki=1e9", b"arm=1", b"wheel_kq=1", b"=", b"wheel_kp", b"\xff" * 60)


def _curves(robot, taken, refused):
    """Speed and gains, when the program says that it took and refused this many lines."""
    curves = robot.pc.curves()
    must(len(curves) == 5, f"{len(curves)} curves")
    must(curves[3:] == (taken, refused), f"{curves[3]} lines taken, {curves[4]} refused")
    return curves[:3]


@row("-", "fresh", needs="debug port")
def gains_set(robot):
    """A PC sets the least gain of the wheels before the robot is armed, and the usual one while it drives."""
    robot.at(20_000, lambda: robot.pc.say(b"wheel_kp=%.3f\nwheel_ki=0\n" % LEAST_KP))
    robot.run(ARM_AT_US)
    must(not robot.driven(), "a line of the PC moves it")
    robot.run(FAULT_AT_US)
    soft, kp, ki = _curves(robot, 2, 0)
    must(abs(kp - LEAST_KP) < 1e-3 and ki == 0, f"gains of {kp} and {ki}")
    must(robot.driven(FAULT_AT_US - 10_000), "it does not drive")
    robot.pc.say(b"wheel_kp=%.3f\nwheel_ki=2.4\n" % USUAL_KP)
    robot.run(FAULT_AT_US + 150_000)
    stiff, kp, _ = _curves(robot, 4, 0)
    must(abs(kp - USUAL_KP) < 1e-3, f"a gain of {kp}")
    # Half a stick is 0.75 m/s, 94 rpm of a wheel of 76 mm.
    must(0 < soft < 40 and 75 < stiff < 115, f"{soft} rpm with the least gain, {stiff} rpm with the usual one")
    must(abs(stiff - robot.world.state(1)[0]) < 10, f"the curve says {stiff} rpm, the wheel has {robot.world.state(1)[0]} rpm")
    must(not robot.resets, "it was reset")
    return {"zero_us": None, "stale": len(robot.stale()), "note": "the wheels follow them; no line moves the robot"}


@row("-", needs="debug port")
def turn_set(robot):
    """A PC asks the standing robot for a turn, and falls silent: the turn expires after 500 ms."""
    driving(robot)
    robot.stick(0.0)
    robot.run(FAULT_AT_US + 300_000)
    robot.pc.say(b"turn=1\n")
    robot.run(FAULT_AT_US + 600_000)
    # 1 rad/s at 0.38 m from the wheels' axes is 48 rpm of a wheel of 76 mm.
    turning = [abs(robot.world.state(motor)[0]) for motor in range(4)]
    must(all(38 < rpm < 58 for rpm in turning), f"the wheels turn with {turning} rpm")
    robot.run(FAULT_AT_US + 1_100_000)
    standing = [abs(robot.world.state(motor)[0]) for motor in range(4)]
    must(max(standing) < 5, f"the wheels turn with {standing} rpm 800 ms after the line")
    must(not robot.resets, "it was reset")
    return {"zero_us": None, "stale": len(robot.stale()), "note": "turns; stands when the line has expired"}


@row("F59", "fresh", needs="debug port")
def debug_nonsense(robot):
    """A PC sends lines out of range, unknown ones, noise and a turn to a robot at rest: each is counted, and nothing moves."""
    robot.at(0, lambda: robot.ask_to_arm(False))
    robot.at(ARM_AT_US, lambda: robot.ask_to_arm(False))
    robot.at(10_000, lambda: robot.pc.say(b"".join(line + b"\n" for line in NONSENSE)))
    drawn = random.Random(7)
    noise = bytes(byte for byte in drawn.randbytes(600) if byte != 0x0A)
    robot.at(40_000, lambda: robot.pc.say(noise + b"\nturn=1\n"))
    robot.run(120_000)
    must(not robot.driven(), "a line of the PC moves it")
    _, kp, ki = _curves(robot, 1, len(NONSENSE) + 1)
    must(abs(kp - USUAL_KP) < 0.02 and abs(ki - 2.4) < 0.1, f"gains of {kp} and {ki}")
    must(not robot.resets, "it was reset")
    return {"zero_us": robot.commands()[0].us, "stale": 0, "note": "each line is counted; at rest"}
