//! `gyre benchmark`: a batch, judged by the rules of a benchmark.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Args;
use gyre_configuration::terminal::{Failure, INTERRUPTED, print};
use gyre_tools::benchmark::Benchmark;

use crate::batch::{BatchArguments, rows};

#[derive(Debug, Args)]
pub struct BenchmarkArguments {
    /// The dataset: its rules and its configuration.
    pub dataset: Benchmark,
    /// The drives, as `gyre batch` takes them: a folder whose sub-folders are recordings, or a
    /// list.
    pub folder: PathBuf,
    /// The folder of the runs, the table and the files. Default: `out/DATASET`.
    /// Complete drives in the folder are kept.
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
}

/// Computes the drives that are not complete, and judges all. Returns the exit code of the batch.
pub fn benchmark(arguments: &BenchmarkArguments) -> Result<ExitCode, Failure> {
    let name = arguments.dataset.name;
    let default = || Path::new("out").join(name);
    let batch = BatchArguments {
        list: arguments.folder.clone(),
        out: arguments.out.clone().unwrap_or_else(default),
        config: Some(format!("gyre:configs/{name}.toml").into()),
        ..BatchArguments::default()
    };
    let (rows, code) = rows(&batch)?;
    if code != ExitCode::from(INTERRUPTED) {
        print::line(arguments.dataset.judge(&rows, &batch.out)?)?;
    }
    Ok(code)
}
