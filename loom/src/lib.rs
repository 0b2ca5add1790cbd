//! The frame queue in every order of its two ends, and with every value that an atomic may then hold.
//!
//! loom runs the sources of `runner::FrameQueue` and of the queue of heapless below it, with its own types in the place
//! of core's: `build.rs` has the table. There too are the defects, each of which a model has to find.

#![cfg(test)]

mod atomic;
mod models;
mod turns;

/// What is tried in every order; see `models`.
enum Model {
    Exchange,
    Count,
    Views,
}

include!(concat!(env!("OUT_DIR"), "/sources.rs"));

#[test]
fn with_one_place_every_frame_is_taken_once_in_order_or_counted_as_dropped() {
    models::run::<2>(Model::Exchange);
}

#[test]
fn with_two_places_every_frame_is_taken_once_in_order_or_counted_as_dropped() {
    models::run::<3>(Model::Exchange);
}

#[test]
fn with_one_place_the_count_of_dropped_frames_never_goes_back_and_ends_at_all() {
    models::run::<2>(Model::Count);
}

#[test]
fn with_one_place_what_waits_can_be_taken_and_what_is_free_can_be_filled() {
    models::run::<2>(Model::Views);
}

#[test]
fn with_two_places_what_waits_can_be_taken_and_what_is_free_can_be_filled() {
    models::run::<3>(Model::Views);
}
