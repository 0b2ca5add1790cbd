//! Questions in the place of commands, of the families whose drives answer either.

use drivetrain::frame::CanFrame;
use drivetrain::motor::{DriveProtocol, ImpedanceControl, Order, Target};
use drivetrain::time::TimeStep;
use drivetrain::{lk, rmd};

fn is_torque(frame: &CanFrame) -> bool {
    frame.bytes()[0] == 0xA1
}

/// While a drive answers a question, it goes on with its last command. If that command was not sent, the drive has an older one.
fn never_follow_a_command_that_was_not_sent(mut motor: impl DriveProtocol) {
    let step = TimeStep::of(0.001);
    let order = Order { target: Target::Torque(1.0), share: 1.0, step };
    let (mut questions, mut is_lost) = (0, false);
    for count in 0..300 {
        let frame = motor.control(order);
        let is_question = !is_torque(&frame);
        assert!(!(is_question && is_lost), "{count}: {frame:?}");
        questions += i32::from(is_question);
        is_lost = count % 5 < 2;
        if is_lost {
            motor.unsent(&frame);
        }
    }
    assert!(questions > 5, "{questions}");
}

#[test]
fn a_question_never_follows_a_command_that_was_not_sent() {
    let torque = ImpedanceControl::new(2.0).unwrap();
    let motor = lk::Motor::new(lk::Model::MF9025_16T, 1, torque).unwrap();
    never_follow_a_command_that_was_not_sent(motor);
    let motor = rmd::Motor::new(rmd::Model::X8_120, 1, torque).unwrap();
    never_follow_a_command_that_was_not_sent(motor);
}
