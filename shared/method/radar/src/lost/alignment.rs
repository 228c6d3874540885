//! Probabilities of the number of azimuths that were lost before each row, given how well all
//! rows agree with predictions. Going along the rows the number never decreases; before the rows
//! are compared, no place is likelier than another.

mod passes;

use gyre_geometry::{MAX_GAPS, MAX_SINGLE};
use gyre_simd::simd;
use passes::{pass_backward, pass_forward};

use super::{LostAzimuths, MAX_LOST, echoes::Echoes, prediction::Prediction};

/// Largest turn of the whole scan against a prediction, in azimuths to either side.
const TURN: usize = 3;
const STEPS: usize = 2;
/// The weights of four neighbours for a value amid them: the cubic of Catmull and Rom.
const AMID: [f32; 4] = [-1.0 / 16.0, 9.0 / 16.0, 9.0 / 16.0, -1.0 / 16.0];
/// Azimuths beyond the turn on each side that the interpolation takes.
const BESIDE: usize = 1;
const LEAST_NOISE: f32 = 1e-3;
/// Likelihood of a row that is not as predicted, whatever number it has: of something that moves.
const OUTLIER: f32 = 1e-3;
/// Logarithm of a negligible likelihood, relative to the highest of a row.
const LEAST_LOGARITHM: f32 = -20.0;
/// Numbers of lost azimuths before a row, from none to all, if they are placed one by one.
const FEW: usize = MAX_SINGLE + 1;
/// Distance below which azimuths were lost together if many were, rows.
const TOGETHER: f64 = 2.0;
/// Measurements for which a row counts if many azimuths were lost, as bursts show in many rows.
const OF_BURST: f32 = 4.0;
/// Logarithm of a likelihood, relative to another, beside which nothing is left of it.
const NEGLIGIBLE: f64 = -30.0;
/// Turns of the scan, a value for each: as many as [`TURN`] allows, and padding up to a multiple of
/// the processor's vector width.
type Turns<T> = [T; TURNS.next_multiple_of(8)];
const TURNS: usize = 2 * TURN * STEPS + 1;

#[derive(Clone, Debug, Default)]
pub(super) struct Alignment {
    /// Sum of products of each row with each predicted azimuth around it.
    products: Vec<f32>,
    /// Likelihood of each row at each step around it, relative to the highest.
    likelihoods: Vec<f32>,
    /// Probability of each number, given the rows up to this one: row x number.
    forward: Vec<Turns<f32>>,
    /// Mean and mean square of each place.
    moments: Vec<[Turns<f64>; 2]>,
    places: Places,
    /// Energy of what remains of a row, of the first prediction.
    noise: f32,
}

#[derive(Clone, Debug, Default)]
struct Places {
    /// Logarithm of the likelihood of all that is averaged here.
    likelihood: f64,
    /// Mean and mean square of each.
    moments: Vec<[f64; 2]>,
}

impl Places {
    fn add(&mut self, likelihood: f64, others: impl Iterator<Item = [f64; 2]>) {
        let most = self.likelihood.max(likelihood);
        let [of_self, of_other] = [self.likelihood, likelihood].map(|of| (of - most).exp());
        let sum = of_self + of_other;
        for (moments, others) in self.moments.iter_mut().zip(others) {
            for (mean, other) in moments.iter_mut().zip(others) {
                *mean = (of_self * *mean + of_other * other) / sum;
            }
        }
        self.likelihood = most + sum.ln();
    }
}

impl Alignment {
    pub fn begin(&mut self) {
        self.places.likelihood = f64::NEG_INFINITY;
        self.noise = 0.0;
    }

    /// Adds the evidence of a prediction about the places of `count` lost azimuths of the scan.
    pub fn add(&mut self, prediction: &Prediction, scan: &Echoes, count: usize) {
        self.places.moments.resize(count, [0.0; 2]);
        match count {
            1 => self.add_numbers::<24, 32, 16, 2>(prediction, scan, count),
            2 => self.add_numbers::<24, 32, 16, 3>(prediction, scan, count),
            3 => self.add_numbers::<24, 32, 16, 4>(prediction, scan, count),
            ..FEW => self.add_numbers::<24, 32, 16, FEW>(prediction, scan, count),
            _ => self.add_numbers::<96, 176, 88, { MAX_LOST + 1 }>(prediction, scan, count),
        }
    }

    /// Compares rows with `WIDTH` azimuths: in `MOST_STEPS` steps, with `HALF` of them amid two
    /// azimuths.
    fn add_numbers<
        const WIDTH: usize,
        const MOST_STEPS: usize,
        const HALF: usize,
        const NUMBERS: usize,
    >(
        &mut self,
        prediction: &Prediction,
        scan: &Echoes,
        count: usize,
    ) {
        let rows = scan.layout.azimuths - count;
        self.products.clear();
        self.products.resize(rows * WIDTH, 0.0);
        let (products, _) = self.products.as_chunks_mut::<WIDTH>();
        let measured = multiply(prediction, scan, products);
        let (gain, common) = Self::gain(products, prediction, count);
        if self.noise == 0.0 {
            let noise = measured - gain * common;
            self.noise = noise.max(LEAST_NOISE * measured).max(1.0) / rows as f32;
        }
        let measurements = if NUMBERS > FEW { OF_BURST } else { 1.0 };
        let weights = Weights {
            gain,
            scale: measurements * gain / self.noise,
            steps: STEPS * (azimuths(count) + 1 - AMID.len()),
        };
        self.likelihoods.resize(rows * MOST_STEPS, 0.0);
        let (steps, _) = self.likelihoods.as_chunks_mut::<MOST_STEPS>();
        let likelihood = weigh::<WIDTH, MOST_STEPS, HALF>(products, prediction, &weights, steps);
        let turns = pass_forward::<MOST_STEPS, NUMBERS>(steps, count, &mut self.forward);
        let is_negligible = |of: &f64| likelihood + of < self.places.likelihood + NEGLIGIBLE;
        if turns[..TURNS].iter().all(is_negligible) {
            return;
        }
        self.moments.resize(count, Default::default());
        pass_backward::<MOST_STEPS, NUMBERS>(steps, &self.forward, &mut self.moments);
        for (turn, of_turn) in turns.into_iter().enumerate().take(TURNS) {
            let moments = self.moments.iter().map(|it| it.map(|it| it[turn]));
            self.places.add(likelihood + of_turn, moments);
        }
    }

    /// Returns where `count` azimuths were lost before one of so many rows, or behind the last:
    /// few of them one by one, more of them in gaps.
    pub fn found(&mut self, rows: usize, count: usize) -> LostAzimuths {
        let moments = &mut self.places.moments;
        let mut azimuths = [1; MAX_LOST];
        let mut gaps = count;
        loop {
            let apart = |gap: &usize| moments[gap + 1][0] - moments[*gap][0];
            let next = (0..gaps.saturating_sub(1)).min_by(|a, b| apart(a).total_cmp(&apart(b)));
            let is_joined = |gap: &usize| gaps > MAX_GAPS || apart(gap) < TOGETHER;
            let Some(gap) = next.filter(|gap| count >= FEW && is_joined(gap)) else {
                break;
            };
            let [of_gap, of_next] = [azimuths[gap], azimuths[gap + 1]].map(f64::from);
            let next = moments[gap + 1];
            for (moment, next) in moments[gap].iter_mut().zip(next) {
                *moment = (of_gap * *moment + of_next * next) / (of_gap + of_next);
            }
            azimuths[gap] += azimuths[gap + 1];
            moments[gap + 1..gaps].rotate_left(1);
            azimuths[gap + 1..gaps].rotate_left(1);
            gaps -= 1;
        }
        let gaps = moments.iter().zip(azimuths).take(gaps);
        LostAzimuths::of_gaps(gaps.map(|([mean, mean_square], azimuths)| {
            let variance = (mean_square - mean * mean).max(0.0);
            // Rows of equal probability with this mean and variance.
            let beside = 0.5 * ((12.0 * variance + 1.0).sqrt() - 1.0);
            let [first, last] = [mean - beside, mean + beside]
                .map(|row| row.round().clamp(0.0, rows as f64) as u16);
            [first, last, azimuths]
        }))
    }

    /// Returns by how much the rows are stronger than predicted, each where it agrees best, and the
    /// sum of its products there.
    fn gain<const WIDTH: usize>(
        products: &[[f32; WIDTH]],
        prediction: &Prediction,
        count: usize,
    ) -> (f32, f32) {
        let (mut common, mut energy) = (0.0, f32::MIN_POSITIVE);
        for (row, products) in products.iter().enumerate() {
            let (mut best, mut highest) = (BESIDE + TURN, products[BESIDE + TURN]);
            for (k, product) in (best..).zip(&products[BESIDE + TURN..][..=count]) {
                // Which it is cannot be foreseen: no branch.
                let is_higher = *product > highest;
                best = if is_higher { k } else { best };
                highest = if is_higher { *product } else { highest };
            }
            common += highest;
            energy += prediction.energies::<1>(azimuth(row, best))[0];
        }
        (common / energy, common)
    }
}

/// Adds the products of each row's echoes with the predicted azimuths around it, and returns the
/// sum of the squares of the echoes.
#[simd]
fn multiply<const WIDTH: usize>(
    prediction: &Prediction,
    scan: &Echoes,
    products: &mut [[f32; WIDTH]],
) -> f32 {
    let mut energy = 0.0;
    for row in scan.rows() {
        let index = row.at as usize;
        let mut sums = [0.0; WIDTH];
        for (cell, power) in row.cells.iter().zip(row.powers) {
            energy += power * power;
            let predicted = prediction.from::<WIDTH>(*cell, azimuth(index, 0));
            for (sum, predicted) in sums.iter_mut().zip(predicted) {
                *sum += power * predicted;
            }
        }
        products[index] = sums;
    }
    energy
}

/// The numbers that make likelihoods from products. A row is the prediction times a gain, and
/// noise: neighbouring cells differ together, so that a row counts as one measurement.
#[derive(Clone, Copy, Debug)]
struct Weights {
    gain: f32,
    scale: f32,
    steps: usize,
}

/// Determines the likelihoods, and returns the sum of the logarithms of the highest.
#[simd]
fn weigh<const WIDTH: usize, const MOST_STEPS: usize, const HALF: usize>(
    products: &[[f32; WIDTH]],
    prediction: &Prediction,
    weights: &Weights,
    likelihoods: &mut [[f32; MOST_STEPS]],
) -> f64 {
    let mut highest = 0.0;
    for (row, (products, likelihoods)) in products.iter().zip(likelihoods).enumerate() {
        let energies = prediction.energies::<WIDTH>(azimuth(row, 0));
        let scores: [f32; WIDTH] = std::array::from_fn(|k| {
            weights.scale * (products[k] - 0.5 * weights.gain * energies[k])
        });
        let amid: [f32; HALF] = std::array::from_fn(|k| amid(&scores, k));
        let mut steps: [f32; MOST_STEPS] = std::array::from_fn(|step| match step % STEPS {
            0 => scores[step / STEPS + BESIDE],
            _ => amid[step / STEPS],
        });
        for (step, score) in steps.iter_mut().enumerate() {
            let is_compared = step < weights.steps;
            *score = if is_compared {
                *score
            } else {
                f32::NEG_INFINITY
            };
        }
        let best = highest_of(&steps);
        highest += f64::from(best);
        for (likelihood, step) in likelihoods.iter_mut().zip(&steps) {
            let relative = step - best;
            // Beside that nothing is left of it.
            let is_none = relative < LEAST_LOGARITHM;
            let of_step = exponential(relative.max(LEAST_LOGARITHM));
            *likelihood = OUTLIER + if is_none { 0.0 } else { of_step };
        }
    }
    highest
}

#[inline(always)]
fn highest_of<const STEPS: usize>(steps: &[f32; STEPS]) -> f32 {
    let higher = |a: f32, b: f32| if b > a { b } else { a };
    let mut best = [f32::NEG_INFINITY; 16];
    for steps in steps.as_chunks::<16>().0 {
        best = std::array::from_fn(|k| higher(best[k], steps[k]));
    }
    for half in [8, 4, 2, 1] {
        let (low, high) = best.split_at_mut(half);
        for (low, high) in low.iter_mut().zip(high) {
            *low = higher(*low, *high);
        }
    }
    best[0]
}

/// Returns the value amid the second and the third of four scores from the `k`-th on.
#[inline(always)]
fn amid<const WIDTH: usize>(scores: &[f32; WIDTH], k: usize) -> f32 {
    AMID[0] * scores[k]
        + AMID[1] * scores[k + 1]
        + AMID[2] * scores[k + 2]
        + AMID[3] * scores[k + 3]
}

/// Returns e to the power of a number from -87 to 0, with a relative error below 2e-7. The function
/// of the C library takes one number at a time.
#[inline(always)]
fn exponential(x: f32) -> f32 {
    use std::f32::consts::LOG2_E;
    // Adding this leaves no digits behind the point.
    const ROUND: f32 = (3 << 22) as f32;
    // ln 2, the first part with so few digits that its multiples are exact.
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    // 1 / 7!, ..., 1 / 1!, 1 / 0!
    const SERIES: [f32; 8] = [
        1.0 / 5040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ];
    let shifted = x * LOG2_E + ROUND;
    let halvings = shifted - ROUND;
    let rest = x - halvings * LN_2[0] - halvings * LN_2[1];
    let mut sum = 0.0;
    for term in SERIES {
        sum = sum * rest + term;
    }
    // The integer in the last digits goes into the exponent.
    let power = shifted.to_bits().wrapping_add(127) << 23;
    sum * f32::from_bits(power)
}

const fn azimuths(count: usize) -> usize {
    count + 2 + 2 * (TURN + BESIDE)
}

#[inline(always)]
const fn azimuth(row: usize, k: usize) -> isize {
    (row + k) as isize - (TURN + BESIDE) as isize
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::exponential;

    proptest! {
        #[test]
        fn the_exponential_is_that_of_double_precision(x in -20.0..=0.0_f32) {
            let expected = f64::from(x).exp();
            let relative = (f64::from(exponential(x)) - expected) / expected;
            prop_assert!(relative.abs() < 2e-7, "{x}: {relative}");
        }
    }
}
