//! The golden vectors of `data/odrive/vectors.json`, through the public face.

use drivetrain::odrive::{Command, Feedback, Firmware, Heartbeat};
use embedded_can::Frame;
use serde_json::Value;

fn number(value: &Value) -> f32 {
    value.to_string().parse().unwrap()
}

fn bytes(text: &Value) -> Vec<u8> {
    let text = text.as_str().unwrap().split_whitespace();
    text.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn id(text: &Value) -> u32 {
    u32::from_str_radix(text.as_str().unwrap().trim_start_matches("0x"), 16).unwrap()
}

#[test]
fn each_vector_holds() {
    let file: Value = serde_json::from_str(include_str!("../data/odrive/vectors.json")).unwrap();
    let vectors = file["vectors"].as_array().unwrap();
    assert_eq!(vectors.len(), 5);
    for vector in vectors {
        let (input, expect) = (&vector["input"], &vector["expect"]);
        let field = |name: &str| number(&input[name]);
        let command = match vector["id"].as_str().unwrap() {
            "odrive.axis_state" => {
                Command::AxisState(input["state"].as_u64().unwrap().try_into().unwrap())
            }
            "odrive.input_pos" => {
                Command::Position(field("pos_turns"), field("vel_ff"), field("torque_ff"))
            }
            "odrive.input_vel" => Command::Velocity(field("vel"), field("torque_ff")),
            "odrive.heartbeat.0_6" => {
                let data = bytes(&input["data"]).try_into().unwrap();
                let heartbeat = Heartbeat::decode(&data, Firmware::V0_6).unwrap();
                assert_eq!(Value::from(heartbeat.axis_error), expect["axis_error"]);
                assert_eq!(Value::from(heartbeat.state), expect["axis_state"]);
                assert_eq!(Value::from(heartbeat.procedure_result), expect["procedure_result"]);
                assert_eq!(Value::from(u8::from(heartbeat.is_done)), expect["trajectory_done"]);
                continue;
            }
            _ => {
                let data = bytes(&input["data"]).try_into().unwrap();
                let expected = Feedback {
                    turns: number(&expect["pos_turns"]),
                    turns_per_s: number(&expect["vel_turns_s"]),
                };
                assert_eq!(Feedback::decode(&data), Some(expected));
                continue;
            }
        };
        let frame = command.frame(input["node"].as_u64().unwrap().try_into().unwrap());
        assert_eq!(frame.header(), id(&expect["can_id"]), "{vector}");
        assert_eq!(frame.data(), bytes(&expect["data"]), "{vector}");
    }
}
