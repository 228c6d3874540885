//! The passes along the rows, forward and back, for each turn of the scan.

use gyre_simd::simd;

use super::{MOST_STEPS, NUMBERS, Places, STEPS, Turns};

/// Passes along the rows, and returns the logarithm of their likelihood for each turn. Writes the
/// probability of each number of lost azimuths before a row, given the rows up to it: row x number.
#[simd]
pub(super) fn pass_forward(
    likelihoods: &[[f32; MOST_STEPS]],
    count: usize,
    forward: &mut Vec<Turns<f32>>,
) -> Turns<f64> {
    // A count that the compiler knows keeps all numbers in registers.
    match count {
        1 => forward_of(likelihoods, 1, forward),
        2 => forward_of(likelihoods, 2, forward),
        3 => forward_of(likelihoods, 3, forward),
        _ => forward_of(likelihoods, count, forward),
    }
}

#[inline(always)]
fn forward_of(
    likelihoods: &[[f32; MOST_STEPS]],
    count: usize,
    forward: &mut Vec<Turns<f32>>,
) -> Turns<f64> {
    let mut likelihood = Turns::default();
    let mut product = [1.0; _];
    let mut before = [Turns::default(); NUMBERS];
    before[0] = [1.0; _];
    forward.resize(likelihoods.len() * (count + 1), Turns::default());
    let of_rows = forward.chunks_exact_mut(count + 1);
    for (row, (steps, forward)) in likelihoods.iter().zip(of_rows).enumerate() {
        let mut reached = Turns::<f32>::default();
        for (number, before) in before[..=count].iter_mut().enumerate() {
            let of_turns = of_number(steps, number);
            for ((reached, before), likelihood) in reached.iter_mut().zip(before).zip(of_turns) {
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
        forward.copy_from_slice(&before[..=count]);
    }
    add_logarithms(&mut likelihood, &mut product);
    likelihood
}

/// Passes back along the rows, and returns the places for each turn.
#[simd]
pub(super) fn pass_backward(
    likelihoods: &[[f32; MOST_STEPS]],
    forward: &[Turns<f32>],
    count: usize,
) -> Turns<Places> {
    match count {
        1 => backward_of(likelihoods, forward, 1),
        2 => backward_of(likelihoods, forward, 2),
        3 => backward_of(likelihoods, forward, 3),
        _ => backward_of(likelihoods, forward, count),
    }
}

#[inline(always)]
fn backward_of(
    likelihoods: &[[f32; MOST_STEPS]],
    forward: &[Turns<f32>],
    count: usize,
) -> Turns<Places> {
    let mut places = Turns::<Places>::default();
    let (mut means, mut squares) = (
        [Turns::<f64>::default(); NUMBERS],
        [Turns::<f64>::default(); NUMBERS],
    );
    // What is lost behind the last row shows in none.
    let mut behind = [[1.0; _]; NUMBERS];
    let forward = forward.chunks_exact(count + 1);
    for (row, (forward, steps)) in forward.zip(likelihoods).enumerate().rev() {
        let mut now = [Turns::default(); NUMBERS];
        for ((now, forward), behind) in now.iter_mut().zip(forward).zip(&behind) {
            *now = std::array::from_fn(|turn| forward[turn] * behind[turn]);
        }
        normalise(&mut now[..=count]);
        // A place lies behind this row as long as fewer azimuths were lost.
        let mut fewer = Turns::<f64>::default();
        for (place, probability) in now[..count].iter().enumerate() {
            let (mean, square) = (&mut means[place], &mut squares[place]);
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
                *further += *behind * likelihood;
                *behind = *further;
            }
        }
        normalise(&mut behind[..=count]);
    }
    for (turn, places) in places.iter_mut().enumerate() {
        for place in 0..count {
            places.mean[place] = means[place][turn];
            places.mean_square[place] = squares[place][turn];
        }
    }
    places
}

/// Returns the likelihoods of a row if a number of azimuths was lost before it.
#[inline(always)]
fn of_number(steps: &[f32; MOST_STEPS], number: usize) -> &Turns<f32> {
    let chunk = steps[STEPS * number..].first_chunk();
    chunk.expect("there are steps for the turns of the largest number")
}

/// Adds the logarithms of products, and begins them anew.
fn add_logarithms(sums: &mut Turns<f64>, products: &mut Turns<f64>) {
    for (sum, product) in sums.iter_mut().zip(products) {
        *sum += product.ln();
        *product = 1.0;
    }
}

/// Divides the values of each turn by their sum, and returns the sums.
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
