//! For sweeps of other modules.

/// Calls `check` with the bits of every `f32`, on two threads, as the machine of the checks has cores: one a sign, upward.
pub(crate) fn every_f32(check: impl Fn(u32) + Sync) {
    std::thread::scope(|scope| {
        for sign in [0, 1 << 31] {
            let check = &check;
            scope.spawn(move || (0..1 << 31).for_each(|bits| check(sign | bits)));
        }
    });
}
