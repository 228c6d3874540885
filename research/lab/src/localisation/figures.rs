//! The figures of first fixes and of tracking.

use gyre_slam::localisation::Status;
use serde_json::json;

use super::is_on_map;
use crate::report::{Table, record};

/// Largest error of the heading of a right fix, degrees.
const WRONG_DEG: f64 = 5.0;

/// The error of a fix.
pub struct FixError {
    /// Distance from the truth, m.
    pub away_m: f64,
    /// Error of the heading, degrees.
    pub yaw_deg: f64,
    /// Normalised estimation error squared over its expectation.
    pub nees: f64,
}

/// First fixes by scans alone.
pub struct First {
    name: &'static str,
    on_map: usize,
    outside: usize,
    right_m: Vec<f64>,
    wrong: usize,
    spent_ns: u64,
}

impl First {
    pub fn new(name: &'static str) -> Self {
        Self {
            name,
            on_map: 0,
            outside: 0,
            right_m: Vec::new(),
            wrong: 0,
            spent_ns: 0,
        }
    }

    /// Adds a scan `away_m` from the map, with the error of its fix.
    pub fn add(&mut self, away_m: f64, row: Option<FixError>, wrong_m: f64, spent_ns: u64) {
        self.spent_ns += spent_ns;
        let is_right = |row: &FixError| row.away_m <= wrong_m && row.yaw_deg <= WRONG_DEG;
        match is_on_map(away_m) {
            Some(true) => self.on_map += 1,
            Some(false) => self.outside += 1,
            // Near the end of the map both a fix and none are right.
            None => return,
        }
        match row {
            Some(row) if is_right(&row) => self.right_m.push(row.away_m),
            Some(_) => self.wrong += 1,
            None => (),
        }
    }
}

/// The table of first fixes.
pub fn first_table(firsts: &[First]) -> Table {
    let row = |first: &First| {
        let mut errors = first.right_m.clone();
        errors.sort_by(f64::total_cmp);
        let quantile = |share: f64| errors.get((share * errors.len() as f64) as usize);
        let scans = first.on_map + first.outside;
        record(json!({
            "scan": first.name, "on_map": first.on_map, "outside": first.outside,
            "right": 100.0 * errors.len() as f64 / first.on_map.max(1) as f64, "wrong": first.wrong,
            "p50_m": quantile(0.5), "p95_m": quantile(0.95),
            "cpu_ms": first.spent_ns as f64 * 1e-6 / scans.max(1) as f64,
        }))
    };
    Table {
        title: "First fix by a scan alone".to_owned(),
        columns: vec![
            ("scan", "", 0),
            ("on_map", "on the map", 0),
            ("outside", "outside", 0),
            ("right", "found %", 2),
            ("wrong", "wrong", 0),
            ("p50_m", "error m, median", 3),
            ("p95_m", "p95", 3),
            ("cpu_ms", "CPU ms a scan", 1),
        ],
        rows: firsts.iter().map(row).collect(),
        legend: "On the map: within 5 m of a keyframe; outside: more than 30 m from all; scans between are in neither. Found: accepted and right. \
                 Wrong: accepted, and not right or outside the map."
            .to_owned(),
        ..Table::default()
    }
}

/// Tracking of a drive.
#[derive(Default)]
pub struct Tracking {
    /// Lost, found, tracked, predicted.
    counts: [usize; 4],
    squares: [f64; 2],
    nees: f64,
    errors: usize,
    worst_m: f64,
    spent_ns: u64,
    outside_fixes: usize,
    /// When the drive left the map.
    left_ns: Option<i64>,
    /// The longest time from leaving the map to `Lost`, s.
    lost_after_s: Option<f64>,
}

impl Tracking {
    /// Adds a scan.
    pub fn add(
        &mut self,
        stamp_ns: i64,
        away_m: f64,
        status: Status,
        row: Option<FixError>,
        spent_ns: u64,
    ) {
        self.counts[match status {
            Status::Lost => 0,
            Status::Found => 1,
            Status::Tracked => 2,
            Status::Predicted => 3,
        }] += 1;
        if status == Status::Tracked {
            self.spent_ns += spent_ns;
        }
        self.outside_fixes += usize::from(row.is_some() && is_on_map(away_m) == Some(false));
        self.watch_leaving(stamp_ns, away_m, status, row.is_some());
        if let Some(row) = row {
            self.errors += 1;
            self.squares[0] += row.away_m.powi(2);
            self.squares[1] += row.yaw_deg.powi(2);
            self.nees += row.nees;
            self.worst_m = self.worst_m.max(row.away_m);
        }
    }

    /// Measures the time from the last fix of a drive that leaves the map to `Lost`.
    fn watch_leaving(&mut self, stamp_ns: i64, away_m: f64, status: Status, is_fix: bool) {
        if is_fix {
            self.left_ns = Some(stamp_ns);
        } else if let (Status::Lost, Some(left_ns)) = (status, self.left_ns)
            && is_on_map(away_m) != Some(true)
        {
            let after_s = (stamp_ns - left_ns) as f64 * 1e-9;
            self.lost_after_s = Some(self.lost_after_s.unwrap_or(0.0).max(after_s));
            self.left_ns = None;
        }
    }

    /// The table of tracking.
    pub fn table(&self) -> Table {
        let [lost, found, tracked, predicted] = self.counts;
        let mean = |sum: f64| (self.errors > 0).then(|| sum / self.errors as f64);
        let rms = |sum: f64| mean(sum).map(f64::sqrt);
        Table {
            title: "Tracking".to_owned(),
            columns: vec![
                ("found", "found", 0),
                ("tracked", "tracked", 0),
                ("predicted", "predicted", 0),
                ("lost", "lost", 0),
                ("rms_m", "rms m", 4),
                ("rms_deg", "rms deg", 4),
                ("worst_m", "worst m", 3),
                ("nees", "NEES", 2),
                ("outside", "fixes outside", 0),
                ("lost_after_s", "lost after s", 2),
                ("cpu_ms", "CPU ms a tracked scan", 2),
            ],
            rows: vec![record(json!({
                "found": found, "tracked": tracked, "predicted": predicted, "lost": lost,
                "rms_m": rms(self.squares[0]), "rms_deg": rms(self.squares[1]), "worst_m": self.worst_m,
                "nees": mean(self.nees), "outside": self.outside_fixes, "lost_after_s": self.lost_after_s,
                "cpu_ms": self.spent_ns as f64 * 1e-6 / tracked.max(1) as f64,
            }))],
            legend: "Errors are those of all fixes; NEES over its expectation. Lost after: from the last fix, where the drive leaves the map."
                .to_owned(),
            ..Table::default()
        }
    }
}
