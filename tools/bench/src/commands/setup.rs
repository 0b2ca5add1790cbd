//! Registers and ids of the families that have them. Rest and questions are sent, and nothing is armed.

use super::{Out, Task};
use crate::options::{Command, Options};
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
    said: String,
    is_done: bool,
    failure: Option<String>,
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
        let (awaited, said, failure) = (None, String::new(), None);
        Ok(Self {
            requests: requests.into_iter(),
            awaited,
            since: 0,
            said,
            is_done: false,
            failure,
        })
    }

    /// Asks for what comes next.
    fn begin(&mut self, session: &mut Session, ticks: u64) -> Result<bool, String> {
        let Some(request) = self.requests.next() else { return Ok(false) };
        let name = session.robot().names().next().map(|name| name.to_string()).unwrap_or_default();
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
            Request::SetId(id) => {
                drive.set_id(id)?;
                self.said =
                    format!("{name} was told to be #{id}: `scan --ask` shows whether it is\n");
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
        if is_time {
            match self.begin(session, ticks) {
                Ok(true) => {}
                Ok(false) => {
                    self.is_done = true;
                    return false;
                }
                Err(error) => {
                    self.failure = Some(error);
                    return false;
                }
            }
        }
        true
    }

    fn report(&mut self, _: &mut Session, _: &mut Out) -> String {
        match &self.failure {
            Some(failure) => format!("{failure}\n"),
            None => self.said.clone(),
        }
    }

    fn is_missed(&self) -> bool {
        !self.is_done
    }
}
