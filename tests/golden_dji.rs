//! The golden vectors of `data/dji.json`, through the public face.

#![cfg(test)]

use drivetrain::dji::*;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Ingest, MotorName};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::Current;
use serde_json::Value;

const NOW: Instant = Instant::from_micros(1_000);

fn vector(id: &str) -> Value {
    let file: Value = serde_json::from_str(include_str!("data/dji.json")).unwrap();
    let vectors = file["vectors"].as_array().unwrap();
    vectors
        .iter()
        .find(|vector| vector["id"] == id)
        .unwrap_or_else(|| panic!("no vector {id}"))
        .clone()
}

fn bytes(text: &Value) -> [u8; 8] {
    let bytes: Vec<u8> = text
        .as_str()
        .unwrap()
        .split(' ')
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect();
    bytes.try_into().unwrap()
}

fn hex(text: &Value) -> u16 {
    u16::from_str_radix(text.as_str().unwrap().trim_start_matches("0x"), 16).unwrap()
}

fn numbers(list: &Value) -> Vec<i64> {
    list.as_array().unwrap().iter().map(|number| number.as_i64().unwrap()).collect()
}

fn facts(device: &str) -> &'static Facts {
    match device {
        "C610" => M2006::FACTS,
        "C620" | "C6x0" => M3508::FACTS,
        "GM6020_voltage" => Gm6020Voltage::FACTS,
        "GM6020_current" => Gm6020Current::FACTS,
        other => panic!("unknown device {other}"),
    }
}

/// A motor whose output range opens at once: the golden bytes are those of the first update.
fn at_once<M: Model>(id: u8) -> Config<M> {
    Config::new(id).with_opening(Duration::ZERO)
}

fn attach(bus: &mut Bus, device: &str, id: u8) -> Result<AnyHandle, AttachError> {
    Ok(match device {
        "C610" => bus.attach(at_once::<M2006>(id))?.erase(),
        "C620" | "C6x0" => bus.attach(at_once::<M3508>(id))?.erase(),
        "GM6020_voltage" => bus.attach(at_once::<Gm6020Voltage>(id))?.erase(),
        "GM6020_current" => bus.attach(at_once::<Gm6020Current>(id))?.erase(),
        other => panic!("unknown device {other}"),
    })
}

#[test]
fn the_id_table_holds_for_every_motor() {
    let table = vector("dji.id_table");
    let rows = table["expect"]["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 8 + 8 + 7 + 7);
    for row in rows {
        let (device, id) =
            (row["device"].as_str().unwrap(), u8::try_from(row["id"].as_u64().unwrap()).unwrap());
        let (frame, slot) = facts(device).place(id).unwrap();
        assert_eq!(frame, hex(&row["tx_id"]), "{row}");
        assert_eq!(u64::from(slot), row["slot"].as_u64().unwrap(), "{row}");

        // The same through the bus: heard on the feedback id, driven in the slot.
        let mut bus = Bus::new();
        let motor = attach(&mut bus, device, id).unwrap();
        let feedback = CanFrame::standard(hex(&row["rx_id"]), [0; 8]).unwrap();
        assert_eq!(bus.ingest(&feedback, NOW), Ingest::Taken, "{row}");
        bus.arm(NOW).unwrap();
        bus.set_raw(motor, 0x0102).unwrap();
        bus.update(Tick::new(NOW, 0.001));
        let command = bus.next_frame().unwrap();
        assert_eq!(command.header(), u32::from(frame));
        let offset = usize::try_from(row["byte_offset"].as_u64().unwrap()).unwrap();
        let mut expected = [0; 8];
        expected[offset..offset + 2].copy_from_slice(&[1, 2]);
        assert_eq!(command.bytes(), &expected, "{row}");
    }
}

#[test]
fn every_pair_of_motors_collides_exactly_where_the_table_says() {
    let table = vector("dji.collisions");
    let pairs = table["expect"]["pairs"].as_array().unwrap();
    let listed = |one: &str, other: &str| {
        pairs.iter().find(|pair| {
            let pair = (pair["a"].as_str().unwrap(), pair["b"].as_str().unwrap());
            pair == (one, other) || pair == (other, one)
        })
    };
    let kinds = ["C6x0", "GM6020_voltage", "GM6020_current"];
    let motors: Vec<(&str, u8)> =
        kinds.iter().flat_map(|kind| (1..=facts(kind).ids).map(move |id| (*kind, id))).collect();
    for one in &motors {
        for other in &motors {
            let names = [one, other].map(|(kind, id)| format!("{kind}#{id}"));
            let mut bus = Bus::new();
            attach(&mut bus, one.0, one.1).unwrap();
            let outcome = attach(&mut bus, other.0, other.1);
            match listed(&names[0], &names[1]) {
                Some(pair) => {
                    let Err(AttachError::Collision { motor, with, slot, .. }) = outcome else {
                        panic!("{names:?} were accepted")
                    };
                    assert_eq!(slot.is_some(), pair["tx_slot"].as_bool().unwrap(), "{names:?}");
                    assert_eq!(with, MotorName::new(facts(one.0).name, one.1));
                    assert_eq!(motor, MotorName::new(facts(other.0).name, other.1));
                }
                None => assert_eq!(outcome.is_err(), one == other, "{names:?}"),
            }
        }
    }
}

#[test]
fn the_error_codes_are_those_of_each_esc() {
    let table = vector("dji.error_codes");
    for (device, feedback_id) in [("C620", 0x201), ("C610", 0x201)] {
        for code in 0..=u8::MAX {
            let mut bus = Bus::new();
            let motor = attach(&mut bus, device, 1).unwrap();
            let frame = CanFrame::standard(feedback_id, [0, 0, 0, 0, 0, 0, 25, code]).unwrap();
            assert_eq!(bus.ingest(&frame, NOW), Ingest::Taken);
            let error = bus.state(motor).unwrap().error;
            let listed = table["expect"][device].get(code.to_string()).is_some();
            match error {
                None => assert_eq!(code, 0),
                Some(ErrorCode::Unlisted(kept)) => {
                    assert!(!listed && kept == code, "{device} {code}")
                }
                Some(_) => assert!(listed, "{device} {code}"),
            }
        }
    }
}

#[test]
fn raw_commands_become_the_golden_bytes() {
    for (id, first) in [("dji.cmd.0x200", 1), ("dji.cmd.0x1FF.slot2", 5)] {
        let vector = vector(id);
        let frame = drive(first, &numbers(&vector["input"]["raw"]));
        assert_eq!(frame.header(), u32::from(hex(&vector["input"]["can_id"])));
        assert_eq!(frame.bytes(), &bytes(&vector["expect"]["data"]), "{id}");
    }
    let saturate = vector("dji.cmd.saturate");
    let frame = drive(1, &numbers(&saturate["input"]["raw_requested"]));
    assert_eq!(frame.bytes(), &bytes(&saturate["expect"]["data"]));
}

/// Commands four C620 from `first` on and returns their frame.
fn drive(first: u8, raw: &[i64]) -> CanFrame {
    let mut bus = Bus::new();
    let motors = bus.attach_all([0, 1, 2, 3].map(|slot| at_once::<M3508>(first + slot))).unwrap();
    for id in 0..4 {
        let feedback = CanFrame::standard(0x200 + u16::from(first) + id, [0; 8]).unwrap();
        assert_eq!(bus.ingest(&feedback, NOW), Ingest::Taken);
    }
    bus.arm(NOW).unwrap();
    for (motor, raw) in motors.iter().zip(raw) {
        bus.set_raw(*motor, i16::try_from(*raw).unwrap()).unwrap();
    }
    bus.update(Tick::new(NOW, 0.001));
    bus.next_frame().unwrap()
}

#[test]
fn amperes_become_the_golden_bytes() {
    fn drive<M: Model<Command = Current>>(vector: &Value) {
        let mut bus = Bus::new();
        let motors = bus.attach_all([1, 2, 3, 4].map(at_once::<M>)).unwrap();
        for id in 1..=4 {
            let feedback = CanFrame::standard(M::FACTS.feedback_base + id, [0; 8]).unwrap();
            assert_eq!(bus.ingest(&feedback, NOW), Ingest::Taken);
        }
        bus.arm(NOW).unwrap();
        for (motor, amperes) in motors.iter().zip(vector["input"]["amps"].as_array().unwrap()) {
            #[expect(clippy::cast_possible_truncation, reason = "a test value")]
            let current = Current::from_amperes(amperes.as_f64().unwrap() as f32);
            bus.set_current(*motor, current).unwrap();
        }
        bus.update(Tick::new(NOW, 0.001));
        assert_eq!(bus.next_frame().unwrap().bytes(), &bytes(&vector["expect"]["data"]));
    }
    drive::<M3508>(&vector("dji.cmd.c620.amps"));
    drive::<Gm6020Current>(&vector("dji.cmd.gm6020_current.amps"));
}

#[test]
fn feedback_frames_become_the_golden_values() {
    let cases = [
        ("dji.fb.c610", "C610", 5, "output_rpm"),
        ("dji.fb.gm6020", "GM6020_current", 7, "rpm"),
        ("dji.fb.c620.half_neg", "C620", 4, "output_rpm"),
    ];
    for (id, device, motor_id, rpm) in cases {
        let vector = vector(id);
        let expect = &vector["expect"];
        let mut bus = Bus::new();
        let motor = attach(&mut bus, device, motor_id).unwrap();
        let frame =
            CanFrame::standard(hex(&vector["input"]["can_id"]), bytes(&vector["input"]["data"]))
                .unwrap();
        assert_eq!(bus.ingest(&frame, NOW), Ingest::Taken, "{id}");
        let state = bus.state(motor).unwrap();
        assert_eq!(i64::from(state.feedback.angle()), expect["encoder"].as_i64().unwrap());
        assert_eq!(i64::from(state.feedback.current()), expect["current_raw"].as_i64().unwrap());
        assert_eq!(i64::from(state.feedback.error()), expect["error"].as_i64().unwrap());
        let close =
            |value: f32, golden: &Value| (f64::from(value) - golden.as_f64().unwrap()).abs() < 1e-4;
        assert!(close(state.velocity.as_rpm(), &expect[rpm]), "{id}");
        assert!(close(state.current.as_amperes(), &expect["current_a"]), "{id}");
        assert_eq!(
            state.temperature_c.map(i64::from),
            expect.get("temperature_c").and_then(Value::as_i64)
        );
        if let Some(torque) = expect.get("output_torque_nm_at_0.3_nm_per_a") {
            assert!(close(state.torque_nm, torque));
        }
    }
}

#[test]
fn sequences_unwrap_to_the_golden_counts() {
    for id in ["unwrap.fwd_wrap", "unwrap.half_turn_up", "unwrap.half_turn_down"] {
        let vector = vector(id);
        let samples = numbers(&vector["input"]["samples"]);
        assert_eq!(
            unwrap(&samples, false),
            numbers(&vector["expect"]["half_open_[-4096,4096)"]),
            "{id}"
        );
    }
    let normal = vector("unwrap.taproot.normal");
    let counts = unwrap(&numbers(&normal["input"]["samples"]), false);
    let zeroed: Vec<i64> = counts.iter().map(|count| count - counts[0]).collect();
    assert_eq!(zeroed, numbers(&normal["expect"]["unwrapped_after_zero"]));
    // taproot inverts as 8191 - raw, this crate as 8192 - raw: the way after zeroing is the same.
    let inverted = vector("unwrap.taproot.inverted");
    let counts = unwrap(&numbers(&inverted["input"]["samples_raw"]), true);
    let zeroed: Vec<i64> = counts.iter().map(|count| count - counts[0]).collect();
    assert_eq!(zeroed, numbers(&inverted["expect"]["unwrapped_after_zero"]));
}

/// The counts of a direct motor that reports these angles, one each millisecond.
fn unwrap(samples: &[i64], reversed: bool) -> Vec<i64> {
    let mut bus = Bus::new();
    let config = Config::<Gm6020Voltage>::new(1);
    let motor = bus.attach(if reversed { config.reversed() } else { config }).unwrap();
    let counts = (1..).zip(samples).map(|(ms, sample)| {
        let [high, low] = u16::try_from(*sample).unwrap().to_be_bytes();
        let frame = CanFrame::standard(0x205, [high, low, 0, 0, 0, 0, 0, 0]).unwrap();
        assert_eq!(bus.ingest(&frame, Instant::from_micros(ms * 1_000)), Ingest::Taken);
        bus.state(motor).unwrap().rotor_counts
    });
    counts.collect()
}
