//! A robot with M3508 wheels in speed loops on a simulated bus, and the invariants that hold whatever goes wrong.

use drivetrain::control::PidConfig;
use drivetrain::dji::{self, Bus, Config, Handle, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Link;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Controller, Line, MotorConfig, MotorKey, Sender, Simulation, Transmission};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;

pub(crate) const SPEED: PidConfig = PidConfig::new(0.6, 6.0, 0.0);

pub(crate) fn at_ms(ms: u64) -> Instant {
    Instant::START + Duration::from_millis(ms)
}

/// How many ticks of 1 ms lie between an instant in ms and a later one, begun ones included.
pub(crate) fn ticks_since(ms: u64, later: Instant) -> u64 {
    later.since(at_ms(ms)).as_micros().div_ceil(1_000)
}

pub(crate) fn rpm(rpm: f32) -> AngularVelocity {
    AngularVelocity::from_rpm(rpm)
}

pub(crate) fn feedback(id: u16, angle: u16, rpm: i16) -> CanFrame {
    let ([a, b], [c, d]) = (angle.to_be_bytes(), rpm.to_be_bytes());
    CanFrame::standard(id, [a, b, c, d, 0, 0, 25, 0]).unwrap()
}

/// The four words of a command frame.
pub(crate) fn words(frame: &CanFrame) -> [i16; 4] {
    let [a, b, c, d, e, f, g, h] = *frame.bytes();
    [[a, b], [c, d], [e, f], [g, h]].map(i16::from_be_bytes)
}

/// A motor whose output range opens at once: for the exact words after arming.
pub(crate) fn at_once<M: dji::Model>(id: u8) -> Config<M> {
    Config::new(id).with_opening(Duration::ZERO)
}

/// A bus with motors heard at 1 ms and armed, without a world. Their output ranges open at once.
pub(crate) fn armed<const N: usize>(configs: [Config<M3508>; N]) -> (Bus, [Handle<M3508>; N]) {
    let mut bus = Bus::new();
    let ids = configs.map(|config| 0x200 + u16::from(config.id()));
    let at_once = |config: Config<M3508>| config.with_opening(Duration::ZERO);
    let handles = bus.attach_all(configs.map(at_once)).unwrap();
    for id in ids {
        _ = bus.ingest(&feedback(id, 0, 0), at_ms(1));
    }
    bus.arm(at_ms(1)).unwrap();
    (bus, handles)
}

/// One update; the words of 0x200, when it was sent.
pub(crate) fn step(bus: &mut Bus, ms: u64) -> Option<[i16; 4]> {
    bus.update(Tick::new(at_ms(ms), 0.001));
    let mut sent = None;
    while let Some(frame) = bus.next_frame() {
        sent = (frame.header() == 0x200).then(|| words(&frame)).or(sent);
    }
    sent
}

/// A command frame on the wire.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sent {
    pub(crate) at: Instant,
    pub(crate) words: [i16; 4],
}

pub(crate) struct Rig<'w> {
    pub(crate) world: &'w Simulation,
    pub(crate) keys: Vec<MotorKey>,
    pub(crate) wheels: Vec<Handle<M3508>>,
    pub(crate) runner: Runner<Nb<Controller<'w>>, &'w Simulation, Bus>,
    /// Every 0x200 frame.
    pub(crate) sent: Vec<Sent>,
    /// Frames that were handed back.
    pub(crate) unrelated: Vec<CanFrame>,
    /// Frames that wait in mailboxes may be older than what the library knows: F54.
    pub(crate) trust_mailboxes: bool,
    stale_since: Vec<Option<Instant>>,
}

impl<'w> Rig<'w> {
    pub(crate) fn new(world: &'w Simulation, line: Line, motors: u8) -> Self {
        Self::with(world, line, motors, |config| config)
    }

    pub(crate) fn with(
        world: &'w Simulation,
        line: Line,
        motors: u8,
        config: impl Fn(Config<M3508>) -> Config<M3508>,
    ) -> Self {
        let mut bus = Bus::new();
        let ids = 1..=motors;
        let motor = |id| MotorConfig::m3508(id).with_line(line);
        Self {
            world,
            keys: ids.clone().map(|id| world.attach(motor(id)).unwrap()).collect(),
            wheels: ids
                .map(|id| bus.attach(config(Config::new(id).speed_loop(SPEED))).unwrap())
                .collect(),
            runner: Runner::new(Nb(world.controller_on(line)), world.clock(), bus),
            sent: Vec::new(),
            unrelated: Vec::new(),
            trust_mailboxes: true,
            stale_since: vec![None; usize::from(motors)],
        }
    }

    /// Runs at 200 rpm on every wheel, arming once.
    pub(crate) fn drive(&mut self, ms: u64) {
        let wheels = self.wheels.clone();
        self.run(ms, |bus, _| {
            for wheel in &wheels {
                _ = bus.set_velocity(*wheel, rpm(200.0));
            }
        });
    }

    /// Runs in steps of 100 µs, with `work` before each tick.
    pub(crate) fn run(&mut self, ms: u64, mut work: impl FnMut(&mut Bus, u64)) {
        for _ in 0..10 * ms {
            self.world.advance_with(Duration::from_micros(100), |record| {
                if record.sender == Sender::Controller {
                    check(record, &self.stale_since, self.trust_mailboxes);
                    self.sent.push(Sent { at: record.at, words: words(&record.frame) });
                }
            });
            self.poll_and_tick(&mut work);
        }
    }

    pub(crate) fn poll_and_tick(&mut self, mut work: impl FnMut(&mut Bus, u64)) {
        self.runner.poll_with(16, |frame| self.unrelated.push(*frame));
        let Some(tick) = self.runner.due() else { return };
        if tick.now() < at_ms(50) {
            _ = self.runner.is_armed() || self.runner.arm(tick).is_ok();
        }
        work(self.runner.device_mut(), tick.now().as_micros() / 1_000);
        self.runner.tick(tick);
        for (stale, wheel) in self.stale_since.iter_mut().zip(&self.wheels) {
            let fresh = self.runner.device().link(*wheel) == Some(Link::Online);
            *stale = if fresh { None } else { stale.or(Some(tick.now())) };
        }
        self.add_up();
    }

    /// I6: frames offered = taken + rejects; frames packed = sent + superseded + waiting.
    fn add_up(&mut self) {
        let (s, bus) = (self.runner.statistics(), self.runner.device().counters());
        assert_eq!(s.received, s.taken + s.unrelated + s.malformed);
        assert_eq!(s.offered, s.sent + s.refused + s.send_errors());
        let waiting = (bus.packed + s.evicted).checked_sub(s.sent + s.superseded);
        assert!(waiting.is_some_and(|waiting| waiting <= 1), "{s:?} {bus:?}");
    }

    pub(crate) fn link(&self, wheel: usize) -> Link {
        self.runner.device().link(self.wheels[wheel]).unwrap()
    }

    /// The words of one wheel that were sent in `from..until`, in ms.
    pub(crate) fn words(&self, wheel: usize, from: u64, until: u64) -> Vec<i16> {
        let within = |sent: &&Sent| (at_ms(from)..at_ms(until)).contains(&sent.at);
        self.sent.iter().filter(within).map(|sent| sent.words[wheel]).collect()
    }

    /// When a wheel's word was zero first, after an instant in ms.
    pub(crate) fn first_zero(&self, wheel: usize, after: u64) -> Instant {
        let zero = |sent: &&Sent| sent.at > at_ms(after) && sent.words[wheel] == 0;
        self.sent.iter().find(zero).unwrap().at
    }
}

/// I2, I3 and I4, for every frame.
fn check(record: &Transmission, stale_since: &[Option<Instant>], trust_mailboxes: bool) {
    use embedded_can::Frame;
    let frame = &record.frame;
    assert!(frame.is_data_frame() && frame.length() == 8 && frame.header() == 0x200, "{record}");
    let words = words(frame);
    assert!(words[stale_since.len()..].iter().all(|word| *word == 0), "a slot of nobody: {record}");
    for (word, stale) in words.iter().zip(stale_since) {
        assert!((-16_384..=16_384).contains(word), "{record}");
        let stale = stale.is_some_and(|since| record.at > since + Duration::from_millis(1));
        assert!(!stale || *word == 0 || !trust_mailboxes, "driven without feedback: {record}");
    }
}
