//! The end of driving: zeros until they are seen.

use super::{Session, Stage};
use crate::end::End;
use drivetrain::time::Tick;

/// When all is over, it may take this long until the motors are seen to have their zeros.
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(5);

/// Good ticks in a row that end it: zeros as keep-alives, in case some are lost.
const GOOD: u32 = 30;

impl Session {
    /// Zeros as keep-alives, each 10 ms; waits where they may not have arrived.
    pub(super) fn rest(
        &mut self,
        tick: Tick,
        end: &End,
        good: u32,
        bad: u32,
        begun: std::time::Instant,
    ) {
        self.runner.tick(tick);
        self.take_edges(tick.now());
        let Some(doubt) = self.doubt() else {
            let is_over = good + 1 >= GOOD;
            self.stage = if is_over {
                Stage::Listening
            } else {
                Stage::Resting { good: good + 1, bad, begun }
            };
            return;
        };
        let bad = bad + 1;
        self.stage = Stage::Resting { good: 0, bad, begun };
        if bad == 30 {
            self.messages.push(format!("{doubt}: cut the battery"));
        }
        if bad == 300 {
            end.is_safe(true);
        }
        if begun.elapsed() > PATIENCE {
            let emptying = self.tap().link.emptying();
            self.fail(format!(
                "{doubt}, and the last command may stand. Cut the battery, and {emptying}"
            ));
            self.stage = Stage::Listening;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }

    /// Why some motor may not have its zero. Who is not heard may not have it; who is heard may still not, where only sending
    /// fails. Step by step nobody is heard, as no more steps come.
    fn doubt(&mut self) -> Option<String> {
        let tap = &self.runner.port_mut().0;
        if let Some(doubt) = tap.ledger.doubt(tap.link.name()) {
            return Some(doubt);
        }
        let is_asked = self.armed_once && !self.pace.is_lock_step();
        let robot = self.runner.device();
        let is_heard = |motor| robot.reading(motor).is_some_and(|reading| reading.is_heard());
        let (_, name) =
            robot.names().enumerate().find(|(motor, _)| is_asked && !is_heard(*motor))?;
        Some(format!("{name} is not heard"))
    }
}
