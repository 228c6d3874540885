//! `gyre doctor`: what this machine lacks for a run, each with its remedy.

use std::{collections::BTreeSet, fs, path::Path, process::ExitCode};

use gyre_client::{
    free_bytes,
    run::{SHARED_MEMORY, free_shared_memory},
};
use gyre_configuration::terminal::{Failure, print};
use gyre_contract::Footprint;
use gyre_masking::networks::runtime::{self, RuntimeError};
use gyre_stage::python_function::Interpreter;

const GOVERNORS: &str = "/sys/devices/system/cpu/cpufreq";

/// A check of the machine: the finding, and the remedy if there is something to do.
type Finding = (String, Option<String>);

/// Prints the findings, and fails if a run cannot work here. Other limits are named by the run that
/// they stop.
pub fn doctor(footprint: &Footprint) -> Result<ExitCode, Failure> {
    let lacks_memory = shared_memory(footprint);
    let works = lacks_memory.1.is_none();
    for (subject, lack, (found, remedy)) in [
        ("shared memory", "FAILS", lacks_memory),
        ("disk", "note", disk()),
        ("cpu governor", "note", governor()),
        ("ONNX Runtime", "note", onnx_runtime()),
        ("Python", "note", python()),
    ] {
        let state = if remedy.is_some() { lack } else { "ok" };
        let remedy = remedy.map(|remedy| format!("\n{:21}-> {remedy}", ""));
        let remedy = remedy.unwrap_or_default();
        print::values(format_args!("{state:<6}{subject:<15}{found}{remedy}"))?;
    }
    print::line(match works {
        true => "a run works here; `gyre demo` tries it",
        false => "no run works here while this fails: shared memory",
    })?;
    Ok(match works {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

/// Acquire the run's root first, which removes the memory of killed runs.
pub fn check_shared_memory(footprint: &Footprint) -> Result<(), Failure> {
    let free = free_shared_memory();
    let free = free.map_err(|error| format!("cannot use shared memory at /dev/shm: {error}"))?;
    match free {
        Some(free) if free < footprint.total() as u64 => Err(format!(
            "shared memory at /dev/shm has {:.1} MB free, but the run needs {footprint}: enlarge it (containers: --shm-size), or lower run.window or raster.n",
            free as f64 / 1e6
        )
        .into()),
        _ => Ok(()),
    }
}

fn shared_memory(footprint: &Footprint) -> Finding {
    let needed = footprint.total() as u64;
    let free = match free_shared_memory() {
        Ok(free) => free,
        Err(error) => {
            let remedy = format!("mount a tmpfs at {SHARED_MEMORY}");
            return (format!("{SHARED_MEMORY}: {error}"), Some(remedy));
        }
    };
    let mb = |bytes: u64| bytes as f64 * 1e-6;
    let room = free.map_or("no limit".to_owned(), |free| {
        format!("{:.1} MB free", mb(free))
    });
    let found = format!(
        "{SHARED_MEMORY}: {room}; a run with default settings needs {:.1} MB",
        mb(needed)
    );
    let remedy = format!(
        "enlarge it (`mount -o remount,size=1G {SHARED_MEMORY}`, containers: --shm-size 1g), or lower run.observers, \
         run.window or raster.n"
    );
    let is_small = free.is_some_and(|free| free < needed);
    (found, is_small.then_some(remedy))
}

/// Megabytes per hour at four scans per second, as measured in docs/on-a-robot.md.
const WRITTEN: &str = "a run writes 22 MB per hour at 4 scans/s; with SLAM 870 MB more, with moving objects 1.2 GB more, with a \
     recording of scans of 576 bins 2.6 GB more";
/// A day of poses and results, and the map of the refinement.
const MIN_FREE: u64 = 600_000_000;

fn disk() -> Finding {
    let Some(free) = free_bytes(Path::new(".")) else {
        return ("the current folder cannot be read".to_owned(), None);
    };
    let remedy = "free some, or start runs in a different folder; record.keep_mb limits recordings";
    let found = format!("{:.1} GB free here; {WRITTEN}", free as f64 * 1e-9);
    (found, (free < MIN_FREE).then(|| remedy.to_owned()))
}

fn governor() -> Finding {
    let policies = fs::read_dir(GOVERNORS).into_iter().flatten().flatten();
    let governors: BTreeSet<String> = policies
        .filter_map(|policy| fs::read_to_string(policy.path().join("scaling_governor")).ok())
        .map(|governor| governor.trim().to_owned())
        .collect();
    let names = governors.into_iter().collect::<Vec<_>>().join(", ");
    let remedy = "latencies vary with the clock rate: `cpupower frequency-set -g performance`";
    match names.as_str() {
        "" => ("not visible, as on most virtual machines".to_owned(), None),
        "performance" => (names, None),
        _ => (names, Some(remedy.to_owned())),
    }
}

fn onnx_runtime() -> Finding {
    let opened = runtime::find(None).and_then(|path| {
        runtime::open(&path)?;
        Ok(path)
    });
    let error = match opened {
        Ok(path) => return (path.display().to_string(), None),
        Err(error) => error,
    };
    let found = match error {
        RuntimeError::Missing => {
            "none: rten computes learned masks and moving objects, which takes longer"
        }
        _ => {
            "cannot be used: no learned masks and moving objects, unless masking.backend is `rten`"
        }
    };
    (found.to_owned(), Some(error.to_string()))
}

/// The interpreter of stages that are functions of Python.
fn python() -> Finding {
    let without = "no stage can be a function of Python";
    let found = match Interpreter::find() {
        Ok(found) => found,
        Err(error) => return (format!("none: {without}"), Some(error)),
    };
    let ([major, minor, micro], executable) = (found.version, &found.executable);
    let python = format!("{executable}, {major}.{minor}.{micro}");
    let remedy = format!(
        "install it there: `{executable} -m pip install numpy`, or python3-numpy for the \
         system's own; or name another Python with GYRE_PYTHON"
    );
    match found.numpy {
        Some(numpy) => (format!("{python}, with numpy {numpy}"), None),
        None => (format!("{python}, without numpy: {without}"), Some(remedy)),
    }
}
