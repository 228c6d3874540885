//! Stretches of a log between steps, and which of them belong together.

use std::{iter, ops::Range};

/// Returns the stretches of `count` rows between these starts of new ones.
pub(crate) fn between(count: usize, starts: impl Iterator<Item = usize>) -> Vec<Range<usize>> {
    let ends = (count > 0).then_some(count);
    let bounds: Vec<usize> = iter::once(0).chain(starts).chain(ends).collect();
    bounds.windows(2).map(|pair| pair[0]..pair[1]).collect()
}

/// Returns the chain of stretches with the most rows; each stretch follows the one before. No two
/// neighbours of it are more than `look_back` stretches apart.
pub(crate) fn longest_chain(
    stretches: &[Range<usize>],
    look_back: usize,
    follows: impl Fn(usize, usize) -> bool,
) -> Vec<Range<usize>> {
    // The rows of the best chain that ends with a stretch, and the stretch before that.
    let mut best: Vec<(usize, Option<usize>)> = Vec::new();
    for (k, stretch) in stretches.iter().enumerate() {
        let before = (k.saturating_sub(look_back)..k)
            .filter(|earlier| follows(*earlier, k))
            .max_by_key(|earlier| best[*earlier].0);
        best.push((stretch.len() + before.map_or(0, |k| best[k].0), before));
    }
    let mut at = (0..best.len()).max_by_key(|k| best[*k].0);
    let mut chain = Vec::new();
    while let Some(k) = at {
        chain.push(stretches[k].clone());
        at = best[k].1;
    }
    chain.reverse();
    chain
}
