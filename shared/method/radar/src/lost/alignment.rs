//! Probabilities of the number of azimuths that were lost before each row, given how well all
//! rows agree with predictions. Going along the rows the number never decreases; before the rows
//! are compared, no place is likelier than another.

use super::{LostAzimuths, MAX_LOST, echoes::Echoes, prediction::Prediction};

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
/// Numbers of lost azimuths before a row, from none to all.
const NUMBERS: usize = MAX_LOST + 1;

/// Aligns the rows of scans with predictions.
#[derive(Debug, Default)]
pub(super) struct Alignment {
    /// Sum of products of each row with each predicted azimuth around it: row x azimuth.
    products: Vec<f32>,
    /// Likelihood of each row at each step around it, relative to the highest: row x step.
    likelihoods: Vec<f32>,
    /// Probability of each number, given the rows up to this one.
    forward: Vec<[f32; NUMBERS]>,
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
        self.compare(prediction, scan, rows, count);
        let likelihood = self.weigh(prediction, count);
        for step in 0..=2 * TURN * STEPS {
            let mut places = self.places_at(step, count);
            places.likelihood += likelihood;
            self.places.add(&places);
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

    fn compare(&mut self, prediction: &Prediction, scan: &Echoes, rows: usize, count: usize) {
        let width = azimuths(count);
        self.products.clear();
        self.products.resize(rows * width, 0.0);
        for echo in &scan.echoes {
            let row = echo.at as usize;
            let products = &mut self.products[row * width..][..width];
            for (k, product) in products.iter_mut().enumerate() {
                let predicted = prediction.row(azimuth(row, k));
                *product += echo.power * predicted[usize::from(echo.cell)];
            }
        }
        if self.noise == 0.0 {
            let measured: f32 = scan.echoes.iter().map(|echo| echo.power * echo.power).sum();
            let (gain, common) = self.gain(prediction, count);
            let noise = measured - gain * common;
            self.noise = noise.max(LEAST_NOISE * measured).max(1.0) / rows as f32;
        }
    }

    /// Returns by how much the rows are stronger than predicted, each where it agrees best, and the
    /// sum of its products there.
    fn gain(&self, prediction: &Prediction, count: usize) -> (f32, f32) {
        let (mut common, mut energy) = (0.0, f32::MIN_POSITIVE);
        for (row, products) in self.products.chunks_exact(azimuths(count)).enumerate() {
            let numbers = BESIDE + TURN..=BESIDE + TURN + count;
            let best = numbers.fold(BESIDE + TURN, |best, k| {
                match products[k] > products[best] {
                    true => k,
                    false => best,
                }
            });
            common += products[best];
            energy += prediction.energy(azimuth(row, best));
        }
        (common / energy, common)
    }

    /// Determines the likelihoods, and returns the sum of the logarithms of the highest. A row is
    /// the prediction times a gain, and noise: neighbouring cells differ together, so that a
    /// row counts as one measurement.
    fn weigh(&mut self, prediction: &Prediction, count: usize) -> f64 {
        let (gain, _) = self.gain(prediction, count);
        let scale = gain / self.noise;
        let mut highest = 0.0;
        self.likelihoods.clear();
        for (row, products) in self.products.chunks_exact_mut(azimuths(count)).enumerate() {
            for (k, product) in products.iter_mut().enumerate() {
                *product = scale * (*product - 0.5 * gain * prediction.energy(azimuth(row, k)));
            }
            let first = self.likelihoods.len();
            for around in products.windows(AMID.len()) {
                let amid = AMID
                    .iter()
                    .zip(around)
                    .map(|(weight, score)| weight * score);
                self.likelihoods.extend([around[BESIDE], amid.sum()]);
            }
            let likelihoods = &mut self.likelihoods[first..];
            let best = likelihoods
                .iter()
                .copied()
                .fold(f32::NEG_INFINITY, f32::max);
            highest += f64::from(best);
            for likelihood in likelihoods {
                *likelihood = OUTLIER + (*likelihood - best).exp();
            }
        }
        highest
    }

    /// Passes forward and backward along the rows, with the scan turned by a step.
    fn places_at(&mut self, step: usize, count: usize) -> Places {
        let mut places = Places::default();
        let rows = self.likelihoods.chunks_exact(steps(count));
        let likelihoods = rows.map(|row| {
            let mut numbers = [0.0; NUMBERS];
            let of_numbers = row[step..].iter().step_by(STEPS);
            for (number, likelihood) in numbers[..=count].iter_mut().zip(of_numbers) {
                *number = *likelihood;
            }
            numbers
        });
        self.forward.clear();
        let mut before = [0.0; NUMBERS];
        before[0] = 1.0;
        for likelihoods in likelihoods.clone() {
            let mut reached = 0.0;
            for number in 0..=count {
                reached += before[number];
                before[number] = reached * likelihoods[number];
            }
            places.likelihood += f64::from(normalise(&mut before[..=count]).ln());
            self.forward.push(before);
        }
        // What is lost behind the last row shows in none.
        let mut behind = [1.0; NUMBERS];
        for (row, (forward, likelihoods)) in self.forward.iter().zip(likelihoods).enumerate().rev()
        {
            let mut now: [f32; NUMBERS] = std::array::from_fn(|n| forward[n] * behind[n]);
            normalise(&mut now[..=count]);
            // A place lies behind this row as long as fewer azimuths were lost.
            let mut fewer = 0.0;
            for (place, probability) in now[..count].iter().enumerate() {
                fewer += f64::from(*probability);
                places.mean[place] += fewer;
                places.mean_square[place] += (2 * row + 1) as f64 * fewer;
            }
            let mut further = 0.0;
            for number in (0..=count).rev() {
                further += behind[number] * likelihoods[number];
                behind[number] = further;
            }
            normalise(&mut behind[..=count]);
        }
        places
    }
}

/// Azimuths with which a row is compared.
const fn azimuths(count: usize) -> usize {
    count + 2 + 2 * (TURN + BESIDE)
}

/// Steps with which a row is compared.
const fn steps(count: usize) -> usize {
    STEPS * (azimuths(count) + 1 - AMID.len())
}

/// The `k`-th azimuth with which a row is compared.
const fn azimuth(row: usize, k: usize) -> isize {
    (row + k) as isize - (TURN + BESIDE) as isize
}

/// Divides values by their sum, and returns it.
fn normalise(values: &mut [f32]) -> f32 {
    let sum = values.iter().sum::<f32>().max(f32::MIN_POSITIVE);
    for value in values {
        *value /= sum;
    }
    sum
}
