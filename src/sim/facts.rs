//! What the wire and the data sheets say about each motor, as the ESC sees it. (Moves to `dji` with its table.)

use super::Model;

/// The wire facts of one model.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facts {
    pub(crate) ids: u8,
    pub(crate) command_ids: [u16; 2],
    pub(crate) feedback_base: u16,
    pub(crate) command_raw: i16,
    pub(crate) command_full_scale: f32,
    pub(crate) in_volts: bool,
    pub(crate) current_raw: i16,
    pub(crate) current_full_scale_a: f32,
    pub(crate) gear: f32,
    pub(crate) torque_constant_nm_per_a: f32,
    pub(crate) no_load_rpm: f32,
    pub(crate) has_temperature: bool,
}

const M2006: Facts = Facts {
    ids: 8,
    command_ids: [0x200, 0x1FF],
    feedback_base: 0x200,
    command_raw: 10_000,
    command_full_scale: 10.0,
    in_volts: false,
    current_raw: 10_000,
    current_full_scale_a: 10.0,
    gear: 36.0,
    torque_constant_nm_per_a: 0.18,
    no_load_rpm: 500.0,
    has_temperature: false,
};

const M3508: Facts = Facts {
    command_raw: 16_384,
    command_full_scale: 20.0,
    current_raw: 16_384,
    current_full_scale_a: 20.0,
    gear: 3591.0 / 187.0,
    torque_constant_nm_per_a: 0.3,
    no_load_rpm: 482.0,
    has_temperature: true,
    ..M2006
};

const GM6020_VOLTAGE: Facts = Facts {
    ids: 7,
    command_ids: [0x1FF, 0x2FF],
    feedback_base: 0x204,
    command_raw: 25_000,
    command_full_scale: 24.0,
    in_volts: true,
    current_raw: 16_384,
    current_full_scale_a: 3.0,
    gear: 1.0,
    torque_constant_nm_per_a: 0.741,
    no_load_rpm: 320.0,
    has_temperature: true,
};

const GM6020_CURRENT: Facts = Facts {
    command_ids: [0x1FE, 0x2FE],
    command_raw: 16_384,
    command_full_scale: 3.0,
    in_volts: false,
    ..GM6020_VOLTAGE
};

impl Facts {
    pub(crate) const fn of(model: Model) -> Self {
        match model {
            Model::M2006 => M2006,
            Model::M3508 => M3508,
            Model::Gm6020Voltage => GM6020_VOLTAGE,
            Model::Gm6020Current => GM6020_CURRENT,
        }
    }

    /// Returns the command id and the slot of a motor id; `None` when the model has no such id.
    pub(crate) const fn place(&self, id: u8) -> Option<(u16, u8)> {
        let [low, high] = self.command_ids;
        match id {
            1..=4 if id <= self.ids => Some((low, id - 1)),
            5..=8 if id <= self.ids => Some((high, id - 5)),
            _ => None,
        }
    }
}
