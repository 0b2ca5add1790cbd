//! Takes fields from the front of a slice, and puts them there.

use super::EncodeError;

/// Reads from the front. Every method gives `None` when the bytes are used up.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Reader<'_> {
    pub(super) fn take<const K: usize>(&mut self) -> Option<[u8; K]> {
        let (field, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*field)
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.take().map(|[byte]| byte)
    }

    pub(super) fn u16_le(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    pub(super) fn i16_le(&mut self) -> Option<i16> {
        self.take().map(i16::from_le_bytes)
    }

    pub(super) fn i16_be(&mut self) -> Option<i16> {
        self.take().map(i16::from_be_bytes)
    }

    pub(super) fn i32_le(&mut self) -> Option<i32> {
        self.take().map(i32::from_le_bytes)
    }

    pub(super) fn i32_be(&mut self) -> Option<i32> {
        self.take().map(i32::from_be_bytes)
    }

    pub(super) fn f32_le(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }

    /// Reads `K` fields of one kind.
    pub(super) fn array<T: Copy + Default, const K: usize>(
        &mut self,
        mut field: impl FnMut(&mut Self) -> Option<T>,
    ) -> Option<[T; K]> {
        let mut values = [T::default(); K];
        for value in &mut values {
            *value = field(self)?;
        }
        Some(values)
    }
}

/// Writes from the front, into a slice of sufficient length.
#[derive(Debug)]
pub(super) struct Writer<'a> {
    out: &'a mut [u8],
    at: usize,
}

impl<'a> Writer<'a> {
    /// Takes exactly `needed` bytes of `out`.
    pub(super) fn new(out: &'a mut [u8], needed: usize) -> Result<Self, EncodeError> {
        let given = out.len();
        let out = out.get_mut(..needed).ok_or(EncodeError::BufferTooSmall { needed, given })?;
        Ok(Self { out, at: 0 })
    }

    pub(super) fn put(&mut self, bytes: &[u8]) {
        let place = self.at.checked_add(bytes.len()).and_then(|end| self.out.get_mut(self.at..end));
        if let Some(place) = place {
            place.copy_from_slice(bytes);
            self.at += bytes.len();
        }
    }

    /// Returns the bytes written so far.
    pub(super) fn written(&self) -> &[u8] {
        self.out.get(..self.at).unwrap_or(&[])
    }

    /// Gives the frame back.
    pub(super) fn finish(self) -> &'a [u8] {
        self.out
    }
}
