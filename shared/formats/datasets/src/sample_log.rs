//! The log of a sensor beside the radar, as a file or in a bag: one reader for the kinds
//! of sensors in [`kinds`].

mod columns;
mod counts;
mod error;
mod faults;
mod fixes;
pub(crate) mod jumps;
pub(crate) mod kinds;
mod names;
mod rates;
mod received;
mod table;
mod words;

use std::path::{Path, PathBuf};

use gyre_geometry::samples::{
    GnssConfig, GnssFix, LocalPlane, Logged, Sample, SampleKind, SensorConfig, UpAxis,
};

pub(crate) use columns::Columns;
use columns::Form;
pub use error::LogError;
pub use faults::{LogFaults, LogGap};
pub use received::ReceivedFixes;

use crate::{
    Format,
    dataset::{frame_stamps, is_folder_of_images},
    parse_seconds,
};
use kinds::Kind;
use table::{MAX_BYTES, Raw, Rows, leave_out};

/// The largest file of `GPS_IMU_Twist`: they have about 900 bytes.
const MAX_TWIST_BYTES: u64 = 1 << 16;
const UNREADABLE_TWIST: &str = "the file of this number is missing, or has another form";
const UNREADABLE_TUM: &str = "a line has seconds, x and y, with spaces between";

/// Accelerations that can be gravity's, m/s², and its share along the axis that points up.
const GRAVITY_MPS2: std::ops::RangeInclusive<f64> = 9.3..=10.3;
const UPRIGHT: f64 = 0.9;

/// The log of a sensor, in its own axes and on its own clock.
#[derive(Clone, Debug)]
pub struct SampleLog {
    pub of: SampleKind,
    /// The samples in the order of their stamps, which all differ. Accelerations of a gyro are all
    /// zero where the log has none; fixes are m east and north in the plane.
    pub samples: Vec<Sample>,
    /// The plane of fixes, which touches the earth at the first of them; `None` if the log has
    /// coordinates in a plane of its own.
    pub plane: Option<LocalPlane>,
    pub faults: LogFaults,
    pub path: PathBuf,
    /// The topic in the bag; `None` of a file.
    pub topic: Option<String>,
    /// The reason why the log of a live receiver has no fixes; in any other log that is an error.
    pub unusable: Option<String>,
}

impl SampleLog {
    pub fn new(of: SampleKind, path: &Path) -> Self {
        Self {
            of,
            samples: Vec::new(),
            plane: None,
            faults: LogFaults::default(),
            path: path.to_owned(),
            topic: None,
            unusable: None,
        }
    }

    /// Reads a log. The first row, or the number of columns, determines the format. Ticks of wheels
    /// are of `m_per_tick` metres.
    pub fn read(of: SampleKind, path: &Path, m_per_tick: Option<f64>) -> Result<Self, LogError> {
        let kind = Kind::of(of);
        let (raw, form) = raw(kind, path)?;
        if let Some(reason) = raw.unreadable.are_most(raw.count()) {
            return Err(LogError::unusable(of, path, reason));
        }
        match form.counts {
            Some(unit) => {
                let log = Self::examined(raw, form, &counts::COUNTS, path).usable()?;
                counts::speeds(log, unit, m_per_tick)
            }
            None => Self::examined(raw, form, kind, path).usable(),
        }
    }

    /// Takes the samples that a bag or a simulation has, which messages name by this path.
    pub fn of(of: SampleKind, logged: Logged, path: &Path) -> Result<Self, LogError> {
        let raw = Raw {
            entries: logged.samples,
            unmeasured: logged.unmeasured,
            ..Raw::default()
        };
        Ok(Self {
            topic: logged.topic,
            ..Self::examined(raw, Form::default(), Kind::of(of), path).usable()?
        })
    }

    /// Reads the log of a live receiver of fixes during a run. Lines without a fix are allowed. A
    /// run without usable fixes continues without them, and keeps the reason.
    pub fn received(path: &Path) -> Self {
        match ReceivedFixes::read(path) {
            Ok(received) => received.log(),
            Err(error) => Self {
                unusable: Some(error.to_string()),
                ..Self::new(SampleKind::Gnss, path)
            },
        }
    }

    /// Returns the log that lies beside the scans of a dataset, which may also be named by the
    /// folder of the images; of the first file of a recording its own, if the kind has one.
    pub fn find(of: SampleKind, folder: &Path) -> Result<PathBuf, LogError> {
        // Nothing lies beside a simulation.
        if folder.as_os_str().is_empty() {
            let folder = PathBuf::new();
            return Err(LogError::None { of, folder });
        }
        let kind = Kind::of(of);
        let mut beside = folder;
        if let Some(ending) = kind.of_recording {
            let own = folder.with_extension(ending);
            // The first file itself may have been moved away.
            if !folder.is_dir() && own.is_file() {
                return Ok(own);
            }
            // For a bag or a different recording in one file, the folder of the file.
            let parent = folder.parent().filter(|_| folder.is_file());
            beside = parent.unwrap_or(folder);
        }
        let mut paths =
            roots(beside).flat_map(|root| kind.places.iter().map(|place| root.join(place)));
        // RADIATE's folder has a list of times beside it.
        let is_folder = |path: &Path| path.is_dir() && path.with_extension("txt").is_file();
        let found = paths.find(|path| path.is_file() || is_folder(path)).map(Ok);
        let found = found.or_else(|| {
            kind.in_truth.and_then(|place| {
                let mut paths = roots(beside).map(|root| root.join(place));
                Some(Err(LogError::InTruth {
                    path: paths.find(|path| path.is_file())?,
                }))
            })
        });
        found.unwrap_or_else(|| {
            Err(LogError::None {
                of,
                folder: beside.to_owned(),
            })
        })
    }

    /// Returns where the fixes lie that belong to a recording of a run: beside its first file,
    /// under the same name.
    pub fn of_recording(recording: &Path) -> PathBuf {
        let ending = Kind::of(SampleKind::Gnss).of_recording;
        recording.with_extension(ending.unwrap_or_default())
    }

    /// Returns all fixes of a log as one table.
    pub fn copy_of_fixes(path: &Path) -> Result<String, LogError> {
        let (raw, form) = raw(Kind::of(SampleKind::Gnss), path)?;
        Ok(Self::table_of_fixes(&raw.entries, form.is_plane))
    }

    /// Returns a table of fixes, m east and north in a plane of their own or degrees on the earth.
    pub fn table_of_fixes(fixes: &[Sample], is_plane: bool) -> String {
        let at = match is_plane {
            true => "east_m,north_m",
            false => "latitude_deg,longitude_deg",
        };
        let rows: String = fixes.iter().map(Self::row_of_fix).collect();
        format!("stamp_ns,{at},altitude_m,sigma_m\n{rows}")
    }

    /// Returns the row of a fix in such a table: with the shortest texts that are read back as the
    /// same numbers.
    pub fn row_of_fix(fix: &Sample) -> String {
        let (ns, [a, b, altitude_m, sigma_m, ..]) = (fix.stamp_ns, fix.values);
        format!("{ns},{a},{b},{altitude_m},{}\n", sigma_m.max(0.0))
    }

    /// Returns the fixes on the radar's clock, with the configured uncertainty where the log has
    /// none.
    pub fn on_radar(&self, config: &GnssConfig) -> Vec<GnssFix> {
        let fixes = self.samples.iter();
        fixes.map(|fix| config.on_radar(fix, None).into()).collect()
    }

    /// Returns the axis that points up: the configured one, or the axis by gravity or the format.
    pub fn up(&self, configured: Option<UpAxis>, dataset: Format) -> Result<UpAxis, LogError> {
        // Of RADIATE's logs z points down, and gravity is taken out of their accelerations.
        let is_radiates = dataset == Format::Radiate && self.path.ends_with("imu_as_logged.csv")
            || self.path.ends_with("GPS_IMU_Twist");
        let measured = self.up_by_gravity();
        let known = measured.or(is_radiates.then_some(UpAxis::MinusZ));
        let up = configured.or(known).unwrap_or_default();
        let Some(known) = known.filter(|known| *known != up) else {
            return Ok(up);
        };
        let by = measured.map_or("its format", |_| "gravity");
        let (up, known) = (up.name(), known.name());
        let reason = format!(
            "gyro.up is {up}, but by {by} its axis {known} points up: take gyro.up out of the configuration, or the accelerations out of the log if their sign is wrong"
        );
        Err(LogError::unusable(self.of, &self.path, reason))
    }

    /// Returns the axis along which the accelerations have gravity: what rests is accelerated
    /// upwards.
    pub(crate) fn up_by_gravity(&self) -> Option<UpAxis> {
        use UpAxis::{MinusX, MinusY, MinusZ, X, Y, Z};
        let sum = |k: usize| self.samples.iter().map(|it| it.values[k]).sum::<f64>();
        let mean = [3, 4, 5].map(|k| sum(k) / self.samples.len().max(1) as f64);
        let norm = mean.iter().map(|value| value * value).sum::<f64>().sqrt();
        let mut axes = [X, MinusX, Y, MinusY, Z, MinusZ].into_iter();
        axes.find(|up| up.in_vehicle(mean)[2] > UPRIGHT * norm)
            .filter(|_| GRAVITY_MPS2.contains(&norm))
    }

    /// Examines samples; the log of samples that cannot be used has the reason.
    fn examined(raw: Raw, form: Form, kind: &Kind, path: &Path) -> Self {
        let all = raw.count();
        let mut log = Self::new(kind.of, path);
        let (faults, mut samples) = (&mut log.faults, raw.entries);
        faults.unreadable = raw.unreadable.count;
        faults.first_unreadable = raw.unreadable.first;
        faults.unit_is_assumed = form.unit_is_assumed;
        faults.not_a_number = leave_out(&mut samples, |it| {
            it.values.iter().take(kind.values).any(|it| !it.is_finite())
        });
        let repaired = match kind.of {
            SampleKind::Gnss => {
                (faults.lost, faults.without_fix) = (raw.lost, raw.unmeasured);
                let (fixes, plane) = fixes::repaired(samples, form.is_plane, faults);
                log.plane = plane;
                let named = faults.named(kind.of).join(", ");
                let named = match named.is_empty() {
                    true => named,
                    false => format!(" ({named})"),
                };
                let none = format!("none of its {all} entries is a usable fix{named}");
                (!fixes.is_empty()).then_some(fixes).ok_or(none)
            }
            _ => {
                faults.not_a_number += raw.unmeasured;
                rates::repaired(samples, kind, faults)
            }
        };
        match repaired {
            Ok(samples) => log.samples = samples,
            Err(reason) => {
                let error = LogError::unusable(kind.of, path, reason);
                log.unusable = Some(error.to_string());
            }
        }
        log
    }

    fn usable(self) -> Result<Self, LogError> {
        match self.unusable {
            Some(reason) => Err(LogError::Unusable(reason)),
            None => Ok(self),
        }
    }
}

/// Returns the folders that may contain the logs of a dataset: its own, and the parent of a folder
/// of images.
pub(crate) fn roots(folder: &Path) -> impl Iterator<Item = &Path> {
    let above = folder.parent().filter(|_| is_folder_of_images(folder));
    [Some(folder), above].into_iter().flatten()
}

/// Returns the samples of a log as they stand there.
fn raw(kind: &'static Kind, path: &Path) -> Result<(Raw, Form), LogError> {
    if path.is_dir() && !kind.twist.is_empty() {
        return Ok((gps_imu_twist(kind, path)?, Form::default()));
    }
    let text = gyre_storage::read_text(path, MAX_BYTES);
    let text = text.map_err(|error| LogError::unreadable(kind.of, path, error))?;
    if kind.of == SampleKind::Gnss && path.extension().is_some_and(|ending| ending == "tum") {
        let form = Form {
            is_plane: true,
            ..Form::default()
        };
        return Ok((tum(&text), form));
    }
    let rows = Rows::of(&text, kind);
    let rows = rows.map_err(|reason| LogError::unknown(kind.of, path, reason))?;
    Ok((rows.raw, rows.columns.form))
}

/// Reads RADIATE's `GPS_IMU_Twist/<number>.txt`, a file for each sample of its INS, and
/// `GPS_IMU_Twist.txt` with their times: the files that the list beside a folder names.
///
/// A file has 18 lines of numbers: latitude, longitude and altitude; their covariance, m² along
/// east, north and up (3); quaternion; angular rates; accelerations; covariances (9); twist (2).
fn gps_imu_twist(kind: &Kind, folder: &Path) -> Result<Raw, LogError> {
    let list = folder.with_extension("txt");
    let mut raw = Raw::default();
    for (number, stamp_ns) in frame_stamps(&list)? {
        match twist(&folder.join(format!("{number:06}.txt")), kind.twist) {
            Some(values) => raw.entries.push((kind.sample)(stamp_ns, values)),
            None => {
                let number = usize::try_from(number).unwrap_or_default();
                raw.unreadable
                    .add(1, number, || UNREADABLE_TWIST.to_owned());
            }
        }
    }
    Ok(raw)
}

fn twist(path: &Path, places: &[(usize, usize)]) -> Option<[f64; 6]> {
    let text = gyre_storage::read_text(path, MAX_TWIST_BYTES).ok()?;
    let lines: Vec<&str> = text.lines().collect();
    let mut values = [0.0; 6];
    for (value, (line, place)) in values.iter_mut().zip(places) {
        let fields = lines.get(*line)?.split(',');
        let fields: Option<Vec<f64>> = fields.map(|field| field.trim().parse().ok()).collect();
        let fields: [f64; 3] = fields?.try_into().ok()?;
        *value = fields[*place];
    }
    Some(values)
}

/// Reads fixes from a trajectory as TUM.
fn tum(text: &str) -> Raw {
    let mut raw = Raw::default();
    for (number, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let mut fields = line.split_whitespace();
        let stamp_ns = fields.next().and_then(parse_seconds);
        let mut coordinate = || fields.next()?.parse().ok();
        match (stamp_ns, coordinate(), coordinate()) {
            (Some(stamp_ns), Some(x), Some(y)) => {
                raw.entries.push(Sample::fix(stamp_ns, [x, y], 0.0, 0.0));
            }
            _ => raw
                .unreadable
                .add(1, number + 1, || UNREADABLE_TUM.to_owned()),
        }
    }
    raw
}
