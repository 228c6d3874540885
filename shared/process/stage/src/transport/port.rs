//! The port that receives a topic.

use std::slice;

use iceoryx2::{
    port::{ReceiveError, port_name::PortName, subscriber},
    sample,
};

use super::{AnyHeader, AnyPayload, Ipc, Service};
use crate::StageError;

pub(crate) struct Subscriber {
    topic: &'static str,
    header_bytes: usize,
    is_observer: bool,
    port: subscriber::Subscriber<Ipc, AnyPayload, AnyHeader>,
}

/// A message in shared memory, borrowed from its publisher until it is dropped.
pub(crate) struct Sample {
    sample: sample::Sample<Ipc, AnyPayload, AnyHeader>,
    header_bytes: usize,
}

impl Subscriber {
    /// Subscribes as a process of the run, or as an observer, under a name for counting observers.
    pub(crate) fn create(service: &Service, observer: Option<&str>) -> Result<Self, StageError> {
        let topic = service.topic.name;
        let mut builder = service.factory.subscriber_builder();
        if let Some(name) = observer {
            let name = PortName::new(name);
            builder =
                builder.name(&name.map_err(|e| StageError::transport("name the observer", e))?);
        }
        let port = builder.create();
        let port = port.map_err(|e| StageError::transport(format!("subscribe to {topic}"), e))?;
        Ok(Self {
            topic,
            header_bytes: service.topic.header.bytes,
            is_observer: observer.is_some(),
            port,
        })
    }

    /// Receives the next message; `None` if the queue is empty, or cannot be read now.
    pub(crate) fn receive(&self) -> Result<Option<Sample>, StageError> {
        match self.port.receive() {
            Ok(sample) => Ok(sample.map(|sample| Sample {
                sample,
                header_bytes: self.header_bytes,
            })),
            // Samples of a dead publisher are still borrowed. The next call succeeds once they are
            // released.
            Err(ReceiveError::ExceedsMaxBorrows) if !self.is_observer => Ok(None),
            // The publisher has just died or is being restarted. Its next message is found at the
            // next wake-up.
            Err(ReceiveError::ConnectionFailure(_)) if self.is_observer => Ok(None),
            Err(e) => Err(StageError::transport(format!("receive {}", self.topic), e)),
        }
    }
}

impl Sample {
    pub(crate) fn header(&self) -> &[u8] {
        let header = std::ptr::from_ref(self.sample.user_header()).cast::<u8>();
        // SAFETY: the topic was opened with this size of headers, so that the sample has as many
        // bytes there, which its publisher does not write any more.
        unsafe { slice::from_raw_parts(header, self.header_bytes) }
    }

    pub(crate) fn payload(&self) -> &[u8] {
        let payload = self.sample.payload();
        // SAFETY: an element of `AnyPayload` is one byte.
        unsafe { slice::from_raw_parts(payload.as_ptr().cast::<u8>(), payload.len()) }
    }
}
