//! Laws of the simulated bus that hold for every sequence of calls and faults.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::frame::CanFrame;
use drivetrain::sim::{
    Controller, Fault, Line, MotorConfig, Sender, Simulation, Transmission, frame_bits,
};
use drivetrain::time::{Duration, Instant};
use embedded_can::nb::Can;
use embedded_can::{Id, StandardId};
use proptest::prelude::*;

#[derive(Debug, Clone)]
enum Action {
    Advance(u64),
    Transmit(u16, [u8; 8]),
    Receive,
    Inject(u16, [u8; 8]),
    Fail(u8, u64),
}

fn action() -> impl Strategy<Value = Action> {
    let id = prop_oneof![Just(0x200), Just(0x1FF), 0x000..=0x7FF_u16];
    prop_oneof![
        4 => (0..700_u64).prop_map(Action::Advance),
        3 => (id.clone(), any::<[u8; 8]>()).prop_map(|(id, data)| Action::Transmit(id, data)),
        1 => Just(Action::Receive),
        1 => (id, any::<[u8; 8]>()).prop_map(|(id, data)| Action::Inject(id, data)),
        1 => (0..11_u8, 0..3_000_u64).prop_map(|(fault, span)| Action::Fail(fault, span)),
    ]
}

/// What a controller was told about its frames.
#[derive(Debug, Default)]
struct Ledger {
    accepted: Vec<CanFrame>,
    evicted: Vec<CanFrame>,
}

fn transmit(can: &mut Controller<'_>, frame: CanFrame, ledger: &mut Ledger) {
    if let Ok(evicted) = can.transmit(&frame) {
        ledger.accepted.push(frame);
        ledger.evicted.extend(evicted);
    }
}

fn remove(frames: &mut Vec<CanFrame>, frame: &CanFrame) -> bool {
    let place = frames.iter().position(|other| other == frame);
    place.map(|place| frames.remove(place)).is_some()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_frame_is_made_up_or_lost_and_no_two_share_the_wire(
        seed: u64,
        actions in proptest::collection::vec(action(), 1..120),
    ) {
        let line = Line::Can1;
        let world = Simulation::new(seed).with_receive_depth(line, 8);
        let motor = world.attach(MotorConfig::m3508(1)).unwrap();
        world.attach(MotorConfig::gm6020_voltage(1)).unwrap();
        let mut can = world.controller();
        let mut ledger = Ledger::default();
        let mut records: Vec<Transmission> = Vec::new();
        for action in actions {
            match action {
                Action::Advance(micros) => {
                    world.advance_with(Duration::from_micros(micros), |record| records.push(*record));
                }
                Action::Transmit(id, data) => {
                    transmit(&mut can, CanFrame::standard(id, data).unwrap(), &mut ledger);
                }
                Action::Receive => _ = can.receive(),
                Action::Inject(id, data) => {
                    let _full = world.inject(line, CanFrame::standard(id, data).unwrap());
                }
                Action::Fail(fault, span) => {
                    let id = StandardId::new(0x200).map(Id::Standard);
                    let frame = CanFrame::standard(0x7FF, [0; 8]).unwrap();
                    let fault = match fault {
                        0 => Fault::LostFrames { line, id, probability: 0.5 },
                        1 => Fault::BusOff(line),
                        2 => Fault::Unplugged(line),
                        3 => Fault::WouldBlock(line),
                        4 => Fault::DriverErrors { line, probability: 0.5 },
                        5 => Fault::Flood { line, frame, period: Duration::from_micros(span) },
                        6 => Fault::PowerLoss { motor, forgets_angle: true },
                        7 => Fault::WrongLength { motor, length: 7 },
                        8 => Fault::WrongAngle { motor, raw: 9_000 },
                        9 => Fault::DuplicateFrames { line, id: None },
                        _ => Fault::StuckEncoder(motor),
                    };
                    let _full = world.fault(fault, world.now()..world.now() + Duration::from_micros(span));
                }
            }
        }
        // All faults are over within 3 ms; then everything that waits goes out.
        world.advance_with(Duration::from_millis(30), |record| records.push(*record));

        // The wire carries one frame at a time, each as long as its bits, with the pause after it.
        let mut free_at = Instant::START;
        for record in &records {
            prop_assert_eq!(record.bits, frame_bits(&record.frame));
            let begin = record.at.as_micros() + 3 - u64::from(record.bits);
            prop_assert!(begin + 1 >= free_at.as_micros(), "{record:?}"); // instants are whole microseconds
            free_at = record.at + Duration::from_micros(3);
        }
        let traffic = world.traffic(line);
        prop_assert_eq!(traffic.frames as usize, records.len());
        prop_assert_eq!(traffic.busy_bits, records.iter().map(|record| u64::from(record.bits)).sum::<u64>());
        prop_assert!(traffic.busy_bits <= traffic.total_bits + 3);

        // What the controller handed over went out once or came back.
        let Ledger { mut accepted, evicted } = ledger;
        prop_assert_eq!(traffic.evicted as usize, evicted.len());
        let waiting = accepted.len() - evicted.len() - traffic.sent as usize;
        prop_assert_eq!(waiting, 0);
        for frame in &evicted {
            prop_assert!(remove(&mut accepted, frame), "{frame:?} came back out of nothing");
        }
        for Transmission { frame, delivered, sender, .. } in &records {
            if *sender == Sender::Controller && *delivered {
                prop_assert!(remove(&mut accepted, frame), "{frame:?} went out of nothing");
            }
        }
    }
}
