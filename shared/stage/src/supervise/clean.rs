//! Cleaning up in the transport after processes that died.
//!
//! The transport's own cleaning does the work; here is what it stumbles over. A process killed in the middle of making a port
//! can leave a shared-memory file of no length, and whoever opens that waits for ever; or a tag of no content, and cleaning
//! fails for ever. Both are removed first. What has not been seen yet is caught by a time limit.

use std::{
    collections::HashSet, fs, os::unix::fs::PermissionsExt, path::Path, sync::mpsc, thread,
    time::Duration,
};

use iceoryx2::{
    node::NodeView,
    prelude::{CallbackProgression, Config, NodeState},
};

use super::SuperviseError;
use crate::{Manifest, services};

/// Cleaning takes milliseconds; after so long it hangs.
const LIMIT: Duration = Duration::from_secs(3);
/// A finished tag cannot be written to; one that its maker died over still can.
const HALF_MADE: u32 = 0o600;

type TransportNode = iceoryx2::node::Node<services::Ipc>;

/// Removes all that dead processes of the run left in the transport. It must be done before one is started again:
/// then there is room for exactly one publisher a topic, and old and new samples never mix.
pub(super) fn after_the_dead(
    manifest: &Manifest,
    transport: &Config,
    nobody_lives: bool,
) -> Result<(), SuperviseError> {
    let (manifest, transport) = (manifest.clone(), transport.clone());
    let (done, finished) = mpsc::channel();
    // A thread, for if it hangs nothing can end it.
    thread::spawn(move || {
        let cleaned = clean(&manifest, &transport, nobody_lives);
        let _ = done.send(cleaned);
    });
    match finished.recv_timeout(LIMIT) {
        Ok(true) => Ok(()),
        Ok(false) | Err(_) => Err(SuperviseError::TransportStuck),
    }
}

fn clean(manifest: &Manifest, transport: &Config, nobody_lives: bool) -> bool {
    let dead = dead_nodes(transport);
    let ports = ports_of(manifest, &dead);
    unlink_empty_files(Path::new("/dev/shm"), &manifest.prefix, |name| {
        nobody_lives || ports.iter().any(|port| name.contains(port.as_str()))
    });
    if remove_dead_nodes(transport) {
        return true;
    }
    for node in &dead {
        unlink_half_made_tags(&manifest.root.join("nodes").join(node));
    }
    remove_dead_nodes(transport)
}

fn dead_nodes(transport: &Config) -> Vec<String> {
    let mut dead = Vec::new();
    let _ = TransportNode::list(transport, |state| {
        if let NodeState::Dead(node) = state {
            dead.push(node.id().value().to_string());
        }
        CallbackProgression::Continue
    });
    dead
}

fn remove_dead_nodes(transport: &Config) -> bool {
    let mut all = true;
    let listed = TransportNode::list(transport, |state| {
        if let NodeState::Dead(node) = state {
            all &= node.try_remove_stale_resources().is_ok();
        }
        CallbackProgression::Continue
    });
    all && listed.is_ok()
}

/// The ids of dead processes' ports: each has a tag `<prefix><port id>.port_tag` in its node's directory.
fn ports_of(manifest: &Manifest, dead: &[String]) -> HashSet<String> {
    let names = |node: &String| {
        fs::read_dir(manifest.root.join("nodes").join(node))
            .into_iter()
            .flatten()
            .flatten()
    };
    let port = |name: String| {
        Some(
            name.strip_prefix(&manifest.prefix)?
                .strip_suffix(".port_tag")?
                .to_owned(),
        )
    };
    dead.iter()
        .flat_map(names)
        .filter_map(|tag| port(tag.file_name().to_string_lossy().into_owned()))
        .collect()
}

/// Removes files of no length whose names are the run's and pass `is_dead`.
fn unlink_empty_files(directory: &Path, prefix: &str, is_dead: impl Fn(&str) -> bool) {
    for file in fs::read_dir(directory).into_iter().flatten().flatten() {
        let name = file.file_name().to_string_lossy().into_owned();
        let empty = file.metadata().is_ok_and(|file| file.len() == 0);
        if empty && name.starts_with(prefix) && is_dead(&name) {
            let _ = fs::remove_file(file.path());
        }
    }
}

/// Removes tags that a process died over; finished ones are needed for the cleaning.
fn unlink_half_made_tags(directory: &Path) {
    for file in fs::read_dir(directory).into_iter().flatten().flatten() {
        let name = file.file_name().to_string_lossy().into_owned();
        let tag = name.ends_with(".service_tag") || name.ends_with(".port_tag");
        let half_made = file
            .metadata()
            .is_ok_and(|f| f.len() == 0 && f.permissions().mode() & 0o777 == HALF_MADE);
        if tag && half_made {
            let _ = fs::remove_file(file.path());
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn only_empty_files_of_dead_ports_are_removed() {
        let directory = tempfile::tempdir().unwrap();
        for (name, content) in [
            ("run_1_2.connection", ""),
            ("run_3_4.connection", ""),
            ("run_1_5.data", "x"),
            ("other_1", ""),
        ] {
            fs::write(directory.path().join(name), content).unwrap();
        }
        unlink_empty_files(directory.path(), "run_", |name| name.contains("_1_"));
        let mut left: Vec<_> = fs::read_dir(directory.path())
            .unwrap()
            .map(|file| file.unwrap().file_name())
            .collect();
        left.sort();
        assert_eq!(left, ["other_1", "run_1_5.data", "run_3_4.connection"]);
    }

    #[test]
    fn finished_tags_stay() {
        let directory = tempfile::tempdir().unwrap();
        for (name, mode) in [("a.port_tag", 0o600), ("b.port_tag", 0o400)] {
            let path = directory.path().join(name);
            fs::write(&path, b"").unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
        }
        unlink_half_made_tags(directory.path());
        assert!(
            !directory.path().join("a.port_tag").exists()
                && directory.path().join("b.port_tag").exists()
        );
    }
}
