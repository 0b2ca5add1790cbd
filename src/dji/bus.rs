use super::attach::Budget;
use super::motors::{FIRST_FEEDBACK_ID, IDS, Motors, is_of_others};
use super::outbox::Outbox;
use super::slot::Key;
use super::watch::{Counters, Rejects};
use super::{AnyHandle, AttachError, Config, Feedback, Handle, Model, attach, watch};
use crate::frame::CanFrame;
use crate::motor::{BusLoad, Devices, Ingest, MotorName, Timeouts, Visitor};
use crate::time::{Duration, Instant, Tick, TimeStep};
use core::marker::PhantomData;

/// The motors of one CAN bus, their loops, and the frames for them.
///
/// The bus owns the motors; [`attach`](Self::attach) returns a `Copy` handle for each. A bus can be a `static`. `N` is its capacity: the
/// protocol's 11 unless a [sized](Self::sized) bus saves memory. A motor takes 296 bytes on a Cortex-M.
///
/// # Examples
/// ```
/// use drivetrain::dji::{Bus, Config, M3508};
/// use drivetrain::frame::CanFrame;
/// use drivetrain::time::{Instant, Tick};
/// use drivetrain::units::Current;
///
/// let mut bus = Bus::new();
/// let wheel = bus.attach(Config::<M3508>::new(1))?;
/// let rest = CanFrame::standard(0x201, [0x0E, 0x16, 0, 0, 0xFF, 0xFD, 0x21, 0]).ok_or("not an 11-bit id")?;
///
/// let mut sent = None;
/// for millis in 1..=50 {
///     let now = Instant::from_micros(1_000 * millis);
///     bus.ingest(&rest, now);
///     if millis == 1 {
///         bus.arm(now)?; // the output range opens from here, in 0.2 s
///     }
///     bus.set_current(wheel, Current::from_amperes(1.0))?;
///     bus.update(Tick::new(now, 0.001));
///     while let Some(frame) = bus.next_frame() {
///         sent = Some(frame); // to the driver
///     }
/// }
/// let frame = sent.ok_or("nothing to send")?;
/// assert_eq!(format!("{frame:?}"), "200 [8] 03 33 00 00 00 00 00 00"); // 819 of 16384 = 1 A of 20 A
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// Takes 3552 bytes on a Cortex-M4F, with its 11 places (`docs/figures.md`).
#[derive(Debug)]
// The motors first: their addresses then need no offset.
#[repr(C)]
pub struct Bus<B = (), const N: usize = IDS> {
    pub(super) motors: Motors<N>,
    pub(super) outbox: Outbox,
    pub(super) budget: Budget,
    rejects: Rejects,
    brand: PhantomData<fn() -> B>,
}

impl Bus {
    /// Makes a bus without motors.
    #[must_use]
    pub const fn new() -> Self {
        Self::branded()
    }
}

impl<B> Bus<B> {
    /// Makes a bus without motors, with handles that fit only a bus of the same brand.
    ///
    /// # Examples
    /// ```compile_fail,E0277
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// struct Left;
    /// struct Right;
    /// let mut left = Bus::<Left>::branded();
    /// let right = Bus::<Right>::branded();
    /// let wheel = left.attach(Config::<M3508>::new(1)).expect("a free id");
    /// right.state(wheel); // no `AnyHandle<Right>` from `Handle<M3508, Left>`
    /// ```
    #[must_use]
    pub const fn branded() -> Self {
        Self::sized()
    }
}

impl<B, const N: usize> Bus<B, N> {
    /// Makes a bus without motors and with a capacity of `N`, 1 to 11. Another number does not compile.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// let mut bus: Bus<(), 2> = Bus::sized();
    /// bus.attach_all([3, 7].map(Config::<M3508>::new))?;
    /// let third = bus.attach(Config::<M3508>::new(1)).map_err(|error| error.to_string());
    /// assert_eq!(third.err().as_deref(), Some("M3508 #1: the bus has room for 2 motors; Bus<_, 3> has more"));
    /// # Ok::<(), drivetrain::dji::AttachError>(())
    /// ```
    /// ```compile_fail,E0080
    /// let bus: drivetrain::dji::Bus<(), 12> = drivetrain::dji::Bus::sized();
    /// ```
    #[must_use]
    pub const fn sized() -> Self {
        const { assert!(N >= 1 && N <= IDS, "a bus has 1 to 11 motors") };
        Self {
            motors: Motors::NONE,
            outbox: Outbox::new(),
            budget: Budget::new(),
            rejects: Rejects::NONE,
            brand: PhantomData,
        }
    }

    /// Sets the ages at which feedback and commands count as lost.
    #[must_use]
    pub const fn with_timeouts(mut self, timeouts: Timeouts) -> Self {
        self.motors.guard.set_timeouts(timeouts);
        self
    }

    /// Sets the period at which a command frame of zeros is repeated; 10 ms by default, at most 10 s.
    #[must_use]
    pub const fn with_keep_alive(mut self, period: Duration) -> Self {
        self.outbox.set_keep_alive(match period.micros_u32() {
            Some(micros) if micros < 10_000_000 => micros,
            _ => 10_000_000,
        });
        self.motors.guard.disturb();
        self
    }

    /// Declares that the driver receives its own frames: a received command frame is then no sign of a second master.
    #[must_use]
    pub const fn with_loopback(mut self) -> Self {
        self.motors.round.echoes = true;
        self
    }

    /// Sets the bit rate, in bits a second, for [`load`](Self::load); 1 000 000 by default.
    #[must_use]
    pub const fn with_bit_rate(mut self, bits_per_s: u32) -> Self {
        self.budget.bit_rate = bits_per_s;
        self
    }

    /// Sets the feedback rate of the ESCs in Hz, as set by RoboMaster Assistant, for [`load`](Self::load); 1000 by default.
    #[must_use]
    pub const fn with_feedback_rate(mut self, hz: u32) -> Self {
        self.motors.round.feedback_hz = hz;
        self
    }

    /// Sets the rate of updates in Hz, for [`load`](Self::load); 1000 by default.
    #[must_use]
    pub const fn with_tick_rate(mut self, hz: u32) -> Self {
        self.budget.tick_hz = hz;
        self
    }

    /// Sets a ceiling for the load: [`attach`](Self::attach) refuses a motor if the worst case would exceed `ceiling`, rounded to whole
    /// percent; 1 is a full bus. By default there is no ceiling. Set rates before, and attach after.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// let mut bus = Bus::new().with_load_ceiling(0.95);
    /// bus.attach_all([1, 2, 3, 4, 5].map(Config::<M3508>::new))?;
    /// let refused = bus.attach(Config::<M3508>::new(6)).map_err(|error| error.to_string());
    /// let why = "M3508 #6: the bus load of up to 108 % is above its ceiling of 95 %; \
    ///     feedback at 839 Hz fits, or a second bus";
    /// assert_eq!(refused.err().as_deref(), Some(why));
    /// # Ok::<(), drivetrain::dji::AttachError>(())
    /// ```
    #[must_use]
    pub const fn with_load_ceiling(mut self, ceiling: f32) -> Self {
        self.budget.set_ceiling(ceiling);
        self
    }

    /// Attaches a motor.
    ///
    /// # Errors
    /// The id is out of range, another motor uses the feedback id or command slot, a parameter of the configuration is not usable, or the
    /// load would exceed the [ceiling](Self::with_load_ceiling). The bus stays as before.
    pub const fn attach<M: Model>(
        &mut self,
        config: Config<M>,
    ) -> Result<Handle<M, B>, AttachError> {
        match attach::attach(
            &mut self.motors,
            &mut self.outbox,
            &self.budget,
            M::FACTS,
            &config.plain,
        ) {
            Ok(key) => Ok(Handle::new(key)),
            Err(error) => Err(error),
        }
    }

    /// Attaches several motors of one model.
    ///
    /// # Errors
    /// The first error; the bus stays as before.
    pub fn attach_all<M: Model, const K: usize>(
        &mut self,
        configs: [Config<M>; K],
    ) -> Result<[Handle<M, B>; K], AttachError> {
        let keys = configs.map(|config| config.plain);
        let keys =
            attach::attach_all(&mut self.motors, &mut self.outbox, &self.budget, M::FACTS, &keys)?;
        Ok(keys.map(Handle::new))
    }

    /// Detaches a motor. Its command slot is sent as zero once more; then the frame stops unless another motor uses the frame.
    pub fn detach(&mut self, motor: impl Into<AnyHandle<B>>) {
        attach::detach(&mut self.motors, &mut self.outbox, motor.into().key());
    }

    /// Iterates over the attached motors, in the order of their feedback ids.
    pub fn motors(&self) -> impl Iterator<Item = (AnyHandle<B>, MotorName)> + '_ {
        self.motors.by_id().filter_map(|(_, index, slot)| {
            let key = Key::new(index, slot.next_generation()?);
            Some((AnyHandle::new(key), slot.name()?))
        })
    }

    /// Returns id and mask of a hardware filter that passes the feedback of all attached motors.
    ///
    /// A frame passes if `frame id & mask == id & mask`. A mask cannot name every set of ids exactly, so a few other frames may pass too.
    /// Without motors, only 0x7FF passes.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// let mut bus = Bus::new();
    /// bus.attach_all([1, 2, 3, 4].map(Config::<M3508>::new))?;
    /// assert_eq!(bus.acceptance_filter(), (0x200, 0x7F8)); // 0x201..=0x204 need three open bits
    /// # Ok::<(), drivetrain::dji::AttachError>(())
    /// ```
    #[must_use]
    pub fn acceptance_filter(&self) -> (u16, u16) {
        attach::acceptance_filter(&self.motors)
    }

    /// Returns the load of the attached motors' feedback and of the command frames in use, if each command frame is sent with every update.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// let mut bus = Bus::new();
    /// bus.attach_all([1, 2, 3, 4].map(Config::<M3508>::new))?;
    /// assert_eq!(bus.load().to_string(), "56 % to 68 %"); // four feedback frames and one command
    /// bus.attach_all([5, 6, 7, 8].map(Config::<M3508>::new))?;
    /// assert_eq!(bus.load().to_string(), "111 % to 135 %");
    /// assert_eq!(bus.with_feedback_rate(500).load().to_string(), "67 % to 81 %");
    /// # Ok::<(), drivetrain::dji::AttachError>(())
    /// ```
    #[must_use]
    pub const fn load(&self) -> BusLoad {
        let (motors, commands) = (self.motors.count(), self.outbox.frames_in_use());
        self.budget.load(motors, self.motors.round.feedback_hz, commands)
    }

    /// Takes a frame received at `now`. Runs in constant time for a frame without an error code. Until the first update, each frame also
    /// checks the age of all feedback.
    ///
    /// A `now` may lie a little ahead of the next update, as from an interrupt. If `now` lies ahead by more than [`Timeouts::late`], the
    /// feedback counts as late, not at once but within twice that time. Only the low 32 bits are kept: an error by a multiple of 71 min 35
    /// s goes undetected.
    // A call would cost a tenth of the function itself.
    ///
    /// Costs 31 instructions on a Cortex-M4F, for a frame of a motor (`docs/figures.md`).
    #[inline(always)]
    pub fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let index = self.motors.slot_of(frame.key().wrapping_sub(FIRST_FEEDBACK_ID) as usize);
        if let Some(slot) = self.motors.slots.get_mut(index) {
            let feedback = Feedback::without_error(frame);
            if feedback.is_some_and(|feedback| slot.receive(feedback, now.stamp())) {
                return Ingest::Taken;
            }
        } else if is_of_others(frame) {
            return Ingest::Unrelated;
        }
        self.ingest_unusual(frame, now)
    }

    // Four words of arguments: with more, the usual path would have to set up a stack.
    #[cold]
    #[inline(never)]
    fn ingest_unusual(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        watch::ingest(&mut self.motors, &self.outbox, &mut self.rejects, frame, now)
    }

    /// Takes a received standard data frame from a driver without an `embedded-can` frame type.
    pub fn ingest_raw(&mut self, id: u16, data: &[u8], now: Instant) -> Ingest {
        match embedded_can::StandardId::new(id).and_then(|id| embedded_can::Frame::new(id, data)) {
            Some(frame) => self.ingest(&frame, now),
            None => Ingest::Unrelated,
        }
    }

    /// Runs every loop once and encodes the commands.
    ///
    /// If an update lies before the arming, or not after the previous update, it sends zeros and relaxes every motor until armed again. A
    /// `dt_s` of zero, below zero, infinite or NaN runs no loop, and keeps the last commands for one update, except those of motors that are
    /// late or relaxed. A second such update in a row, or a late one, sends zeros. Above 20 ms, integrals and derivatives rest for the step.
    ///
    /// Costs 505 instructions on a Cortex-M4F, with 8 speed loops (`docs/figures.md`).
    ///
    /// Costs 777 instructions on a Cortex-M4F, with 8 position and speed loops (`docs/figures.md`).
    pub fn update(&mut self, tick: Tick) {
        let before = self.motors.guard.begin(tick.now());
        let Some(step) = TimeStep::usable(tick.dt_s(), TimeStep::MOTOR_MAX_S) else {
            return watch::end_without_step(&mut self.motors, &mut self.outbox, before);
        };
        let is_quiet = self.motors.guard.is_quiet(before, tick.now());
        if !is_quiet && !watch::apply_due(&mut self.motors, &mut self.outbox, before) {
            return;
        }
        self.check_next();
        let mut rest = self.motors.taken_mut();
        while let [slot, others @ ..] = rest {
            let raw = match slot.update(&step, tick.dt_s()) {
                Some(raw) => raw,
                None => slot.update_carefully(tick.dt_s(), &self.outbox),
            };
            self.outbox.put(slot.place, raw);
            rest = others;
        }
        self.outbox.finish_update();
    }

    /// Checks the next motor in turn.
    #[inline(always)]
    fn check_next(&mut self) {
        let index = self.motors.round.next;
        let Some(slot) = self.motors.slots.get_mut(usize::from(index)) else {
            return watch::check_without_slot(&mut self.motors, &self.outbox);
        };
        self.motors.round.next = index + 1;
        let word = self.outbox.get(slot.place);
        if !slot.is_well(word, self.motors.round.elapsed) {
            watch::check(&mut self.motors, index, word);
        }
    }

    /// Returns the next command frame to send, and removes it from the list.
    ///
    /// Costs 52 instructions on a Cortex-M4F, for the two frames of 8 motors and the end (`docs/figures.md`).
    #[inline]
    pub fn next_frame(&mut self) -> Option<CanFrame> {
        self.outbox.next()
    }

    /// Requeues a frame that was not sent, or was evicted. Returns `false` for a frame of another sender.
    pub fn requeue(&mut self, frame: &CanFrame) -> bool {
        self.outbox.requeue(frame.header())
    }

    /// Returns the counters of the bus.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        Counters {
            bad_length: self.rejects.bad_length,
            bad_field: self.rejects.bad_field,
            unattached: self.rejects.unattached,
            bad_steps: self.motors.bad_steps,
            packed: self.outbox.packed,
            superseded: self.outbox.superseded,
        }
    }
}

/// A single device needs no search: each call goes straight to the bus.
impl<B, const N: usize> Devices for Bus<B, N> {
    #[inline]
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }

    #[inline]
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        Self::ingest(self, frame, now)
    }

    #[inline]
    fn update(&mut self, tick: Tick) {
        Self::update(self, tick);
    }

    #[inline]
    fn next_frame(&mut self, _: u32) -> Option<CanFrame> {
        Self::next_frame(self)
    }
}
