use super::{BarrelHeat, MAX_FRAME, RefereeMessage};
use crate::time::{Duration, Edge, Instant};
use crate::wire::receiver::Deadline;
use crate::wire::{Counts, Deframer};

/// A buffer energy above this is no reading: a public super-capacitor controller (HKUST, 2024) counts no more either.
const MOST_BUFFER_J: u16 = 300;

/// The same controller switches itself off at a higher limit.
const HIGHEST_LIMIT_W: u16 = 250;

/// A heat limit or a cooling above this is not believed. A bound of this crate: robots have a few hundred.
const HIGHEST_HEAT: u16 = 2_000;

/// Reads the referee system, and returns the valid power limit, buffer energy and barrel heat.
///
/// | received frames | power limit | buffer energy |
/// |---|---|---|
/// | none yet, or none in time | the safe limit, or the last received limit if lower | `None` |
/// | a first frame | the same | `None` |
/// | two frames or more | the lower of the last two | the lower of the last two |
/// | an impossible value | as without the frame | as without the frame |
///
/// So a limit falls with the first frame of a lower value and rises with the second frame of a higher value, and neither silence
/// nor a single frame raises it. Both are only numbers: no message arms a motor, moves a motor, or stops a motor.
///
/// # Examples
/// ```
/// use drivetrain::time::{Duration, Instant};
/// use drivetrain::wire::referee::{Referee, encode};
///
/// let ms = |ms| Instant::START + Duration::from_millis(ms);
/// let state = |limit_w| [3, 1, 200, 0, 200, 0, 40, 0, 100, 0, limit_w, 0, 0b111];
/// let mut referee = Referee::new(45);
/// for (at, limit_w) in [(0, 100), (100, 100), (200, 60)] {
///     let mut frame = [0; 32];
///     let mut received = encode(0x0201, 0, &state(limit_w), &mut frame)?;
///     assert!(referee.read(&mut received, ms(at)).is_some());
/// }
/// assert_eq!(referee.power_limit_w(ms(700)), 60.0);
/// assert_eq!(referee.power_limit_w(ms(701)), 45.0); // 500 ms without a frame
/// assert!(referee.edge(ms(701)).is_some_and(|heard| !heard.began && heard.at == ms(0)));
/// assert!(referee.edge(ms(701)).is_some_and(|silent| silent.began && silent.at == ms(700)));
/// # Ok::<(), drivetrain::wire::EncodeError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Referee {
    decoder: Deframer<RefereeMessage, MAX_FRAME>,
    safe_limit_w: u16,
    highest_limit_w: u16,
    limit_w: LowerOfTwo,
    buffer_j: LowerOfTwo,
    heat_limit: LowerOfTwo,
    cooling_per_s: LowerOfTwo,
    heat_17mm: u16,
}

impl Referee {
    /// Takes the power limit in W during silence: the lowest limit that the rules give the robot.
    ///
    /// A limit above 250 W is ignored. The limit is lost 500 ms after its last frame (five at 10 Hz), the buffer energy after 250
    /// ms: at 160 W with a limit of 80 W, the delay costs 20 J of the buffer.
    #[must_use]
    pub const fn new(safe_limit_w: u16) -> Self {
        Self {
            decoder: Deframer::new(),
            safe_limit_w,
            highest_limit_w: HIGHEST_LIMIT_W,
            limit_w: LowerOfTwo::new(Duration::from_millis(500)),
            buffer_j: LowerOfTwo::new(Duration::from_millis(250)),
            heat_limit: LowerOfTwo::new(Duration::from_millis(500)),
            cooling_per_s: LowerOfTwo::new(Duration::from_millis(500)),
            heat_17mm: 0,
        }
    }

    /// Sets the highest accepted power limit in W. Frames with a higher limit do not count.
    #[must_use]
    pub const fn with_highest_limit_w(self, highest_limit_w: u16) -> Self {
        Self { highest_limit_w, ..self }
    }

    /// Sets the ages at which the power limit and the buffer energy are lost.
    #[must_use]
    pub const fn with_deadlines(self, limit: Duration, buffer: Duration) -> Self {
        Self {
            limit_w: LowerOfTwo::new(limit),
            heat_limit: LowerOfTwo::new(limit),
            cooling_per_s: LowerOfTwo::new(limit),
            buffer_j: LowerOfTwo::new(buffer),
            ..self
        }
    }

    /// Returns the next message of `input`, as [`Deframer::read`] does; `now` is when the bytes arrived.
    #[must_use]
    pub fn read(&mut self, input: &mut &[u8], now: Instant) -> Option<RefereeMessage> {
        let message = self.decoder.read(input)?;
        match message {
            RefereeMessage::Robot {
                chassis_power_limit_w,
                barrel_heat_limit,
                barrel_cooling_per_s,
                ..
            } => {
                self.limit_w.note(chassis_power_limit_w, self.highest_limit_w, now);
                self.heat_limit.note(barrel_heat_limit, HIGHEST_HEAT, now);
                self.cooling_per_s.note(barrel_cooling_per_s, HIGHEST_HEAT, now);
            }
            RefereeMessage::Power { buffer_energy_j, heat_17mm, .. } => {
                self.buffer_j.note(buffer_energy_j, MOST_BUFFER_J, now);
                self.heat_17mm = heat_17mm;
            }
            RefereeMessage::Shot { .. } | RefereeMessage::Raw { .. } => {}
        }
        Some(message)
    }

    /// Discards an unfinished frame; see [`Deframer::abandon`].
    pub fn abandon(&mut self) {
        self.decoder.abandon();
    }

    /// Returns the power limit of the chassis in W.
    #[must_use]
    pub fn power_limit_w(&self, now: Instant) -> f32 {
        let fallback = self.safe_limit_w.min(self.limit_w.latest);
        f32::from(self.limit_w.value(now).unwrap_or(fallback))
    }

    /// Returns the charge of the buffer in J.
    #[must_use]
    pub fn buffer_energy_j(&self, now: Instant) -> Option<f32> {
        self.buffer_j.value(now).map(f32::from)
    }

    /// Returns heat, limit and cooling of the first 17 mm barrel, for [`shooter`](crate::shooter); `None` while one of both messages is
    /// silent, or came once only.
    ///
    /// Limit and cooling are the lower of the last two that were heard, the heat is the last. A limit or a cooling above 2000 is not
    /// believed.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::time::Instant;
    /// use drivetrain::wire::referee::{BarrelHeat, Referee, encode};
    ///
    /// let mut referee = Referee::new(45);
    /// let now = Instant::START;
    /// let state = [3, 1, 200, 0, 200, 0, 40, 0, 100, 0, 80, 0, 0b111]; // cools by 40 in 1 s, 100 at most
    /// let heat = [0, 0, 0, 0, 0, 0, 0, 0, 60, 0, 70, 0, 0, 0]; // heat 70
    /// for (command, data) in [(0x0201, &state[..]), (0x0202, &heat), (0x0201, &state)] {
    ///     let mut frame = [0; 32];
    ///     let mut received = encode(command, 0, data, &mut frame)?;
    ///     assert!(referee.read(&mut received, now).is_some());
    /// }
    /// assert_eq!(referee.heat_17mm(now), None); // each counts from the second frame on
    /// let mut frame = [0; 32];
    /// let mut received = encode(0x0202, 0, &heat, &mut frame)?;
    /// assert!(referee.read(&mut received, now).is_some());
    /// let expected = BarrelHeat { heat: 70, limit: 100, cooling_per_s: 40 };
    /// assert_eq!(referee.heat_17mm(now), Some(expected));
    /// # Ok::<(), drivetrain::wire::EncodeError>(())
    /// ```
    #[must_use]
    pub fn heat_17mm(&self, now: Instant) -> Option<BarrelHeat> {
        // The heat comes in the message of the buffer energy.
        self.buffer_j.value(now)?;
        Some(BarrelHeat {
            heat: self.heat_17mm,
            limit: self.heat_limit.value(now)?,
            cooling_per_s: self.cooling_per_s.value(now)?,
        })
    }

    /// Returns whether an accepted power limit came in time.
    #[must_use]
    pub fn is_live(&self, now: Instant) -> bool {
        self.limit_w.deadline.is_live(now)
    }

    /// Returns the oldest unread edge of the power limit's silence.
    #[must_use]
    pub fn edge(&mut self, now: Instant) -> Option<Edge<&'static str>> {
        self.limit_w.deadline.edge(now)
    }

    /// Returns the counts of frames and of discarded bytes. A header with a wrong CRC-8 is a length error.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.decoder.counts()
    }
}

/// The value agreed on by the last two frames at least.
#[derive(Debug, Clone)]
struct LowerOfTwo {
    previous: u16,
    /// Value of the last frame that counted; the largest number before the first.
    latest: u16,
    is_second: bool,
    deadline: Deadline,
}

impl LowerOfTwo {
    const fn new(limit: Duration) -> Self {
        Self {
            previous: u16::MAX,
            latest: u16::MAX,
            is_second: false,
            deadline: Deadline::new(limit),
        }
    }

    fn note(&mut self, value: u16, most: u16, now: Instant) {
        if value > most {
            return;
        }
        self.is_second = self.deadline.is_live(now);
        (self.previous, self.latest) = (self.latest, value);
        self.deadline.meet(now);
    }

    fn value(&self, now: Instant) -> Option<u16> {
        let holds = self.is_second && self.deadline.is_live(now);
        holds.then_some(self.previous.min(self.latest))
    }
}
