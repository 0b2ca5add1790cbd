//! Programs that measure a motor.

use super::Session;
use crate::identifying::{Identifying, Limits, Subject};
use crate::program::Program;
use crate::tuning::{Plan, Tuning};

impl Session {
    /// Begins to tune a motor.
    ///
    /// # Errors
    /// Names the value of the plan that is none.
    pub(crate) fn start_tuning(&mut self, motor: usize, plan: Plan) -> Result<(), String> {
        let Subject { motor: name, unit, limit, .. } = self.subject(motor);
        let tuning = Tuning::new(plan, name, unit, limit, self.robot().gains(motor))?;
        self.start_program(motor, Program::Tune(Box::new(tuning)));
        Ok(())
    }

    /// Begins to identify a motor.
    ///
    /// # Errors
    /// Names the limit that is none.
    pub(crate) fn start_identifying(&mut self, motor: usize, limits: Limits) -> Result<(), String> {
        let identifying = Identifying::new(limits, self.subject(motor))?;
        self.start_program(motor, Program::Identify(Box::new(identifying)));
        Ok(())
    }

    fn subject(&self, motor: usize) -> Subject {
        let robot = self.robot();
        Subject {
            motor: robot.names().nth(motor).map(|name| name.to_string()).unwrap_or_default(),
            unit: robot.unit(motor),
            limit: robot.limit(motor),
            torque_constant_nm: robot.torque_constant_nm(motor),
        }
    }
}
