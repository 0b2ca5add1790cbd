//! An STS3032 servo: registers and motion, written from the manual and not with the crate's code.

use drivetrain::sim::SerialLine;
use drivetrain::time::Instant;

/// Where a goal begins, and where the measurements do.
const TORQUE: usize = 40;
const GOAL: usize = 42;
const SPEED: usize = 46;
const PRESENT: usize = 56;

/// Half-duplex in reality; the two directions are kept apart, as an adapter that does not hear itself does.
pub(crate) struct Servo {
    pub(crate) to: SerialLine,
    pub(crate) from: SerialLine,
    received: Vec<u8>,
    registers: [u8; 80],
    counts: f32,
}

impl Servo {
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            to: SerialLine::new(1_000_000, seed),
            from: SerialLine::new(1_000_000, seed + 1),
            received: Vec::new(),
            registers: [0; 80],
            counts: 2_048.0,
        }
    }

    pub(crate) fn degrees(&self) -> f32 {
        self.counts * (360.0 / 4096.0)
    }

    pub(crate) fn has_torque(&self) -> bool {
        self.registers.get(TORQUE) == Some(&1)
    }

    pub(crate) fn step(&mut self, now: Instant, dt_s: f32) {
        if self.has_torque() {
            let way = f32::from(self.word(GOAL)) - self.counts;
            let most = f32::from(self.word(SPEED)) * dt_s;
            self.counts += way.clamp(-most, most);
        }
        let mut buffer = [0; 64];
        self.received.extend_from_slice(self.to.receive(now, &mut buffer));
        while let Some(reply) = self.next_instruction() {
            self.from.send(&reply, now);
        }
    }

    /// Answers the first whole instruction; noise before it is dropped.
    fn next_instruction(&mut self) -> Option<Vec<u8>> {
        loop {
            match *self.received.as_slice() {
                [0xFF, 0xFF, id, length, ref rest @ ..] if id != 0xFF => {
                    let (body, _) = rest.split_at_checked(usize::from(length))?;
                    let sum = body.iter().fold(id.wrapping_add(length), |s, b| s.wrapping_add(*b));
                    let body = body.to_vec();
                    self.received.drain(..4 + body.len());
                    // The sum with its complement is all ones.
                    if sum == 0xFF {
                        return self.obey(&body);
                    }
                }
                [] | [_] | [0xFF, 0xFF] | [0xFF, 0xFF, _] => return None,
                _ => _ = self.received.remove(0),
            }
        }
    }

    fn obey(&mut self, body: &[u8]) -> Option<Vec<u8>> {
        let data = match *body {
            [3, address, ref data @ .., _sum] => {
                let first = usize::from(address);
                let place = self.registers.get_mut(first..first + data.len())?;
                place.copy_from_slice(data);
                Vec::new()
            }
            [2, address, count, _sum] => {
                let [low, high] = self.position().to_le_bytes();
                self.registers.get_mut(PRESENT..PRESENT + 2)?.copy_from_slice(&[low, high]);
                let first = usize::from(address);
                self.registers.get(first..first + usize::from(count))?.to_vec()
            }
            _ => return None,
        };
        let length = u8::try_from(data.len() + 2).ok()?;
        let mut reply = vec![0xFF, 0xFF, 1, length, 0];
        reply.extend(&data);
        let sum = reply.iter().skip(2).fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        reply.push(!sum);
        Some(reply)
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 4095")]
    fn position(&self) -> u16 {
        self.counts.round() as u16
    }

    fn word(&self, first: usize) -> u16 {
        match self.registers.get(first..first + 2) {
            Some(&[low, high]) => u16::from_le_bytes([low, high]),
            _ => 0,
        }
    }
}
