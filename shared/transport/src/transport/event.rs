//! Events: notifications without content.

use std::{
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    sync::{Mutex, MutexGuard, PoisonError},
};

use iceoryx2::{
    port::{listener, notifier},
    prelude::FileDescriptorBased,
    service::port_factory::event,
};

use super::{Ipc, Node, service_name};
use crate::RunError;

/// Spare ports of an event: a listener that is killed during its creation can occupy one until the
/// run ends.
const HEADROOM: usize = 6;

/// Held while a listener is created. The transport binds its socket under a umask of 0177, which it
/// sets for the whole process and puts back: of two threads that do so at once, one puts back the
/// umask of the other.
static BINDING: Mutex<()> = Mutex::new(());

/// Waits until no listener is being created by another thread of this process, and keeps it so.
pub(crate) fn bind_alone() -> MutexGuard<'static, ()> {
    BINDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An event. It exists as long as a process has it open.
pub struct Event(event::PortFactory<Ipc>);

pub struct Listener {
    event: String,
    port: listener::Listener<Ipc>,
}

pub struct Notifier {
    event: String,
    port: notifier::Notifier<Ipc>,
}

impl Event {
    /// Creates an event with room for listeners, notifiers, and the nodes of both.
    pub fn create(
        node: &Node,
        name: &str,
        [listeners, notifiers]: [usize; 2],
        nodes: usize,
    ) -> Result<Self, RunError> {
        node.0
            .service_builder(&service_name(name)?)
            .event()
            .max_listeners(listeners + HEADROOM)
            .max_notifiers(notifiers + HEADROOM)
            .max_nodes(nodes)
            .event_id_max_value(1)
            .create()
            .map(Self)
            .map_err(|e| RunError::transport(format!("create the event {name}"), e))
    }

    fn open(node: &Node, name: &str) -> Result<Self, RunError> {
        node.0
            .service_builder(&service_name(name)?)
            .event()
            .open()
            .map(Self)
            .map_err(|e| RunError::transport(format!("open the event {name}"), e))
    }
}

impl Listener {
    pub fn open(node: &Node, event: &str) -> Result<Self, RunError> {
        let event_service = Event::open(node, event)?;
        let _alone = bind_alone();
        let created = event_service.0.listener_builder().create();
        let port = created.map_err(|e| RunError::transport(format!("listen to {event}"), e))?;
        Ok(Self {
            event: event.to_owned(),
            port,
        })
    }

    pub fn take(&self) -> Result<usize, RunError> {
        let mut notifications = 0;
        let taken = self.port.try_wait(|_| notifications += 1);
        taken.map_err(|e| RunError::transport(format!("read {}", self.event), e))?;
        Ok(notifications)
    }
}

impl Listener {
    /// Returns a copy of the descriptor, so that a different thread can wait.
    pub fn descriptor(&self) -> Result<OwnedFd, RunError> {
        let descriptor = self.as_fd().try_clone_to_owned();
        descriptor.map_err(|e| RunError::transport(format!("wait for {}", self.event), e))
    }
}

impl AsFd for Listener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        // SAFETY: the listener owns the descriptor, and the borrow has the listener's lifetime.
        unsafe { BorrowedFd::borrow_raw(self.port.file_descriptor().native_handle()) }
    }
}

impl Notifier {
    pub fn open(node: &Node, event: &str) -> Result<Self, RunError> {
        let created = Event::open(node, event)?.0.notifier_builder().create();
        let port = created.map_err(|e| RunError::transport(format!("notify {event}"), e))?;
        Ok(Self {
            event: event.to_owned(),
            port,
        })
    }

    pub fn notify(&self) -> Result<(), RunError> {
        let notified = self.port.notify().map(drop);
        notified.map_err(|e| RunError::transport(format!("notify {}", self.event), e))
    }
}
