//! Errors of the configuration: those of `lk`.

pub use crate::lk::ConfigError;
