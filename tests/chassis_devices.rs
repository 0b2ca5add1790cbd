//! A chassis whose wheels are motors of several devices: two buses, two families, motors of one's own.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::chassis::{Chassis, ChassisLimits, ChassisStatus, Mecanum, MecanumWheels};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::geometry::{Heading, Twist, Vec2};
use drivetrain::motor::{
    Actuator, AngleDrive, Capabilities, Capability, Claim, Condition, Devices, DriveProtocol,
    HealthConfig, Ingest, MotorName, OneOf, Order, Reaction, Target, TargetError, VelocityDrive,
};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Controller, Fault, Line, MotorConfig, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{Frame, Id, StandardId};
use proptest::prelude::*;

const WHEEL_RADIUS_M: f32 = 0.1;
const FRONT_LEFT_M: Vec2 = Vec2::new(0.2, 0.2);
const SPEED: PidConfig = PidConfig::new(0.5, 1.0, 0.0);
/// The wheels are turned by hand, against their current too.
const BY_HAND: HealthConfig =
    HealthConfig::new().with_reaction(Condition::Runaway, Reaction::Report);

struct Front;
struct Rear;

type Axles = OneOf<Handle<M3508, Front>, Handle<M3508, Rear>>;

fn mecanum() -> Chassis<Mecanum> {
    let mut chassis = Chassis::new(Mecanum::new(WHEEL_RADIUS_M, FRONT_LEFT_M).unwrap());
    chassis.set_limits(ChassisLimits::new().with_acceleration(2.0, 10.0)).unwrap();
    chassis
}

fn at(ms: u32) -> Tick {
    Tick::new(Instant::START + Duration::from_millis(u64::from(ms)), 0.001)
}

fn rad_per_s(value: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(value)
}

/// Feedback of an ESC at `0x200 + id` whose rotor has turned at `rpm` since the start.
fn hear<B>(bus: &mut Bus<B>, id: u8, rpm: i16, now: Instant) {
    let micros = i64::try_from(now.as_micros()).unwrap();
    let counts = (i64::from(rpm) * 8192 * micros / 60_000_000).rem_euclid(8192);
    let [a, b] = u16::try_from(counts).unwrap().to_be_bytes();
    let [c, d] = rpm.to_be_bytes();
    let frame = CanFrame::standard(0x200 + u16::from(id), [a, b, c, d, 0, 0, 30, 0]).unwrap();
    assert_eq!(bus.ingest(&frame, now), Ingest::Taken);
}

fn config(id: u8) -> Config<M3508> {
    Config::<M3508>::new(id).speed_loop(SPEED).with_health(&BY_HAND)
}

/// Four wheels on one bus.
struct OneBus {
    bus: Bus,
    wheels: MecanumWheels<Handle<M3508>>,
    chassis: Chassis<Mecanum>,
}

impl OneBus {
    fn new() -> Self {
        let mut bus = Bus::new();
        let ids = MecanumWheels::from_array([1, 2, 3, 4]);
        let wheels = ids.map(|id| bus.attach(config(id)).unwrap());
        Self { bus, wheels, chassis: mecanum() }
    }

    fn hear(&mut self, rpm: [i16; 4], heard: [bool; 4], now: Instant) {
        for (id, (rpm, _)) in (1..).zip(rpm.into_iter().zip(heard)).filter(|it| it.1.1) {
            hear(&mut self.bus, id, rpm, now);
        }
    }
}

/// The same wheels, front and rear on a bus each, with the ids 1 and 2.
struct TwoBuses {
    front: Bus<Front>,
    rear: Bus<Rear>,
    wheels: MecanumWheels<Axles>,
    chassis: Chassis<Mecanum>,
}

impl TwoBuses {
    fn new() -> Self {
        let (mut front, mut rear) = (Bus::<Front>::branded(), Bus::<Rear>::branded());
        let wheels = MecanumWheels {
            front_left: OneOf::First(front.attach(config(1)).unwrap()),
            front_right: OneOf::First(front.attach(config(2)).unwrap()),
            rear_left: OneOf::Second(rear.attach(config(1)).unwrap()),
            rear_right: OneOf::Second(rear.attach(config(2)).unwrap()),
        };
        Self { front, rear, wheels, chassis: mecanum() }
    }

    fn hear(&mut self, rpm: [i16; 4], heard: [bool; 4], now: Instant) {
        for (id, (rpm, _)) in (1..).zip(rpm.into_iter().zip(heard)).filter(|it| it.1.1) {
            match id {
                1 | 2 => hear(&mut self.front, id, rpm, now),
                _ => hear(&mut self.rear, id - 2, rpm, now),
            }
        }
    }

    fn arm(&mut self, now: Instant) {
        self.front.arm(now).unwrap();
        self.rear.arm(now).unwrap();
    }

    /// Drives the chassis with one call.
    fn drive(&mut self, tick: Tick) -> MecanumWheels<AngularVelocity> {
        self.chassis.drive(&mut (&mut self.front, &mut self.rear), self.wheels, tick)
    }

    fn update(&mut self, tick: Tick) {
        self.front.update(tick);
        self.rear.update(tick);
    }

    /// The current that each ESC is sent.
    fn amperes(&self) -> [f32; 4] {
        let current = |wheel| match wheel {
            OneOf::First(motor) => self.front.commanded_current(motor),
            OneOf::Second(motor) => self.rear.commanded_current(motor),
        };
        self.wheels.map(|wheel| current(wheel).unwrap().as_amperes()).into_array()
    }
}

fn bits(wheels: MecanumWheels<AngularVelocity>) -> [u32; 4] {
    wheels.map(|wheel| wheel.as_rad_per_s().to_bits()).into_array()
}

/// What a chassis is told for 40 ms, and how fast its wheels turn.
#[derive(Debug, Clone, Copy)]
struct Step {
    twist: [f32; 3],
    heading: Option<f32>,
    rpm: [i16; 4],
}

fn step() -> impl Strategy<Value = Step> {
    let twist = [-2.0_f32..2.0, -2.0_f32..2.0, -8.0_f32..8.0];
    let heading = prop::option::of(-200.0_f32..200.0);
    let rpm = prop::array::uniform4(-9000_i16..9000);
    (twist, heading, rpm).prop_map(|(twist, heading, rpm)| Step { twist, heading, rpm })
}

fn command(chassis: &mut Chassis<Mecanum>, step: Step) {
    let [vx, vy, wz] = step.twist;
    match step.heading {
        Some(degrees) => {
            let heading = Heading::new(Angle::from_degrees(degrees));
            chassis.set_world(Twist::new(vx, vy, wz), heading);
        }
        None => chassis.set_body(Twist::new(vx, vy, wz)),
    }
}

proptest! {
    /// A wheel that is silent in one step is late, in three steps it is offline.
    #[test]
    fn on_two_buses_a_chassis_does_what_it_does_on_one_bit_for_bit(
        steps in prop::collection::vec(step(), 14),
        silent in prop::array::uniform4(prop::option::of((3..11_usize, 1..4_usize))),
        disarmed in prop::option::of(5..14_usize),
    ) {
        let (mut one, mut two) = (OneBus::new(), TwoBuses::new());
        for ms in 1..=40 * 14 {
            let (tick, index) = (at(ms), (ms - 1) as usize / 40);
            let (now, step) = (tick.now(), steps[index]);
            let heard = silent
                .map(|gap| gap.is_none_or(|(from, steps)| !(from..from + steps).contains(&index)));
            one.hear(step.rpm, heard, now);
            two.hear(step.rpm, heard, now);
            if ms == 20 {
                one.bus.arm(now).unwrap();
                two.arm(now);
            }
            if disarmed == Some(index) {
                one.bus.disarm();
                two.front.disarm();
                two.rear.disarm();
            }
            command(&mut one.chassis, step);
            command(&mut two.chassis, step);
            let wanted = one.chassis.drive(&mut one.bus, one.wheels, tick);
            let told = two.drive(tick);
            prop_assert_eq!(bits(told), bits(wanted));
            prop_assert_eq!(&two.chassis, &one.chassis);
            one.bus.update(tick);
            two.update(tick);
        }
    }
}

/// Drives until the robot moves, then the rear bus falls silent for a second.
fn with_a_lost_bus(mut each: impl FnMut(&mut TwoBuses, u32)) {
    let mut robot = TwoBuses::new();
    for ms in 1..=1_500 {
        let tick = at(ms);
        robot.hear([300; 4], [true, true, ms <= 500, ms <= 500], tick.now());
        if ms == 20 {
            robot.arm(tick.now());
        }
        robot.chassis.set_body(Twist::new(0.5, 0.0, 0.0));
        robot.drive(tick);
        robot.update(tick);
        each(&mut robot, ms);
    }
}

#[test]
fn the_wheels_of_a_lost_bus_refuse_and_the_others_are_driven() {
    let mut refusals = Vec::new();
    with_a_lost_bus(|robot, ms| {
        let ChassisStatus { refused, refusal, lost_wheels, motion_known, .. } =
            *robot.chassis.status();
        if ms > 20 {
            refusals.push((refused, refusal, lost_wheels, motion_known));
        }
        if ms == 1_500 {
            let [front_left, front_right, rear_left, rear_right] = robot.amperes();
            assert!(front_left > 0.5 && front_right > 0.5, "{:?}", robot.amperes());
            assert!(rear_left == 0.0 && rear_right == 0.0, "{:?}", robot.amperes());
        }
    });
    refusals.dedup();
    let lost = |why| (2, Some(why), 2, false);
    assert_eq!(
        refusals,
        [(0, None, 0, true), lost(TargetError::NoFeedback), lost(TargetError::Relaxed)]
    );
}

/// The rule of one bus: only a chassis whose motors all refuse starts from the measured motion.
#[test]
fn a_lost_bus_leaves_the_ramp_alone_and_the_last_one_starts_it_over() {
    let mut reference = Vec::new();
    with_a_lost_bus(|robot, ms| {
        if ms == 1_000 {
            robot.front.disarm();
        }
        if [999, 1_001].contains(&ms) {
            reference.push((robot.chassis.reference().vx_m_s, robot.chassis.status().refused));
        }
    });
    // With two wheels the motion is unknown, and counts as none.
    assert_eq!(reference, [(0.5, 2), (0.0, 4)]);
}

/// The first wheel that refuses tells why, whichever device it belongs to; those after it are set all the same.
#[test]
fn the_first_error_over_all_devices_is_told_and_the_later_wheels_are_driven() {
    let mut robot = TwoBuses::new();
    for ms in 1..=200 {
        let tick = at(ms);
        robot.hear([0; 4], [true; 4], tick.now());
        if ms == 20 {
            robot.rear.arm(tick.now()).unwrap();
        }
        robot.chassis.set_body(Twist::new(0.5, 0.0, 0.0));
        robot.drive(tick);
        robot.update(tick);
    }
    let status = robot.chassis.status();
    assert_eq!((status.refused, status.refusal), (2, Some(TargetError::Disarmed)));
    let amperes = robot.amperes();
    assert!(amperes[0] == 0.0 && amperes[2] > 0.5 && amperes[3] > 0.5, "{amperes:?}");
    let MecanumWheels { front_left, rear_left, .. } = robot.wheels;
    let targets = [(front_left, rad_per_s(1.0)), (rear_left, rad_per_s(f32::NAN))];
    let mut both = (&mut robot.front, &mut robot.rear);
    assert_eq!(both.drive(targets), Err(TargetError::Disarmed));
    let [first, second] = targets;
    assert_eq!(both.drive([second, first]), Err(TargetError::NotFinite));
}

/// A hub motor of one's own: its frames carry rad/s as `f32`, and its own controller follows them.
struct Hub {
    id: u8,
    rad_per_s: f32,
}

impl Hub {
    fn new(id: u8) -> Actuator<Self> {
        Actuator::new(Self { id, rad_per_s: 0.0 })
    }

    fn command(&self, rad_per_s: f32) -> CanFrame {
        CanFrame::of(standard(0x300 + u16::from(self.id)), rad_per_s.to_le_bytes())
    }

    fn feedback(id: u8, rad_per_s: f32) -> CanFrame {
        CanFrame::of(standard(0x320 + u16::from(id)), rad_per_s.to_le_bytes())
    }
}

fn standard(raw: u16) -> Id {
    StandardId::new(raw).unwrap().into()
}

impl DriveProtocol for Hub {
    fn name(&self) -> MotorName {
        MotorName::new("hub", self.id)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let id = u16::from(self.id);
        [
            Claim::command(standard(0x300 + id), self.name()),
            Claim::feedback(standard(0x320 + id), self.name()),
        ]
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        self.rad_per_s = f32::from_le_bytes(frame.data().try_into().unwrap());
        Ingest::Taken
    }

    fn velocity(&self) -> AngularVelocity {
        rad_per_s(self.rad_per_s)
    }

    fn rest(&mut self) -> CanFrame {
        self.command(0.0)
    }

    fn control(&mut self, order: Order) -> CanFrame {
        match order.target {
            Target::Velocity(target) => self.command(order.share * target.as_rad_per_s()),
            _ => self.rest(),
        }
    }

    fn reset(&mut self) {}
}

/// Drives 0.5 m/s for a second after arming, with hubs that do at once what they are told; returns what they were told last.
fn drive_hubs<H: Copy, D: Devices + VelocityDrive<H>>(
    device: &mut D,
    wheels: MecanumWheels<H>,
    mut hear: impl FnMut(&mut D, Instant),
) -> (Chassis<Mecanum>, [f32; 4]) {
    let mut chassis = mecanum();
    let mut told = [0.0; 4];
    for ms in 1..=1_000 {
        let tick = at(ms);
        hear(device, tick.now());
        for id in 1..=4 {
            let feedback = Hub::feedback(id, told[usize::from(id) - 1]);
            _ = device.ingest(&feedback, tick.now());
        }
        if ms == 20 {
            device.arm(tick.now()).unwrap();
        }
        chassis.set_body(Twist::new(0.5, 0.0, 0.0));
        chassis.drive(device, wheels, tick);
        device.update(tick);
        while let Some(frame) = device.next_frame(ms) {
            let Id::Standard(id) = frame.id() else { continue };
            if let Some(hub @ 1..=4) = id.as_raw().checked_sub(0x300) {
                told[usize::from(hub) - 1] = f32::from_le_bytes(frame.data().try_into().unwrap());
            }
        }
    }
    (chassis, told)
}

#[test]
fn four_motors_of_ones_own_carry_a_chassis() {
    let mut hubs = [1, 2, 3, 4].map(Hub::new);
    let wheels = MecanumWheels::from_array([(0, ()), (1, ()), (2, ()), (3, ())]);
    let (chassis, told) = drive_hubs(&mut hubs, wheels, |_, _| {});
    assert!(told.iter().all(|speed| (speed - 5.0).abs() < 1e-4), "{told:?}");
    let status = chassis.status();
    assert_eq!((status.refused, status.lost_wheels), (0, 0), "{status:?}");
    assert!((chassis.measured().vx_m_s - 0.5).abs() < 1e-4, "{:?}", chassis.measured());
    assert!(chassis.pose().x_m > 0.3, "{:?}", chassis.pose());
}

/// One CAN bus with two families, as the device of one runner holds them.
#[test]
fn dji_motors_and_motors_of_ones_own_carry_a_chassis_together() {
    let mut bus = Bus::new();
    let wheels = MecanumWheels {
        front_left: OneOf::First(bus.attach(config(1)).unwrap()),
        front_right: OneOf::First(bus.attach(config(2)).unwrap()),
        rear_left: OneOf::Second((0, ())),
        rear_right: OneOf::Second((1, ())),
    };
    let mut device = (bus, [Hub::new(3), Hub::new(4)]);
    let (chassis, told) = drive_hubs(&mut device, wheels, |(bus, _), now| {
        hear(bus, 1, 940, now);
        hear(bus, 2, 940, now);
    });
    assert!(told[2..].iter().all(|speed| (speed - 5.0).abs() < 1e-4), "{told:?}");
    assert_eq!((chassis.status().refused, chassis.status().lost_wheels), (0, 0));
    assert!((chassis.measured().vx_m_s - 0.5).abs() < 1e-2, "{:?}", chassis.measured());
}

/// Motors that remember what they were told.
#[derive(Default)]
struct Told(f32, f32);

impl VelocityDrive<()> for Told {
    fn velocity(&self, (): ()) -> Option<AngularVelocity> {
        Some(rad_per_s(self.0))
    }

    fn capabilities(&self, (): ()) -> Capabilities {
        Capabilities::of(&[Capability::Velocity, Capability::Torque])
    }

    fn set_velocity(&mut self, (): (), target: AngularVelocity) -> Result<(), TargetError> {
        self.0 = target.as_rad_per_s();
        Ok(())
    }
}

impl AngleDrive<()> for Told {
    fn angle(&self, (): ()) -> Option<Angle> {
        Some(Angle::from_radians(self.1))
    }

    fn set_angle(&mut self, (): (), target: Angle) -> Result<(), TargetError> {
        self.1 = target.as_radians();
        Ok(())
    }
}

/// Sets velocity and angle of each motor to a number of its own, and reads them back.
fn reaches<H: Copy, D: VelocityDrive<H> + AngleDrive<H>>(owner: &mut D, motors: &[H]) {
    for (number, motor) in (1_u8..).zip(motors) {
        owner.set_velocity(*motor, rad_per_s(number.into())).unwrap();
        owner.set_angle(*motor, Angle::from_radians(-f32::from(number))).unwrap();
    }
    for (number, motor) in (1_u8..).zip(motors) {
        assert_eq!(owner.velocity(*motor), Some(rad_per_s(number.into())));
        assert_eq!(owner.angle(*motor), Some(Angle::from_radians(-f32::from(number))));
        assert!(owner.capabilities(*motor).has(Capability::Torque));
    }
}

#[test]
fn each_handle_finds_its_motor_in_tuples_arrays_and_both() {
    use OneOf::{First, Fourth, Second, Third};
    let told = Told::default;
    reaches(&mut (told(), told()), &[First(()), Second(())]);
    reaches(&mut (told(), told(), told()), &[First(()), Second(()), Third(())]);
    reaches(&mut (told(), told(), told(), told()), &[First(()), Second(()), Third(()), Fourth(())]);
    reaches(&mut [told(), told(), told()], &[(0, ()), (1, ()), (2, ())]);
    let mut lent = (told(), [told(), told()]);
    let nested = [First(()), Second((0, ())), Second((1, ()))];
    reaches(&mut (&mut lent.0, &mut lent.1), &nested);
}

#[test]
fn an_index_beyond_the_array_names_no_motor() {
    let mut two = [Told::default(), Told::default()];
    assert_eq!(two.velocity((2, ())), None);
    assert_eq!(two.angle((2, ())), None);
    assert_eq!(two.capabilities((2, ())), Capabilities::NONE);
    assert_eq!(two.set_velocity((2, ()), rad_per_s(1.0)), Err(TargetError::Detached));
    assert_eq!(two.set_angle((usize::MAX, ()), Angle::ZERO), Err(TargetError::Detached));
}

type Axle<'w, B> = Runner<Nb<Controller<'w>>, &'w Simulation, Bus<B>>;

fn axle<B>(world: &Simulation, line: Line) -> (Axle<'_, B>, [Handle<M3508, B>; 2]) {
    let mut bus = Bus::branded();
    let motors = [1, 2].map(|id| {
        world.attach(MotorConfig::m3508(id).with_line(line)).unwrap();
        bus.attach(config(id)).unwrap()
    });
    (Runner::new(Nb(world.controller_on(line)), world.clock(), bus), motors)
}

/// Two CAN ports and two runners, each with a grid of its own: the steps of the rear come 0.3 ms after those in front.
#[test]
fn one_call_drives_the_devices_of_two_runners_and_goes_on_when_one_is_lost() {
    let world = Simulation::new(1);
    let (mut front, [front_left, front_right]) = axle::<Front>(&world, Line::Can1);
    let (mut rear, [rear_left, rear_right]) = axle::<Rear>(&world, Line::Can2);
    let wheels = MecanumWheels {
        front_left: OneOf::First(front_left),
        front_right: OneOf::First(front_right),
        rear_left: OneOf::Second(rear_left),
        rear_right: OneOf::Second(rear_right),
    };
    let lost = Instant::from_micros(1_000_000)..Instant::from_micros(9_000_000);
    world.fault(Fault::Unplugged(Line::Can2), lost).unwrap();
    let mut chassis = mecanum();
    let mut before = None;
    let mut steps = [0_u32; 2];
    for count in 0..20_000 {
        world.advance(Duration::from_micros(100));
        front.poll(16);
        rear.poll(16);
        if let Some(tick) = front.due() {
            steps[0] += 1;
            if steps[0] == 20 {
                front.arm(tick).unwrap();
                rear.arm(tick).unwrap();
            }
            chassis.set_body(Twist::new(0.5, 0.0, 0.0));
            chassis.drive(&mut (front.device_mut(), rear.device_mut()), wheels, tick);
            front.tick(tick);
        }
        if let Some(tick) = (count >= 3).then(|| rear.due()).flatten() {
            steps[1] += 1;
            rear.tick(tick);
        }
        if count == 9_990 {
            before = Some((*chassis.status(), chassis.measured().vx_m_s));
        }
    }
    assert_eq!(steps, [2_000, 2_000]);
    let (status, vx_m_s) = before.unwrap();
    assert_eq!((status.refused, status.lost_wheels), (0, 0), "{status:?}");
    assert!((vx_m_s - 0.5).abs() < 0.02, "{vx_m_s}");
    let status = chassis.status();
    assert_eq!((status.refused, status.lost_wheels), (2, 2), "{status:?}");
    let five = Mecanum::new(WHEEL_RADIUS_M, FRONT_LEFT_M)
        .unwrap()
        .inverse(Twist::new(0.5, 0.0, 0.0))
        .front_left;
    let measured = front.device().velocity(front_left).unwrap();
    assert!((measured - five).as_rad_per_s().abs() < 0.2, "{measured:?}");
}
