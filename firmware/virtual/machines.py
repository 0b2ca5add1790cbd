"""The machines of firmware/boards on the virtual board: a sentry and a snake robot, in closed loop with their motors and sensors."""
import math

from board.board import Board
from board.chips import Stm32f407, Stm32f427, Stm32h723
from board.host import DISABLE, ENABLE, JOINTS, NONE, REZERO, Host, gait_deg
from board.imu import Imu
from board.remote import MIDDLE, UP, Remote
from board.servo import Servo

ARM_AT_US, DRIVE_AT_US, FAULT_AT_US = 60_000, 140_000, 500_000
CYCLE_US = 1000.0
GIMBAL_KG_M2 = 0.02
# Places of the motors in the world.
WHEELS, YAW, PITCH, FLYWHEELS, LOADER = range(4), 4, 5, (6, 7), 8


class Machine(Board):
    fault_at_us = FAULT_AT_US
    FRESH_US = CYCLE_US + 300

    @classmethod
    def robot(cls, builds, world, _row):
        return cls(builds, world)

    def zero_after(self, since):
        """How long after `since` the first command leaves that rests, and none follows that does not, in us."""
        driven = self.driven(since)
        last = driven[-1].us if driven else since
        rest = [frame.us for frame in self.commands(last) if not self.drives(frame) and frame.us > last]
        return rest[0] - since if rest else None

    def driven(self, since=0.0, until=1e12):
        return [frame for frame in self.commands(since, until) if self.drives(frame)]

    def stale(self, since=0.0):
        """Frames that drive and left later than a cycle after they were in the controller."""
        return [frame for frame in self.driven(since) if frame.us - frame.born > self.FRESH_US]

    def jitter_us(self, since, until, identifier):
        """The largest difference between the distance of two commands of this id on the first line and a cycle."""
        born = [frame.born for frame in self.sent(since, until) if frame.id == identifier]
        return max(abs(after - before - CYCLE_US) for before, after in zip(born, born[1:]))


class Sentry(Machine):
    name, package, chip, has = "sentry", "c-board-embassy", Stm32f407, {"sentry"}

    def __init__(self, builds, world):
        things = [f"motor m3508 {place + 1} can1" for place in WHEELS]
        things += [f"motor gm6020 1 can1 {GIMBAL_KG_M2}", f"motor gm6020 2 can2 {GIMBAL_KG_M2}"]
        things += ["motor m3508 1 can2", "motor m3508 2 can2", "motor m2006 3 can2 0.001"]
        things += ["body 0 1 2 3 20", f"aboard {YAW} {GIMBAL_KG_M2}"]
        super().__init__(self.chip, f"{builds}/{self.name}", world, things)
        self.remote = Remote(self, 3)
        self.start = None
        self.before = None
        self.imu = Imu(self, 1, self.attitude, 921_600, 2_000)
        self.at(ARM_AT_US, lambda: self.ask_to_arm(True))
        self.at(DRIVE_AT_US, self.drive)

    def attitude(self):
        """Of the gimbal in the world, level and ahead at power-on."""
        heading, _, _, turning = self.world.pose()
        yaw, pitch = self.world.degrees(YAW), self.world.degrees(PITCH)
        self.start = self.start or (heading + yaw, pitch)
        yaw_rate = self.world.state(YAW)[0] * 6 + turning
        return {"yaw_deg": heading + yaw - self.start[0], "pitch_deg": pitch - self.start[1],
                "yaw_rate": yaw_rate, "pitch_rate": self.world.state(PITCH)[0] * 6}

    def ask_to_arm(self, is_asked):
        self.remote.switch = UP if is_asked else MIDDLE

    def arm_again(self, at_us):
        def let_go():
            self.ask_to_arm(False)
            self.remote.channels[:] = (0.0,) * 4
            self.remote.left_switch = MIDDLE

        self.at(at_us, let_go)
        self.at(at_us + 150_000, lambda: self.ask_to_arm(True))
        self.at(at_us + 200_000, self.drive)

    def drive(self):
        """Ahead at half speed, and the gimbal to the right."""
        self.remote.channels[:] = (0.0, 0.5, 0.3, 0.0)

    @staticmethod
    def drives(frame):
        return any(frame.data)

    def commands(self, since=0.0, until=1e12):
        return sorted((frame for place in (0, 1) for frame in self.sent(since, until, wire=place)), key=lambda frame: frame.us)


class Snake(Machine):
    name, package, chip, has = "snake", "snake", Stm32f427, {"snake"}
    # After which joint each IMU sits, and on which port.
    IMUS = ((2, 0), (7, 3), (8, 6), (6, 9))

    def __init__(self, builds, world):
        things = [f"joint {place + 1}" for place in range(JOINTS)]
        things += ["motor gm6020 1 can1 0.002", "motor m2006 1 can1 0.002"]
        super().__init__(self.chip, f"{builds}/{self.name}", world, things)
        self.straight = [self.world.degrees(place) for place in range(JOINTS)]
        self.gait_since = None
        self.imus = [Imu(self, port, lambda after=after: {"yaw_deg": self.body_deg(after)}) for port, after in self.IMUS]
        self.servo = Servo(self, 1)
        self.host = Host(self, 3, self.wanted)
        self.at(ARM_AT_US, lambda: self.ask(REZERO))
        self.at(ARM_AT_US + 150_000, self.swing)

    def ask(self, reset):
        self.host.reset = reset

    def swing(self):
        self.ask(NONE)
        self.gait_since = self.clock.us()

    def straighten(self):
        self.gait_since = None

    def angle(self, joint):
        """From where it was straight, in degrees."""
        return self.world.degrees(joint) - self.straight[joint]

    def body_deg(self, after):
        return sum(self.angle(joint) for joint in range(after + 1))

    def gait(self, joint, us):
        return 0.0 if self.gait_since is None else gait_deg(joint, (us - self.gait_since) / 1e6)

    def gripper(self, us):
        """Where the gripper is to be in degrees; the servo has 180 degrees more."""
        return 0 if self.gait_since is None else 30 * math.sin((us - self.gait_since) / 1e6 * math.tau)

    def wanted(self, us):
        """Where the joints are to be when the next command comes, and how fast they have to be for it."""
        angles = [self.gait(joint, us + 50_000) for joint in range(JOINTS)]
        return angles, 20, self.gripper(us)

    def arm_again(self, at_us):
        def let_go():
            self.straighten()
            self.ask(DISABLE)

        self.at(at_us, let_go)
        self.at(at_us + 160_000, lambda: self.ask(NONE))
        self.at(at_us + 320_000, lambda: self.ask(ENABLE))
        self.at(at_us + 480_000, self.swing)

    def enabled(self):
        """How many joints are."""
        return sum(self.world.is_enabled(joint) for joint in range(JOINTS))

    @staticmethod
    def drives(frame):
        """A joint is driven by a target or an enable; the gripper by a word that is not zero. Questions drive nothing."""
        if frame.id > JOINTS:
            return any(frame.data)
        return frame.data[0] == 1 and (frame.data[1] == 0x0A or frame.data[1] == 0x10 and frame.data[5] == 1)

    def commands(self, since=0.0, until=1e12):
        return self.sent(since, until)


class Check(Machine):
    """A program that only uses the drivers: what it sends at USART1 is kept."""

    def __init__(self, builds, world):
        super().__init__(self.chip, f"{builds}/{self.name}", world, [])
        self.heard = bytearray()
        self.serial[1].append(lambda byte, _baud: self.heard.append(byte))

    def say(self, text):
        for place, byte in enumerate(text):
            self.clock.after(self.clock.cycles(1 + 87 * place), lambda byte=byte: self.chip.usarts[1].receive(byte, 115_200))


class CheckEmbassy(Check):
    name, package, chip, has = "check-embassy", "c-board-embassy", Stm32f407, {"check", "echo"}


class CheckHal(Check):
    name, package, chip, has = "check-hal", "c-board-rtic", Stm32f407, {"check"}


class CheckH7(Check):
    name, package, chip, has = "check-h7", "dm-mc02-embassy", Stm32h723, {"check", "echo"}
