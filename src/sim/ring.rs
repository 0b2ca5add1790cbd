/// A queue of at most `N` values, first in, first out.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ring<T, const N: usize> {
    slots: [Option<T>; N],
    first: usize,
    length: usize,
}

impl<T: Copy, const N: usize> Ring<T, N> {
    pub(crate) const fn new() -> Self {
        Self { slots: [None; N], first: 0, length: 0 }
    }

    pub(crate) const fn len(&self) -> usize {
        self.length
    }

    /// Appends a value; returns it when the queue is full.
    pub(crate) fn push(&mut self, value: T) -> Result<(), T> {
        if self.length >= N {
            return Err(value);
        }
        match self.slots.get_mut((self.first + self.length) % N) {
            Some(slot) => *slot = Some(value),
            None => return Err(value),
        }
        self.length += 1;
        Ok(())
    }

    /// Returns the first value without removing it.
    pub(crate) fn peek(&self) -> Option<T> {
        self.slots.get(self.first).copied().flatten()
    }

    /// Takes out the first value.
    pub(crate) fn pop(&mut self) -> Option<T> {
        let value = self.slots.get_mut(self.first)?.take()?;
        self.first = (self.first + 1) % N;
        self.length -= 1;
        Some(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_out_in_order_through_many_wraps() {
        let mut ring = Ring::<u32, 3>::new();
        let mut expected = 0;
        for value in 0..100 {
            if ring.len() == 3 {
                assert_eq!(ring.push(999), Err(999));
                assert_eq!((ring.peek(), ring.pop()), (Some(expected), Some(expected)));
                expected += 1;
            }
            assert_eq!(ring.push(value), Ok(()));
        }
        assert_eq!(
            [ring.pop(), ring.pop(), ring.pop(), ring.pop()],
            [Some(97), Some(98), Some(99), None]
        );
    }
}
