//! The steps of a network in ONNX whose layers are quantised: each operator stands between
//! `DequantizeLinear` and `QuantizeLinear`. `None` always means that the network has an unsupported
//! part, which another library computes.

mod layout;

use std::collections::HashMap;

use rten_onnx::onnx::{GraphProto, NodeProto};

use super::{
    Integers, Output, Step,
    image::Image,
    kernels::{Kernel, OUTPUTS},
};
use crate::network::tensors::{self, Attributes, Constants, Weights};
use layout::Layout;

/// Integers in 32-bit floating-point numbers are exact below this.
const EXACT: f32 = (1 << 24) as f32;

#[derive(Clone)]
enum Value {
    Raster {
        divisor: f32,
        shape: Vec<usize>,
    },
    /// Integers of an image.
    Integers(Layout),
    /// Integers of an image, times their scale.
    Of(Layout),
    Weights(Weights),
    Convolved(Layout, Weights, Weights),
    Pooled(Layout),
    Enlarged(Layout),
    Joined([Layout; 2]),
    /// The logistic function of integers.
    Squashed(Layout),
    /// The factors: their integers have been computed.
    Factors,
}

#[derive(Clone, Copy, PartialEq)]
struct Quantisation {
    scale: f32,
    zero: f32,
}

pub fn read(graph: &GraphProto) -> Option<Integers> {
    let mut reader = Reader::new(graph)?;
    for node in &graph.node {
        reader.read(node)?;
    }
    let [output] = &graph.output[..] else {
        return None;
    };
    let mut sizes = tensors::shape_of(output)?.into_iter();
    let cells = sizes.try_fold(1_usize, usize::checked_mul)?;
    let computed = reader.output.filter(|it| it.places.len() == cells)?;
    match reader.values.get(output.name.as_deref()?)? {
        Value::Factors => Some(Integers {
            images: reader.images,
            steps: reader.steps,
            output: computed,
        }),
        _ => None,
    }
}

struct Reader<'a> {
    constants: Constants<'a>,
    values: HashMap<&'a str, Value>,
    images: Vec<Image>,
    steps: Vec<Step>,
    output: Option<Output>,
}

impl<'a> Reader<'a> {
    fn new(graph: &'a GraphProto) -> Option<Self> {
        let [input] = &graph.input[..] else {
            return None;
        };
        let raster = Value::Raster {
            divisor: 1.0,
            shape: tensors::shape_of(input)?,
        };
        Some(Self {
            constants: Constants::of(graph),
            values: HashMap::from([(input.name.as_deref()?, raster)]),
            images: Vec::new(),
            steps: Vec::new(),
            output: None,
        })
    }

    fn read(&mut self, node: &'a NodeProto) -> Option<()> {
        let [output] = &node.output[..] else {
            return None;
        };
        let value = match node.op_type.as_deref()? {
            "QuantizeLinear" => self.quantised(node)?,
            _ => self.float(node)?,
        };
        self.values.insert(output, value);
        Some(())
    }

    fn float(&mut self, node: &NodeProto) -> Option<Value> {
        let attributes = Attributes(&node.attribute);
        Some(match node.op_type.as_deref()? {
            "DequantizeLinear" => self.dequantised(node)?,
            "Div" => match self.input(node, 0)? {
                Value::Raster { divisor, shape } => Value::Raster {
                    divisor: divisor * self.constants.number(node.input.get(1)?)?,
                    shape,
                },
                _ => return None,
            },
            "Conv" if attributes.are_of_plain_convolution() => {
                match (self.input(node, 1)?, self.input(node, 2)?) {
                    (Value::Weights(weights), Value::Weights(bias)) => {
                        Value::Convolved(self.layout(node, 0)?, weights, bias)
                    }
                    _ => return None,
                }
            }
            "MaxPool" if attributes.are_of_plain_pool() => Value::Pooled(self.layout(node, 0)?),
            "Resize" if attributes.are_of_linear_resize() => {
                let layout = self.layout(node, 0)?;
                let [_, channels, rows, columns] = layout.shape[..].try_into().ok()?;
                let sizes = self.constants.sizes(node.input.get(3)?)?;
                (sizes == [1, channels, 2 * rows, 2 * columns])
                    .then_some(Value::Enlarged(layout))?
            }
            "Concat" if attributes.integer("axis") == Some(1) && node.input.len() == 2 => {
                Value::Joined([self.layout(node, 0)?, self.layout(node, 1)?])
            }
            "Sigmoid" => Value::Squashed(self.layout(node, 0)?),
            _ => {
                let layout = self.layout(node, 0)?;
                let places = &self.images[layout.image];
                Value::Of(layout.moved(node, &self.constants, places)?)
            }
        })
    }

    fn input(&self, node: &NodeProto, index: usize) -> Option<Value> {
        self.values.get(node.input.get(index)?.as_str()).cloned()
    }

    fn layout(&self, node: &NodeProto, index: usize) -> Option<Layout> {
        match self.input(node, index)? {
            Value::Of(layout) => Some(layout),
            _ => None,
        }
    }

    fn quantisation(&self, node: &NodeProto) -> Option<Quantisation> {
        Some(Quantisation {
            scale: self.constants.number(node.input.get(1)?)?,
            zero: self.constants.number(node.input.get(2)?)?,
        })
    }

    fn dequantised(&self, node: &NodeProto) -> Option<Value> {
        let input = node.input.first()?.as_str();
        let Some(value) = self.values.get(input) else {
            return Some(Value::Weights(self.constants.weights(node)?));
        };
        match value {
            Value::Integers(layout) if layout.quantisation == self.quantisation(node)? => {
                Some(Value::Of(layout.clone()))
            }
            Value::Factors => Some(Value::Factors),
            _ => None,
        }
    }

    fn quantised(&mut self, node: &NodeProto) -> Option<Value> {
        let to = self.quantisation(node)?;
        let layout = match self.input(node, 0)? {
            Value::Of(layout) if layout.quantisation == to => layout,
            Value::Raster { divisor, shape } if to.zero == 0.0 => {
                let [_, 1, rows, columns] = shape[..] else {
                    return None;
                };
                let (image, layout) = self.image([1, 1, rows, columns], to)?;
                self.steps.push(Step::Quantise {
                    to: image,
                    divisor,
                    step: to.scale,
                });
                layout
            }
            Value::Convolved(layout, weights, bias) => {
                let kernel = kernel(&layout, &weights, &bias, to)?;
                let shape = |[_, rows, columns]: [usize; 3]| [kernel.offsets.len(), rows, columns];
                let (from, image, layout) = self.made_from(&layout, to, shape)?;
                self.steps.push(Step::Convolve {
                    from,
                    to: image,
                    kernel,
                });
                layout
            }
            Value::Pooled(layout) if layout.quantisation == to => {
                let shape =
                    |[channels, rows, columns]: [usize; 3]| [channels, rows / 2, columns / 2];
                let (from, image, layout) = self.made_from(&layout, to, shape)?;
                self.steps.push(Step::Pool { from, to: image });
                layout
            }
            Value::Enlarged(layout) if layout.quantisation == to && to.zero == 0.0 => {
                let shape =
                    |[channels, rows, columns]: [usize; 3]| [channels, 2 * rows, 2 * columns];
                let (from, image, layout) = self.made_from(&layout, to, shape)?;
                self.steps.push(Step::Enlarge { from, to: image });
                layout
            }
            Value::Joined(layouts) => self.joined(&layouts, to)?,
            Value::Squashed(layout) => {
                self.output = Some(self.factors(&layout, to));
                return Some(Value::Factors);
            }
            _ => return None,
        };
        Some(Value::Integers(layout))
    }

    /// Adds an image that is made from an existing one. Returns the numbers of both and the values.
    fn made_from(
        &mut self,
        from: &Layout,
        to: Quantisation,
        shape: impl Fn([usize; 3]) -> [usize; 3],
    ) -> Option<(usize, usize, Layout)> {
        let whole = self.whole(from)?;
        let [_, channels, rows, columns] = from.shape[..].try_into().ok()?;
        let [channels, rows, columns] = shape([channels, rows, columns]);
        let (image, layout) = self.image([1, channels, rows, columns], to)?;
        Some((whole, image, layout))
    }

    fn joined(&mut self, layouts: &[Layout; 2], quantisation: Quantisation) -> Option<Layout> {
        let [first, second] = layouts;
        let [_, channels, rows, columns] = first.shape[..].try_into().ok()?;
        let [_, others, other_rows, other_columns] = second.shape[..].try_into().ok()?;
        let zeros = [first, second].map(|layout| layout.quantisation.zero);
        let fits = (rows, columns) == (other_rows, other_columns)
            && zeros == [0.0; 2]
            && quantisation.zero == 0.0;
        let from = [self.whole(first)?, self.whole(second)?];
        let factors = [first, second].map(|it| it.quantisation.scale / quantisation.scale);
        let shape = [1, channels + others, rows, columns];
        let (to, layout) = fits.then(|| self.image(shape, quantisation))??;
        self.steps.push(Step::Join { from, factors, to });
        Some(layout)
    }

    fn factors(&self, layout: &Layout, quantisation: Quantisation) -> Output {
        let Quantisation { scale, zero } = layout.quantisation;
        let factor = |value: usize| {
            let argument = f64::from((value as f32 - zero) * scale);
            let squashed = 1.0 / (1.0 + (-argument).exp());
            let integer = squashed / f64::from(quantisation.scale) + f64::from(quantisation.zero);
            let integer = integer.round_ties_even().clamp(0.0, 255.0) as f32;
            ((integer - quantisation.zero) * quantisation.scale).clamp(0.0, 1.0)
        };
        Output {
            from: layout.image,
            places: layout.places(&self.images[layout.image]),
            factors: Box::new(std::array::from_fn(factor)),
        }
    }

    fn image(&mut self, shape: [usize; 4], quantisation: Quantisation) -> Option<(usize, Layout)> {
        let [1, channels, rows, columns] = shape else {
            return None;
        };
        layout::is_bounded(&shape).then_some(())?;
        let image = self.images.len();
        self.images.push(Image::new([channels, rows, columns]));
        Some((image, Layout::whole(image, shape, quantisation)))
    }

    /// Returns an image that holds the values in their order, and adds a gathering step if no image
    /// does.
    fn whole(&mut self, layout: &Layout) -> Option<usize> {
        if layout.is_whole() {
            return Some(layout.image);
        }
        let shape = layout.shape[..].try_into().ok()?;
        let (to, _) = self.image(shape, layout.quantisation)?;
        self.steps.push(Step::Gather {
            from: layout.image,
            to,
            places: layout.places(&self.images[layout.image]),
        });
        Some(to)
    }
}

/// Returns a convolution, if all its sums are exact.
fn kernel(from: &Layout, weights: &Weights, bias: &Weights, to: Quantisation) -> Option<Kernel> {
    let [outputs, inputs, 3, 3] = weights.shape[..] else {
        return None;
    };
    let scale = from.quantisation.scale;
    let fits = from.quantisation.zero == 0.0
        && outputs.is_multiple_of(OUTPUTS)
        && from.shape.get(1) == Some(&inputs)
        && bias.values.len() == outputs
        && (bias.scales.iter().zip(&weights.scales)).all(|(of_bias, of_weights)| {
            (of_bias - scale * of_weights).abs() <= 1e-5 * of_bias.abs()
        });
    fits.then_some(())?;
    let mut kernel = Kernel {
        weights: vec![[[0.0; OUTPUTS]; 9]; outputs / OUTPUTS * inputs],
        offsets: bias.values.clone(),
        factors: weights
            .scales
            .iter()
            .map(|of| scale * of / to.scale)
            .collect(),
        zero: to.zero,
    };
    let of_outputs = weights.values.chunks_exact(9 * inputs);
    for (output, (of_output, offset)) in of_outputs.zip(&kernel.offsets).enumerate() {
        let most = of_output
            .iter()
            .map(|weight| 255.0 * weight.abs())
            .sum::<f32>();
        if most + offset.abs() >= EXACT {
            return None;
        }
        for (input, of_input) in of_output.chunks_exact(9).enumerate() {
            let block = &mut kernel.weights[output / OUTPUTS * inputs + input];
            for (weights, weight) in block.iter_mut().zip(of_input) {
                weights[output % OUTPUTS] = *weight;
            }
        }
    }
    Some(kernel)
}
