//! Removes the transport's resources of dead processes, by the transport's own cleanup. A process
//! that is killed while it creates a port can leave an empty shared-memory file, for which every
//! process that opens it waits for ever, or an empty tag, by which every cleanup fails: both go
//! first.

use std::{
    collections::HashSet,
    fs,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

use gyre_client::observer;
use gyre_transport::{
    Manifest,
    run::{self, SHARED_MEMORY},
    transport::Transport,
};

use crate::{SuperviseError, run::Run};

const LIMIT: Duration = Duration::from_secs(3);
/// Time between two looks for killed observers.
const PERIOD: Duration = Duration::from_secs(1);
/// The same after a cleanup that failed or did not end. No stage needs it: every restart of a stage
/// includes a cleanup.
const PERIOD_AFTER_FAILURE: Duration = Duration::from_secs(30);
/// Time after which a file that is still empty is not being created any more, which takes
/// microseconds.
const UNFINISHED: Duration = Duration::from_millis(200);
/// File mode of an incomplete tag. A complete one is read-only.
const INCOMPLETE: u32 = 0o600;

/// Removes all resources of dead processes. This must precede a restart: a topic has room for
/// exactly one publisher, and old and new samples must not mix.
pub(crate) fn remove_dead(
    manifest: &Manifest,
    transport: &Transport,
    all_dead: bool,
) -> Result<(), SuperviseError> {
    let (manifest, transport) = (manifest.clone(), transport.clone());
    within_limit(move || clean(&manifest, &transport, all_dead))
}

/// Also removes the files that would make a stage wait for a stopped observer.
fn remove_dead_observers(manifest: &Manifest, transport: &Transport) -> Result<(), SuperviseError> {
    let (manifest, transport) = (manifest.clone(), transport.clone());
    within_limit(move || {
        unlink_unfinished_files(&manifest, &transport);
        clean(&manifest, &transport, false)
    })
}

/// Looks for killed observers beside the run's own processes; returns when to look again. At a low
/// rate, since nothing informs the supervisor of their death.
pub(crate) fn sweep_observers(run: &Run<'_>, processes: usize) -> Instant {
    let has_observers = nodes(run.manifest()) > processes;
    let failed = has_observers && remove_dead_observers(run.manifest(), &run.transport).is_err();
    let period = match failed {
        true => PERIOD_AFTER_FAILURE,
        false => PERIOD,
    };
    Instant::now() + period
}

fn nodes(manifest: &Manifest) -> usize {
    let entries = fs::read_dir(manifest.root.join("nodes")).into_iter();
    let is_directory = |entry: &fs::DirEntry| entry.file_type().is_ok_and(|kind| kind.is_dir());
    entries.flatten().flatten().filter(is_directory).count()
}

fn within_limit(clean: impl Fn() -> bool + Clone + Send + 'static) -> Result<(), SuperviseError> {
    let (done, finished) = mpsc::channel();
    let cleaning = clean.clone();
    // On a thread of its own, since a cleanup that hangs cannot be cancelled.
    let thread = thread::Builder::new().spawn(move || {
        let _ = done.send(cleaning());
    });
    let cleaned = match thread {
        Ok(_) => finished.recv_timeout(LIMIT).unwrap_or(false),
        // The system has no room for a thread.
        Err(_) => clean(),
    };
    match cleaned {
        true => Ok(()),
        false => Err(SuperviseError::TransportStuck),
    }
}

fn clean(manifest: &Manifest, transport: &Transport, all_dead: bool) -> bool {
    let dead = transport.dead_nodes();
    let ports = ports_of(manifest, &dead);
    let is_dead = |name: &str| all_dead || ports.iter().any(|port| name.contains(port.as_str()));
    let empty = empty_files(Path::new(SHARED_MEMORY), &manifest.prefix, is_dead);
    empty
        .into_iter()
        .for_each(|file| drop(fs::remove_file(file)));
    if transport.remove_dead_nodes() {
        return true;
    }
    for node in &dead {
        unlink_incomplete_tags(&manifest.root.join("nodes").join(node));
    }
    transport.remove_dead_nodes()
}

/// An observer was stopped while it created them.
fn unlink_unfinished_files(manifest: &Manifest, transport: &Transport) {
    let ports = ports_of(manifest, &transport.living_nodes(observer::NAME));
    let unfinished = || {
        let is_of_observer = |name: &str| ports.iter().any(|port| name.contains(port.as_str()));
        empty_files(Path::new(SHARED_MEMORY), &manifest.prefix, is_of_observer)
    };
    let seen = unfinished();
    if !seen.is_empty() {
        thread::sleep(UNFINISHED);
        let still = unfinished().into_iter().filter(|file| seen.contains(file));
        still.for_each(|file| drop(fs::remove_file(file)));
    }
}

/// Returns the ids of the ports of dead processes: each has a tag `<prefix><port id>.port_tag` in
/// the directory of its node.
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

fn empty_files(directory: &Path, prefix: &str, is_meant: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let empty = run::own_files(directory, prefix).filter(|(path, file)| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        file.len() == 0 && is_meant(&name)
    });
    empty.map(|(path, _)| path).collect()
}

/// Removes tags that a process died creating. The cleanup needs the complete ones.
fn unlink_incomplete_tags(directory: &Path) {
    for file in fs::read_dir(directory).into_iter().flatten().flatten() {
        let name = file.file_name().to_string_lossy().into_owned();
        let tag = name.ends_with(".service_tag") || name.ends_with(".port_tag");
        let incomplete = file
            .metadata()
            .is_ok_and(|f| f.len() == 0 && f.permissions().mode() & 0o777 == INCOMPLETE);
        if tag && incomplete {
            let _ = fs::remove_file(file.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use gyre_client::Run;
    use gyre_contract::Pose;
    use gyre_transport::wake::Signals;

    use super::*;
    use crate::{rig::Rig, tests::manifest};

    #[test]
    fn only_empty_files_of_dead_ports_are_found() {
        let directory = tempfile::tempdir().unwrap();
        for (name, content) in [
            ("run_1_2.connection", ""),
            ("run_3_4.connection", ""),
            ("run_1_5.data", "x"),
            ("other_1", ""),
        ] {
            fs::write(directory.path().join(name), content).unwrap();
        }
        let empty = empty_files(directory.path(), "run_", |name| name.contains("_1_"));
        assert_eq!(empty, [directory.path().join("run_1_2.connection")]);
    }

    #[test]
    fn an_empty_file_that_a_stopped_observer_began_does_not_stay() {
        let (out, signals) = (tempfile::tempdir().unwrap(), Signals::install().unwrap());
        let guardian = ["cat".to_owned()];
        let mut run = Rig::new(manifest(out.path()), "", &guardian, &signals).unwrap();
        run.create_services().unwrap();
        let manifest = run.manifest();
        let transport = manifest.transport().unwrap();
        let observed = Run::at(&manifest.root).unwrap();
        let _observer = observed.observe::<Pose>().unwrap();
        let of_observer = ports_of(manifest, &transport.living_nodes(observer::NAME));
        let file = |port: &str| {
            let name = format!("{}0_{port}.connection", manifest.prefix);
            let path = Path::new(SHARED_MEMORY).join(name);
            fs::write(&path, "").unwrap();
            path
        };
        let begun: Vec<_> = of_observer.iter().map(|port| file(port)).collect();
        let of_a_stage = file("1");
        assert!(remove_dead_observers(manifest, &transport).is_ok());
        assert!(!begun.is_empty() && begun.iter().all(|path| !path.exists()));
        assert!(of_a_stage.exists());
    }

    #[test]
    fn complete_tags_stay() {
        let directory = tempfile::tempdir().unwrap();
        for (name, mode) in [("a.port_tag", 0o600), ("b.port_tag", 0o400)] {
            let path = directory.path().join(name);
            fs::write(&path, b"").unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
        }
        unlink_incomplete_tags(directory.path());
        assert!(
            !directory.path().join("a.port_tag").exists()
                && directory.path().join("b.port_tag").exists()
        );
    }
}
