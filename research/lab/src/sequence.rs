//! A recording with its configuration, and `gyre run` on it.

use std::{collections::BTreeSet, env, fs, path::{Path, PathBuf}, process::{Command, Stdio}};

use clap::Args;
use gyre_configuration::{Configuration, terminal::{Failure, print}};
use gyre_contract::StageId;
use serde_json::{Value, json};

use crate::{models::Model, recording::{Recording, folder_name}, report::{Column, Notes, Record, Table, command, record}};

/// The sequences of a command line.
#[derive(Debug, Args)]
pub struct SequenceArguments {
    /// A sequence's configuration; one for each --data, in the same order.
    #[arg(long = "config", required = true)]
    pub configurations: Vec<PathBuf>,
    /// A sequence's folder; may be repeated.
    #[arg(long, required = true)]
    pub data: Vec<PathBuf>,
    /// The folder of the learned masks. A row whose network is missing is left out, and named under
    /// the table.
    #[arg(long, default_value = "models")]
    pub models: PathBuf,
}

/// A sequence that was named on the command line.
#[derive(Debug)]
pub struct Sequence {
    /// The configuration's and the folder's names: the results' folder.
    pub name: String,
    file: PathBuf,
    /// The recording's folder.
    pub data: PathBuf,
}

/// The columns of runs: up to `forward` the place in the evaluation of `summary.json`, then what is
/// made of other parts of it.
const COLUMNS: [Column; 16] = [
    ("row", "row", 0),
    ("path_m", "path m", 0),
    ("kitti/translation_percent", "KITTI %", 2),
    ("kitti/rotation_deg_per_100m", "deg/100 m", 2),
    ("kitti/rotation_deg_per_km", "deg/km", 2),
    ("ate/rmse_m", "ATE m", 2),
    ("seg/percent", "seg %", 3),
    ("rpe/translation_rmse_m", "m a scan", 3),
    ("rpe/rotation_rmse_deg", "deg a scan", 3),
    ("rpe/forward_ratio", "forward", 4),
    ("masking_ms", "masking ms", 2),
    ("search_ms", "search ms", 2),
    ("scans_per_s", "scans/s", 0),
    ("paper_percent", "paper %", 2),
    ("paper_deg_per_km", "paper deg/km", 2),
    ("mask", "mask", 0),
];

const LEGEND: &str = "KITTI and seg need a truth of more than 100 m. m and deg a scan: errors of single motions, RMS. forward: \
    estimated over true distance. ms: median work of the stages in the running pipeline. -: not known.";

impl Sequence {
    /// A recording with its configuration.
    pub fn new(file: &Path, data: &Path) -> Self {
        let name = folder_name(&file.with_extension(""));
        Self {
            name: format!("{name}-{}", folder_name(data)),
            file: file.to_owned(),
            data: data.to_owned(),
        }
    }

    /// The sequences in the order of the command line, each with a name of its own.
    ///
    /// # Errors
    /// Not as many configurations as folders, or the first configuration that cannot be read.
    pub fn all(arguments: &SequenceArguments) -> Result<Vec<Self>, Failure> {
        let (files, data) = (&arguments.configurations, &arguments.data);
        if files.len() != data.len() {
            let counts = format!("{} --config but {} --data", files.len(), data.len());
            return Err(format!("{counts}: give one for one").into());
        }
        let named = files.iter().zip(data);
        let sequences: Vec<Self> = named.map(|(file, data)| Self::new(file, data)).collect();
        let mut names = BTreeSet::new();
        for sequence in &sequences {
            sequence.configuration(&[])?;
            if !names.insert(&sequence.name) {
                let name = &sequence.name;
                return Err(format!("two sequences would write to the same folder, {name}").into());
            }
        }
        Ok(sequences)
    }

    /// Returns its configuration with overrides.
    pub fn configuration(&self, changes: &[String]) -> Result<Configuration, Failure> {
        Ok(Configuration::read(&self.file, changes)?)
    }

    /// Opens the recording as its configuration plays it.
    pub fn open(&self) -> Result<Recording, Failure> {
        Recording::open(&self.configuration(&[])?.streaming(Some(&self.data)))
    }

    /// Finds a network for its rasters with overrides; `None` where no name is given.
    ///
    /// # Errors
    /// An override that does not fit; inside, why there is no network.
    pub fn model(
        &self,
        models: &Path,
        names: &[String],
        changes: &[String],
    ) -> Result<Result<Option<Model>, String>, Failure> {
        let raster = self.configuration(changes)?.odometry.raster;
        Ok(Model::find(models, names, raster.n, Some(raster.cell_m)))
    }

    /// Runs it with a row's overrides, masked by this network if there is one, as a person would,
    /// by `gyre run`, into a folder below `out`. Returns the folder, and what `summary.json` says.
    pub fn run(
        &self,
        row: &str,
        changes: &[String],
        model: Option<&Model>,
        out: &Path,
    ) -> Result<(PathBuf, Record), Failure> {
        print::note(format_args!("{}: {row}", self.name));
        let out = out.join(&self.name).join(folder(row));
        let masked = model.into_iter().flat_map(Model::changes);
        let changes: Vec<String> = changes.iter().cloned().chain(masked).collect();
        let arguments = self.run_arguments(&changes, &out);
        let command = command("gyre", &arguments);
        let mut run = Command::new(program());
        let status = run.args(&arguments).stdout(Stdio::null()).status();
        let status = status.map_err(|error| format!("cannot start {}: {error}; build it with `cargo build --release`, or name another program by GYRE_PROGRAM", program().display()))?;
        if !status.success() {
            return Err(format!("`{command}` did not succeed").into());
        }
        let summary = out.join("summary.json");
        let text = fs::read_to_string(&summary);
        let text = text.map_err(|error| format!("cannot read {}: {error}", summary.display()))?;
        let mut cells = figures(&serde_json::from_str(&text)?);
        let card = model.map(|model| &model.card);
        cells.extend(record(
            json!({ "row": row, "command": command, "mask": card }),
        ));
        Ok((out, cells))
    }

    fn run_arguments(&self, changes: &[String], out: &Path) -> Vec<String> {
        let paths = [&self.file, &self.data, out];
        let [file, data, out] = paths.map(|path| path.display().to_string());
        let run = ["run", &file, &data, "--out", &out];
        let run = run.into_iter().chain(["--rate", "max", "--fresh"]);
        let sets = changes.iter().flat_map(|set| ["--set", set]);
        run.chain(sets).map(str::to_owned).collect()
    }

    /// Returns the table of its runs.
    pub fn table(&self, title: &str, rows: Vec<Record>, left_out: Notes) -> Table {
        Table {
            title: format!("{title} on {}", self.data.display()),
            columns: COLUMNS.to_vec(),
            rows,
            left_out,
            legend: LEGEND.to_owned(),
        }
    }
}

/// Returns the program that is measured: the one that `GYRE_PROGRAM` names, else the product's
/// build of the profile of this program.
fn program() -> PathBuf {
    let profile = if cfg!(debug_assertions) {
        "debug"
    } else {
        "release"
    };
    let built = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target");
    match env::var_os("GYRE_PROGRAM") {
        Some(program) => program.into(),
        None => built().join(profile).join("gyre"),
    }
}

/// The figures of `summary.json`.
fn figures(summary: &Value) -> Record {
    let at = |place: &str| summary.pointer(place).and_then(Value::as_f64);
    let work_ms = |stage: &StageId| {
        let place = format!("/latency/stages/{}/work/p50_us", stage.name());
        at(&place).unwrap_or(0.0) * 1e-3
    };
    let searches = |stage: &&StageId| {
        use StageId::{Masking, PoseIntegration, RadarReplay};
        !matches!(stage, RadarReplay | Masking | PoseIntegration)
    };
    let searching = StageId::ALL.iter().filter(searches);
    let judged = |(place, ..): &Column| {
        Some((
            (*place).to_owned(),
            at(&format!("/evaluation/{place}"))?.into(),
        ))
    };
    let mut figures = record(json!({
        "masking_ms": work_ms(&StageId::Masking),
        "search_ms": searching.map(work_ms).sum::<f64>(),
        "scans_per_s": at("/scans_per_s"),
    }));
    figures.extend(COLUMNS.iter().filter_map(judged));
    figures
}

/// Returns a row's name as that of a folder.
pub fn folder(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    words.join("-").to_ascii_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_repeats_the_row_from_the_command_line() {
        let sequence = Sequence::new(
            Path::new("configs/oxford.toml"),
            Path::new("recordings/monday"),
        );
        assert_eq!(sequence.name, "oxford-monday");
        let arguments =
            sequence.run_arguments(&["search.kind=exhaustive".to_owned()], Path::new("out/raw"));
        let expected = "gyre run configs/oxford.toml recordings/monday --out out/raw --rate max --fresh \
                        --set search.kind=exhaustive";
        assert_eq!(command("gyre", arguments), expected);
        assert_eq!(folder("f-raw, Eq. 7"), "f-raw-eq-7");
    }

    #[test]
    fn a_summary_gives_errors_and_the_time_of_all_stages_between_masking_and_pose() {
        let work = |p50_us: f64| json!({ "work": { "p50_us": p50_us, "p90_us": 1e6 } });
        let stages = json!({
            "radar-replay": work(9000.0), "masking": work(2000.0), "rotation-search": work(250.0),
            "translation-search": work(500.0), "refinement": work(1500.0), "pose-integration": work(7.0)
        });
        let evaluation = json!({
            "path_m": 22.0, "kitti": null, "ate": { "rmse_m": 0.5 }, "seg": null,
            "rpe": { "rotation_rmse_deg": 0.25, "forward_ratio": null }
        });
        let summary = json!({ "scans_per_s": 120.5, "latency": { "stages": stages }, "evaluation": evaluation });
        let expected = json!({
            "ate/rmse_m": 0.5, "masking_ms": 2.0, "path_m": 22.0, "rpe/rotation_rmse_deg": 0.25, "scans_per_s": 120.5,
            "search_ms": 2.25
        });
        assert_eq!(Value::from(figures(&summary)), expected);
    }
}
