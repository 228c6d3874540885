//! A network of 8-bit integers, computed without a library: convolutions of 3 x 3, maxima of 2 x 2,
//! images enlarged twofold, and joined.
//!
//! Each value is an integer from 0 to 255 and each weight one from -128 to 127, and every sum is
//! below 2^24. So 32-bit floating-point numbers hold all of them exactly: no sum is rounded, and
//! each vector unit gives the same bits, whether it adds products in one step or in two.

mod graph;
mod image;
mod kernels;
#[cfg(test)]
mod tests;

use ndarray::{ArrayView3, ArrayViewMut3};
use rten_onnx::onnx::GraphProto;
use rten_simd::SimdOp;

use image::Image;
use kernels::{Convolution, Kernel};

/// A network. One thread computes it.
#[derive(Debug)]
pub(super) struct Integers {
    images: Vec<Image>,
    steps: Vec<Step>,
    output: Output,
}

#[derive(Debug)]
enum Step {
    /// The raster in steps of `step`.
    Quantise {
        to: usize,
        divisor: f32,
        step: f32,
    },
    /// Each value from a place in another image.
    Gather {
        from: usize,
        to: usize,
        places: Vec<u32>,
    },
    Convolve {
        from: usize,
        to: usize,
        kernel: Kernel,
    },
    Pool {
        from: usize,
        to: usize,
    },
    Enlarge {
        from: usize,
        to: usize,
    },
    /// The channels of both, each multiplied by a factor.
    Join {
        from: [usize; 2],
        factors: [f32; 2],
        to: usize,
    },
}

#[derive(Debug)]
struct Output {
    from: usize,
    places: Vec<u32>,
    factors: Box<[f32; 256]>,
}

impl Integers {
    /// Reads a network that has only these steps, for one raster; `None` for any other network.
    pub fn read(graph: &GraphProto) -> Option<Self> {
        graph::read(graph)
    }

    /// Computes the mask of a raster, both 1 x n x n.
    pub fn run(&mut self, rasters: ArrayView3<'_, f32>, mut masks: ArrayViewMut3<'_, f32>) {
        for step in &self.steps {
            step.take(&rasters, &mut self.images);
        }
        let values = self.images[self.output.from].values();
        for (mask, place) in masks.iter_mut().zip(&self.output.places) {
            *mask = self.output.factors[values[*place as usize] as u8 as usize];
        }
    }
}

impl Step {
    fn take(&self, rasters: &ArrayView3<'_, f32>, images: &mut [Image]) {
        match self {
            Self::Quantise { to, divisor, step } => {
                quantise(rasters, *divisor, *step, &mut images[*to]);
            }
            Self::Gather { from, to, places } => {
                let (from, to) = two(images, *from, *to);
                gather(from, places, to);
            }
            Self::Convolve { from, to, kernel } => {
                let (from, to) = two(images, *from, *to);
                Convolution { kernel, from, to }.dispatch();
            }
            Self::Pool { from, to } => {
                let (from, to) = two(images, *from, *to);
                kernels::pool(from, to);
            }
            Self::Enlarge { from, to } => {
                let (from, to) = two(images, *from, *to);
                kernels::enlarge(from, to);
            }
            Self::Join { from, factors, to } => {
                let mut first = 0;
                for (from, factor) in from.iter().zip(factors) {
                    let (from, to) = two(images, *from, *to);
                    kernels::copy(from, *factor, first, to);
                    first += from.channels;
                }
            }
        }
    }
}

fn quantise(rasters: &ArrayView3<'_, f32>, divisor: f32, step: f32, to: &mut Image) {
    for (row, powers) in rasters.rows().into_iter().enumerate() {
        let values = to.row_mut(0, row);
        values
            .iter_mut()
            .zip(powers)
            .for_each(|(value, power)| *value = *power);
        kernels::quantise(values, divisor, step);
    }
}

fn gather(from: &Image, places: &[u32], to: &mut Image) {
    let mut places = places.iter();
    for channel in 0..to.channels {
        for row in 0..to.rows {
            for (value, place) in to.row_mut(channel, row).iter_mut().zip(&mut places) {
                *value = from.values()[*place as usize];
            }
        }
    }
}

fn two(images: &mut [Image], from: usize, to: usize) -> (&Image, &mut Image) {
    // Each step writes an image that did not exist before it.
    let (before, rest) = images.split_at_mut(to);
    (&before[from], &mut rest[0])
}
