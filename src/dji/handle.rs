use super::Model;
use core::marker::PhantomData;

/// Names a motor of a bus: one byte, `Copy`, with the model as a type.
///
/// `B` is the brand of the bus ([`Bus::branded`](super::Bus::branded)); handles of differently branded buses do
/// not mix. A handle of a motor that was detached finds nothing, even when another motor took its place.
pub struct Handle<M: Model, B = ()> {
    key: Key,
    brand: PhantomData<fn() -> (M, B)>,
}

/// Names a motor of a bus whatever its model: for logging, tuning and everything that all models can do.
pub struct AnyHandle<B = ()> {
    key: Key,
    brand: PhantomData<fn() -> B>,
}

/// Slot index in the low half, generation in the high half.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Key(u8);

impl Key {
    pub(super) const GENERATIONS: u8 = 16;
    /// Names no slot: there are 11.
    pub(super) const NONE: Self = Self(0xFF);

    pub(super) const fn new(index: u8, generation: u8) -> Self {
        Self(generation << 4 | (index & 15))
    }

    pub(super) const fn index(self) -> usize {
        (self.0 & 15) as usize
    }

    /// Returns the index as it is kept in small places.
    pub(super) const fn place(self) -> u8 {
        self.0 & 15
    }

    pub(super) const fn generation(self) -> u8 {
        self.0 >> 4
    }
}

impl<M: Model, B> Handle<M, B> {
    pub(super) const fn new(key: Key) -> Self {
        Self { key, brand: PhantomData }
    }

    /// Forgets the model.
    #[must_use]
    pub const fn erase(self) -> AnyHandle<B> {
        AnyHandle::new(self.key)
    }
}

impl<B> AnyHandle<B> {
    pub(super) const fn new(key: Key) -> Self {
        Self { key, brand: PhantomData }
    }

    pub(super) const fn key(self) -> Key {
        self.key
    }
}

impl<M: Model, B> From<Handle<M, B>> for AnyHandle<B> {
    fn from(handle: Handle<M, B>) -> Self {
        handle.erase()
    }
}

impl<M: Model, B> Clone for Handle<M, B> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: Model, B> Copy for Handle<M, B> {}
impl<M: Model, B> PartialEq for Handle<M, B> {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}
impl<M: Model, B> Eq for Handle<M, B> {}
impl<M: Model, B> core::fmt::Debug for Handle<M, B> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Handle({} in slot {})", M::FACTS.name, self.key.index())
    }
}

impl<B> Clone for AnyHandle<B> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<B> Copy for AnyHandle<B> {}
impl<B> PartialEq for AnyHandle<B> {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}
impl<B> Eq for AnyHandle<B> {}
impl<B> core::fmt::Debug for AnyHandle<B> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "AnyHandle(slot {})", self.key.index())
    }
}
