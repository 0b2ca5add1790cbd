use drivetrain::chassis::{Mecanum, MecanumWheels};
use drivetrain::control::PidConfig;
use drivetrain::dji::{self, Gm6020Voltage, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::geometry::{Heading, Twist, World, Vec2};
use drivetrain::motor::{ArmError, ArmingSwitch, Condition, MotorName, SwitchOrder, VelocityDrive};
use drivetrain::runner::{EmergencyStop, Nb, Runner};
use drivetrain::time::{Clock, Edge};
use drivetrain::units::{Angle, AngularVelocity};

const SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0); // A per rad/s, A per rad: 20 kg, see docs/gains.md
const ANGLE: PidConfig = PidConfig::new(15.0, 0.0, 0.0).with_output_limit(4.0); // rad/s per rad, at most 4 rad/s
const RATE: PidConfig = PidConfig::new(1.0, 5.0, 0.0); // V per rad/s, V per rad

static STOP: EmergencyStop = EmergencyStop::new(); // `STOP.set()`, from an interrupt too

trait Pilot {
    fn is_switch_on(&self) -> Option<bool>; // as it stands; `None` while the remote control is not heard
    fn clears_stop(&mut self) -> bool; // on purpose, when what set STOP is over
    fn twist(&self) -> Twist<World>; // m/s and rad/s, in the world's frame
    fn heading(&self) -> Heading; // from the IMU
    fn offer(&mut self, frame: &CanFrame); // a frame that is no motor's
    fn feed_watchdog(&mut self); // a time-out of some ticks: a loop that hangs leaves the motors their last command
    fn report(&mut self, why: ArmError); // "no feedback from M3508 #3"
    fn note(&mut self, change: Edge<Condition, MotorName>); // "M3508 #2: ESC fault began at 10240 us"
}

fn robot(
    can: impl embedded_can::nb::Can,
    clock: impl Clock,
    mut pilot: impl Pilot,
) -> Result<(), Box<dyn core::error::Error>> {
    let mut bus = dji::Bus::new();
    let wheel = |id| dji::Config::<M3508>::new(id).speed_loop(SPEED);
    // The ids as DJI counts them: 1 front right, 2 front left, 3 rear left, 4 rear right.
    let wheels = MecanumWheels {
        front_left: bus.attach(wheel(2))?,
        front_right: bus.attach(wheel(1).reversed())?,
        rear_left: bus.attach(wheel(3))?,
        rear_right: bus.attach(wheel(4).reversed())?,
    };
    let yaw = bus.attach(dji::Config::<Gm6020Voltage>::new(5).position_loop(ANGLE, RATE))?;
    let mecanum = Mecanum::new(0.076, Vec2::new(0.20, 0.18))?; // in m: wheel radius, front left wheel from the centre
    let fastest = AngularVelocity::from_rpm(450.0);
    let mut runner = Runner::new(Nb(can), clock, bus).with_emergency_stop(&STOP);
    let mut switch = ArmingSwitch::new(); // on at power-on, or after a watchdog's reset, it arms nothing
    let mut beat = runner.heartbeat();
    loop {
        runner.poll_with(16, |other| pilot.offer(other)); // bounded; foreign frames are yours
        let Some(tick) = runner.due() else { continue }; // 1 kHz on a grid, overruns counted
        let mut twist = pilot.twist();
        match switch.read(pilot.is_switch_on(), twist == Twist::ZERO, tick) {
            SwitchOrder::Arm => runner.arm(tick).unwrap_or_else(|why| pilot.report(why)),
            SwitchOrder::Keep => {}
            SwitchOrder::Brake => twist = Twist::ZERO, // for a second from when the remote control is lost
            SwitchOrder::Disarm => runner.device_mut().disarm(),
        }
        if pilot.clears_stop() {
            runner.clear_emergency_stop(); // then the switch, off and on, arms
        }
        // Armed means all of them: when one wheel is lost for 100 ms, the others stop as well.
        let wanted = if runner.is_armed() { twist } else { Twist::ZERO };
        let (speeds, _) = mecanum.inverse(wanted.to_body(pilot.heading())).desaturate(fastest);
        _ = runner.device_mut().drive(wheels.zip(speeds).into_array());
        _ = runner.device_mut().set_angle(yaw, Angle::from_degrees(90.0));
        runner.tick(tick); // update, then send
        while let Some(change) = runner.device_mut().next_edge() {
            pilot.note(change);
        }
        if beat != runner.heartbeat() {
            beat = runner.heartbeat();
            pilot.feed_watchdog();
        }
    }
}
