//! Measures one motion by parts of the scans: by the left and the right half, by the front and the
//! rear, and if chirps alternate by the rising and the falling ones. Wrong constants displace the
//! echoes of the parts differently. So the motions that the parts measure differ, in proportion to
//! the distance between the two scans.

use std::{num::NonZeroUsize, thread};

use gyre_geometry::{Pose, SparsePoint, UncertainMotion, xy_yaw};
use gyre_matching::{KeyframeAligner, SettingError, Submap};
use gyre_radar::median;
use nalgebra::{SMatrix, SVector};

use crate::{
    BLOCKS, Drive, Estimate, Fact, Track,
    facts::{FACTS, FactVector},
    jackknife,
};

/// Distances along the path between the two scans of a pair, m. The longer, the more a wrong fact
/// displaces, and the less the scans have in common.
const BASELINES_M: [f64; 3] = [6.0, 12.0, 20.0];
/// Distance along the path between the later scans of pairs, at least, m.
const SPACING_M: f64 = 3.0;
/// Pairs, at most: of a longer drive they are farther apart.
const MAX_PAIRS: usize = 900;
/// Differences beyond this multiple of the usual one weigh less (Huber).
const USUAL_SPREADS: f64 = 2.0;
const ITERATIONS: usize = 6;

/// A pair of parts: of the later scan, and of the earlier scan that it is aligned with. A point is
/// in a part as it was measured, whatever the facts.
type Part = [fn(&SparsePoint) -> bool; 2];

const LEFT: Part = [|point| point.y_m > 0.0; 2];
const RIGHT: Part = [|point| point.y_m <= 0.0; 2];
const FRONT: Part = [|point| point.x_m > 0.0; 2];
const REAR: Part = [|point| point.x_m <= 0.0; 2];
/// Echoes of one chirp coincide with any Doppler coefficient: each chirp is aligned with the other.
const RISING: Part = [|point| point.doppler_s > 0.0, |point| point.doppler_s < 0.0];
const FALLING: Part = [RISING[1], RISING[0]];
const COMPARED: [[Part; 2]; 3] = [[LEFT, RIGHT], [FRONT, REAR], [RISING, FALLING]];
const FIGURES: usize = 3 * COMPARED.len();

/// The motion by a part less that by the part that it is compared with: x, y (m) and yaw (rad) for
/// each row of [`COMPARED`].
type Difference = SVector<f64, FIGURES>;

struct Pair {
    earlier: usize,
    later: usize,
    block: usize,
    length_m: f64,
    speed_mps: f64,
}

/// Two scans each, along a drive.
pub(crate) struct Pairs<'a> {
    drive: &'a Drive,
    track: &'a Track,
    pairs: Vec<Pair>,
    /// Called after each measurement of all pairs.
    progress: &'a dyn Fn(),
}

/// The differences of all pairs under assumed facts; `None` for a pair with a part that does not
/// determine the motion.
pub(crate) struct Differences {
    of_pairs: Vec<Option<Difference>>,
    spread: Difference,
}

impl<'a> Pairs<'a> {
    pub fn of(drive: &'a Drive, track: &'a Track, progress: &'a dyn Fn()) -> Self {
        let path_m = track.path_m();
        let total_m = path_m.last().copied().unwrap_or_default();
        let spacing_m = SPACING_M.max(total_m * BASELINES_M.len() as f64 / MAX_PAIRS as f64);
        let mut pairs = Vec::new();
        for baseline_m in BASELINES_M {
            let mut next_m = baseline_m;
            for (later, here_m) in path_m.iter().enumerate() {
                if *here_m < next_m {
                    continue;
                }
                next_m = here_m + spacing_m;
                let earlier = path_m.partition_point(|there_m| *there_m < here_m - baseline_m);
                if earlier == later || track.is_broken(earlier, later) {
                    continue;
                }
                let speeds = [earlier, later].map(|scan| track.twists[scan].linear_mps().norm());
                pairs.push(Pair {
                    earlier,
                    later,
                    block: ((here_m / total_m * BLOCKS as f64) as usize).min(BLOCKS - 1),
                    length_m: here_m - path_m[earlier],
                    speed_mps: 0.5 * (speeds[0] + speeds[1]),
                });
            }
        }
        Self {
            drive,
            track,
            pairs,
            progress,
        }
    }

    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Measures the differences under changed facts.
    pub fn measure(&self, change: &FactVector) -> Result<Differences, SettingError> {
        let (drive, track) = (self.drive, self.track);
        let threads = thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let share = self.pairs.len().div_ceil(threads).max(1);
        let measured = thread::scope(|scope| {
            let shares = self.pairs.chunks(share);
            let workers: Vec<_> = shares
                .map(|pairs| scope.spawn(move || measure(drive, track, pairs, change)))
                .collect();
            let joined = workers.into_iter().map(|worker| worker.join());
            joined
                .map(|measured| measured.expect("a worker does not panic"))
                .collect::<Result<Vec<_>, _>>()
        })?;
        (self.progress)();
        let of_pairs = measured.concat();
        let spread = Difference::from_fn(|k, _| {
            let sizes = of_pairs
                .iter()
                .flatten()
                .map(|difference| difference[k].abs());
            1.4826 * median(sizes).unwrap_or_default()
        });
        Ok(Differences { of_pairs, spread })
    }

    /// Measures the change of the differences by each fact, per metre between the scans (by the
    /// Doppler shift per metre and m/s). A slope is the median over all pairs, since the slopes of
    /// single pairs are as noisy as the images.
    fn slopes(&self, at: &FactVector) -> Result<SMatrix<f64, FIGURES, FACTS>, SettingError> {
        let mut slopes = SMatrix::zeros();
        for fact in Fact::ALL {
            let [above, below] = [1.0, -1.0].map(|sign| {
                let mut shifted = *at;
                shifted[fact as usize] += sign * fact.step();
                self.measure(&shifted)
            });
            let (above, below) = (above?.of_pairs, below?.of_pairs);
            for k in 0..FIGURES {
                let each = self.pairs.iter().zip(above.iter().zip(&below));
                let each = each.filter_map(|(pair, (above, below))| {
                    let step = 2.0 * fact.step() * pair.effect(fact);
                    Some((above.as_ref()?[k] - below.as_ref()?[k]) / step)
                });
                slopes[(k, fact as usize)] = median(each).unwrap_or_default();
            }
        }
        Ok(slopes)
    }

    /// Estimates the change of the `free` facts from `at` under which the parts agree, with
    /// standard deviations by the jackknife. `None` if the pairs do not determine them.
    pub fn solve(
        &self,
        at: &FactVector,
        free: &[Fact],
    ) -> Result<Option<[Estimate; FACTS]>, SettingError> {
        let (here, slopes) = (self.measure(at)?, self.slopes(at)?);
        let solve = |left_out: Option<usize>| {
            (0..ITERATIONS).try_fold(FactVector::zeros(), |change, _| {
                let mut information = SMatrix::<f64, FACTS, FACTS>::identity();
                let mut moment = FactVector::zeros();
                free.iter()
                    .for_each(|fact| information[(*fact as usize, *fact as usize)] = 0.0);
                for (pair, difference) in self.pairs.iter().zip(&here.of_pairs) {
                    let Some(difference) = difference.filter(|_| left_out != Some(pair.block))
                    else {
                        continue;
                    };
                    let mut effects = FactVector::zeros();
                    free.iter()
                        .for_each(|fact| effects[*fact as usize] = pair.effect(*fact));
                    for k in (0..FIGURES).filter(|k| here.spread[*k] > 0.0) {
                        let slope = slopes.row(k).transpose().component_mul(&effects);
                        let left = (difference[k] + slope.dot(&change)).abs() / here.spread[k];
                        let weight = (USUAL_SPREADS / left).min(1.0) / here.spread[k].powi(2);
                        information += slope * slope.transpose() * weight;
                        moment -= slope * (difference[k] * weight);
                    }
                }
                Some(information.cholesky()?.solve(&moment))
            })
        };
        Ok(jackknife(solve))
    }
}

fn measure(
    drive: &Drive,
    track: &Track,
    pairs: &[Pair],
    change: &FactVector,
) -> Result<Vec<Option<Difference>>, SettingError> {
    let config = drive.config();
    let mut aligner = KeyframeAligner::new(&config.refinement, config.points.capacity)?;
    let compared = &COMPARED[..2 + usize::from(drive.alternates)];
    let measure = |pair: &Pair| {
        let measured = [pair.later, pair.earlier].map(|scan| &drive.sweeps[scan].points);
        let scans = [pair.later, pair.earlier].map(|scan| drive.points(scan, change));
        let poses = [pair.later, pair.earlier].map(|scan| &track.poses[scan]);
        let initial = poses[1].inv_mul(poses[0]);
        let mut align = |part: &Part| -> Option<UncertainMotion> {
            let [later, earlier] = [0, 1].map(|k| {
                let both = measured[k].iter().zip(&scans[k]);
                let seen = both.filter_map(|(measured, point)| part[k](measured).then_some(*point));
                let mut submap = Submap::default();
                let twist = &track.twists[[pair.later, pair.earlier][k]];
                submap.start(&seen.collect::<Vec<_>>(), twist);
                submap
            });
            aligner.align(&later, &earlier, false, &initial)
        };
        let mut difference = Difference::zeros();
        for (row, [one, other]) in compared.iter().enumerate() {
            let apart = apart(&align(one)?.motion, &align(other)?.motion);
            difference.fixed_rows_mut::<3>(3 * row).copy_from(&apart);
        }
        Some(difference)
    };
    Ok(pairs.iter().map(measure).collect())
}

impl Pair {
    /// Returns the quantity that the displacement by a fact is proportional to.
    fn effect(&self, fact: Fact) -> f64 {
        match fact {
            Fact::RangeOffset | Fact::Eccentricity => self.length_m,
            Fact::Doppler => self.length_m * self.speed_mps,
        }
    }
}

impl Differences {
    /// The mean of the squared differences, each over the usual one in `unit` and bounded.
    pub fn size(&self, unit: &Self) -> f64 {
        let of_pairs = self.of_pairs.iter().flatten();
        let each = of_pairs.flat_map(|difference| {
            let spreads = (0..FIGURES).filter(|k| unit.spread[*k] > 0.0);
            spreads.map(|k| {
                (difference[k] / unit.spread[k])
                    .powi(2)
                    .min(USUAL_SPREADS.powi(2))
            })
        });
        let (sum, count) = each.fold((0.0, 0), |(sum, count), it| (sum + it, count + 1));
        sum / f64::from(count.max(1))
    }
}

fn apart(one: &Pose, other: &Pose) -> SVector<f64, 3> {
    SVector::from(xy_yaw(one)) - SVector::from(xy_yaw(other))
}
