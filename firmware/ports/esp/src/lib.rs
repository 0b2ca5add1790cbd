//! The TWAI of an ESP32-C3.
//!
//! Its controller holds one frame, and esp-hal calls that frame back when nobody acknowledges it, after some 2 ms. The error of this
//! call and success then take turns, so the runner does not report the bus as down: lost feedback relaxes the motors after 10 ms.
//! [`EspTwai`] mends the rest: an overrun would leave the receiver deaf, and bus-off would last for ever.
#![no_std]
#![warn(missing_docs)]

use drivetrain::runner::{Nb, Port};
use embedded_can::{Error, ErrorKind, nb::Can};
use esp_hal::twai::{EspTwaiError, EspTwaiFrame, Twai};
use esp_hal::{Blocking, DriverMode};

/// The whole driver, blocking or async, which recovers from overrun and bus-off: `Nb(EspTwai::new(twai))` is a port.
pub struct EspTwai<'d, M: DriverMode> {
    twai: Twai<'d, M>,
    /// Recovery takes 128 times 11 bits, and would begin anew with each request.
    is_recovering: bool,
}

impl<'d, M: DriverMode> EspTwai<'d, M> {
    /// Takes the driver that was started.
    pub fn new(twai: Twai<'d, M>) -> Self {
        Self { twai, is_recovering: false }
    }

    fn recover(&mut self) {
        let is_bus_off = self.twai.is_bus_off();
        if is_bus_off && !self.is_recovering {
            self.twai.initiate_recovery();
        }
        self.is_recovering = is_bus_off;
    }
}

impl<M: DriverMode> Can for EspTwai<'_, M> {
    type Frame = EspTwaiFrame;
    type Error = EspTwaiError;

    fn transmit(&mut self, frame: &EspTwaiFrame) -> nb::Result<Option<EspTwaiFrame>, EspTwaiError> {
        self.twai.transmit(frame).map(|()| None)
    }

    fn receive(&mut self) -> nb::Result<EspTwaiFrame, EspTwaiError> {
        self.recover();
        let received = self.twai.receive();
        if let Err(nb::Error::Other(error)) = &received
            && error.kind() == ErrorKind::Overrun
        {
            self.twai.clear_receive_fifo();
        }
        received
    }
}

const fn is_port<P: Port>() {}
const _: () = is_port::<Nb<EspTwai<'static, Blocking>>>();
