//! Criterion benches live in `benches/`; this crate is only their home.
