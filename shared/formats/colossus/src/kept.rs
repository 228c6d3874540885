//! An azimuth that outlives the buffer it was received in.

use crate::message::{Azimuth, Powers};

#[derive(Clone, Debug, Default)]
pub(crate) struct KeptAzimuth {
    sweep_counter: u16,
    encoder: u16,
    seconds: [u8; 4],
    split_seconds: [u8; 4],
    sixteen: bool,
    powers: Vec<u8>,
}

impl KeptAzimuth {
    pub(crate) fn keep(&mut self, azimuth: &Azimuth<'_>) {
        self.sweep_counter = azimuth.sweep_counter;
        self.encoder = azimuth.encoder;
        self.seconds = azimuth.seconds;
        self.split_seconds = azimuth.split_seconds;
        self.sixteen = matches!(azimuth.powers, Powers::Sixteen(_));
        self.powers.clear();
        self.powers.extend_from_slice(azimuth.powers.bytes());
    }

    pub(crate) fn azimuth(&self) -> Azimuth<'_> {
        Azimuth {
            sweep_counter: self.sweep_counter,
            encoder: self.encoder,
            seconds: self.seconds,
            split_seconds: self.split_seconds,
            powers: match self.sixteen {
                true => Powers::Sixteen(&self.powers),
                false => Powers::Eight(&self.powers),
            },
        }
    }
}
