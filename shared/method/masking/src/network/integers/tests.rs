use std::{fs, path::Path};

use rten_onnx::onnx::ModelProto;
use rten_simd::{SimdOp, isa::GenericIsa};

use super::{
    Integers,
    image::Image,
    kernels::{self, Convolution, Kernel, OUTPUTS},
};

/// Integers from 0 to below a bound, without any pattern.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self, bound: u64) -> i64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        ((self.0 >> 33) % bound) as i64
    }

    fn image(&mut self, shape: [usize; 3]) -> Image {
        let mut image = Image::new(shape);
        for channel in 0..shape[0] {
            for row in 0..shape[1] {
                let values = image.row_mut(channel, row).iter_mut();
                values.for_each(|value| *value = self.next(256) as f32);
            }
        }
        image
    }
}

/// A value of an image; zero beside it.
fn at(image: &Image, channel: usize, row: i64, column: i64) -> i64 {
    let inside = |at: i64, size: usize| usize::try_from(at).ok().filter(|at| *at < size);
    match (inside(row, image.rows), inside(column, image.columns)) {
        (Some(row), Some(column)) => image.row(channel, row)[column] as i64,
        _ => 0,
    }
}

/// All rows and columns.
fn places(rows: i64, columns: i64) -> impl Iterator<Item = (i64, i64)> {
    (0..rows).flat_map(move |row| (0..columns).map(move |column| (row, column)))
}

#[test]
fn a_convolution_is_the_direct_sum() {
    let mut numbers = Numbers(1);
    for [inputs, outputs, rows, columns] in [[3, 8, 5, 8], [16, 16, 4, 21], [2, 24, 9, 64]] {
        let from = numbers.image([inputs, rows, columns]);
        let weights = Vec::from_iter((0..outputs * inputs * 9).map(|_| numbers.next(256) - 128));
        let offsets = Vec::from_iter((0..outputs).map(|_| numbers.next(20_000) - 10_000));
        let mut kernel = Kernel {
            weights: vec![[[0.0; OUTPUTS]; 9]; outputs / OUTPUTS * inputs],
            offsets: offsets.iter().map(|offset| *offset as f32).collect(),
            factors: vec![1.0 / 1024.0; outputs],
            zero: 100.0,
        };
        for (place, weight) in weights.iter().enumerate() {
            let (output, input, tap) = (place / 9 / inputs, place / 9 % inputs, place % 9);
            let block = &mut kernel.weights[output / OUTPUTS * inputs + input];
            block[tap][output % OUTPUTS] = *weight as f32;
        }
        let expected = |output: usize, row: i64, column: i64| {
            let mut sum = offsets[output];
            for input in 0..inputs {
                for tap in 0..9 {
                    let value = at(&from, input, row + tap / 3 - 1, column + tap % 3 - 1);
                    sum += value * weights[(output * inputs + input) * 9 + tap as usize];
                }
            }
            ((sum as f64 / 1024.0).round_ties_even() as i64 + 100).clamp(0, 255)
        };
        // The widest vector unit of this processor, and the narrowest that there is.
        for is_widest in [true, false] {
            let mut to = Image::new([outputs, rows, columns]);
            let convolution = Convolution {
                kernel: &kernel,
                from: &from,
                to: &mut to,
            };
            match is_widest {
                true => convolution.dispatch(),
                false => convolution.eval(GenericIsa::new()),
            }
            for output in 0..outputs {
                for (row, column) in places(rows as i64, columns as i64) {
                    let expected = expected(output, row, column);
                    let value = at(&to, output, row, column);
                    assert_eq!(value, expected, "{output} {row} {column}");
                }
            }
        }
    }
}

#[test]
fn images_are_enlarged_between_the_centres_and_pooled_to_the_highest() {
    let from = Numbers(2).image([3, 6, 10]);
    let mut large = Image::new([3, 12, 20]);
    kernels::enlarge(&from, &mut large);
    let mut small = Image::new([3, 3, 5]);
    kernels::pool(&from, &mut small);
    // The two values beside a centre, each with its weight in quarters.
    let beside = |place: i64, size: i64| {
        let near = place / 2;
        let far = if place % 2 == 0 { near - 1 } else { near + 1 };
        [(near, 3), (far.clamp(0, size - 1), 1)]
    };
    for channel in 0..3 {
        for (row, column) in places(12, 20) {
            let of_rows = beside(row, 6).into_iter();
            let weighed = of_rows.flat_map(|(y, down)| {
                let from = &from;
                let of_columns = beside(column, 10).into_iter();
                of_columns.map(move |(x, across)| down * across * at(from, channel, y, x))
            });
            let expected = (weighed.sum::<i64>() as f64 / 16.0).round_ties_even() as i64;
            assert_eq!(at(&large, channel, row, column), expected, "{row} {column}");
        }
        for (row, column) in places(3, 5) {
            let of_block = (0..4).map(|i| at(&from, channel, 2 * row + i / 2, 2 * column + i % 2));
            assert_eq!(at(&small, channel, row, column), of_block.max().unwrap());
        }
    }
}

fn model(name: &str) -> ModelProto {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../models");
    ModelProto::parse_buf(&fs::read(folder.join(name)).unwrap()).unwrap()
}

#[test]
fn networks_of_one_scan_in_8_bits_are_read_and_others_are_not() {
    for (name, is_read) in [
        ("gyre-255.onnx", true),
        ("light-255.onnx", true),
        ("mbym-255.onnx", false),
        ("f-mbym-255.onnx", false),
    ] {
        let graph = model(name).graph.unwrap();
        assert_eq!(Integers::read(&graph).is_some(), is_read, "{name}");
    }
}

#[test]
fn a_network_that_has_something_else_is_not_read() {
    for (node, other) in [
        ("Sigmoid", "Tanh"),
        ("Conv", "ConvTranspose"),
        ("MaxPool", "AveragePool"),
    ] {
        let mut graph = model("gyre-255.onnx").graph.unwrap();
        let mut nodes = graph.node.iter_mut();
        let changed = nodes
            .find(|it| it.op_type.as_deref() == Some(node))
            .unwrap();
        changed.op_type = Some(other.to_owned());
        assert!(Integers::read(&graph).is_none(), "{other}");
    }
}

#[test]
fn a_network_with_another_number_of_channels_is_not_read() {
    let mut graph = model("gyre-255.onnx").graph.unwrap();
    let weights = graph.initializer.iter_mut();
    let mut weights = weights.filter(|it| matches!(it.dims[..], [_, _, 3, 3]));
    let dims = &mut weights.next().unwrap().dims;
    let values = dims[0] * dims[1];
    (dims[0], dims[1]) = (1, values);
    assert!(Integers::read(&graph).is_none());
}
