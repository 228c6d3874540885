//! A limit on how long processors take to wake, for the whole machine, while the supervisor lives.
//! A processor without work sleeps, the deeper the longer, and each hop of a scan wakes one: that
//! can take longer than the hop's message needs.

use std::{
    fs::File,
    io::{self, Write},
};

use crate::SuperviseError;

/// The system applies the value written here until the process closes the file (Linux, "PM QoS").
const FILE: &str = "/dev/cpu_dma_latency";

pub(crate) struct WakeLimit {
    _file: File,
}

impl WakeLimit {
    /// Lets no processor sleep so deeply that it takes longer than `us` microseconds to wake; with
    /// 0 none sleeps.
    pub fn hold(us: u32) -> Result<Self, SuperviseError> {
        let set = || {
            let mut file = File::options().write(true).open(FILE)?;
            // The file takes a signed number.
            let limit = i32::try_from(us).unwrap_or(i32::MAX);
            file.write_all(&limit.to_ne_bytes())?;
            Ok(Self { _file: file })
        };
        set().map_err(|error: io::Error| {
            SuperviseError::System(format!(
                "cannot limit the time in which processors wake to {us} us (run.cpu_wake_us): {FILE}: {error}; give the user of the run the right to write to it, or leave the key out"
            ))
        })
    }
}
