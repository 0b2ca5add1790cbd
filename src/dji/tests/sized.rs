//! Buses with room for fewer motors than the protocol has ids.

use super::*;
use proptest::prelude::*;

#[test]
fn a_bus_that_is_full_says_how_many_it_has_room_for() {
    let mut bus: Bus<(), 1> = Bus::sized();
    bus.attach(Config::<M3508>::new(8)).unwrap();
    let refused = bus.attach(Config::<M2006>::new(1)).unwrap_err();
    let AttachError::Full { motor, capacity } = refused else { panic!("{refused}") };
    assert_eq!((motor.id(), capacity), (1, 1));
    assert_eq!(refused.to_string(), "M2006 #1: the bus has room for 1 motor; Bus<_, 2> has more");
    // A clash is told first: more room would not help.
    let clash = bus.attach(Config::<Gm6020Current>::new(4)).unwrap_err();
    assert!(matches!(clash, AttachError::Collision { feedback_id: 0x208, .. }), "{clash}");
    assert_eq!(bus.motors().count(), 1);
}

#[test]
fn the_slot_of_a_motor_that_left_takes_any_other_and_old_handles_find_nothing() {
    let mut bus: Bus<(), 2> = Bus::sized();
    let [one, two] = bus.attach_all([5, 2].map(Config::<M3508>::new)).unwrap();
    bus.detach(one);
    let other = bus.attach(Config::<Gm6020Voltage>::new(7)).unwrap();
    let names: Vec<_> = bus.motors().map(|(_, name)| name.to_string()).collect();
    assert_eq!(names, ["M3508 #2", "GM6020 (voltage) #7"]);
    assert!(bus.health(one).is_none() && bus.health(two).is_some() && bus.health(other).is_some());
    assert_eq!(bus.ingest(&feedback(0x205, 0, 0), at_ms(1)), Ingest::Unrelated);
    assert_eq!(bus.ingest(&feedback(0x20B, 77, 0), at_ms(1)), Ingest::Taken);
    assert_eq!(bus.counters().unattached, 1);
    assert_eq!(bus.state(other).unwrap().feedback.angle(), 77);
    assert!(bus.state(two).is_none(), "not heard");
}

#[test]
fn motors_that_are_not_all_attached_leave_their_slots_free() {
    let mut bus: Bus<(), 2> = Bus::sized();
    let refused = bus.attach_all([1, 2, 3].map(Config::<M3508>::new));
    assert!(matches!(refused, Err(AttachError::Full { capacity: 2, .. })));
    assert_eq!((bus.motors().count(), bus.load().worst_percent()), (0, 0));
    assert!(bus.attach_all([3, 1].map(Config::<M3508>::new)).is_ok());
    assert_eq!(bus.acceptance_filter(), (0x200, 0x7FC));
}

/// Returns the frames, edges and states of a bus in these milliseconds. A bit of each byte of `heard` is the feedback of a motor.
fn run<const N: usize>(mut bus: Bus<(), N>, ids: &[u8], heard: &[u8]) -> Vec<std::string::String> {
    let handles: Vec<_> = ids
        .iter()
        .map(|id| bus.attach(Config::<M3508>::at_once(*id).speed_loop(SPEED)).unwrap())
        .collect();
    let mut seen = Vec::new();
    for (ms, byte) in (1..).zip(heard) {
        for id in 1..=8_u16 {
            if byte >> (id - 1) & 1 != 0 {
                _ = bus.ingest(&feedback(0x200 + id, id * 100 + u16::from(*byte), 50), at_ms(ms));
            }
        }
        _ = bus.arm(at_ms(ms));
        for handle in &handles {
            _ = bus.set_velocity(*handle, AngularVelocity::from_rad_per_s(f32::from(*byte)));
        }
        bus.update(Tick::new(at_ms(ms), 0.001));
        while let Some(frame) = bus.next_frame() {
            seen.push(std::format!("{ms} {frame:?}"));
        }
    }
    // The order of edges beyond those with a time is that of the slots.
    let mut edges: Vec<_> =
        core::iter::from_fn(|| bus.next_edge()).take(12).map(|edge| edge.to_string()).collect();
    edges.sort();
    seen.extend(edges);
    seen.extend(bus.motors().map(|(motor, name)| std::format!("{name} {:?}", bus.state(motor))));
    seen.push(std::format!("{:?}", bus.counters()));
    seen
}

/// A round has a turn for each id of the protocol, and one to begin it.
#[test]
fn a_motor_is_looked_at_in_each_twelfth_update_however_small_the_bus_is() {
    fn looks<const N: usize>() -> u16 {
        let mut bus: Bus<(), N> = Bus::sized();
        let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
        for ms in 1..=120 {
            let angle = u16::try_from(273 * ms % 8_192).unwrap();
            assert_eq!(bus.ingest(&feedback(0x201, angle, 2_000), at_ms(ms)), Ingest::Taken);
            if ms == 1 {
                bus.arm(at_ms(ms)).unwrap();
            }
            bus.set_raw(wheel, 16_384).unwrap();
            bus.update(Tick::new(at_ms(ms), 0.001));
        }
        bus.health(wheel).unwrap().saturated
    }
    for looks in [looks::<1>(), looks::<3>(), looks::<10>(), looks::<11>()] {
        assert!((9..=11).contains(&looks), "{looks}");
    }
}

proptest! {
    /// Law: a bus for three motors gives the results of the largest bus with the same motors.
    #[test]
    fn a_sized_bus_is_a_bus(
        ids in prop::sample::subsequence(&[1_u8, 2, 3, 4, 5, 6, 7, 8][..], 3).prop_shuffle(),
        heard in prop::collection::vec(any::<u8>(), 1..60),
    ) {
        prop_assert_eq!(run(Bus::<(), 3>::sized(), &ids, &heard), run(Bus::new(), &ids, &heard));
    }
}
