//! Looks for the dearest tick: changes scripts at random and keeps what is not cheaper.
//!
//! Arguments: how many scripts to try, and a number for the random ones. Prints `found <instructions> <script>` for each that is
//! dearer than all before.

#![no_std]
#![no_main]

mod dearest;
#[path = "../../qemu/src/meter.rs"]
mod meter;
#[path = "../../qemu/src/wiring.rs"]
mod wiring;

use core::panic::PanicInfo;
use cortex_m_semihosting::{debug, hprint, hprintln, nr, syscall1};
use dearest::{CYCLE, CYCLES, MOTORS, Script, dearest, exact, found};

/// Lines of descent, so that one that is stuck does not end the search.
const LINES: usize = 4;

struct Random(u32);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    fn below(&mut self, end: usize) -> usize {
        self.next() as usize % end
    }

    fn byte(&mut self) -> u8 {
        (self.next() >> 11) as u8
    }
}

fn change(script: &mut Script, random: &mut Random) {
    for _ in 0..=random.below(3) {
        let cycle = random.below(CYCLES) * CYCLE;
        let other = random.below(CYCLES) * CYCLE;
        match random.below(8) {
            0 | 1 => script[random.below(CYCLE * CYCLES)] = random.byte(),
            // The head of a cycle: time, repetition, calls.
            2 | 3 => script[cycle + random.below(4)] = random.byte(),
            // One thing for all eight frames.
            4 | 5 => {
                let (which, byte) = (random.below(3), random.byte());
                for frame in 0..MOTORS {
                    script[cycle + 4 + 3 * frame + which] = byte;
                }
            }
            6 => script.copy_within(cycle..cycle + CYCLE, other),
            // A cycle less, or one more.
            _ => {
                let (first, last) = (cycle.min(other), cycle.max(other));
                if random.below(2) == 0 {
                    script[first..last + CYCLE].rotate_left(CYCLE);
                } else {
                    script[first..last + CYCLE].rotate_right(CYCLE);
                }
            }
        }
    }
}

/// The two numbers of the command line.
fn arguments() -> (u32, u32) {
    let mut line = [0_u8; 128];
    let mut block = [line.as_mut_ptr() as usize, line.len()];
    // SAFETY: the block is an address and its length, as the call asks for.
    unsafe { syscall1(nr::GET_CMDLINE, (&raw mut block) as usize) };
    let text = core::str::from_utf8(&line).unwrap_or("");
    let mut numbers = text.split([' ', '\0']).filter_map(|word| word.parse().ok());
    (numbers.next().unwrap_or(1_000), numbers.next().unwrap_or(1))
}

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(mut peripherals) = cortex_m::Peripherals::take() {
        meter::start(&mut peripherals.SYST);
        search();
        debug::exit(debug::EXIT_SUCCESS);
    }
    fail()
}

fn search() {
    let (tries, seed) = arguments();
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9) | 1);
    let mut lines = [[0; CYCLE * CYCLES]; LINES];
    let mut costs = [0; LINES];
    // The first goes on where the search before ended; the others begin anywhere.
    lines[0] = found();
    lines[1..].iter_mut().flatten().for_each(|byte| *byte = random.byte());
    let mut best = 0;
    for attempt in 0..tries as usize {
        let line = attempt % LINES;
        let mut script = lines[line];
        if costs[line] > 0 {
            change(&mut script, &mut random);
        }
        let cost = dearest(&script);
        if cost >= costs[line] {
            (lines[line], costs[line]) = (script, cost);
        }
        // A line that falls behind by far begins anew from the best.
        if attempt % 4_096 == 4_095 {
            let (first, _) =
                (0..LINES).map(|it| (it, costs[it])).max_by_key(|it| it.1).unwrap_or((0, 0));
            let (last, _) =
                (0..LINES).map(|it| (it, costs[it])).min_by_key(|it| it.1).unwrap_or((0, 0));
            (lines[last], costs[last]) = (lines[first], costs[first]);
        }
        if cost > best {
            best = cost;
            hprint!("found {} ", exact(&script));
            script.iter().for_each(|byte| hprint!("{:02x}", byte));
            hprintln!();
        }
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    hprintln!("{}", info);
    fail()
}

fn fail() -> ! {
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
