//! loom's atomics for one writer each. In loom 0.7 the writer's own load hides the other thread's loads from its next
//! store, which is then never tried before them (its issues 166 and 392). So the writer reads what it wrote last, which it
//! would read anyway, without loom's notice.

pub use loom::sync::atomic::Ordering;
use loom::thread::{self, ThreadId};

macro_rules! atomics {
    ($($name:ident: $value:ty)*) => {$(
        #[derive(Debug)]
        pub struct $name {
            value: loom::sync::atomic::$name,
            task: ThreadId,
            written_by_task: bool,
        }

        impl $name {
            /// Written only by the thread that calls this, which is the task.
            pub fn of_task(value: $value) -> Self {
                let value = loom::sync::atomic::$name::new(value);
                Self { value, task: thread::current().id(), written_by_task: true }
            }

            /// Written only by the other thread.
            pub fn of_interrupt(value: $value) -> Self {
                Self { written_by_task: false, ..Self::of_task(value) }
            }

            fn is_mine(&self) -> bool {
                (thread::current().id() == self.task) == self.written_by_task
            }

            pub fn load(&self, order: Ordering) -> $value {
                if self.is_mine() {
                    // SAFETY: loom panics when there is a store that this thread does not know of.
                    unsafe { self.value.unsync_load() }
                } else {
                    self.value.load(order)
                }
            }

            pub fn store(&self, value: $value, order: Ordering) {
                assert!(self.is_mine(), "one end writes what is the other's");
                self.value.store(value, order);
            }
        }
    )*};
}

atomics!(AtomicUsize: usize AtomicU32: u32);
