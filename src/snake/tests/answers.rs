//! Who owes an answer, and until when.

use super::*;

/// Has joint 3 asked in this millisecond; returns the question.
fn ask(bench: &mut Bench) -> CanFrame {
    bench.ms += 1;
    bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    let mut frames = core::iter::from_fn(|| bench.joints.next_frame());
    let is_read =
        |frame: &CanFrame| matches!(Command::decode(frame.data()), Some(Command::Read(_)));
    frames.find(is_read).unwrap()
}

/// It would collide with the answer: both have one id.
#[test]
fn a_joint_that_comes_while_one_that_went_owes_an_answer_is_not_disabled_yet() {
    let mut bench = Bench::new(&[3]);
    bench.silent = std::vec![3];
    assert!(bench.run(1).iter().any(|(_, command)| matches!(command, Command::Read(_))));
    bench.joints.detach(bench.handles[0]);
    bench.joints.attach(Config::new(3)).unwrap();
    assert_eq!(bench.run(2), []);
    assert_eq!(writes(&bench.run(1)), [Command::DISABLE]);
}

#[test]
fn the_answer_of_a_joint_that_went_ends_the_wait() {
    let mut bench = Bench::new(&[3]);
    _ = ask(&mut bench);
    bench.joints.detach(bench.handles[0]);
    assert_eq!(bench.joints.next_frame(), None);
    let late = reply(3, Register::ActualPosition, 0);
    assert_eq!(bench.joints.ingest(&late, at_ms(bench.ms)), Ingest::Unrelated);
    assert_eq!(bench.take(), [(3, Command::DISABLE)]);
    // So does its question that was not sent.
    let mut bench = Bench::new(&[3]);
    let question = ask(&mut bench);
    bench.joints.detach(bench.handles[0]);
    assert!(!bench.joints.requeue(&question), "nobody is there to be asked again");
    assert_eq!(bench.take(), [(3, Command::DISABLE)]);
}

#[test]
fn a_question_that_was_given_up_and_comes_back_does_not_end_the_wait_for_another() {
    let mut bench = Bench::new(&[3]);
    let position = ask(&mut bench);
    bench.ms += 3; // it is given up, and its turn is over
    assert_eq!(ask(&mut bench), position);
    bench.hear_of(3, Register::ActualPosition, 0);
    let speed = ask(&mut bench);
    assert_eq!(speed, Command::Read(Register::ActualSpeed).frame(3).unwrap());
    assert!(bench.joints.requeue(&position));
    assert_eq!(bench.joints.awaited(bench.handles[0]), Some(Register::ActualSpeed));
    assert!(bench.joints.requeue(&speed));
    assert_eq!(bench.joints.awaited(bench.handles[0]), None);
    assert_eq!(ask(&mut bench), speed, "its turn comes again");
}

#[test]
fn a_question_that_comes_back_is_not_counted() {
    let mut bench = Bench::new(&[3]);
    for _ in 0..4 {
        let question = ask(&mut bench);
        assert!(bench.joints.requeue(&question));
    }
    _ = ask(&mut bench);
    assert_eq!(bench.joints.counters().requests, 1);
}

#[test]
fn a_clock_that_is_set_back_ends_the_wait() {
    let mut bench = Bench::new(&[3]);
    bench.ms = 5_000;
    _ = ask(&mut bench);
    bench.ms = 1_000;
    _ = ask(&mut bench);
    assert_eq!((bench.joints.counters().unanswered, bench.joints.counters().requests), (1, 2));
}

#[test]
fn who_owes_an_answer_gets_no_frame_beside_those_of_an_update() {
    let mut bench = Bench::armed(&[1, 2]);
    bench.drive(20);
    let question = ask(&mut bench);
    let id = u8::try_from(question.header()).unwrap();
    bench.ms += 1;
    bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    bench.answer(id, Command::decode(question.data()).unwrap());
    let sent = bench.take();
    assert_eq!(sent.len(), 2, "{sent:?}");
    assert!(sent.iter().all(|(to, _)| *to != id));
}
