//! Registers and ids of the families that have them. Rest and questions are sent, and nothing is armed.

use super::{Out, Task};
use crate::drive::master_id;
use crate::motors::{Model, Spec};
use crate::options::{Command, Options};
use crate::robot::Robot;
use crate::session::Session;
use serde_json::json;

/// Ticks from one request to the next: the drive is asked each 10 ms.
const PATIENCE: u64 = 300;

/// What is asked next.
#[derive(Debug, Clone)]
enum Request {
    Read(String),
    Write(String, f32),
    Store,
    SetId(u8),
}

/// Reads or writes a register of the first motor, or gives it another id.
#[derive(Debug)]
pub(super) struct Setup {
    requests: std::vec::IntoIter<Request>,
    /// The register that is waited for.
    awaited: Option<String>,
    since: u64,
    spec: Option<Spec>,
    said: String,
    is_done: bool,
    failure: Option<String>,
}

/// Tries the command on a robot that nobody hears.
///
/// # Errors
/// Names the register or the id that the drive does not have.
pub(super) fn check(robot: &mut Robot, command: &Command) -> Result<(), String> {
    let name = robot.names().next().map(|name| name.to_string()).unwrap_or_default();
    let drive =
        robot.first_drive().ok_or(format!("{name} has no registers that the bench knows"))?;
    match command {
        Command::Get(register) => drive.read(register),
        Command::Set(register, value) => drive.write(register, *value),
        Command::SetId(id) => drive.set_id(*id),
        _ => Ok(()),
    }
}

/// How `--motors` names a drive with another id. A Damiao keeps its master id, which the new id no longer implies.
fn renamed(spec: Spec, id: u8) -> String {
    let (word, host) = match spec.model {
        Model::Damiao(model) => {
            let number = model.name().trim_start_matches("DM-").trim_start_matches('J');
            (format!("damiao{number}"), Some(master_id(spec)))
        }
        Model::RobStride(model) => (model.name().to_owned(), spec.host),
        _ => return String::new(),
    };
    let host = host.map_or(String::new(), |host| format!(":{host:#x}"));
    format!("{}:{id}{host}", word.to_lowercase())
}

impl Setup {
    /// # Errors
    /// If the command is none of these.
    pub(super) fn new(options: &Options) -> Result<Self, String> {
        let requests = match options.command.clone() {
            Command::Get(register) => vec![Request::Read(register)],
            Command::Set(register, value) => {
                vec![
                    Request::Write(register.clone(), value),
                    Request::Store,
                    Request::Read(register),
                ]
            }
            Command::SetId(id) => vec![Request::SetId(id), Request::Store],
            _ => return Err("no register is asked for".into()),
        };
        Ok(Self {
            requests: requests.into_iter(),
            spec: options.motors.first().copied(),
            awaited: None,
            since: 0,
            said: String::new(),
            is_done: false,
            failure: None,
        })
    }

    /// Asks for what comes next.
    fn begin(&mut self, session: &mut Session, ticks: u64, is_json: bool) -> Result<bool, String> {
        let Some(request) = self.requests.next() else { return Ok(false) };
        let name = session.robot().names().next().map(|name| name.to_string()).unwrap_or_default();
        let is_heard = session.robot().reading(0).is_some_and(|reading| reading.is_heard());
        let drive = session
            .robot_mut()
            .first_drive()
            .ok_or(format!("{name} has no registers that the bench knows"))?;
        self.since = ticks;
        match request {
            Request::Read(register) => {
                drive.read(&register)?;
                self.awaited = Some(register);
            }
            Request::Write(register, value) => {
                drive.write(&register, value)?;
                self.awaited = None;
            }
            Request::Store => drive.store()?,
            Request::SetId(_) if !is_heard => {
                return Err(format!("{name} is not heard: is the id right, and the drive on?"));
            }
            Request::SetId(id) => {
                drive.set_id(id)?;
                let motors = self.spec.map_or(String::new(), |spec| renamed(spec, id));
                self.said = if is_json {
                    format!("{}\n", json!({ "id": id, "motors": motors }))
                } else {
                    format!(
                        "{name} was told to be #{id}: from now on --motors {motors}, and `scan --ask` shows whether it is\n"
                    )
                };
            }
        }
        Ok(true)
    }
}

impl Task for Setup {
    fn begin(&mut self, session: &mut Session) {
        session.talk();
    }

    fn ticked(&mut self, session: &mut Session, ticks: u64, out: &mut Out) -> bool {
        // The drive is asked for the settings that arming looks at first.
        let is_time =
            ticks == 200 || (self.since > 0 && ticks >= self.since + 100 && self.awaited.is_none());
        if let Some(register) = &self.awaited {
            let answer = session.robot_mut().first_drive().and_then(|drive| drive.answer(register));
            if let Some(value) = answer {
                self.said = if out.is_json {
                    format!("{}\n", json!({ "register": register, "value": value }))
                } else {
                    format!("{register} = {value}\n")
                };
                self.is_done = true;
                return false;
            }
            if ticks > self.since + PATIENCE {
                self.failure =
                    Some(format!("{register}: no answer; is the id right, and the drive on?"));
                return false;
            }
        }
        if !is_time {
            return true;
        }
        let begun = self.begin(session, ticks, out.is_json);
        self.is_done = begun == Ok(false);
        self.failure = begun.as_ref().err().cloned();
        begun == Ok(true)
    }

    fn report(&mut self, _: &mut Session, _: &mut Out) -> String {
        if self.is_done { self.said.clone() } else { String::new() }
    }

    fn is_missed(&self) -> bool {
        !self.is_done
    }

    fn failures(&self) -> Vec<String> {
        self.failure.clone().into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motors;
    use drivetrain::{damiao, robstride};

    #[test]
    fn a_drive_with_another_id_is_named_as_the_options_read_it() {
        let damiao = damiao::Model::ALL.iter().map(|model| Model::Damiao(*model));
        let robstride = robstride::Model::ALL.iter().map(|model| Model::RobStride(*model));
        for model in damiao.chain(robstride) {
            let named = motors::parse(&renamed(Spec { model, id: 3, host: None }, 9)).unwrap();
            let host = matches!(model, Model::Damiao(_)).then_some(0x13);
            assert_eq!(named, [Spec { model, id: 9, host }]);
        }
    }
}
