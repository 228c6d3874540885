//! Kernel, processors, clock, limits of the process, ONNX Runtime, Python.

use std::{collections::BTreeSet, fs};

use gyre_masking::networks::runtime::{self, RuntimeError};
use gyre_results::machine::Machine;
use gyre_run::MOST_OPEN_FILES;
use gyre_stage::python_function::Interpreter;
use rustix::process::{Resource, getrlimit};

use crate::doctor::Finding;

/// Files that a publisher opens for each observer: its queue, its event and its socket.
const FILES_PER_OBSERVER: u64 = 3;
/// Processes and threads of a run, and of the commands around it.
const PROCESSES: u64 = 32;
/// Clock sources that are read without a system call, in tens of nanoseconds.
const FAST_CLOCKS: [&str; 5] = [
    "tsc",
    "kvm-clock",
    "arch_sys_counter",
    "hyperv_clocksource_tsc_page",
    "riscv_clocksource",
];
const CLOCK: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
const GOVERNORS: &str = "/sys/devices/system/cpu/cpufreq";

pub fn kernel() -> Finding {
    let system = rustix::system::uname();
    let text = |part: &std::ffi::CStr| part.to_string_lossy().into_owned();
    let [name, release, machine] = [system.sysname(), system.release(), system.machine()].map(text);
    Finding::good("kernel", format!("{name} {release}, {machine}"))
}

pub fn processors() -> Finding {
    let machine = Machine::this();
    let found = Finding::good("processors", machine.to_string());
    match machine.cores {
        0 | 1 => found.limited("the stages take turns: give it two cores or more"),
        _ => found,
    }
}

/// The variants for which `gyre_simd::simd` compiles the hot loops.
pub fn vector_units() -> Finding {
    let unit = vector_unit();
    let found = Finding::good("vector units", unit.unwrap_or("none beyond the baseline"));
    match unit {
        Some(_) => found,
        None => found.limited("the search takes longer: a processor with AVX2 is faster"),
    }
}

#[cfg(target_arch = "x86_64")]
fn vector_unit() -> Option<&'static str> {
    let avx512 = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl");
    let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    match (avx512, avx2) {
        (true, _) => Some("AVX-512"),
        (false, true) => Some("AVX2"),
        (false, false) => None,
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn vector_unit() -> Option<&'static str> {
    cfg!(target_arch = "aarch64").then_some("NEON")
}

pub fn governor() -> Finding {
    let policies = fs::read_dir(GOVERNORS).into_iter().flatten().flatten();
    let governors: BTreeSet<String> = policies
        .filter_map(|policy| fs::read_to_string(policy.path().join("scaling_governor")).ok())
        .map(|governor| governor.trim().to_owned())
        .collect();
    let names = governors.into_iter().collect::<Vec<_>>().join(", ");
    match names.as_str() {
        "" => Finding::good("cpu governor", "not visible, as on most virtual machines"),
        "performance" => Finding::good("cpu governor", names),
        _ => Finding::good("cpu governor", names)
            .limited("latencies vary with the clock rate: `cpupower frequency-set -g performance`"),
    }
}

pub fn clock() -> Finding {
    let source = fs::read_to_string(CLOCK).unwrap_or_default();
    let source = source.trim();
    let found = Finding::good("clock", format!("monotonic, from {source}"));
    match source {
        "" => Finding::good("clock", "monotonic; its source is not visible"),
        fast if FAST_CLOCKS.contains(&fast) => found,
        _ => found.limited(
            "each reading takes about a microsecond, and a scan has some sixty: boot with clocksource=tsc if the \
             processor allows it",
        ),
    }
}

pub fn open_files(observers: usize) -> Finding {
    let Some(limit) = getrlimit(Resource::Nofile).current else {
        return Finding::good("open files", "no limit");
    };
    let with_observers = MOST_OPEN_FILES + FILES_PER_OBSERVER * observers as u64;
    let found = Finding::good("open files", format!("at most {limit} in a process"));
    match limit {
        0..MOST_OPEN_FILES => found.bad(format!("a stage needs {MOST_OPEN_FILES}: `ulimit -n 1024`")),
        _ if limit < with_observers => found.limited(format!(
            "a stage with {observers} observers of each topic needs {with_observers}: `ulimit -n 1024`"
        )),
        _ => found,
    }
}

pub fn processes() -> Finding {
    let Some(limit) = getrlimit(Resource::Nproc).current else {
        return Finding::good("processes", "no limit");
    };
    let found = Finding::good("processes", format!("at most {limit} of this user"));
    match limit < PROCESSES {
        true => found.bad(format!(
            "a run needs up to {PROCESSES} with their threads: `ulimit -u 1024`"
        )),
        false => found,
    }
}

pub fn core_files() -> Finding {
    let found = match getrlimit(Resource::Core).current {
        Some(0) => {
            "off: after a crash there is none to look at (`ulimit -c unlimited` turns them on)"
        }
        _ => "on",
    };
    Finding::good("core files", found)
}

pub fn onnx_runtime() -> Finding {
    let opened = runtime::find(None).and_then(|path| {
        runtime::open(&path)?;
        Ok(path)
    });
    let error = match opened {
        Ok(path) => return Finding::good("ONNX Runtime", path.display().to_string()),
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
    Finding::good("ONNX Runtime", found).limited(error.to_string())
}

/// The interpreter of stages that are functions of Python.
pub fn python() -> Finding {
    let without = "no stage can be a function of Python";
    let found = match Interpreter::find() {
        Ok(found) => found,
        Err(error) => {
            return Finding::good("Python", format!("none: {without}")).limited(error.to_string());
        }
    };
    let ([major, minor, micro], executable) = (found.version, &found.executable);
    let python = format!("{executable}, {major}.{minor}.{micro}");
    match found.numpy {
        Some(numpy) => Finding::good("Python", format!("{python}, with numpy {numpy}")),
        None => {
            Finding::good("Python", format!("{python}, without numpy: {without}")).limited(format!(
                "install it there: `{executable} -m pip install numpy`, or python3-numpy for the \
                 system's own; or name another Python with GYRE_PYTHON"
            ))
        }
    }
}
