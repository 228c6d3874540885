//! The steps on images, compiled for each vector unit.

use gyre_simd::simd;
use rten_simd::{
    Isa, SimdOp,
    ops::{BitOps, NumOps},
};

use super::image::{Image, LANES};

/// Output channels that are computed at once.
pub const OUTPUTS: usize = 8;
const MOST: f32 = 255.0;
/// Numbers from -2^22 to 2^22 lose all digits behind the point, ties to even, when this is added.
const ROUND: f32 = (3 << 22) as f32;

#[derive(Debug)]
pub struct Kernel {
    /// Block of outputs x input x row and column x output.
    pub weights: Vec<[[f32; OUTPUTS]; 9]>,
    /// An addend of the sum of each output.
    pub offsets: Vec<f32>,
    /// Steps of a value in a step of its sum.
    pub factors: Vec<f32>,
    /// The value of 0.
    pub zero: f32,
}

/// Writes the values of a raster's powers over `divisor` in steps of `step`.
#[simd]
pub fn quantise(values: &mut [f32], divisor: f32, step: f32) {
    for value in values {
        *value = rounded(*value / divisor / step, 0.0);
    }
}

/// Returns the integer next to a number, plus `zero`, from 0 to [`MOST`].
#[inline(always)]
fn rounded(value: f32, zero: f32) -> f32 {
    let near = value.clamp(-MOST, 2.0 * MOST);
    ((near + ROUND - ROUND) + zero).clamp(0.0, MOST)
}

pub struct Convolution<'a> {
    pub kernel: &'a Kernel,
    pub from: &'a Image,
    pub to: &'a mut Image,
}

impl SimdOp for Convolution<'_> {
    type Output = ();

    #[inline(always)]
    fn eval<I: Isa>(self, isa: I) {
        let Self { kernel, from, to } = self;
        let lanes = isa.f32().len().min(LANES);
        let blocks = kernel.weights.chunks_exact(from.channels);
        for (first, weights) in (0..).step_by(OUTPUTS).zip(blocks) {
            for row in 0..to.rows {
                for column in (0..to.columns).step_by(lanes) {
                    let sums = sums(isa, weights, from, [row, column]);
                    let wide = lanes.min(to.columns - column);
                    for (output, sum) in (first..).zip(sums) {
                        let values = values(isa, kernel, output, sum);
                        to.row_mut(output, row)[column..][..wide].copy_from_slice(&values[..wide]);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn values<I: Isa>(isa: I, kernel: &Kernel, output: usize, sums: I::F32) -> [f32; LANES] {
    let ops = isa.f32();
    let sums = ops.add(sums, ops.splat(kernel.offsets[output]));
    let near = ops.mul(sums, ops.splat(kernel.factors[output]));
    let near = ops.clamp(near, ops.splat(-MOST), ops.splat(2.0 * MOST));
    let rounded = ops.sub(ops.add(near, ops.splat(ROUND)), ops.splat(ROUND));
    let rounded = ops.add(rounded, ops.splat(kernel.zero));
    let mut values = [0.0; LANES];
    ops.store(ops.clamp(rounded, ops.zero(), ops.splat(MOST)), &mut values);
    values
}

#[inline(always)]
fn sums<I: Isa>(
    isa: I,
    weights: &[[[f32; OUTPUTS]; 9]],
    from: &Image,
    [row, column]: [usize; 2],
) -> [I::F32; OUTPUTS] {
    let (ops, stride) = (isa.f32(), from.stride());
    let wide = ops.len() + 2;
    let mut sums = [ops.zero(); OUTPUTS];
    for (channel, weights) in weights.iter().enumerate() {
        let channel = from.channel(channel);
        for y in 0..3 {
            let line = &channel[(row + y) * stride + column..][..wide];
            for x in 0..3 {
                let values = ops.load(&line[x..]);
                for (sum, weight) in sums.iter_mut().zip(&weights[3 * y + x]) {
                    *sum = ops.mul_add(values, ops.splat(*weight), *sum);
                }
            }
        }
    }
    sums
}

/// Writes the highest of each 2 x 2 values.
#[simd]
pub fn pool(from: &Image, to: &mut Image) {
    for channel in 0..to.channels {
        for row in 0..to.rows {
            let [above, below] = [0, 1].map(|next| from.row(channel, 2 * row + next));
            let pairs = above
                .as_chunks::<2>()
                .0
                .iter()
                .zip(below.as_chunks::<2>().0);
            for (value, (above, below)) in to.row_mut(channel, row).iter_mut().zip(pairs) {
                *value = higher(higher(above[0], above[1]), higher(below[0], below[1]));
            }
        }
    }
}

#[inline(always)]
fn higher(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Enlarges an image twofold, linear between the centres of its values.
#[simd]
pub fn enlarge(from: &Image, to: &mut Image) {
    let columns = from.columns;
    let mut sums = vec![0.0; columns + 2];
    for channel in 0..to.channels {
        for row in 0..to.rows {
            let near = row / 2;
            let far = match row % 2 {
                0 => near.saturating_sub(1),
                _ => (near + 1).min(from.rows - 1),
            };
            let values = from.row(channel, near).iter().zip(from.row(channel, far));
            for (sum, (near, far)) in sums[1..].iter_mut().zip(values) {
                *sum = 3.0 * near + far;
            }
            (sums[0], sums[columns + 1]) = (sums[1], sums[columns]);
            let pairs = to.row_mut(channel, row).as_chunks_mut::<2>().0;
            for (pair, sums) in pairs.iter_mut().zip(sums.windows(3)) {
                let beside = [sums[0], sums[2]];
                *pair = beside.map(|beside| rounded((3.0 * sums[1] + beside) / 16.0, 0.0));
            }
        }
    }
}

/// Writes the channels of an image, multiplied, into another image, beginning at channel `first`.
#[simd]
pub fn copy(from: &Image, factor: f32, first: usize, to: &mut Image) {
    for channel in 0..from.channels {
        for row in 0..from.rows {
            let values = to.row_mut(first + channel, row).iter_mut();
            for (to, from) in values.zip(from.row(channel, row)) {
                *to = rounded(from * factor, 0.0);
            }
        }
    }
}
