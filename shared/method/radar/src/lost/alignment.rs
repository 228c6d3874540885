//! Probabilities of the number of azimuths that were lost before each row, given how well all
//! rows agree with predictions. Going along the rows the number never decreases; before the rows
//! are compared, no place is likelier than another.

mod passes;

use gyre_simd::simd;

use super::{LostAzimuths, MAX_LOST, echoes::Echoes, prediction::Prediction};
use passes::{pass_backward, pass_forward};

/// Azimuths by which the whole scan may be turned against a prediction, to either side.
const TURN: usize = 3;
/// Steps of that turn for each azimuth.
const STEPS: usize = 2;
/// The weights of four neighbours for a value amid them: the cubic of Catmull and Rom.
const AMID: [f32; 4] = [-1.0 / 16.0, 9.0 / 16.0, 9.0 / 16.0, -1.0 / 16.0];
/// Azimuths beyond the turn on each side that the interpolation takes.
const BESIDE: usize = 1;
/// The least share of noise in the energy of a scan.
const LEAST_NOISE: f32 = 1e-3;
/// Likelihood of a row that is not as predicted, whatever number it has: of something that moves.
const OUTLIER: f32 = 1e-3;
/// Logarithm of a likelihood, relative to the highest of a row, that is none.
const LEAST_LOGARITHM: f32 = -20.0;
/// Numbers of lost azimuths before a row, from none to all.
const NUMBERS: usize = MAX_LOST + 1;
/// The most azimuths with which a row is compared, a multiple of what a processor takes at once.
const WIDTH: usize = azimuths(MAX_LOST).next_multiple_of(8);
/// Turns of the scan, a value for each: those of [`TURN`], and some that fill a multiple of what a
/// processor takes at once.
type Turns<T> = [T; TURNS.next_multiple_of(8)];
const TURNS: usize = 2 * TURN * STEPS + 1;
/// Steps with which a row is compared at most, as many as the turns of the largest number reach,
/// and some that make it a power of two.
const MOST_STEPS: usize = (STEPS * MAX_LOST + TURNS.next_multiple_of(8)).next_power_of_two();

/// Aligns the rows of scans with predictions.
#[derive(Clone, Debug, Default)]
pub(super) struct Alignment {
    /// Sum of products of each row with each predicted azimuth around it.
    products: Vec<[f32; WIDTH]>,
    /// Likelihood of each row at each step around it, relative to the highest.
    likelihoods: Vec<[f32; MOST_STEPS]>,
    /// Probability of each number, given the rows up to this one: row x number.
    forward: Vec<Turns<f32>>,
    places: Places,
    /// Energy of what remains of a row, of the first prediction.
    noise: f32,
}

/// The places of lost azimuths, as the number of rows before each.
#[derive(Clone, Copy, Debug, Default)]
struct Places {
    /// Logarithm of the likelihood of all that is averaged here.
    likelihood: f64,
    mean: [f64; MAX_LOST],
    mean_square: [f64; MAX_LOST],
}

impl Places {
    /// Averages with others, each by how likely it is.
    fn add(&mut self, other: &Self) {
        let most = self.likelihood.max(other.likelihood);
        let [of_self, of_other] = [self.likelihood, other.likelihood].map(|of| (of - most).exp());
        let sum = of_self + of_other;
        let average =
            |mean: &mut f64, other: f64| *mean = (of_self * *mean + of_other * other) / sum;
        for place in 0..MAX_LOST {
            average(&mut self.mean[place], other.mean[place]);
            average(&mut self.mean_square[place], other.mean_square[place]);
        }
        self.likelihood = most + sum.ln();
    }
}

impl Alignment {
    /// Begins with a scan.
    pub fn begin(&mut self) {
        self.places.likelihood = f64::NEG_INFINITY;
        self.noise = 0.0;
    }

    /// Adds what a prediction says of where `count` azimuths of the scan were lost.
    pub fn add(&mut self, prediction: &Prediction, scan: &Echoes, count: usize) {
        let rows = scan.layout.azimuths - count;
        self.products.clear();
        self.products.resize(rows, [0.0; WIDTH]);
        multiply(prediction, scan, &mut self.products);
        let (gain, common) = self.gain(prediction, count);
        if self.noise == 0.0 {
            let measured = scan.energy();
            let noise = measured - gain * common;
            self.noise = noise.max(LEAST_NOISE * measured).max(1.0) / rows as f32;
        }
        self.likelihoods.resize(rows, [0.0; MOST_STEPS]);
        let weights = Weights {
            gain,
            scale: gain / self.noise,
            steps: STEPS * (azimuths(count) + 1 - AMID.len()),
        };
        let likelihood = weigh(&self.products, prediction, &weights, &mut self.likelihoods);
        let turns = pass_forward(&self.likelihoods, count, &mut self.forward);
        let all = pass_backward(&self.likelihoods, &self.forward, count);
        for (places, turn) in all.iter().zip(turns).take(TURNS) {
            let likelihood = likelihood + turn;
            self.places.add(&Places {
                likelihood,
                ..*places
            });
        }
    }

    /// Returns where `count` azimuths were lost before one of so many rows, or behind the last.
    pub fn found(&self, rows: usize, count: usize) -> LostAzimuths {
        let places = &self.places;
        LostAzimuths::between((0..count).map(|place| {
            let mean = places.mean[place];
            let variance = (places.mean_square[place] - mean * mean).max(0.0);
            // Rows of equal probability with this mean and variance.
            let beside = 0.5 * ((12.0 * variance + 1.0).sqrt() - 1.0);
            [mean - beside, mean + beside].map(|row| row.round().clamp(0.0, rows as f64) as u16)
        }))
    }

    /// Returns by how much the rows are stronger than predicted, each where it agrees best, and the
    /// sum of its products there.
    fn gain(&self, prediction: &Prediction, count: usize) -> (f32, f32) {
        let (mut common, mut energy) = (0.0, f32::MIN_POSITIVE);
        for (row, products) in self.products.iter().enumerate() {
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

/// Adds the products of each row's echoes with the predicted azimuths around it.
#[simd]
fn multiply(prediction: &Prediction, scan: &Echoes, products: &mut [[f32; WIDTH]]) {
    for row in scan.rows() {
        let index = row.at as usize;
        let mut sums = [0.0; WIDTH];
        for (cell, power) in row.cells.iter().zip(row.powers) {
            let predicted = prediction.from::<WIDTH>(*cell, azimuth(index, 0));
            for (sum, predicted) in sums.iter_mut().zip(predicted) {
                *sum += power * predicted;
            }
        }
        products[index] = sums;
    }
}

/// The numbers that make likelihoods from products. A row is the prediction times a gain, and
/// noise: neighbouring cells differ together, so that a row counts as one measurement.
#[derive(Clone, Copy, Debug)]
struct Weights {
    gain: f32,
    /// The gain over the noise.
    scale: f32,
    /// Steps with which a row is compared.
    steps: usize,
}

/// Determines the likelihoods, and returns the sum of the logarithms of the highest.
#[simd]
fn weigh(
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
        let amid: [f32; MOST_STEPS / STEPS] = std::array::from_fn(|k| amid(&scores, k));
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

/// Returns the highest score, without a chain of comparisons.
#[inline(always)]
fn highest_of(steps: &[f32; MOST_STEPS]) -> f32 {
    let mut best = *steps;
    let mut half = MOST_STEPS / 2;
    while half > 0 {
        let (low, high) = best.split_at_mut(half);
        for (low, high) in low.iter_mut().zip(high) {
            *low = if *high > *low { *high } else { *low };
        }
        half /= 2;
    }
    best[0]
}

/// Returns the value amid the second and the third of four scores from the `k`-th on.
#[inline(always)]
fn amid(scores: &[f32; WIDTH], k: usize) -> f32 {
    AMID[0] * scores[k]
        + AMID[1] * scores[k + 1]
        + AMID[2] * scores[k + 2]
        + AMID[3] * scores[k + 3]
}

/// Returns e to the power of a number from -87 to 0, with a relative error below 2e-7. That of the
/// C library takes one number at a time.
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

/// Azimuths with which a row is compared.
const fn azimuths(count: usize) -> usize {
    count + 2 + 2 * (TURN + BESIDE)
}

/// The `k`-th azimuth with which a row is compared.
#[inline(always)]
const fn azimuth(row: usize, k: usize) -> isize {
    (row + k) as isize - (TURN + BESIDE) as isize
}

#[cfg(test)]
mod tests {
    use super::exponential;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_exponential_is_that_of_double_precision(x in -20.0..=0.0_f32) {
            let expected = f64::from(x).exp();
            let relative = (f64::from(exponential(x)) - expected) / expected;
            prop_assert!(relative.abs() < 2e-7, "{x}: {relative}");
        }
    }
}
