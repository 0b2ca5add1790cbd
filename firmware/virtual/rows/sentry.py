"""The sentry: two buses, a gimbal on an IMU, a shooter."""
from board.remote import BAUD, DOWN
from machines import ARM_AT_US, CYCLE_US, FAULT_AT_US, FLYWHEELS, LOADER, PITCH, UP, YAW
from rows.judge import BRAKING_US, LOST_US, REMOTE_LOST_US, START_US, WATCHDOG_US, drives_again, figures, must, rests, row, watched

YAW_COMMAND, SHOOTER_COMMAND = 0x1FF, 0x200
# After so long the sentry without a remote control is disarmed: it brakes before.
DISARMED_US = REMOTE_LOST_US + BRAKING_US


def _driving(robot):
    robot.run(FAULT_AT_US)
    must(robot.driven(FAULT_AT_US - 3 * CYCLE_US), "it does not drive before the fault")


def _at_rest(robot, since, limit_us, note, until):
    robot.run(until)
    zero, stale = robot.zero_after(since), robot.stale(since)
    must(zero is not None and zero < limit_us, f"no zeros after {zero} us")
    must(not stale, f"{len(stale)} stale frames")
    return {"zero_us": zero, "stale": len(stale), "note": note}


def _words(robot, wire, identifier, place, since):
    """The frames of a line and an id whose word at `place` is not zero."""
    frames = [frame for frame in robot.sent(since, wire=wire) if frame.id == identifier]
    return [frame for frame in frames if any(frame.data[2 * place : 2 * place + 2])]


def _shoot(robot, us):
    robot.at(us, lambda: setattr(robot.remote, "left_switch", UP))


@row("-", "fresh", "sentry")
def closed_loop(robot):
    """It is armed, drives and turns its gimbal, follows it, and shoots."""
    busy = watched(robot, FAULT_AT_US)
    robot.run(ARM_AT_US)
    must(robot.commands() and not robot.driven(), "it drives before it was armed")
    first = robot.commands()[0].us
    must(first < START_US, f"the first frame came after {first:.0f} us")
    robot.run(FAULT_AT_US)
    heading, ahead, _, _ = robot.world.pose()
    yaw = robot.attitude()["yaw_deg"]
    must(ahead > 0.5, f"it drives with {ahead:.2f} m/s")
    must(-25 < yaw < -8, f"its gimbal looks to {yaw:.1f} degrees")
    must(robot.pins and robot.pins[-1][1:] == ("PH12", 0), "its lamps do not say that it is armed")
    _shoot(robot, FAULT_AT_US)
    robot.at(FAULT_AT_US, lambda: robot.remote.channels.__setitem__(slice(None), (0.0,) * 4))
    robot.run(FAULT_AT_US + 350_000)
    wheels = [robot.world.state(place)[0] for place in FLYWHEELS]
    loader = robot.world.state(LOADER)[0]
    must(min(abs(wheels[0]), abs(wheels[1])) > 190 and wheels[0] * wheels[1] < 0, f"friction wheels: {wheels} rpm")
    must(50 < loader < 70, f"the loader turns with {loader:.1f} rpm")
    heading, _, _, _ = robot.world.pose()
    off = abs(heading - robot.attitude()["yaw_deg"])
    must(off < 12, f"the chassis is {off:.1f} degrees off its gimbal")
    must(not robot.stale() and not robot.resets, "stale frames, or a reset")
    jitter_us = robot.jitter_us(FAULT_AT_US - 50_000, FAULT_AT_US, YAW_COMMAND)
    must(jitter_us < CYCLE_US / 4, f"the cycle is {jitter_us:.0f} us off")
    return {
        "zero_us": first, "stale": 0, "note": "drives, follows its gimbal, shoots",
        "figures": figures(busy, jitter_us),
    }


@row("F41", "fresh", "sentry")
def armed_with_a_switch(robot):
    """The right switch is turned to the top while the left one is at the top, then while it is at the bottom: neither arms."""
    robot.remote.left_switch = UP
    robot.run(300_000)
    must(robot.commands() and not robot.driven(), "it was armed with the trigger held")
    robot.ask_to_arm(False)
    robot.remote.channels[:], robot.remote.left_switch = (0.0,) * 4, DOWN
    robot.at(450_000, lambda: robot.ask_to_arm(True))
    robot.run(600_000)
    must(not robot.driven(), "it was armed with the chassis to spin")
    robot.arm_again(600_000)
    robot.run(950_000)
    must(robot.driven(900_000), "it does not drive after the left switch was turned to its middle")
    return {"zero_us": robot.commands()[0].us, "stale": 0, "note": "arming needs the left switch in its middle"}


@row("F21", needs="sentry")
def short_jam(robot):
    """The loader is blocked for 200 ms while it feeds: it turns back, and feeds on."""
    _shoot(robot, FAULT_AT_US)
    robot.run(FAULT_AT_US + 300_000)
    jam = FAULT_AT_US + 300_000
    robot.world.fault("blocked", LOADER, jam, jam + 200_000)
    turned_back = []
    for place in range(40):
        robot.at(jam + place * 10_000, lambda: turned_back.append(robot.world.state(LOADER)[2] < -100))
    robot.run(jam + 450_000)
    must(any(turned_back), "the loader does not turn back")
    must(robot.world.state(LOADER)[0] > 50, "the loader does not feed on")
    return {"zero_us": None, "stale": len(robot.stale(jam)), "note": "turns back, feeds on"}


@row("F21", needs="sentry")
def long_jam(robot):
    """The loader is blocked for good: two tries, then it rests, and the friction wheels go on."""
    _shoot(robot, FAULT_AT_US)
    jam = FAULT_AT_US + 300_000
    robot.run(jam)
    robot.world.fault("blocked", LOADER, jam, jam + 1_500_000)
    robot.run(jam + 1_300_000)
    words = _words(robot, 1, SHOOTER_COMMAND, 2, jam)
    zero = words[-1].us - jam
    must(zero < 1_200_000, f"the loader goes on, {zero / 1000:.0f} ms")
    must(abs(robot.world.state(FLYWHEELS[0])[0]) > 190, "the friction wheels do not go on")
    return {"zero_us": zero, "stale": len(robot.stale(jam)), "note": "two tries, then the loader rests"}


@row("F58", needs="sentry")
def gimbal_imu_cut(robot):
    """The line of the IMU is cut in the middle of a frame: both axes rest, and the chassis drives on."""
    _driving(robot)
    robot.imu.cut_after = 40
    robot.run(FAULT_AT_US + 100_000)
    yaw, pitch = (_words(robot, wire, YAW_COMMAND, place, FAULT_AT_US + 26_000) for wire, place in ((0, 0), (1, 1)))
    must(not yaw and not pitch, f"{len(yaw)} and {len(pitch)} words drive the gimbal by an IMU that is dead")
    driven = _words(robot, 0, YAW_COMMAND, 0, FAULT_AT_US)
    return {"zero_us": driven[-1].us - FAULT_AT_US, "stale": len(robot.stale(FAULT_AT_US)), "note": "the gimbal rests; the chassis drives on"}


@row("F63", needs="sentry")
def gimbal_imu_frozen(robot):
    """The IMU repeats one frame: as cut."""
    _driving(robot)
    robot.imu.frozen = robot.imu.frame_of(400)
    robot.run(FAULT_AT_US + 100_000)
    must(not _words(robot, 0, YAW_COMMAND, 0, FAULT_AT_US + 26_000), "the gimbal is driven by an IMU that is frozen")
    driven = _words(robot, 0, YAW_COMMAND, 0, FAULT_AT_US)
    return {"zero_us": driven[-1].us - FAULT_AT_US, "stale": len(robot.stale(FAULT_AT_US)), "note": "the gimbal rests; the chassis drives on"}


@row("F59", needs="sentry")
def gimbal_imu_noise(robot):
    """A byte of each second frame of the IMU is inverted: half of its frames count."""
    _driving(robot)
    count = [0]

    def spoil(place, byte):
        count[0] += place == 0
        return byte ^ 0xFF if place == 40 and count[0] % 2 else byte

    robot.imu.spoil = spoil
    robot.run(FAULT_AT_US + 100_000)
    must(_words(robot, 0, YAW_COMMAND, 0, FAULT_AT_US + 90_000), "the gimbal rests")
    return {"zero_us": None, "stale": len(robot.stale(FAULT_AT_US)), "note": "goes on"}


@row("F54", needs="sentry")
def second_plug(robot):
    """The plug of the second bus is out for 150 ms: both buses rest, and nothing old leaves when it is back."""
    _driving(robot)
    robot.wires[1].pull()
    back = FAULT_AT_US + 150_000
    robot.run(back)
    robot.wires[1].plug()
    first = [frame for frame in robot.driven(FAULT_AT_US, back)]
    zero = first[-1].us - FAULT_AT_US
    must(zero < 103_000, f"the first bus is driven for {zero:.0f} us")
    robot.run(back + 50_000)
    must(not robot.driven(back), "it drives though nobody armed it again")
    return {"zero_us": zero, "stale": len(robot.stale(FAULT_AT_US)), "note": "the first bus rests as well"}


@row("F24", needs="sentry")
def flywheel_silent(robot):
    """A friction wheel is silent for good: it is lost after 100 ms, and then both buses rest."""
    _driving(robot)
    robot.world.fault("silent", FLYWHEELS[0], FAULT_AT_US, FAULT_AT_US + 400_000)
    return _at_rest(robot, FAULT_AT_US, 103_000, "all rest until armed again", FAULT_AT_US + 200_000)


@row("F58", needs="sentry")
def sentry_remote_cut(robot):
    """The line of the remote control, which DMA reads, is cut in the middle of a frame."""
    _driving(robot)
    robot.remote.cut_after = 7
    robot.run(FAULT_AT_US + REMOTE_LOST_US + 500_000)
    _, ahead, _, _ = robot.world.pose()
    must(abs(ahead) < 0.05, f"it drives with {ahead:.2f} m/s half a second after the loss")
    return _at_rest(robot, FAULT_AT_US, DISARMED_US, "stands, is disarmed a second later, until armed again", FAULT_AT_US + 1_200_000)


@row("F59", needs="sentry")
def sentry_remote_storm(robot):
    """The bytes of the remote control come at twice its rate: the USART reports framing errors, and DMA starts again each time."""
    _driving(robot)
    robot.remote.baud = 200_000
    heard = FAULT_AT_US + 1_200_000
    result = _at_rest(robot, FAULT_AT_US, DISARMED_US, "rests when heard again; drives again when armed again", heard)
    robot.remote.baud = BAUD
    robot.run(heard + 50_000)
    rests(robot, heard, heard + 50_000)
    drives_again(robot, heard + 50_000)
    return result


@row("F59", needs="sentry")
def sentry_remote_flaw(robot):
    """Three bytes of the remote control have a framing error; then the switch is turned away."""
    _driving(robot)
    for place, flaw in enumerate((0, 8, 17)):
        robot.at(FAULT_AT_US + place * 30_000, lambda flaw=flaw: setattr(robot.remote, "flaw", flaw))
    away = FAULT_AT_US + 110_000
    robot.run(away)
    must(robot.driven(away - 10_000), "it does not drive any more")
    must(robot.remote.flaw is None, "no byte had an error")
    robot.ask_to_arm(False)
    result = _at_rest(robot, away, 40_000, "goes on; rests when the switch is turned away", away + 100_000)
    rests(robot, away + 50_000, away + 100_000)
    drives_again(robot, away + 100_000)
    return result


@row("F27", needs="sentry")
def sentry_dead_loop(robot):
    """All tasks stand: the watchdog resets, both buses show zeros, nothing arms by itself."""
    _driving(robot)
    robot.core.hang(None)
    result = _at_rest(robot, FAULT_AT_US, WATCHDOG_US + CYCLE_US + START_US, "reset by the watchdog", FAULT_AT_US + 150_000)
    must(len(robot.resets) == 1 and robot.resets[0][1] == "watchdog", f"resets: {robot.resets}")
    return result


@row("F27", needs="sentry")
def sentry_brown_out(robot):
    """The supply dips while it drives; after the reset it is armed again, and drives."""
    _driving(robot)
    robot.reset("brown-out")
    result = _at_rest(robot, FAULT_AT_US, START_US, "at rest until armed again", FAULT_AT_US + 100_000)
    robot.arm_again(FAULT_AT_US + 100_000)
    robot.run(FAULT_AT_US + 420_000)
    must(robot.driven(FAULT_AT_US + 400_000), "it does not drive after it was armed again")
    return result
