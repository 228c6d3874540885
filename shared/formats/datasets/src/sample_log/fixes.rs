//! Fixes that are left out, and the plane of the others.

use gyre_geometry::samples::{LocalPlane, Sample};

use super::LogFaults;
use super::table::{between, leave_out, longest_chain};

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

/// Leaves out the fixes that cannot be used, and returns the others in their plane, which is the
/// plane of the log if `is_plane`.
pub(super) fn repaired(
    mut rows: Vec<Sample>,
    is_plane: bool,
    faults: &mut LogFaults,
) -> (Vec<Sample>, Option<LocalPlane>) {
    if !is_plane {
        faults.zero = leave_out(&mut rows, |row| row.place() == [0.0, 0.0]);
        faults.off_the_earth = leave_out(&mut rows, |row| {
            row.values[0].abs() > 89.9 || row.values[1].abs() > 360.0
        });
    }
    sort(&mut rows, faults);
    let before = rows.len();
    rows.dedup_by(|later, earlier| later.place() == earlier.place());
    faults.frozen = before - rows.len();
    let count = |is_so: &dyn Fn(&&Sample) -> bool| rows.iter().filter(is_so).count();
    faults.of_unknown_status = count(&|row| row.values[4] > 0.0);
    faults.too_certain = count(&|row| row.sigma_m().is_some_and(|sigma_m| sigma_m < LEAST_SIGMA_M));
    let plane_at = |row: &Sample| LocalPlane::new(row.geographic(), finite_or_zero(row.values[2]));
    let first = rows.first().filter(|_| !is_plane);
    let fixes = in_plane(&rows, first.map(plane_at).as_ref());
    let kept = without_jumps(&fixes);
    faults.jumps = rows.len() - kept.len();
    let rows: Vec<Sample> = kept.into_iter().map(|k| rows[k]).collect();
    let plane = rows.first().filter(|_| !is_plane).map(plane_at);
    (in_plane(&rows, plane.as_ref()), plane)
}

fn finite_or_zero(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

/// Sorts fixes by their stamps. Of fixes with the same stamp only the first in the log is used.
fn sort(rows: &mut Vec<Sample>, faults: &mut LogFaults) {
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

fn in_plane(rows: &[Sample], plane: Option<&LocalPlane>) -> Vec<Sample> {
    let fix = |row: &Sample| {
        let place = plane.map_or(row.place(), |plane| plane.east_north(row.geographic()));
        let sigma_m = row.sigma_m().filter(|sigma_m| sigma_m.is_finite());
        let sigma_m = sigma_m.map_or(0.0, |it| it.clamp(LEAST_SIGMA_M, MOST_SIGMA_M));
        Sample::fix(row.stamp_ns, place, row.values[2], sigma_m)
    };
    rows.iter().map(fix).collect()
}

/// Returns the indices of the fixes that are left without those that a vehicle cannot have reached:
/// of the stretches between jumps the chain that has the most fixes.
fn without_jumps(fixes: &[Sample]) -> Vec<usize> {
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

fn is_reachable(from: &Sample, to: &Sample) -> bool {
    let seconds = (to.stamp_ns.saturating_sub(from.stamp_ns)) as f64 * 1e-9;
    let [east, north] = [0, 1].map(|axis| to.values[axis] - from.values[axis]);
    let sigma_m = [from, to].map(|fix| fix.sigma_m().unwrap_or_default());
    let slack_m = SLACK_M + SLACK_SIGMAS * sigma_m[0].hypot(sigma_m[1]);
    east.hypot(north) <= MAX_SPEED_MPS * seconds + slack_m
}
