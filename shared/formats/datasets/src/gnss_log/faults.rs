//! Faults of the fixes of a log, and which fixes are left out.

use gyre_geometry::samples::{LocalPlane, RawFix};
use serde::Serialize;

use super::LoggedFix;
use crate::table::{Raw, between, leave_out, longest_chain};

/// No vehicle that carries a spinning radar is faster, m/s.
const MAX_SPEED_MPS: f64 = 70.0;
/// A step of fixes by less is noise, m.
const SLACK_M: f64 = 10.0;
/// A step may be longer by this many stated standard deviations.
const SLACK_SIGMAS: f64 = 5.0;
/// No receiver measures better than 1 cm with the phase of the carrier, nor is a fix compared with
/// the radar's place better than that: within 1 ms a car drives a centimetre.
const LEAST_SIGMA_M: f64 = 0.01;
/// A fix with a larger standard deviation contains no information, m.
const MOST_SIGMA_M: f64 = 1e6;
/// Stretches between jumps that are looked back over: behind so many the fixes are noise.
const LOOK_BACK: usize = 200;

/// Faults of a log. Counted fixes are left out unless the count states otherwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct GnssFaults {
    /// Rows that do not fit the table, such as a truncated row.
    pub unreadable: usize,
    /// Line (of a folder of files: number) of the first of them.
    #[serde(skip_serializing_if = "is_zero")]
    pub first_unreadable: usize,
    /// Messages of a bag, and rows with a stamp but no place: the receiver had no fix.
    pub without_fix: usize,
    pub not_a_number: usize,
    /// Fixes that are on no place of the earth.
    pub off_the_earth: usize,
    /// Fixes at latitude 0, longitude 0: what receivers write without a fix.
    pub zero: usize,
    pub repeated: usize,
    /// Fixes at the very place of the fix before, as of a frozen receiver or a standing vehicle:
    /// only the first is used.
    pub frozen: usize,
    /// Fixes with a stamp before an earlier one: sorted.
    pub out_of_order: usize,
    /// Fixes whose status the receiver does not state: used.
    pub of_unknown_status: usize,
    /// Fixes that state to be better than a centimetre: used as if they stated that.
    pub too_certain: usize,
    /// Fixes that jump away from the others faster than a vehicle.
    pub jumps: usize,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl GnssFaults {
    pub(super) fn without_usable(&self, all: usize) -> String {
        let named = match self.listed() {
            Some(listed) => format!(" ({listed})"),
            None => String::new(),
        };
        format!("none of its {all} entries is a usable fix{named}")
    }

    pub(crate) fn listed(&self) -> Option<String> {
        let named = self.named().into_iter();
        let named = named.map(|(count, what)| format!("{count} {what}"));
        let listed = named.collect::<Vec<_>>().join(", ");
        (!listed.is_empty()).then_some(listed)
    }

    pub fn named(&self) -> Vec<(usize, &'static str)> {
        let all = [
            (self.unreadable, "unreadable"),
            (self.without_fix, "without a fix"),
            (self.not_a_number, "not a number"),
            (self.off_the_earth, "off the earth"),
            (self.zero, "at 0, 0"),
            (self.repeated, "repeated"),
            (self.frozen, "at the very place of the fix before"),
            (self.out_of_order, "out of order"),
            (self.of_unknown_status, "of unknown status, used"),
            (self.too_certain, "stated better than 1 cm, used as of 1 cm"),
            (self.jumps, "jump faster than a vehicle"),
        ];
        all.into_iter().filter(|(count, _)| *count > 0).collect()
    }
}

type Examined = (Vec<LoggedFix>, Option<LocalPlane>, GnssFaults);

pub(super) fn examine(raw: Raw<RawFix>, is_plane: bool) -> Examined {
    let mut faults = GnssFaults {
        unreadable: raw.unreadable.count,
        first_unreadable: raw.unreadable.first,
        without_fix: raw.unmeasured,
        ..GnssFaults::default()
    };
    let mut rows = raw.entries;
    faults.not_a_number = leave_out(&mut rows, |row| row.at.iter().any(|it| !it.is_finite()));
    if !is_plane {
        faults.zero = leave_out(&mut rows, |row| row.at == [0.0, 0.0]);
        faults.off_the_earth = leave_out(&mut rows, |row| {
            row.at[0].abs() > 89.9 || row.at[1].abs() > 360.0
        });
    }
    sort(&mut rows, &mut faults);
    let before = rows.len();
    rows.dedup_by(|later, earlier| later.at == earlier.at);
    faults.frozen = before - rows.len();
    let count = |is_so: &dyn Fn(&&RawFix) -> bool| rows.iter().filter(is_so).count();
    faults.of_unknown_status = count(&|row| row.status_is_unknown);
    faults.too_certain = count(&|row| 0.0 < row.sigma_m && row.sigma_m < LEAST_SIGMA_M);
    let plane_at = |row: &RawFix| LocalPlane::new(row.geographic(), finite_or_zero(row.altitude_m));
    let first = rows.first().filter(|_| !is_plane);
    let fixes = in_plane(&rows, first.map(plane_at).as_ref());
    let kept = without_jumps(&fixes);
    faults.jumps = rows.len() - kept.len();
    let rows: Vec<RawFix> = kept.into_iter().map(|k| rows[k]).collect();
    let plane = rows.first().filter(|_| !is_plane).map(plane_at);
    (in_plane(&rows, plane.as_ref()), plane, faults)
}

fn finite_or_zero(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

/// Sorts fixes by their stamps. Of fixes with the same stamp only the first in the log is used.
fn sort(rows: &mut Vec<RawFix>, faults: &mut GnssFaults) {
    let before = rows.len();
    let mut latest_ns = i64::MIN;
    for row in rows.iter() {
        faults.out_of_order += usize::from(row.stamp_ns < latest_ns);
        latest_ns = latest_ns.max(row.stamp_ns);
    }
    rows.sort_by_key(|row| row.stamp_ns);
    rows.dedup_by_key(|row| row.stamp_ns);
    faults.repeated = before - rows.len();
}

fn in_plane(rows: &[RawFix], plane: Option<&LocalPlane>) -> Vec<LoggedFix> {
    let fix = |row: &RawFix| LoggedFix {
        stamp_ns: row.stamp_ns,
        east_north_m: plane.map_or(row.at, |plane| plane.east_north(row.geographic())),
        sigma_m: Some(row.sigma_m)
            .filter(|sigma| sigma.is_finite() && *sigma > 0.0)
            .map(|sigma| sigma.clamp(LEAST_SIGMA_M, MOST_SIGMA_M)),
    };
    rows.iter().map(fix).collect()
}

/// Returns the indices of the fixes that are left without those that a vehicle cannot have reached:
/// of the stretches between jumps the chain that has the most fixes.
fn without_jumps(fixes: &[LoggedFix]) -> Vec<usize> {
    let jumps = (1..fixes.len()).filter(|k| !is_reachable(&fixes[k - 1], &fixes[*k]));
    let stretches = between(fixes.len(), jumps);
    let follows = |earlier: usize, k: usize| {
        is_reachable(
            &fixes[stretches[earlier].end - 1],
            &fixes[stretches[k].start],
        )
    };
    let chain = longest_chain(&stretches, LOOK_BACK, follows);
    chain.into_iter().flatten().collect()
}

fn is_reachable(from: &LoggedFix, to: &LoggedFix) -> bool {
    let seconds = (to.stamp_ns.saturating_sub(from.stamp_ns)) as f64 * 1e-9;
    let [east, north] = [0, 1].map(|axis| to.east_north_m[axis] - from.east_north_m[axis]);
    let sigma_m = [from, to].map(|fix| fix.sigma_m.unwrap_or_default());
    let slack_m = SLACK_M + SLACK_SIGMAS * sigma_m[0].hypot(sigma_m[1]);
    east.hypot(north) <= MAX_SPEED_MPS * seconds + slack_m
}
