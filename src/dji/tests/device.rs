//! The bus as any device: through the trait that the runner and combined devices know it by.

use super::*;
use crate::motor::{Condition, MotorName};

fn frames_of<D: Devices>(device: &mut D, ms: u64) -> Vec<CanFrame> {
    device.update(Tick::new(at_ms(ms), 0.001));
    core::iter::from_fn(|| device.next_frame(0)).collect()
}

fn with_error(id: u16, code: u8) -> CanFrame {
    CanFrame::standard(id, [0, 0, 0, 0, 0, 0, 25, code]).unwrap()
}

fn id_of(mut names: impl Iterator<Item = MotorName>) -> Option<u8> {
    names.next().map(|name| name.id())
}

#[test]
fn a_device_sends_what_its_updates_give_and_takes_back_its_own_only() {
    fn check<D: Devices>(device: &mut D) {
        let frames = frames_of(device, 2);
        assert_eq!(frames.len(), 1);
        assert_eq!(device.superseded(), 0);
        assert!(device.requeue(&frames[0]));
        assert!(!device.requeue(&CanFrame::standard(0x1FF, [0; 8]).unwrap()));
        assert_eq!(device.superseded(), 1, "the newest words go");
        assert_eq!(frames_of(device, 3).len(), 1);
        assert_eq!(device.superseded(), 1);
    }
    let (mut bus, _) = armed([Config::<M3508>::at_once(1)]);
    check(&mut bus);
}

#[test]
fn a_device_names_who_is_faulty_and_who_else_commands_and_tells_edges() {
    fn check<D: Devices + CanDevice>(device: &mut D) {
        assert_eq!(id_of(device.faulty().map(|(name, _)| name)), None);
        assert_eq!((device.second_master(), Devices::next_edge(device)), (None, None));
        assert_eq!(Devices::ingest(device, &with_error(0x202, 3), at_ms(1)), Ingest::Taken);
        for ms in 2..20 {
            frames_of(device, ms);
        }
        assert_eq!(id_of(device.faulty().map(|(name, _)| name)), Some(2));
        let edge = Devices::next_edge(device).unwrap();
        assert_eq!((edge.source.id(), edge.condition, edge.began), (2, Condition::Fault, true));
        let command = CanFrame::standard(0x200, [1; 8]).unwrap();
        assert_eq!(Devices::ingest(device, &command, at_ms(20)), Ingest::Unrelated);
        assert!(device.second_master().is_some());
        assert!(matches!(
            device.arm(at_ms(20)),
            Err(ArmError::Missing(_) | ArmError::SecondMaster(_))
        ));
    }
    let mut bus: Bus = Bus::new();
    bus.attach(Config::<M3508>::at_once(2)).unwrap();
    check(&mut bus);
}

#[test]
fn each_command_frame_in_use_tells_of_a_second_master_and_no_other_does() {
    let all = [0x1FE, 0x1FF, 0x200, 0x2FE, 0x2FF];
    for used in all {
        let heard = all.map(|id| {
            let mut bus: Bus = Bus::new();
            match used {
                0x200 => bus.attach(Config::<M3508>::at_once(1)).map(Handle::erase),
                0x1FF => bus.attach(Config::<M3508>::at_once(5)).map(Handle::erase),
                0x2FF => bus.attach(Config::<Gm6020Voltage>::at_once(5)).map(Handle::erase),
                0x1FE => bus.attach(Config::<Gm6020Current>::at_once(1)).map(Handle::erase),
                _ => bus.attach(Config::<Gm6020Current>::at_once(5)).map(Handle::erase),
            }
            .unwrap();
            let frame = CanFrame::standard(id, [0; 8]).unwrap();
            assert_eq!(bus.ingest(&frame, at_ms(1)), Ingest::Unrelated);
            bus.second_master().map(|claim| claim.id())
        });
        let expected = all
            .map(|id| (id == used).then(|| embedded_can::Id::from(StandardId::new(used).unwrap())));
        assert_eq!(heard, expected, "0x{used:X} in use");
    }
}

#[test]
fn a_device_that_is_disarmed_takes_no_target() {
    fn disarm<D: Devices>(device: &mut D) {
        device.disarm();
        assert!(!device.is_armed());
    }
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
    assert_eq!(bus.set_raw(wheel, 1), Ok(()));
    disarm(&mut bus);
    assert_eq!(bus.set_raw(wheel, 1), Err(TargetError::Disarmed));
}

/// A motor that takes targets again by itself is armed: a request ends the trip of its bus.
#[test]
fn a_request_to_arm_is_granted_again_after_a_motor_has_resumed() {
    let (mut bus, _) = armed([Config::<M3508>::at_once(1).with_resume()]);
    let run = |bus: &mut Bus, to_ms: u64, ms: &mut u64| {
        while *ms < to_ms {
            *ms += 1;
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(*ms));
            step(bus, *ms);
        }
    };
    let mut ms = 1;
    run(&mut bus, 50, &mut ms);
    ms = 300; // silent meanwhile
    step(&mut bus, ms);
    assert!(!bus.is_armed());
    run(&mut bus, 420, &mut ms);
    assert!(bus.is_armed());
    assert_eq!(bus.arm(at_ms(ms)), Ok(()));
    run(&mut bus, 430, &mut ms);
    assert_eq!(bus.arm(at_ms(ms)), Ok(()), "10 ms later");
}
