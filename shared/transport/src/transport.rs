//! The transport, iceoryx2, behind a boundary without its types. Its ports are generic in the
//! message; here each is instantiated once, for bytes, and a topic is opened with the names, sizes
//! and alignments of [`gyre_contract::Topic`], as by the transport's bindings for other languages.

mod event;
mod service;

use std::{fmt::Debug, path::Path};

use iceoryx2::{
    node::NodeView,
    prelude::{
        CallbackProgression, Config, FileName, FilePath, LogLevel, NodeBuilder, NodeName,
        NodeState, Path as TransportPath, SemanticString, ServiceName, SignalHandlingMode, ipc,
        set_log_level,
    },
    service::marker::{CustomHeaderMarker, CustomPayloadMarker},
};

use crate::{Manifest, RunError};

pub use event::Event;
#[cfg(test)]
pub(crate) use event::bind_alone;
pub use event::{Listener, Notifier};
pub use service::Service;

pub(crate) type Ipc = ipc::Service;
/// Stands for a header of any type. It has no bytes itself.
pub(crate) type AnyHeader = CustomHeaderMarker;
pub(crate) type AnyPayload = [CustomPayloadMarker];

pub fn data_event(topic: &str) -> String {
    format!("{topic}_data")
}

pub fn handshake_event(topic: &str) -> String {
    format!("{topic}_handshake")
}

#[derive(Clone)]
pub struct Transport(Config);

/// A process in the transport of a run.
pub struct Node(iceoryx2::node::Node<Ipc>);

/// Lets the transport print nothing: what fails is an error that Gyre reports.
pub fn silence() {
    set_log_level(LogLevel::Fatal);
}

impl Manifest {
    /// Returns the transport of the run. Names and paths are unique to the run, and only the
    /// supervisor cleans up.
    pub fn transport(&self) -> Result<Transport, RunError> {
        let mut config = Config::default();
        config.global.prefix = FileName::new(self.prefix.as_bytes())
            .map_err(|e| RunError::transport("name the run", e))?;
        let root = format!("{}/", self.root.display());
        let root = TransportPath::new(root.as_bytes())
            .map_err(|e| RunError::transport("use the run's root", e))?;
        config.global.set_root_path(&root);
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(Transport(config))
    }
}

impl Transport {
    /// Makes the configuration in a file the global one, which the transport uses to clean up
    /// incomplete nodes.
    pub fn use_as_global(path: &Path) -> Result<(), RunError> {
        let failed = |error: &dyn Debug| RunError::manifest(path, format_args!("{error:?}"));
        let file = FilePath::new(path.as_os_str().as_encoded_bytes()).map_err(|e| failed(&e))?;
        Config::setup_global_config_from_file(&file).map_err(|e| failed(&e))?;
        Ok(())
    }

    #[cfg(test)]
    pub(crate) fn config(&self) -> &Config {
        &self.0
    }

    /// Joins the run. The transport's tools show the name.
    pub fn join(&self, name: &str) -> Result<Node, RunError> {
        let name = NodeName::new(name).map_err(|e| RunError::transport("name the node", e))?;
        let node = NodeBuilder::new()
            .name(&name)
            .config(&self.0)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|e| RunError::transport("join the run", e))?;
        Ok(Node(node))
    }

    /// Returns the folder in the run's root where the transport describes its services.
    pub fn services_folder(&self) -> String {
        self.0.global.service.directory.to_string()
    }

    pub fn dead_nodes(&self) -> Vec<String> {
        let mut dead = Vec::new();
        self.for_each_node(|state| {
            if let NodeState::Dead(node) = state {
                dead.push(node.id().value().to_string());
            }
        });
        dead
    }

    /// Returns the ids of the nodes of living processes that joined under a name.
    pub fn living_nodes(&self, name: &str) -> Vec<String> {
        let mut living = Vec::new();
        self.for_each_node(|state| {
            if let NodeState::Alive(node) = state {
                let details = node.details().as_ref();
                if details.is_some_and(|details| details.name().as_str() == name) {
                    living.push(node.id().value().to_string());
                }
            }
        });
        living
    }

    /// Removes the resources of dead processes; returns whether all are removed.
    pub fn remove_dead_nodes(&self) -> bool {
        let mut all = true;
        let listed = self.for_each_node(|state| {
            if let NodeState::Dead(node) = state {
                all &= node.try_remove_stale_resources().is_ok();
            }
        });
        all && listed
    }

    fn for_each_node(&self, mut visit: impl FnMut(NodeState<Ipc>)) -> bool {
        let listed = iceoryx2::node::Node::<Ipc>::list(&self.0, |state| {
            visit(state);
            CallbackProgression::Continue
        });
        listed.is_ok()
    }
}

fn service_name(name: &str) -> Result<ServiceName, RunError> {
    ServiceName::new(name).map_err(|e| RunError::transport(format!("name the service {name}"), e))
}
