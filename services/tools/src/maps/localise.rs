//! `gyre localise`: finds a drive in a map.

mod scans;

use std::{
    fmt::Write,
    path::{Path, PathBuf},
    time::Instant,
};

use clap::Args;
use gyre_configuration::{
    Configuration,
    terminal::{Failure, inputs::Inputs, print},
};
use gyre_datasets::write_tum;
use gyre_geometry::{Pose, covariance, xy_yaw};
use gyre_radar::Trajectory;
use gyre_results::{Content, Out};
use gyre_slam::{
    localisation::{Localisation, Localiser, Map as KeptMap, Observation, Status},
    mapping::{Map, Overlay, map_png},
};
use gyre_storage::{self as storage, Draft};
use serde::Serialize;

use crate::{bar::Bar, maps::folder};

pub use scans::{RegisteredScan, Scans};

const FIXES: &str = "fixes.csv";
/// The places of the scans that were found or tracked, in the frame of the map.
const TUM: &str = "fixes.tum";
/// The same, drawn over the map.
const PICTURE: &str = "fixes.png";
/// If none of so many scans at the start is found, so many spread over the drive are searched: with
/// a tenth of it on the map four, each found by 86 %, and none of them once in 2,600 drives.
const FIRST: usize = 20;
const PROBES: usize = 40;

#[derive(Debug, Args)]
pub struct LocaliseArguments {
    /// The scans, and the configuration: its odometry.
    #[command(flatten)]
    pub inputs: Inputs,
    /// The folder of the map, of `gyre map --format folder`.
    #[arg(long)]
    pub map: PathBuf,
    /// The folder of fixes.csv, fixes.tum and fixes.png.
    #[arg(long, default_value = "out/localise")]
    pub out: PathBuf,
    /// Print JSON instead of sentences.
    #[arg(long)]
    pub json: bool,
}

/// Localises the scans of a recording in a map, and writes `fixes.csv`.
/// If no scan was found, the error is returned after all files are written.
pub fn localise(arguments: &LocaliseArguments) -> Result<(), Failure> {
    let configuration = arguments.inputs.configuration()?;
    let mut localiser = localiser(&arguments.map, &configuration)?;
    let mut scans = Scans::open(&configuration)?;
    let out = &arguments.out;
    let _locked = Out::lock_for(out, Content::FIXES)?;
    let mut fixes = Draft::create(&out.join(FIXES))?;
    let (started, mut found) = (Instant::now(), Found::default());
    let ended = follow(
        &mut scans,
        &mut localiser,
        &mut fixes,
        &mut found,
        &configuration,
    );
    let searched = found.scans.len() + PROBES * usize::from(!scans.played.is_empty());
    let ms_a_scan = started.elapsed().as_secs_f64() * 1e3 / searched.max(1) as f64;
    fixes.commit()?;
    let drawn = draw(&arguments.map, &found, out);
    ended?;
    drawn?;
    let figures = Figures {
        left_out: scans.left_out,
        ms_a_scan,
        fixes: out.join(FIXES),
        ..Figures::of(&found.scans)
    };
    match arguments.json {
        true => print::line(serde_json::to_string_pretty(&figures)?)?,
        false => print::line(figures.summary())?,
    }
    match found.has_fix() {
        true => Ok(()),
        false => {
            let (data, map) = (configuration.data(), arguments.map.display());
            Err(format!("no scan of {data} was found in {map}: it may be of another place, or made with settings for another radar. If the first {FIRST} scans are not found, {PROBES} others over the drive are searched; source.first and source.scans choose a part").into())
        }
    }
}

/// Opens the map in a folder, and plans localisation in it.
pub fn localiser(path: &Path, configuration: &Configuration) -> Result<Localiser, Failure> {
    folder::settle(path)?;
    let drawn = Map::open(path)?;
    let map = KeptMap::open(path)
        .map_err(|error| format!("{} cannot be localised in: {error}", path.display()))?;
    let (path, drawn, kept) = (path.display(), drawn.keyframes(), map.keyframes().len());
    if kept != drawn {
        return Err(format!("{path} was drawn from {drawn} keyframes and keeps {kept}: draw the map again with gyre map").into());
    }
    plan(map, configuration)
}

pub fn plan(map: KeptMap, configuration: &Configuration) -> Result<Localiser, Failure> {
    let odometry = &configuration.odometry;
    let capacity = odometry.points.capacity;
    if capacity == 0 {
        return Err(
            "points.capacity is 0, but scans are localised by their points: it must be 1 or more"
                .into(),
        );
    }
    Ok(Localiser::new(map, &odometry.refinement, capacity)?)
}

#[derive(Default)]
struct Found {
    scans: Vec<Located>,
    /// The times of those with a fix.
    stamps_ns: Vec<i64>,
    /// Their poses, in pieces with a fix for each scan; the last may be empty.
    pieces: Vec<Vec<Pose>>,
}

impl Found {
    fn has_fix(&self) -> bool {
        !self.stamps_ns.is_empty()
    }

    fn add(&mut self, scan: &RegisteredScan<'_>, found: &Localisation) {
        let stamp_ns = scan.observation.stamp_ns;
        self.scans.push((scan.number, stamp_ns, found.status));
        let is_fix = matches!(found.status, Status::Found | Status::Tracked);
        match (&found.fix, self.pieces.last_mut()) {
            (Some(fix), Some(piece)) if is_fix => {
                self.stamps_ns.push(stamp_ns);
                piece.push(fix.pose.motion);
            }
            (_, Some(piece)) if piece.is_empty() => {}
            _ => self.pieces.push(Vec::new()),
        }
    }
}

/// Localises all scans, or those until the drive turns out to be elsewhere. The rows so far are
/// whole when it fails.
fn follow(
    scans: &mut Scans,
    localiser: &mut Localiser,
    fixes: &mut Draft,
    all: &mut Found,
    configuration: &Configuration,
) -> Result<(), Failure> {
    fixes.append(HEADER)?;
    all.pieces.push(Vec::new());
    let (mut progress, mut row) = (Bar::new(Some(scans.played.len())), String::new());
    while let Some(scan) = scans.register_next()? {
        if scan.starts {
            localiser.reset();
        }
        let found = localiser.locate(&scan.observation);
        row.clear();
        write_row(&scan, &found, localiser.map(), &mut row);
        fixes.append(&row)?;
        all.add(&scan, &found);
        let done = all.scans.len() as u64;
        progress.scans(done, done, status_name(found.status).to_owned());
        if all.scans.len() == FIRST && !all.has_fix() && !scans.played.is_empty() {
            let is_found = |it: &Observation<'_>| localiser.find(it.points, &it.twist).is_some();
            if !Scans::open(configuration)?.any_of(PROBES, is_found)? {
                break;
            }
        }
    }
    progress.finish();
    Ok(())
}

const HEADER: &str = "scan,stamp_ns,status,x_m,y_m,yaw_rad,\
    cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw,correlation,place\n";

/// Writes the row of a scan to `text`, in fixed decimals, so that equal fixes give equal bytes.
/// Unknown values are empty.
fn write_row(scan: &RegisteredScan<'_>, found: &Localisation, map: &KeptMap, text: &mut String) {
    let (number, stamp_ns) = (scan.number, scan.observation.stamp_ns);
    let status = status_name(found.status);
    let _ = write!(text, "{number},{stamp_ns},{status},");
    let Some(fix) = &found.fix else {
        text.push_str(",,,,,,,,,,\n");
        return;
    };
    for value in xy_yaw(&fix.pose.motion) {
        let _ = write!(text, "{value:.6},");
    }
    for value in covariance::pack(&fix.pose.covariance) {
        let _ = write!(text, "{value:.12},");
    }
    let place = map.keyframes()[fix.keyframe].scan;
    let _ = match found.status {
        Status::Predicted | Status::Lost => writeln!(text, ",{place}"),
        Status::Found | Status::Tracked => writeln!(text, "{:.6},{place}", fix.correlation),
    };
}

fn status_name(status: Status) -> &'static str {
    match status {
        Status::Lost => "lost",
        Status::Found => "found",
        Status::Tracked => "tracked",
        Status::Predicted => "predicted",
    }
}

fn draw(map: &Path, path: &Found, out: &Path) -> Result<(), Failure> {
    let mut text = Vec::new();
    let trajectory = Trajectory::timed(path.stamps_ns.clone(), path.pieces.concat());
    write_tum(&trajectory, &mut text)
        .map_err(|error| format!("cannot write the fixes: {error}"))?;
    storage::write(&out.join(TUM), text)?;
    let pieces: Vec<&[Pose]> = path.pieces.iter().map(Vec::as_slice).collect();
    let overlay = Overlay {
        trajectory: &pieces,
        ..Overlay::default()
    };
    let picture = map_png(&mut Map::open(map)?, &overlay)?;
    Ok(storage::write(&out.join(PICTURE), picture)?)
}

/// Spans without a fix that are listed.
const LISTED: usize = 10;

/// A scan: its number, its time in ns, and whether it was found.
type Located = (usize, i64, Status);

/// The figures of a drive, as `--json` prints them.
#[derive(Debug, Default, Serialize)]
struct Figures {
    found: usize,
    tracked: usize,
    predicted: usize,
    lost: usize,
    /// The first scan with a fix, and its time after the first scan, s.
    first_fix: Option<(usize, f64)>,
    /// The first and the last scan of each span where the localiser was lost.
    lost_scans: Vec<(usize, usize)>,
    left_out: usize,
    ms_a_scan: f64,
    fixes: PathBuf,
}

impl Figures {
    fn of(scans: &[Located]) -> Self {
        let count = |status: Status| scans.iter().filter(|it| it.2 == status).count();
        let after_s = |stamp_ns: i64| stamp_ns.saturating_sub(scans[0].1) as f64 * 1e-9;
        let first = scans.iter().find(|it| it.2 == Status::Found);
        let is_lost = |it: &Located| it.2 == Status::Lost;
        let spans = scans.chunk_by(|one, next| is_lost(one) == is_lost(next));
        let lost = spans.filter(|span| is_lost(&span[0]));
        Self {
            found: count(Status::Found),
            tracked: count(Status::Tracked),
            predicted: count(Status::Predicted),
            lost: count(Status::Lost),
            first_fix: first.map(|(number, stamp_ns, _)| (*number, after_s(*stamp_ns))),
            lost_scans: lost.map(|it| (it[0].0, it[it.len() - 1].0)).collect(),
            ..Self::default()
        }
    }

    fn summary(&self) -> String {
        let mut text = match self.first_fix {
            Some((scan, after_s)) => format!("first fix: scan {scan}, after {after_s:.1} s"),
            None => "no scan was found in the map".to_owned(),
        };
        let Self {
            found,
            tracked,
            predicted,
            lost,
            left_out,
            ms_a_scan,
            ..
        } = self;
        let (scans, fixes) = (found + tracked + predicted + lost, found + tracked);
        let percent = 100.0 * fixes as f64 / scans.max(1) as f64;
        text += &format!("\n{fixes} of {scans} scans localised ({percent:.1} %): ");
        text += &format!("{found} found, {tracked} tracked; {predicted} predicted, {lost} lost");
        if *left_out > 0 {
            text += &format!("; {left_out} more could not be used");
        }
        if !self.lost_scans.is_empty() {
            let span = |(first, last): &(usize, usize)| format!("{first} to {last}");
            let spans: Vec<String> = self.lost_scans.iter().take(LISTED).map(span).collect();
            text += &format!("\nlost: scans {}", spans.join(", "));
            let more = self.lost_scans.len().saturating_sub(LISTED);
            if more > 0 {
                text += &format!(" and {more} more times");
            }
        }
        let fixes = self.fixes.display();
        text + &format!("\n{ms_a_scan:.1} ms a scan; {fixes}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(statuses: &[Status]) -> Figures {
        let scans = (0..).zip(statuses);
        let located = scans.map(|(k, status)| (k, k as i64 * 250_000_000, *status));
        Figures {
            left_out: 1,
            ms_a_scan: 2.5,
            fixes: FIXES.into(),
            ..Figures::of(&located.collect::<Vec<_>>())
        }
    }

    #[test]
    fn the_summary_says_when_the_first_fix_was_and_where_the_drive_was_lost() {
        use Status::{Found, Lost, Predicted, Tracked};
        let drive = [Lost, Lost, Found, Tracked, Predicted, Lost, Found, Tracked];
        let expected = "first fix: scan 2, after 0.5 s\n\
            4 of 8 scans localised (50.0 %): 2 found, 2 tracked; 1 predicted, 3 lost; 1 more could not be used\n\
            lost: scans 0 to 1, 5 to 5\n2.5 ms a scan; fixes.csv";
        assert_eq!(figures(&drive).summary(), expected);
        let none = "no scan was found in the map\n0 of 3 scans localised (0.0 %)";
        assert!(figures(&[Lost; 3]).summary().starts_with(none));
    }
}
