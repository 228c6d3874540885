//! Jumps: values that change faster than the values of a vehicle can.

use gyre_geometry::samples::{Sample, SampleKind};
use gyre_radar::median;

use super::kinds::Kind;

/// Time within which a value that has jumped jumps back, s: two turns of the radar. What stays for
/// longer is seen by the radar.
const BACK_S: f64 = 0.5;
/// Share of the changes of a log that are of the vehicle and of noise, and the factor beyond which
/// one is of neither.
const USUAL_SHARE: f64 = 0.95;
const UNUSUAL: f64 = 3.0;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Jumps {
    left_out: usize,
    /// Jumps without one back: their samples stay.
    alone: usize,
}

impl Jumps {
    /// Returns a sentence about them, if there are any.
    pub fn sentence(&self) -> Option<String> {
        let Self { left_out, alone } = self;
        let of = "faster than a vehicle can";
        match (left_out, alone) {
            (0, 0) => None,
            (_, 0) => Some(format!(
                "{left_out} samples differ from those around them by a change {of}: left out."
            )),
            (0, _) => Some(format!("The values change {alone} times {of}.")),
            _ => Some(format!(
                "{left_out} samples differ from those around them by a change {of}: left out; so the values change {alone} times more."
            )),
        }
    }
}

/// Leaves out samples of a kind, in the order of their stamps, that jump away from those before and
/// back to those after them.
pub(crate) fn leave_out(samples: &mut Vec<Sample>, of: SampleKind) -> Jumps {
    let Some((changed, per_s)) = Kind::of(of).changes else {
        return Jumps::default();
    };
    let all: &[Sample] = samples;
    let change = |from: usize, to: usize| changed(&all[from], &all[to]);
    let at_least = at_least(all, per_s, change);
    let step = |from: usize, to: usize| {
        let change = change(from, to);
        let most = at_least.max(per_s * seconds(all, from, to));
        (change.abs() > most).then_some(change)
    };
    let mut jumps = Jumps::default();
    let mut is_left_out = vec![false; all.len()];
    let mut next = 1;
    while next < all.len() {
        let (before, first) = (next - 1, next);
        next += 1;
        let Some(away) = step(before, first) else {
            continue;
        };
        let within = first + 1..all.len();
        let within = within.take_while(|end| seconds(all, before, *end) <= BACK_S);
        let mut back = within.filter(|end| step(end - 1, *end).is_some_and(|it| it * away < 0.0));
        match back.find(|end| step(before, *end).is_none()) {
            Some(end) => {
                is_left_out[first..end].fill(true);
                next = end + 1;
            }
            None => jumps.alone += 1,
        }
    }
    let mut left_out = is_left_out.iter();
    samples.retain(|_| !left_out.next().is_some_and(|it| *it));
    jumps.left_out = is_left_out.iter().filter(|it| **it).count();
    jumps
}

/// The change of a value that is no jump, whatever the time between two samples, which are closer
/// together where stamps jitter.
fn at_least(samples: &[Sample], per_s: f64, change: impl Fn(usize, usize) -> f64) -> f64 {
    let pairs = || 1..samples.len();
    let period_s = median(pairs().map(|k| seconds(samples, k - 1, k))).unwrap_or_default();
    let mut changes: Vec<f64> = pairs().map(|k| change(k - 1, k).abs()).collect();
    changes.sort_unstable_by(f64::total_cmp);
    let usual = changes.get((USUAL_SHARE * changes.len() as f64) as usize);
    (per_s * period_s).max(UNUSUAL * usual.copied().unwrap_or_default())
}

fn seconds(samples: &[Sample], from: usize, to: usize) -> f64 {
    (samples[to].stamp_ns - samples[from].stamp_ns) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PERIOD_NS: i64 = 10_000_000;

    /// A gyro of 100 Hz on a vehicle that turns as sharply as one of 2 m can, with noise.
    fn track(seed: usize) -> Vec<Sample> {
        let rate = |k: usize| {
            let time_s = k as f64 * 1e-2;
            let noise = 2e-3 * ((k * 37 + seed) % 11) as f64 - 1e-2;
            2.0 * (5.0 * time_s).sin() + noise
        };
        let sample = |k| Sample::yaw_rate(k as i64 * PERIOD_NS, rate(k));
        (0..500).map(sample).collect()
    }

    proptest! {
        /// Whatever the length and the height of a jump, the samples in it are left out and no
        /// others.
        #[test]
        fn samples_that_jump_there_and_back_are_left_out(
            seed in 0usize..11, from in 1usize..400, count in 1usize..40, by in 0.6..9.0f64, up in any::<bool>(),
        ) {
            let good = track(seed);
            let mut samples = good.clone();
            let by = if up { by } else { -by };
            samples[from..from + count].iter_mut().for_each(|it| it.values[2] += by);
            let jumps = leave_out(&mut samples, SampleKind::Gyro);
            prop_assert_eq!(jumps, Jumps { left_out: count, alone: 0 });
            let kept: Vec<Sample> = good[..from].iter().chain(&good[from + count..]).copied().collect();
            prop_assert_eq!(samples, kept);
            prop_assert!(jumps.sentence().is_some());
        }
    }

    #[test]
    fn a_sharp_drive_has_no_jumps_and_a_value_that_stays_is_named_and_kept() {
        let mut samples = track(0);
        assert_eq!(leave_out(&mut samples, SampleKind::Gyro), Jumps::default());
        assert_eq!(samples, track(0));
        samples[300..].iter_mut().for_each(|it| it.values[2] += 1.0);
        let jumps = leave_out(&mut samples, SampleKind::Gyro);
        assert_eq!((jumps.left_out, jumps.alone), (0, 1));
        assert_eq!(samples.len(), 500);
        let sentence = "The values change 1 times faster than a vehicle can.";
        assert_eq!(jumps.sentence().as_deref(), Some(sentence));
        assert_eq!(Jumps::default().sentence(), None);
    }

    #[test]
    fn wheels_that_brake_have_none_and_stamps_that_jitter_make_none() {
        let speed = |k: i64| (20.0 - 0.2 * k as f64).max(0.0);
        let stamp_ns = |k: i64| 2 * k * PERIOD_NS - if k % 7 == 3 { 19_000_000 } else { 0 };
        let samples = (0..200).map(|k| Sample::speed(stamp_ns(k), speed(k)));
        let samples: Vec<Sample> = samples.collect();
        let mut kept = samples.clone();
        assert_eq!(leave_out(&mut kept, SampleKind::Wheels), Jumps::default());
        assert_eq!(kept, samples);
        kept[50].values[0] = 0.0;
        let jumps = leave_out(&mut kept, SampleKind::Wheels);
        assert_eq!((jumps.left_out, jumps.alone), (1, 0));
    }
}
