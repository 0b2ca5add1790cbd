//! Addresses of registers, for [`read`](super::read) and [`write`](super::write).

/// The number on the line, in the EEPROM.
pub const ID: u8 = 5;
/// 0: 1 Mbaud, 1: 500k, 2: 250k, 3: 128k, 4: 115200, 5: 76800, 6: 57600, 7: 38400.
pub const BAUD_RATE: u8 = 6;
/// The lowest position, two bytes.
pub const MIN_ANGLE: u8 = 9;
/// The highest position, two bytes.
pub const MAX_ANGLE: u8 = 11;
/// Added to the position, two bytes with sign.
pub const OFFSET: u8 = 31;
/// 0: position, 1: wheel (speed).
pub const MODE: u8 = 33;
/// 1: torque on, 0: off, 128: take the present position as 2048.
pub const TORQUE: u8 = 40;
/// In 100 steps per second².
pub const ACCELERATION: u8 = 41;
/// Two bytes with sign, in counts.
pub const GOAL_POSITION: u8 = 42;
/// Two bytes.
pub const GOAL_TIME: u8 = 44;
/// Two bytes with sign, in counts per second.
pub const GOAL_SPEED: u8 = 46;
/// Two bytes, in 0.1 % of the stall torque.
pub const TORQUE_LIMIT: u8 = 48;
/// 0: the EEPROM can be written, 1: the EEPROM is locked.
pub const LOCK: u8 = 55;
/// Two bytes with sign, in counts.
pub const PRESENT_POSITION: u8 = 56;
/// Two bytes with sign, in counts per second.
pub const PRESENT_SPEED: u8 = 58;
/// Two bytes with sign, in 0.1 % of the largest output.
pub const PRESENT_LOAD: u8 = 60;
/// In 0.1 V.
pub const PRESENT_VOLTAGE: u8 = 62;
/// In degrees Celsius.
pub const PRESENT_TEMPERATURE: u8 = 63;
/// 1 while the servo moves.
pub const MOVING: u8 = 66;
/// Two bytes with sign, in 6.5 mA.
pub const PRESENT_CURRENT: u8 = 69;
