//! The ports that publish and receive a topic.

use std::slice;

use gyre_messages::{Item, Limits, Window};
use iceoryx2::{
    port::{
        ReceiveError, port_name::PortName, publisher, subscriber,
        update_connections::UpdateConnections,
    },
    prelude::BackpressureStrategy,
    sample,
    sample_mut::SampleMut,
};

use super::{AnyHeader, AnyPayload, Ipc, Service};
use crate::StageError;

pub(crate) struct Publisher {
    topic: &'static str,
    header_bytes: usize,
    elements: usize,
    port: publisher::Publisher<Ipc, AnyPayload, AnyHeader>,
}

pub(crate) struct Loan {
    sample: SampleMut<Ipc, AnyPayload, AnyHeader>,
    header_bytes: usize,
}

impl Publisher {
    pub(crate) fn create(
        service: &Service,
        window: &Window,
        limits: &Limits,
    ) -> Result<Self, StageError> {
        let topic = &service.topic;
        let (sizes, elements) = ((topic.sizes)(window), (topic.max_elements)(limits));
        let port = service
            .factory
            .publisher_builder()
            .initial_max_slice_len(elements)
            .max_loaned_samples(sizes.loaned)
            // The transport would reserve a queue of samples of its own for each subscriber.
            .override_sample_preallocation(move |_| sizes.samples())
            // Never wait for a slow or dead reader: the window bounds the items in flight.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| StageError::transport(format!("publish {}", topic.name), e))?;
        Ok(Self {
            topic: topic.name,
            header_bytes: topic.header.bytes,
            elements,
            port,
        })
    }

    /// Returns the number in the name of its shared memory.
    pub(crate) fn id(&self) -> u128 {
        self.port.id().value()
    }

    /// Loans a message of the longest payload. The header is zero; the payload is whatever is in
    /// memory.
    pub(crate) fn loan(&self) -> Result<Loan, StageError> {
        // SAFETY: the topic's payload is a slice, so that any number of elements may be loaned.
        let sample = unsafe { self.port.loan_custom_payload(self.elements) }
            .map_err(|e| StageError::transport(format!("get memory for {}", self.topic), e))?;
        let mut loan = Loan {
            // SAFETY: any bytes of mapped memory are valid values of bytes.
            sample: unsafe { sample.assume_init() },
            header_bytes: self.header_bytes,
        };
        loan.header().fill(0);
        Ok(loan)
    }

    /// Publishes a message without copying: readers receive its offset in shared memory.
    pub(crate) fn send(&self, loan: Loan) -> Result<(), StageError> {
        let sent = loan.sample.send();
        sent.map(drop)
            .map_err(|e| StageError::transport(format!("send {}", self.topic), e))
    }

    pub(crate) fn connect(&self) -> Result<(), StageError> {
        self.port
            .update_connections()
            .map_err(|e| StageError::transport(format!("connect the readers of {}", self.topic), e))
    }
}

impl Loan {
    pub(crate) fn parts(&mut self) -> (&mut [u8], &mut [u8]) {
        let header = std::ptr::from_mut(self.sample.user_header_mut()).cast::<u8>();
        let payload = self.sample.payload_mut();
        let (elements, bytes) = (payload.as_mut_ptr().cast::<u8>(), payload.len());
        // SAFETY: the topic was opened with this size of headers, so that the sample has as many
        // bytes there. `loan` has written them. An element of `AnyPayload` is one byte. Header and
        // payload are disjoint parts of a sample that this loan owns.
        unsafe {
            (
                slice::from_raw_parts_mut(header, self.header_bytes),
                slice::from_raw_parts_mut(elements, bytes),
            )
        }
    }

    pub(crate) fn header(&mut self) -> &mut [u8] {
        self.parts().0
    }

    /// Returns the item of the message's scan, which is at the start of every header.
    pub(crate) fn item(&mut self) -> &mut Item {
        bytemuck::from_bytes_mut(&mut self.header()[..size_of::<Item>()])
    }
}

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
