//! The passes along the rows, forward and back, for each turn of the scan.

use gyre_simd::simd;

use super::{FEW, STEPS, Turns};

/// Probability of a gap before a row, whatever its width, where many azimuths were lost. So small
/// that a motion that differs a little from the predicted one is not taken for more gaps.
const GAP: f32 = 1e-12;
/// Rows after which probabilities are normalised if few azimuths were lost.
const SCALED: usize = 4;

/// Passes along the rows, and returns the logarithm of their likelihood for each turn. Writes the
/// probability of each number of lost azimuths before a row, given the rows up to it: row x number.
#[simd]
pub(super) fn pass_forward<const MOST_STEPS: usize, const NUMBERS: usize>(
    likelihoods: &[[f32; MOST_STEPS]],
    count: usize,
    forward: &mut Vec<Turns<f32>>,
) -> Turns<f64> {
    let count = known::<NUMBERS>(count);
    let mut likelihood = Turns::default();
    let mut product = [1.0; _];
    let mut before = [Turns::default(); NUMBERS];
    before[0] = [1.0; _];
    forward.resize(likelihoods.len() * (count + 1), Turns::default());
    let of_rows = forward.chunks_exact_mut(count + 1);
    for (row, (steps, forward)) in likelihoods.iter().zip(of_rows).enumerate() {
        let mut fewer = Turns::<f32>::default();
        for (number, before) in before[..=count].iter_mut().enumerate() {
            let of_turns = of_number(steps, number);
            for ((fewer, before), likelihood) in fewer.iter_mut().zip(before).zip(of_turns) {
                let reached = gap::<NUMBERS>() * *fewer + *before;
                *fewer += *before;
                *before = reached * likelihood;
            }
        }
        if NUMBERS > FEW || row % SCALED == 0 {
            let sums = normalise(&mut before[..=count]);
            for (product, sum) in product.iter_mut().zip(sums) {
                *product *= f64::from(sum);
            }
        }
        // Logarithms are slow, and a row's likelihood is at least an outlier's.
        if row % 64 == 63 {
            add_logarithms(&mut likelihood, &mut product);
        }
        forward.copy_from_slice(&before[..=count]);
    }
    for (turn, product) in product.iter_mut().enumerate() {
        let fewer: f32 = before[..count].iter().map(|before| before[turn]).sum();
        *product *= f64::from(gap::<NUMBERS>() * fewer + before[count][turn]);
    }
    add_logarithms(&mut likelihood, &mut product);
    likelihood
}

/// Passes back along the rows, and writes mean and mean square of each place for each turn.
#[simd]
pub(super) fn pass_backward<const MOST_STEPS: usize, const NUMBERS: usize>(
    likelihoods: &[[f32; MOST_STEPS]],
    forward: &[Turns<f32>],
    moments: &mut [[Turns<f64>; 2]],
) {
    let count = known::<NUMBERS>(moments.len());
    moments[..count].fill(Default::default());
    // A loss behind the last row shows in no row.
    let mut behind = [[gap::<NUMBERS>(); _]; NUMBERS];
    behind[count] = [1.0; _];
    let forward = forward.chunks_exact(count + 1);
    for (row, (forward, steps)) in forward.zip(likelihoods).enumerate().rev() {
        let mut now = [Turns::default(); NUMBERS];
        for ((now, forward), behind) in now.iter_mut().zip(forward).zip(&behind) {
            *now = std::array::from_fn(|turn| forward[turn] * behind[turn]);
        }
        normalise(&mut now[..=count]);
        // A place lies behind this row as long as fewer azimuths were lost.
        let mut fewer = Turns::<f64>::default();
        for (probability, [mean, square]) in now.iter().zip(&mut moments[..count]) {
            for turn in 0..fewer.len() {
                fewer[turn] += f64::from(probability[turn]);
                mean[turn] += fewer[turn];
                square[turn] += (2 * row + 1) as f64 * fewer[turn];
            }
        }
        let mut further = Turns::<f32>::default();
        for (number, behind) in behind[..=count].iter_mut().enumerate().rev() {
            let of_turns = of_number(steps, number);
            for ((further, behind), likelihood) in further.iter_mut().zip(behind).zip(of_turns) {
                let here = *behind * likelihood;
                *behind = gap::<NUMBERS>() * *further + here;
                *further += here;
            }
        }
        if NUMBERS > FEW || row % SCALED == 0 {
            normalise(&mut behind[..=count]);
        }
    }
}

/// Returns the count, which the compiler knows if it is small: all numbers are in registers then.
#[inline(always)]
const fn known<const NUMBERS: usize>(count: usize) -> usize {
    if NUMBERS < FEW { NUMBERS - 1 } else { count }
}

/// Returns the probability of a gap relative to none: where few azimuths were lost, no place is
/// likelier than another.
const fn gap<const NUMBERS: usize>() -> f32 {
    if NUMBERS > FEW { GAP } else { 1.0 }
}

/// Returns the likelihoods of a row if a number of azimuths was lost before it.
#[inline(always)]
fn of_number<const MOST_STEPS: usize>(steps: &[f32; MOST_STEPS], number: usize) -> &Turns<f32> {
    let chunk = steps[STEPS * number..].first_chunk();
    chunk.expect("there are steps for the turns of the largest number")
}

fn add_logarithms(sums: &mut Turns<f64>, products: &mut Turns<f64>) {
    for (sum, product) in sums.iter_mut().zip(products) {
        *sum += product.ln();
        *product = 1.0;
    }
}

#[inline(always)]
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
