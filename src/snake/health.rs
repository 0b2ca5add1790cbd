//! What is wrong with the joints of a bus.

use super::{Joint, Joints};
use crate::motor::{Capabilities, Capability, Conditions, Edge, Health};

/// Health: what is wrong with each joint, and every change of it.
impl Joints {
    /// Says that the driver hands back the frames that it sent, so that a frame of a controller that is received is no
    /// sign of a second one. None is looked for then.
    #[must_use]
    pub const fn with_loopback(mut self) -> Self {
        self.echoes = true;
        self
    }

    /// Returns what a joint offers: positions over many turns, in radians or in its own pulses, and what it reports of
    /// them. Nothing once it is detached. There is no function for any other target.
    #[must_use]
    pub fn capabilities(&self, joint: Joint) -> Capabilities {
        const OFFERED: Capabilities =
            Capabilities::of(&[Capability::Raw, Capability::Position, Capability::Feedback]);
        self.slot(joint).map_or(Capabilities::NONE, |_| OFFERED)
    }

    /// Returns how a joint is; `None` once it is detached. Its feedback rate is that of positions, and its ambiguous gaps
    /// are the positions further off than it can go.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::snake::{Config, Joints};
    ///
    /// let mut joints = Joints::new();
    /// let neck = joints.attach(Config::new(3))?;
    /// assert_eq!(
    ///     joints.health(neck).map(|health| health.to_string()).as_deref(),
    ///     Some("snake joint #3: unheard, disarmed, healthy; 0 Hz, gap 0 us, no temperature, error 0; saturated 0, refused 0, forgotten 0, ambiguous 0"),
    /// );
    /// # Ok::<(), drivetrain::snake::AttachError>(())
    /// ```
    #[must_use]
    pub fn health(&self, joint: Joint) -> Option<Health> {
        self.slot(joint)?.health()
    }

    /// Returns what is wrong with a joint; nothing once it is detached.
    #[must_use]
    pub fn conditions(&self, joint: Joint) -> Conditions {
        self.slot(joint).map_or(Conditions::NONE, |slot| slot.guard.conditions())
    }

    /// Returns the oldest change of a joint's condition that was not read yet.
    ///
    /// None is lost, however late it is read; while it waits, the same change is not noted again. Of each joint, beyond 6
    /// that wait, the later ones have the time of the last of these.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::motor::Condition;
    /// use drivetrain::snake::{Config, Joints};
    /// use drivetrain::time::{Instant, Tick};
    ///
    /// let mut joints = Joints::new();
    /// joints.attach(Config::new(3))?;
    /// let at_ms = |ms: u64| Instant::from_micros(ms * 1_000);
    /// let id = embedded_can::StandardId::new(3).ok_or("id")?;
    /// let reply = <CanFrame as embedded_can::Frame>::new(id, &[4, 7, 0, 0, 0, 9]).ok_or("length")?;
    /// _ = joints.ingest(&reply, at_ms(1));
    /// (2..50).for_each(|ms| joints.update(Tick::new(at_ms(ms), 0.001)));
    /// let edge = joints.next_edge().ok_or("nothing happened")?;
    /// assert_eq!((edge.motor.id(), edge.condition, edge.began), (3, Condition::Late, true));
    /// assert_eq!(edge.at.as_micros() / 1_024, 42_000 / 1_024); // the first update after 40 ms
    /// assert_eq!(joints.next_edge(), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn next_edge(&mut self) -> Option<Edge> {
        let waiting = self.slots.iter_mut().filter(|slot| slot.next_edge_at().is_some());
        waiting.min_by_key(|slot| slot.next_edge_at())?.next_edge()
    }
}
