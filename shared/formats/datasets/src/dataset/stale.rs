//! Stale rows: the last rows of an image, if they still contain rows of the image before. A host
//! that loses azimuths of a turn fills so many rows less.

/// Least correlation of a stale row with the same row of the image before. It is 0.93 to 0.97 for
/// stale rows that were compressed again, and mostly below 0.75 for measured rows.
const STALE: f64 = 0.85;
/// Share of the bins, the nearest, that are left out: the echoes of the vehicle itself are the same
/// in each turn.
const NEAR: f64 = 0.05;

#[derive(Debug, Default)]
pub(crate) struct StaleRows {
    of: Option<usize>,
    /// The rows of that image; empty if it cannot be read.
    rows: Vec<u8>,
    is_compressed: bool,
}

impl StaleRows {
    /// Expects stale rows that differ a little, because the images had a lossy compression.
    /// Otherwise stale rows are bitwise equal, so that measured rows of a standing radar do not
    /// count as stale.
    pub fn of_compressed(self) -> Self {
        Self {
            is_compressed: true,
            ..self
        }
    }

    pub fn has(&self, index: usize) -> bool {
        self.of == Some(index)
    }

    pub fn remember(&mut self, index: usize, image: &[u8]) {
        self.of = Some(index);
        self.rows.clear();
        self.rows.extend_from_slice(image);
    }

    /// Returns the number of stale rows at the end of an image of the same shape; 0 if all are, as
    /// where an image was written twice.
    pub fn count(&self, image: &[u8], bins: usize) -> usize {
        let near = (bins as f64 * NEAR) as usize;
        let rows = image.chunks_exact(bins).rev();
        let before = self.rows.chunks_exact(bins).rev();
        let is_stale = |(row, before): &(&[u8], &[u8])| {
            (self.is_compressed || row == before)
                && correlation(&row[near..], &before[near..]) > STALE
        };
        let stale = rows.zip(before).take_while(is_stale).count();
        if stale * bins < image.len() { stale } else { 0 }
    }
}

/// Pearson's correlation; 0 where a row is uniform.
fn correlation(a: &[u8], b: &[u8]) -> f64 {
    let mean = |row: &[u8]| row.iter().map(|p| f64::from(*p)).sum::<f64>() / row.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let mut sums = [0.0; 3];
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (f64::from(*a) - mean_a, f64::from(*b) - mean_b);
        for (sum, product) in sums.iter_mut().zip([a * b, a * a, b * b]) {
            *sum += product;
        }
    }
    let [both, of_a, of_b] = sums;
    match of_a * of_b > 0.0 {
        true => both / (of_a * of_b).sqrt(),
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BINS: usize = 200;

    fn image(seed: u64) -> Vec<u8> {
        let noise = |i: u64| (i + seed * 7919).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
        (0..20 * BINS as u64)
            .map(|i| (noise(i) % 200) as u8)
            .collect()
    }

    #[test]
    fn rows_at_the_end_that_are_those_of_the_image_before_as_compressed_anew_are_stale() {
        let (before, lost) = (image(1), 3);
        let mut now = image(2);
        for (power, stale) in now.iter_mut().zip(&before).skip((20 - lost) * BINS) {
            *power = stale.saturating_add(stale % 7);
        }
        for (mut rows, expected) in [
            (StaleRows::default().of_compressed(), lost),
            (StaleRows::default(), 0),
        ] {
            rows.remember(4, &before);
            assert_eq!(rows.count(&now, BINS), expected);
        }
        let mut rows = StaleRows::default();
        rows.remember(0, &before);
        assert_eq!(rows.count(&before, BINS), 0, "written twice");
    }

    #[test]
    fn uniform_rows_are_not_stale() {
        let dark = vec![0; 20 * BINS];
        let mut rows = StaleRows::default();
        rows.remember(0, &dark);
        assert_eq!(rows.count(&dark, BINS), 0);
    }
}
