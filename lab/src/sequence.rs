//! A recording with its configuration, and `gyre run` on it.

use std::{
    collections::BTreeMap,
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use clap::Args;
use gyre::{Failure, configuration::Configuration, print};
use gyre_messages::StageId;
use gyre_radar::OwnedScan;
use serde::Serialize;
use serde_json::Value;

use crate::{
    models::Model,
    report::{Notes, command, folder, number, paragraph, table},
};

/// The sequences of a command line.
#[derive(Debug, Args)]
pub struct SequenceArguments {
    /// A sequence's configuration; one for each --data, in the same order.
    #[arg(long = "config", required = true)]
    pub configurations: Vec<PathBuf>,
    /// A sequence's folder; may be repeated.
    #[arg(long, required = true)]
    pub data: Vec<PathBuf>,
    /// The folder of the learned masks. A row whose network is missing is left out, and named under the table.
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

/// The figures of a run that tables show: place in the evaluation of `summary.json`, heading, decimals. The last three are made of
/// other parts of it.
const FIGURES: [(&str, &str, usize); 12] = [
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
];

/// Figures of a run by their places; one is missing without a ground truth that fits, or where the truth allows none.
pub type Figures = BTreeMap<&'static str, f64>;

/// A row of an [`Experiment`].
#[derive(Debug, Default, Serialize)]
pub struct Line {
    /// The row.
    pub row: String,
    /// The network that masked.
    pub model: Option<Model>,
    /// The command that repeats the run; `None` where there is none.
    pub command: Option<String>,
    /// The figures of the run.
    pub figures: Figures,
    /// The paper's KITTI errors at this raster's size, on other sequences: %, and degrees per km.
    pub paper: [Option<f64>; 2],
}

/// Runs of one sequence with different overrides.
#[derive(Debug, Serialize)]
pub struct Experiment {
    /// The title.
    pub title: &'static str,
    /// The sequence's folder.
    pub data: String,
    /// Row by row.
    pub lines: Vec<Line>,
    /// Rows that are left out, by the reason.
    pub left_out: Notes,
}

impl Sequence {
    /// A recording with its configuration.
    pub fn new(file: &Path, data: &Path) -> Self {
        // `recordings/.` and the like have names only once they are resolved.
        let resolved = data.canonicalize().unwrap_or_else(|_| data.to_owned());
        let name = |path: &Path| {
            path.file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        Self {
            name: format!("{}-{}", name(&file.with_extension("")), name(&resolved)),
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
        let mut sequences: Vec<Self> = Vec::new();
        for sequence in files
            .iter()
            .zip(data)
            .map(|(file, data)| Self::new(file, data))
        {
            if let Some(other) = sequences.iter().find(|other| other.name == sequence.name) {
                let (one, two) = (other.data.display(), sequence.data.display());
                let name = &sequence.name;
                return Err(
                    format!("{one} and {two} would write to the same folder, {name}").into(),
                );
            }
            sequence.configuration(&[])?;
            sequences.push(sequence);
        }
        Ok(sequences)
    }

    /// Returns its configuration with overrides.
    ///
    /// # Errors
    /// A configuration that cannot be read, or an override that does not fit.
    pub fn configuration(&self, changes: &[String]) -> Result<Configuration, Failure> {
        Ok(Configuration::read(&self.file, changes)?)
    }

    /// Finds a network for its rasters with overrides.
    ///
    /// # Errors
    /// An override that does not fit; inside, why there is no network.
    pub fn model(
        &self,
        models: &Path,
        names: &[String],
        changes: &[String],
    ) -> Result<Result<Model, String>, Failure> {
        let raster = self.configuration(changes)?.odometry.raster;
        Ok(Model::find(models, names, raster.n, Some(raster.cell_m)))
    }

    /// Runs it with a row's overrides as a person would, by `gyre run`, into a folder below `out`; returns the
    /// folder and what `summary.json` says.
    ///
    /// # Errors
    /// A run that does not succeed.
    pub fn run(
        &self,
        row: &str,
        changes: &[String],
        out: &Path,
    ) -> Result<(PathBuf, Line), Failure> {
        print::note(format_args!("{}: {row}", self.name));
        let out = out.join(&self.name).join(folder(row));
        let arguments = self.run_arguments(changes, &out);
        // This program has gyre's commands too: so what runs is of the same build.
        let status = Command::new(env::current_exe()?)
            .args(&arguments)
            .stdout(Stdio::null())
            .status()
            .map_err(|error| format!("cannot start gyre run: {error}"))?;
        let command = command("gyre", &arguments);
        if !status.success() {
            return Err(format!("`{command}` did not succeed").into());
        }
        let summary = out.join("summary.json");
        let text = fs::read_to_string(&summary)
            .map_err(|error| format!("cannot read {}: {error}", summary.display()))?;
        let line = Line {
            row: row.to_owned(),
            command: Some(command),
            figures: figures(&serde_json::from_str(&text)?),
            ..Line::default()
        };
        Ok((out, line))
    }

    fn run_arguments(&self, changes: &[String], out: &Path) -> Vec<String> {
        let path = |path: &Path| path.display().to_string();
        let mut arguments = vec!["run".to_owned(), path(&self.file)];
        arguments.extend([
            "--data".to_owned(),
            path(&self.data),
            "--out".to_owned(),
            path(out),
        ]);
        arguments.extend(["--rate", "max", "--fresh"].map(str::to_owned));
        arguments.extend(
            changes
                .iter()
                .flat_map(|set| ["--set".to_owned(), set.clone()]),
        );
        arguments
    }

    /// Reads the first scans, at most `most`; unreadable ones are left out.
    ///
    /// # Errors
    /// A recording without two scans that can be read.
    pub fn scans(&self, most: usize) -> Result<Vec<OwnedScan>, Failure> {
        let configuration = self.configuration(&[])?;
        let mut dataset = gyre_radar::open(&self.data, &configuration.dataset)?;
        let len = dataset.len();
        let read = |index| {
            let mut scan = OwnedScan::with_limits(dataset.limits());
            scan.geometry = dataset.read(index, scan.slot()).ok()?;
            Some(scan)
        };
        let first = configuration.source.first;
        let scans: Vec<OwnedScan> = (first..len).filter_map(read).take(most).collect();
        match scans.len() {
            0 | 1 => {
                Err(format!("{} has no two scans that can be read", self.data.display()).into())
            }
            _ => Ok(scans),
        }
    }
}

/// The figures of `summary.json`.
fn figures(summary: &Value) -> Figures {
    let at = |place: &str| summary.pointer(place).and_then(Value::as_f64);
    let judged =
        |(place, ..): &(&'static str, _, _)| Some((*place, at(&format!("/evaluation/{place}"))?));
    let work_ms = |stage: StageId| {
        let place = ["", "latency", "stages", stage.name(), "work", "p50_us"].join("/");
        at(&place).unwrap_or(0.0) * 1e-3
    };
    let around = [
        StageId::RadarReplay,
        StageId::Masking,
        StageId::PoseIntegration,
    ];
    let searching = StageId::ALL
        .into_iter()
        .filter(|stage| !around.contains(stage));
    let mut figures: Figures = FIGURES.iter().filter_map(judged).collect();
    figures.insert("masking_ms", work_ms(StageId::Masking));
    figures.insert("search_ms", searching.map(work_ms).sum());
    figures.extend(at("/scans_per_s").map(|rate| ("scans_per_s", rate)));
    figures
}

impl Experiment {
    /// Markdown: a table of all figures, what masked, what is left out, and the commands that repeat the runs.
    pub fn markdown(&self) -> String {
        let papers = self.lines.iter().any(|line| line.paper != [None; 2]);
        let mut header = vec!["row"];
        header.extend(FIGURES.map(|(_, heading, _)| heading));
        header.extend(if papers {
            &["paper %", "paper deg/km"][..]
        } else {
            &[]
        });
        let cells = |line: &Line| {
            let ours = |(place, _, decimals): &(&str, &str, usize)| {
                number(line.figures.get(place).copied(), *decimals)
            };
            let paper = line.paper.map(|figure| number(figure, 2));
            let shown = if papers { &paper[..] } else { &[] };
            let ours = FIGURES.iter().map(ours).chain(shown.iter().cloned());
            std::iter::once(line.row.clone()).chain(ours).collect()
        };
        let mut masks = Notes::new();
        for line in &self.lines {
            if let Some(model) = &line.model {
                masks
                    .entry(model.card.display().to_string())
                    .or_default()
                    .push(line.row.clone());
            }
        }
        let commands: Vec<&str> = self
            .lines
            .iter()
            .filter_map(|line| line.command.as_deref())
            .collect();
        format!(
            "\n## {} on {}\n\n{}{}{}\n```sh\n{}\n```\n",
            self.title,
            self.data,
            table(&header, self.lines.iter().map(cells)),
            paragraph("Masks", &masks),
            paragraph("Left out", &self.left_out),
            commands.join("\n")
        )
    }
}

/// The meaning of the columns of [`Experiment::markdown`].
pub const LEGEND: &str = "\nKITTI and seg need a truth of more than 100 m. m and deg a scan: errors of single motions, RMS. \
    forward: estimated over true distance. ms: median work of the stages in the running pipeline. -: not known.\n";

#[cfg(test)]
mod tests {
    use serde_json::json;

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
        let expected = "gyre run configs/oxford.toml --data recordings/monday --out out/raw --rate max --fresh \
                        --set search.kind=exhaustive";
        assert_eq!(command("gyre", arguments), expected);
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
        let expected = [
            ("ate/rmse_m", 0.5),
            ("masking_ms", 2.0),
            ("path_m", 22.0),
            ("rpe/rotation_rmse_deg", 0.25),
            ("scans_per_s", 120.5),
            ("search_ms", 2.25),
        ];
        assert_eq!(figures(&summary), Figures::from(expected));
    }

    #[test]
    fn a_table_has_ours_and_where_there_are_any_the_papers_figures() {
        let line = Line {
            row: "raw".to_owned(),
            figures: Figures::from([("ate/rmse_m", 1.5), ("scans_per_s", 120.4)]),
            ..Line::default()
        };
        let mut experiment = Experiment {
            title: "IIIb",
            data: "drive".to_owned(),
            lines: vec![line],
            left_out: Notes::new(),
        };
        let plain = "| raw | - | - | - | - | 1.50 | - | - | - | - | - | - | 120 |\n";
        assert!(
            experiment.markdown().contains(plain),
            "{}",
            experiment.markdown()
        );
        experiment.lines[0].paper = [Some(6.39), None];
        let beside = "| raw | - | - | - | - | 1.50 | - | - | - | - | - | - | 120 | 6.39 | - |\n";
        assert!(
            experiment.markdown().contains(beside),
            "{}",
            experiment.markdown()
        );
    }
}
