//! All families side by side: rest after whatever ends the driving, the load of the bus, and the table of faults and families in `docs/faults.md`.

#![cfg(test)]

mod drives;
mod faults;
mod joint;
mod limits;
mod load;
mod motors;
mod places;
mod questions;
mod rest;
mod station;
mod switch;
mod table;
