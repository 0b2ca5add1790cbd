//! The frame type of a driver.

use embedded_can::{Frame, Id};

/// A frame as the drivers of bxCAN have it.
#[derive(Clone, Copy)]
pub struct DriverFrame {
    id: Id,
    is_remote: bool,
    dlc: u8,
    pub data: [u8; 8],
}

impl Frame for DriverFrame {
    #[inline]
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self { id: id.into(), is_remote: false, dlc: data.len() as u8, data: bytes })
    }

    #[inline]
    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        (dlc <= 8).then(|| Self { id: id.into(), is_remote: true, dlc: dlc as u8, data: [0; 8] })
    }

    #[inline]
    fn is_extended(&self) -> bool {
        matches!(self.id, Id::Extended(_))
    }

    #[inline]
    fn is_remote_frame(&self) -> bool {
        self.is_remote
    }

    #[inline]
    fn id(&self) -> Id {
        self.id
    }

    #[inline]
    fn dlc(&self) -> usize {
        self.dlc.into()
    }

    #[inline]
    fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.dlc)]
    }
}
