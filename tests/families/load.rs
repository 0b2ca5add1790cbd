//! No motor puts more on the bus than `Actuator::load` says, from power-on through arming, driving and a trip, and a driven one nearly as much.

use crate::motors::FAMILIES;
use crate::station::Station;
use drivetrain::motor::BusLoad;

/// The largest bits of the frames of a millisecond: sent, and answered.
fn bits(station: &Station) -> u32 {
    let frames = station.frames.iter().chain(&station.answers);
    frames.map(|frame| BusLoad::frame_bits(frame).1).sum()
}

#[test]
fn no_motor_puts_more_on_the_bus_than_its_load() {
    for (family, (mode, make)) in
        FAMILIES.iter().flat_map(|it| it.modes.iter().map(move |mode| (it.name, mode)))
    {
        let mut station = make();
        let most = station.device.load().worst_case() * 1e6;
        let mut window = std::collections::VecDeque::new();
        let mut worst = 0;
        let mut driven = 0;
        for ms in 0..2_000 {
            match ms {
                200 => station.device.arm(station.now()).unwrap(),
                1_200 => station.device.emergency_stop(),
                1_300 => station.device.clear_emergency_stop(),
                1_600 => station.is_deaf = true,
                _ => {}
            }
            if ms > 200 {
                _ = station.device.set(1.0);
            }
            station.step();
            window.push_back(bits(&station));
            if window.len() > 100 {
                window.pop_front();
                let sum: u32 = window.iter().sum();
                worst = worst.max(sum);
                driven = if ms == 1_199 { sum } else { driven };
            }
        }
        let (worst, driven) = (worst as f32 * 10.0, driven as f32 * 10.0);
        assert!(worst <= most, "{family}, {mode}: {worst} bits a second, the load is {most}");
        assert!(driven > 0.4 * most, "{family}, {mode}: {driven} bits a second of {most}");
    }
}
