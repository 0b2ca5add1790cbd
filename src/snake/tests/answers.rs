//! Outstanding replies and their time-out.

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
    assert!(bench.joints.requeue(&question));
    let counters = bench.joints.counters();
    assert_eq!((counters.requests, counters.packed, counters.superseded), (0, 3, 1));
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

/// A driver that is not heard for 3 ms may hold two questions that are the same.
#[test]
fn of_two_equal_questions_the_one_that_comes_back_may_be_the_one_that_was_given_up() {
    let mut bench = Bench::new(&[3]);
    let question = ask(&mut bench);
    bench.ms += 3;
    assert_eq!(ask(&mut bench), question);
    assert!(bench.joints.requeue(&question));
    bench.joints.emergency_stop();
    assert_eq!(bench.take(), [], "the other may be on its way");
    bench.hear_of(3, Register::ActualPosition, 0);
    assert_eq!(bench.take(), [(3, Command::DISABLE)]);
    // From then on it is the only one again.
    _ = ask(&mut bench);
    bench.hear_of(3, Register::ActualSpeed, 0);
    assert_eq!(ask(&mut bench), question);
    assert!(bench.joints.requeue(&question));
    assert_eq!(bench.joints.awaited(bench.handles[0]), None);
}

#[test]
fn a_joint_that_owes_an_answer_is_neither_written_nor_asked_what_was_left_over_for_it() {
    let mut bench = Bench::armed(&[3]);
    bench.drive(20);
    bench.silent = std::vec![3];
    let step = |bench: &mut Bench| {
        bench.ms += 1;
        _ = bench.joints.set_pulses(bench.handles[0], 1_000);
        bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    };
    // The write goes out, the question is left over, and goes first in the next update.
    step(&mut bench);
    let first = bench.joints.next_frame().unwrap();
    assert!(matches!(Command::decode(first.data()), Some(Command::Write(..))));
    step(&mut bench);
    let question = bench.joints.next_frame().unwrap();
    assert!(matches!(Command::decode(question.data()), Some(Command::Read(_))));
    assert_eq!(bench.take(), [], "its write waits");
    bench.hear_of(3, bench.joints.awaited(bench.handles[0]).unwrap(), 0);
    assert!(matches!(*bench.take(), [(3, Command::Write(..))]));
    // An old question that comes back is asked again, but not now.
    step(&mut bench);
    bench.take();
    assert!(bench.joints.requeue(&question) && bench.joints.awaited(bench.handles[0]).is_some());
    step(&mut bench);
    assert_eq!(bench.take(), []);
}

#[test]
fn a_joint_that_owes_an_answer_takes_no_other_joint_s_place() {
    let mut bench = Bench::armed(&[1, 2]);
    bench.drive(20);
    let (mut asked, mut written) = ([0; 2], [0; 2]);
    bench.silent = std::vec![1];
    for _ in 0..30 {
        for (id, command) in bench.drive(1) {
            let is_read = matches!(command, Command::Read(_));
            let counts = if is_read { &mut asked } else { &mut written };
            counts[usize::from(id - 1)] += 1;
        }
    }
    // Joint 1 is asked each fourth millisecond, joint 2 in the others.
    assert!(asked[0] >= 6 && asked[1] >= 20, "{asked:?}");
    assert!(written[1] >= 20, "{written:?}");
}

/// The two joints are asked and written to in turn; of joint 1 something is left over that has to wait.
#[test]
fn what_waits_for_an_answer_takes_no_place_in_an_update() {
    let mut bench = Bench::armed(&[1, 2]);
    bench.drive(20);
    bench.silent = std::vec![1];
    let step = |bench: &mut Bench| {
        let sent = bench.drive(1);
        let of =
            |id| sent.iter().filter(|(to, _)| *to == id).map(|(_, command)| *command).collect();
        let of: [Vec<Command>; 2] = [of(1), of(2)];
        of
    };
    let is_read = |command: &Command| matches!(command, Command::Read(_));
    let mut question = None;
    while question.is_none() {
        let [first, _] = step(&mut bench);
        question = first.into_iter().find(is_read);
    }
    let write = Command::Write(Register::Position, 1_000);
    assert!(bench.joints.requeue(&write.frame(1).unwrap()));
    let [first, second] = step(&mut bench);
    assert_eq!(first, []);
    assert!(second.contains(&write) && second.iter().any(is_read), "{second:?}");
    // The same of a question, that of long ago.
    bench.run(2);
    while !step(&mut bench)[0].iter().any(is_read) {}
    assert!(bench.joints.requeue(&question.unwrap().frame(1).unwrap()));
    let [first, second] = step(&mut bench);
    assert_eq!(first, []);
    assert!(second.iter().any(is_read), "{second:?}");
}

#[test]
fn a_question_of_another_device_is_not_taken_back() {
    let mut bench = Bench::new(&[3]);
    _ = ask(&mut bench);
    let question = |id| Command::Read(Register::ActualPosition).frame(id).unwrap();
    assert!(!bench.joints.requeue(&question(9)));
    assert_eq!(bench.joints.counters().requests, 1);
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
    bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    assert_eq!(bench.joints.counters().bad_steps, 1);
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

/// A stop waits for an answer that is due, so an answer is not waited for as long as one likes.
#[test]
fn a_silent_joint_is_stopped_by_the_first_update_after_ten_milliseconds_whatever_the_reply_timeout()
{
    for (timeout_ms, waits_ms) in [(0, 1), (2, 3), (10, 11), (11, 11), (60_000, 11)] {
        let joints = Joints::new().with_reply_timeout(Duration::from_millis(timeout_ms));
        let mut bench = Bench::of(joints, [Config::new(3)]);
        _ = ask(&mut bench);
        bench.joints.emergency_stop();
        bench.silent = std::vec![3];
        let asked = bench.ms;
        while writes(&bench.run(1)).is_empty() {}
        assert_eq!(bench.ms - asked, waits_ms, "{timeout_ms} ms");
    }
}

/// A time-out of a question for one register leaves the questions for other registers outstanding.
#[test]
fn a_reply_settles_its_register_and_a_question_given_up_is_of_its_register_alone() {
    let mut bench = Bench::new(&[3]);
    let position = ask(&mut bench);
    bench.ms += 3; // given up
    assert_eq!(ask(&mut bench), position);
    bench.hear_of(3, Register::ActualPosition, 0); // and settled
    assert_ne!(ask(&mut bench), position);
    bench.ms += 3; // the speed is given up
    assert_eq!(ask(&mut bench), position);
    assert!(bench.joints.requeue(&position));
    assert_eq!(bench.joints.awaited(bench.handles[0]), None, "it was not sent");
}

#[test]
fn a_check_of_the_enable_that_was_not_sent_comes_again() {
    let mut bench = Bench::new(&[3]);
    let enable = Command::Read(Register::Enable).frame(3).unwrap();
    let mut questions = 1;
    loop {
        let question = ask(&mut bench);
        if question == enable {
            break;
        }
        questions += 1;
        bench.answer(3, Command::decode(question.data()).unwrap());
    }
    assert_eq!(questions, 24);
    assert!(bench.joints.requeue(&enable));
    assert_eq!(ask(&mut bench), enable);
}
