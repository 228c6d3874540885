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
/// The most azimuths with which a row is compared, a multiple of what a processor takes at once.
const WIDTH: usize = azimuths(MAX_LOST).next_multiple_of(8);
/// Turns of the scan, a value for each: those of [`TURN`], and some that fill a multiple of what a
/// processor takes at once.
type Turns<T> = [T; TURNS.next_multiple_of(8)];
const TURNS: usize = 2 * TURN * STEPS + 1;
/// Steps with which a row is compared at most, as many as the turns of the largest number reach.
const MOST_STEPS: usize = STEPS * MAX_LOST + TURNS.next_multiple_of(8);

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
        self.compare(prediction, scan, rows, count);
        let likelihood = self.weigh(prediction, count);
        let turns = self.pass_forward(count);
        let all = self.pass_backward(count);
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

    fn compare(&mut self, prediction: &Prediction, scan: &Echoes, rows: usize, count: usize) {
        let width = azimuths(count).next_multiple_of(8);
        self.products.clear();
        self.products.resize(rows, [0.0; WIDTH]);
        for echo in &scan.echoes {
            let row = echo.at as usize;
            let predicted = prediction.from(usize::from(echo.cell), azimuth(row, 0));
            let products = self.products[row][..width].as_chunks_mut::<8>().0;
            for (products, predicted) in products.iter_mut().zip(predicted.as_chunks::<8>().0) {
                for (product, predicted) in products.iter_mut().zip(predicted) {
                    *product += echo.power * predicted;
                }
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
        for (row, products) in self.products.iter().enumerate() {
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
        for (row, products) in self.products.iter_mut().enumerate() {
            let products = &mut products[..azimuths(count)];
            for (k, product) in products.iter_mut().enumerate() {
                *product = scale * (*product - 0.5 * gain * prediction.energy(azimuth(row, k)));
            }
            let mut steps = [f32::NEG_INFINITY; MOST_STEPS];
            for (around, pair) in products
                .windows(AMID.len())
                .zip(steps.chunks_exact_mut(STEPS))
            {
                let amid = AMID
                    .iter()
                    .zip(around)
                    .map(|(weight, score)| weight * score);
                pair.copy_from_slice(&[around[BESIDE], amid.sum()]);
            }
            let best = steps.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            highest += f64::from(best);
            self.likelihoods.push(steps.map(|step| match step - best {
                // Beside that nothing is left of it.
                ..-20.0 => OUTLIER,
                relative => OUTLIER + relative.exp(),
            }));
        }
        highest
    }

    /// Passes along the rows, and returns the logarithm of their likelihood for each turn.
    fn pass_forward(&mut self, count: usize) -> Turns<f64> {
        self.forward.clear();
        let mut likelihood = Turns::default();
        let mut product = [1.0; _];
        let mut before = [Turns::default(); NUMBERS];
        before[0] = [1.0; _];
        for (row, steps) in self.likelihoods.iter().enumerate() {
            let mut reached = Turns::<f32>::default();
            for (number, before) in before[..=count].iter_mut().enumerate() {
                let of_turns = likelihoods(steps, number);
                for ((reached, before), likelihood) in reached.iter_mut().zip(before).zip(of_turns)
                {
                    *reached += *before;
                    *before = *reached * likelihood;
                }
            }
            let sums = normalise(&mut before[..=count]);
            for (product, sum) in product.iter_mut().zip(sums) {
                *product *= f64::from(sum);
            }
            // Logarithms are slow, and a row's likelihood is at least that of an outlier.
            if row % 64 == 63 {
                add_logarithms(&mut likelihood, &mut product);
            }
            self.forward.extend_from_slice(&before[..=count]);
        }
        add_logarithms(&mut likelihood, &mut product);
        likelihood
    }

    /// Passes back along the rows, and returns the places for each turn.
    fn pass_backward(&self, count: usize) -> Turns<Places> {
        let mut places = Turns::<Places>::default();
        // What is lost behind the last row shows in none.
        let mut behind = [[1.0; _]; NUMBERS];
        let forward = self.forward.chunks_exact(count + 1);
        for (row, (forward, steps)) in forward.zip(&self.likelihoods).enumerate().rev() {
            let mut now = [Turns::default(); NUMBERS];
            for ((now, forward), behind) in now.iter_mut().zip(forward).zip(&behind) {
                *now = std::array::from_fn(|turn| forward[turn] * behind[turn]);
            }
            normalise(&mut now[..=count]);
            // A place lies behind this row as long as fewer azimuths were lost.
            let mut fewer = Turns::<f64>::default();
            for (place, probability) in now[..count].iter().enumerate() {
                for ((fewer, probability), places) in
                    fewer.iter_mut().zip(probability).zip(&mut places)
                {
                    *fewer += f64::from(*probability);
                    places.mean[place] += *fewer;
                    places.mean_square[place] += (2 * row + 1) as f64 * *fewer;
                }
            }
            let mut further = Turns::<f32>::default();
            for (number, behind) in behind[..=count].iter_mut().enumerate().rev() {
                let of_turns = likelihoods(steps, number);
                for ((further, behind), likelihood) in further.iter_mut().zip(behind).zip(of_turns)
                {
                    *further += *behind * likelihood;
                    *behind = *further;
                }
            }
            normalise(&mut behind[..=count]);
        }
        places
    }
}

/// Returns the likelihoods of a row if a number of azimuths was lost before it.
fn likelihoods(steps: &[f32; MOST_STEPS], number: usize) -> &[f32] {
    &steps[STEPS * number..][..TURNS.next_multiple_of(8)]
}

/// Adds the logarithms of products, and begins them anew.
fn add_logarithms(sums: &mut Turns<f64>, products: &mut Turns<f64>) {
    for (sum, product) in sums.iter_mut().zip(products) {
        *sum += product.ln();
        *product = 1.0;
    }
}

/// Azimuths with which a row is compared.
const fn azimuths(count: usize) -> usize {
    count + 2 + 2 * (TURN + BESIDE)
}

/// The `k`-th azimuth with which a row is compared.
const fn azimuth(row: usize, k: usize) -> isize {
    (row + k) as isize - (TURN + BESIDE) as isize
}

/// Divides the values of each turn by their sum, and returns the sums.
fn normalise(numbers: &mut [Turns<f32>]) -> Turns<f32> {
    let mut sums = [f32::MIN_POSITIVE; _];
    for turns in &*numbers {
        for (sum, value) in sums.iter_mut().zip(turns) {
            *sum += value;
        }
    }
    let shares = sums.map(f32::recip);
    for turns in numbers {
        for (value, share) in turns.iter_mut().zip(shares) {
            *value *= share;
        }
    }
    sums
}
