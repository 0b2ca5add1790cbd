use super::can::{Mailboxes, Offer, rank};
use super::chassis::{Chassis, Escs};
use super::esc::Esc;
use super::fault::Faults;
use super::joint::Drive;
use super::line::{Ring, Sender, Transmission, Wire};
use super::motor::{JOINTS, MOTORS, MotorConfig, MotorState};
use super::{Fault, JointConfig, Line, MotorKey, SimError};
use crate::frame::CanFrame;
use crate::time::Duration;
use embedded_can::Frame;

/// The step of the motors and of the chassis.
const STEP_NS: u64 = 100_000;
const STEP_S: f32 = 1e-4;
/// Every so many steps the temperatures move.
const STEPS_A_WARMING: u64 = 10;

/// The next event. At equal times, the order of this list decides.
#[derive(Debug, Clone, Copy)]
enum Event {
    FrameEnd(Line),
    Step,
    Feedback(usize),
    Reply(usize),
    Fault,
    Arbitration(Line),
}

/// The content of a world: a list of future events, and the state changed by them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Engine {
    pub(crate) seed: u64,
    pub(crate) now_ns: u64,
    stepped_ns: u64,
    steps: u64,
    wires: [Wire; 3],
    escs: Escs,
    joints: [Option<Drive>; JOINTS],
    /// Taken places, from the first on.
    esc_count: usize,
    joint_count: usize,
    /// The feedback that is due first, and its ESC.
    feedback: (u64, usize),
    pub(crate) chassis: Option<Chassis>,
    pub(crate) faults: Faults,
    /// Frames that passed during a blocking call.
    pub(crate) unseen: Ring<Transmission, 64>,
}

impl Engine {
    pub(crate) const fn new(seed: u64) -> Self {
        Self {
            seed,
            now_ns: 0,
            stepped_ns: 0,
            steps: 0,
            wires: [Wire::new(Line::Can1), Wire::new(Line::Can2), Wire::new(Line::Can3)],
            escs: [None; MOTORS],
            joints: [None; JOINTS],
            esc_count: 0,
            joint_count: 0,
            feedback: (u64::MAX, 0),
            chassis: None,
            faults: Faults::new(),
            unseen: Ring::new(),
        }
    }

    pub(crate) const fn wire(&self, line: Line) -> &Wire {
        let [can1, can2, can3] = &self.wires;
        match line {
            Line::Can1 => can1,
            Line::Can2 => can2,
            Line::Can3 => can3,
        }
    }

    /// Returns a wire to change, after which a frame may be ready.
    pub(crate) const fn wire_mut(&mut self, line: Line) -> &mut Wire {
        let [can1, can2, can3] = &mut self.wires;
        let wire = match line {
            Line::Can1 => can1,
            Line::Can2 => can2,
            Line::Can3 => can3,
        };
        wire.stirred = true;
        wire
    }

    pub(crate) fn attach(&mut self, config: MotorConfig) -> Result<MotorKey, SimError> {
        let index = self.esc_count;
        let key = MotorKey::new(index).ok_or(SimError::Full)?;
        let esc = Esc::new(config, self.seed, index as u64, self.now_ns);
        let esc = esc.ok_or(SimError::Id { model: config.facts().name, id: config.id })?;
        *self.escs.get_mut(index).ok_or(SimError::Full)? = Some(esc);
        self.esc_count += 1;
        self.feedback = self.next_feedback();
        Ok(key)
    }

    pub(crate) fn attach_joint(&mut self, config: JointConfig) -> Result<MotorKey, SimError> {
        let refused = SimError::Joint { id: config.id };
        let index = self.joint_count;
        let key = MotorKey::of_joint(index).ok_or(refused)?;
        let drive = Drive::new(config, self.seed, index as u64).ok_or(refused)?;
        *self.joints.get_mut(index).ok_or(refused)? = Some(drive);
        self.joint_count += 1;
        Ok(key)
    }

    pub(crate) fn set_latency(&mut self, key: MotorKey, latency: Duration) {
        let joint = key.joint_index().and_then(|index| self.joints.get_mut(index)?.as_mut());
        if let Some(joint) = joint {
            joint.config.latency = latency;
        }
    }

    pub(crate) fn esc_mut(&mut self, key: MotorKey) -> Option<&mut Esc> {
        self.escs.get_mut(key.index())?.as_mut()
    }

    /// Iterates over the attached ESCs.
    fn escs(&self) -> impl Iterator<Item = (usize, &Esc)> {
        let slots = self.escs.iter().take(self.esc_count).enumerate();
        slots.filter_map(|(index, slot)| Some((index, slot.as_ref()?)))
    }

    /// Iterates over the attached joints.
    fn joints(&self) -> impl Iterator<Item = (usize, &Drive)> {
        let slots = self.joints.iter().take(self.joint_count).enumerate();
        slots.filter_map(|(index, slot)| Some((index, slot.as_ref()?)))
    }

    fn mailboxes_mut(&mut self, key: MotorKey) -> Option<&mut Mailboxes> {
        match key.joint_index() {
            Some(joint) => Some(&mut self.joints.get_mut(joint)?.as_mut()?.mailboxes),
            None => Some(&mut self.esc_mut(key)?.mailboxes),
        }
    }

    pub(crate) fn motor(&self, key: MotorKey) -> Option<MotorState> {
        if let Some(joint) = key.joint_index() {
            return Some(self.joints.get(joint)?.as_ref()?.state());
        }
        let esc = self.escs.get(key.index())?.as_ref()?;
        Some(esc.state(self.since_step_s()))
    }

    /// Returns the time since the last step of the motors: below one step.
    fn since_step_s(&self) -> f32 {
        (self.now_ns - self.stepped_ns) as f32 * 1e-9
    }

    /// Runs all events until `limit_ns`, up to and including the next frame.
    pub(crate) fn run_until(&mut self, limit_ns: u64) -> Option<Transmission> {
        loop {
            let (at_ns, event) = self.next_event();
            if at_ns > limit_ns {
                self.now_ns = self.now_ns.max(limit_ns);
                return None;
            }
            self.now_ns = self.now_ns.max(at_ns);
            match event {
                Event::FrameEnd(line) => {
                    if let Some(record) = self.end_frame(line) {
                        return Some(record);
                    }
                }
                Event::Step => self.step(),
                Event::Feedback(index) => self.send_feedback(index),
                Event::Reply(index) => self.send_reply(index),
                Event::Fault => {
                    while let Some((line, frame)) = self.faults.next_of_flood(self.now_ns) {
                        // A foreign node whose queue is full skips a turn.
                        let _full = self.wire_mut(line).foreign.push(frame);
                    }
                }
                Event::Arbitration(line) => self.arbitrate(line),
            }
        }
    }

    fn next_event(&self) -> (u64, Event) {
        let mut next = (u64::MAX, Event::Fault);
        let mut offer = |at_ns: u64, event: Event| {
            if at_ns < next.0 {
                next = (at_ns, event);
            }
        };
        for wire in &self.wires {
            if let Some(end_ns) = wire.flight_end() {
                offer(end_ns, Event::FrameEnd(wire.line));
            }
        }
        offer(self.stepped_ns + STEP_NS, Event::Step);
        let (due_ns, index) = self.feedback;
        offer(due_ns, Event::Feedback(index));
        for (index, joint) in self.joints() {
            if let Some(due_ns) = joint.due() {
                offer(due_ns, Event::Reply(index));
            }
        }
        offer(self.faults.next_event(self.now_ns), Event::Fault);
        for wire in &self.wires {
            let is_connected = || self.faults.is_connected(wire.line, self.now_ns);
            if let Some(idle_ns) = wire.arbitration(is_connected) {
                offer(idle_ns.max(self.now_ns), Event::Arbitration(wire.line));
            }
        }
        next
    }

    fn next_feedback(&self) -> (u64, usize) {
        self.escs().fold((u64::MAX, 0), |next, (index, esc)| match esc.due() {
            Some(due_ns) if due_ns < next.0 => (due_ns, index),
            _ => next,
        })
    }

    /// Moves motors and chassis by one step.
    fn step(&mut self) {
        self.stepped_ns += STEP_NS;
        self.steps += 1;
        if !self.faults.is_empty() {
            self.apply_faults();
        }
        for esc in self.escs.iter_mut().take(self.esc_count).flatten() {
            esc.step_current(self.now_ns, STEP_S);
        }
        for joint in self.joints.iter_mut().take(self.joint_count).flatten() {
            joint.step(STEP_S);
        }
        let ground = self.chassis.as_mut().map(|chassis| chassis.step(&self.escs, STEP_S));
        let warms = self.steps.is_multiple_of(STEPS_A_WARMING);
        let escs = self.escs.iter_mut().take(self.esc_count).flatten();
        for (esc, ground_nm) in escs.zip(ground.unwrap_or_default()) {
            esc.rotor.step_motion(ground_nm, STEP_S);
            if warms {
                esc.rotor.step_temperature(STEP_S * STEPS_A_WARMING as f32);
            }
        }
    }

    /// Gives and removes supplies, and changes mechanics, as the faults say.
    fn apply_faults(&mut self) {
        for (index, slot) in self.escs.iter_mut().enumerate() {
            let (Some(esc), Some(key)) = (slot, MotorKey::new(index)) else { continue };
            esc.set_powered(self.faults.power_loss(key, self.now_ns), self.now_ns);
            esc.rotor.mechanics = self.faults.mechanics(key, self.now_ns);
        }
        for (index, slot) in self.joints.iter_mut().enumerate() {
            let (Some(joint), Some(key)) = (slot, MotorKey::of_joint(index)) else { continue };
            joint.set_powered(self.faults.power_loss(key, self.now_ns).is_none());
        }
        self.feedback = self.next_feedback();
    }

    /// Lets an ESC hand its feedback to its mailboxes.
    fn send_feedback(&mut self, index: usize) {
        let since_step_s = self.since_step_s();
        let (Some(Some(esc)), Some(key)) = (self.escs.get_mut(index), MotorKey::new(index)) else {
            return;
        };
        let tampering = self.faults.tampering(key, self.now_ns);
        let frame = esc.feedback(since_step_s, &tampering);
        let (line, offer) = (esc.config.line, frame.map(|frame| esc.mailboxes.offer(frame)));
        self.feedback = self.next_feedback();
        let wire = self.wire_mut(line);
        if offer.is_some_and(|offer| offer != Offer::Taken) {
            wire.traffic.starved = wire.traffic.starved.saturating_add(1);
        }
    }

    /// Lets a joint hand its answer to its mailboxes.
    fn send_reply(&mut self, index: usize) {
        let silent = MotorKey::of_joint(index).map(Fault::Silent);
        let silent = silent.is_some_and(|fault| self.faults.is_active(fault, self.now_ns));
        let Some(Some(joint)) = self.joints.get_mut(index) else { return };
        joint.reply(silent);
        let line = joint.config.line;
        self.wire_mut(line).stirred = true;
    }

    /// Returns the sender of the pending frame of highest priority on a bus.
    fn winner(&self, line: Line) -> Option<Sender> {
        let wire = self.wire(line);
        let connected = self.faults.is_connected(line, self.now_ns);
        let controller = wire.mailboxes.rank().filter(|_| connected);
        let controller = controller.map(|rank| (rank, Sender::Controller));
        let foreign = wire.foreign.peek().map(|frame| (rank(&frame), Sender::Foreign));
        let motors = self.escs().filter(|(_, esc)| esc.config.line == line);
        let motors = motors.filter_map(|(index, esc)| {
            Some((esc.mailboxes.rank()?, Sender::Motor(MotorKey::new(index)?)))
        });
        let joints = self.joints().filter(|(_, joint)| joint.config.line == line);
        let joints = joints.filter_map(|(index, joint)| {
            Some((joint.mailboxes.rank()?, Sender::Motor(MotorKey::of_joint(index)?)))
        });
        let all = controller.into_iter().chain(foreign).chain(motors).chain(joints);
        all.min_by_key(|(rank, _)| *rank).map(|(_, sender)| sender)
    }

    fn arbitrate(&mut self, line: Line) {
        let now_ns = self.now_ns;
        let winner = self.winner(line);
        let Some((frame, sender)) =
            winner.and_then(|sender| Some((self.begin(line, sender)?, sender)))
        else {
            self.wire_mut(line).stirred = false;
            return;
        };
        if sender == Sender::Controller {
            for joint in self.joints.iter_mut().take(self.joint_count).flatten() {
                let reply = joint.mailboxes.candidate().filter(|_| joint.config.line == line);
                if reply.is_some_and(|reply| reply.id() == frame.id()) {
                    joint.collisions = joint.collisions.saturating_add(1);
                }
            }
        }
        self.wire_mut(line).begin(frame, sender, now_ns);
    }

    /// Takes the first frame of a sender, which keeps it until the end of the transmission.
    fn begin(&mut self, line: Line, sender: Sender) -> Option<CanFrame> {
        match sender {
            Sender::Controller => self.wire_mut(line).mailboxes.begin(),
            Sender::Foreign => self.wire(line).foreign.peek(),
            Sender::Motor(key) => self.mailboxes_mut(key)?.begin(),
        }
    }

    /// Removes a frame from the wire and delivers it to all other nodes.
    fn end_frame(&mut self, line: Line) -> Option<Transmission> {
        let now_ns = self.now_ns;
        let flight = self.wire(line).flight()?;
        let (frame, sender) = (flight.frame, flight.sender);
        let connected = self.faults.is_connected(line, now_ns);
        match sender {
            Sender::Controller if !connected => {
                // Cut off in the middle: no node receives the frame, which stays pending.
                let wire = self.wire_mut(line);
                wire.mailboxes.give_up();
                return wire.finish(now_ns, false);
            }
            Sender::Controller => {
                let wire = self.wire_mut(line);
                wire.mailboxes.finish();
                wire.traffic.sent = wire.traffic.sent.saturating_add(1);
            }
            Sender::Foreign => {
                let _sent = self.wire_mut(line).foreign.pop();
            }
            Sender::Motor(key) => {
                if let Some(mailboxes) = self.mailboxes_mut(key) {
                    mailboxes.finish();
                }
            }
        }
        let copies = self.faults.copies(line, &frame, now_ns);
        for _ in 0..copies {
            if sender != Sender::Controller && connected {
                self.wire_mut(line).hear(frame);
            }
            let escs = self.escs.iter_mut().take(self.esc_count).flatten();
            for esc in escs.filter(|esc| esc.config.line == line) {
                esc.receive(&frame, now_ns);
            }
            for joint in self.joints.iter_mut().take(self.joint_count).flatten() {
                if joint.config.line == line
                    && !matches!(sender, Sender::Motor(key) if key.is_joint())
                {
                    joint.receive(&frame, now_ns);
                }
            }
        }
        self.wire_mut(line).finish(now_ns, copies > 0)
    }
}
