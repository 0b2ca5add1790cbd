//! Byte protocols that are not CAN.
//!
//! | module | what it reads and writes |
//! |---|---|
//! | [`candump`] | the text of SocketCAN's `candump`, a line at a time |

pub mod candump;
