use super::*;

/// Attaches M3508 until one is refused; returns how many there are, and the words of the refusal.
fn filled(bus: &mut Bus) -> (u8, std::string::String) {
    let refused = (1..=8).find_map(|id| {
        let refusal = bus.attach(Config::<M3508>::at_once(id)).err()?;
        Some((id - 1, refusal.to_string()))
    });
    refused.unwrap()
}

#[test]
fn a_ceiling_refuses_what_is_above_it_and_not_what_is_at_it() {
    let six = Bus::<()>::new;
    let mut bus = six().with_load_ceiling(1.08);
    let (attached, why) = filled(&mut bus);
    assert_eq!((attached, bus.load().to_string().as_str()), (6, "89 % to 108 %"));
    assert_eq!(
        why,
        "M3508 #7: the bus load of up to 122 % is above its ceiling of 108 %; feedback at 857 Hz fits, or a second bus"
    );
    assert_eq!(filled(&mut six().with_load_ceiling(1.0749)).0, 5, "107 %");
    assert_eq!(filled(&mut six().with_load_ceiling(1.0751)).0, 6, "108 %");
    assert_eq!(filled(&mut six().with_load_ceiling(f32::NAN)).0, 0);
}

#[test]
fn the_load_counts_the_motors_and_each_frame_of_commands_once() {
    let mut bus: Bus = Bus::new().with_feedback_rate(500).with_tick_rate(250);
    assert_eq!(bus.load().to_string(), "0 % to 0 %");
    let mut seen = Vec::new();
    for id in 1..=5 {
        bus.attach(Config::<M3508>::at_once(id)).unwrap();
        seen.push(bus.load().worst_percent());
    }
    // 500 times 135 bits for each motor; 250 times 135 for 0x200, and from the fifth on for 0x1FF.
    assert_eq!(seen, [11, 17, 24, 31, 41]);
    let slow: Bus = bus.with_bit_rate(500_000);
    assert_eq!(slow.load().worst_percent(), 81);
}

#[test]
fn a_hardware_filter_opens_the_bits_in_which_ids_differ() {
    let filter = |ids: &[u8]| {
        let mut bus: Bus = Bus::new();
        for id in ids {
            bus.attach(Config::<M3508>::at_once(*id)).unwrap();
        }
        bus.acceptance_filter()
    };
    assert_eq!(filter(&[]), (0x7FF, 0x7FF));
    assert_eq!(filter(&[5]), (0x205, 0x7FF));
    assert_eq!(filter(&[2, 3]), (0x202, 0x7FE));
    assert_eq!(filter(&[1, 2]), (0x200, 0x7FC));
    assert_eq!(filter(&[4, 6]), (0x204, 0x7FC));
    assert_eq!(filter(&[1, 2, 3]), (0x200, 0x7FC), "a bit that two of them differ in stays open");
    assert_eq!(filter(&[1, 2, 3, 4]), (0x200, 0x7F8));
    assert_eq!(filter(&[1, 8]), (0x200, 0x7F0));
}
