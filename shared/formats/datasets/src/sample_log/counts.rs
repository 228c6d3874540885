//! Speeds of the counts of an encoder or an odometer.

use gyre_geometry::samples::{Sample, SampleKind};
use gyre_radar::median;

use super::{
    LogError, SampleLog,
    columns::Counts,
    kinds::{Kind, MOST_MPS, WHEELS},
    rates::ABSURD_SHARE,
};

/// Shortest time between the two counts of a speed: over less, ticks are too coarse.
const SPAN_NS: i64 = 90_000_000;

/// Any count is plausible: only speeds are checked.
pub(super) const COUNTS: Kind = Kind {
    values: 2,
    most: f64::MAX,
    ..WHEELS
};

/// Makes speeds of counts: each is the mean of the time between two, and has the stamp of its
/// middle. Speeds that no vehicle has, as after a reset of the counter, are left out.
pub(super) fn speeds(
    mut log: SampleLog,
    unit: Counts,
    m_per_tick: Option<f64>,
) -> Result<SampleLog, LogError> {
    let path = log.path.clone();
    let unusable = |reason: &str| LogError::unusable(SampleKind::Wheels, &path, reason);
    let missing = "it counts ticks: give the distance of one, in metres, as wheels.m_per_tick";
    let m_per_count = match unit {
        Counts::Ticks => m_per_tick.ok_or_else(|| unusable(missing))?,
        Counts::Metres => 1.0,
    };
    (0..2).for_each(|wheel| count_on(&mut log.samples, wheel));
    let mut speeds = Vec::with_capacity(log.samples.len());
    let mut from = log.samples[0];
    for to in &log.samples {
        let span_ns = to.stamp_ns - from.stamp_ns;
        if span_ns >= SPAN_NS {
            let by = |wheel: usize| to.values[wheel] - from.values[wheel];
            let way_m = (by(0) + by(1)) / 2.0 * m_per_count;
            let speed_mps = way_m / (span_ns as f64 * 1e-9);
            speeds.push(Sample::speed(from.stamp_ns + span_ns / 2, speed_mps));
            from = *to;
        }
    }
    let before = speeds.len();
    if before == 0 {
        return Err(unusable("it is shorter than 0.09 s"));
    }
    speeds.retain(|speed| speed.values[0].abs() <= MOST_MPS);
    let absurd = before - speeds.len();
    if absurd as f64 > ABSURD_SHARE * before as f64 && absurd > 1 || speeds.is_empty() {
        let remedy = match unit {
            Counts::Ticks => "is wheels.m_per_tick in metres?",
            Counts::Metres => "is the distance in metres?",
        };
        let reason = format!("{absurd} of its {before} speeds are beyond 100 m/s: {remedy}");
        return Err(unusable(&reason));
    }
    log.faults.absurd += absurd;
    log.samples = speeds;
    Ok(log)
}

/// Unwraps a counter that overflows. The range of the counter is a power of two, or the size of
/// its jumps if all jumps are equal; a single other jump is a restart of the counter.
fn count_on(counts: &mut [Sample], wheel: usize) {
    let mut values: Vec<f64> = counts.iter().map(|it| it.values[wheel]).collect();
    values.sort_unstable_by(f64::total_cmp);
    // Without a hundredth at each end: single rows are corrupt.
    let margin = values.len() / 100;
    let range = values[values.len() - 1 - margin] - values[margin];
    let apart = |pair: &[Sample]| pair[1].values[wheel] - pair[0].values[wheel];
    let steps: Vec<f64> = counts.windows(2).map(apart).collect();
    let (jumps, others): (Vec<usize>, Vec<usize>) =
        (0..steps.len()).partition(|k| steps[*k].abs() > 0.5 * range);
    let largest = others.iter().map(|k| steps[*k].abs()).fold(0.0, f64::max);
    // The counter would have gone on as before.
    let before = |k: usize| k.checked_sub(1).map_or(0.0, |before| steps[before].abs());
    let size = |k: &usize| steps[*k].abs() + before(*k).min(largest);
    let Some(usual) = median(jumps.iter().map(size)) else {
        return;
    };
    let is_usual = |size: f64| (size - usual).abs() <= largest;
    let bits = usual.log2().round().exp2();
    let repeats = jumps.len() > 1 && jumps.iter().all(|k| is_usual(size(k)));
    let modulus = match is_usual(bits) && bits > range {
        true => bits,
        false if repeats && usual + largest > range => usual.max(range),
        false => return,
    };
    let mut turns = 0.0;
    for (count, step) in counts[1..].iter_mut().zip(steps) {
        if step.abs() > 0.5 * range {
            turns -= step.signum();
        }
        count.values[wheel] += turns * modulus;
    }
}
