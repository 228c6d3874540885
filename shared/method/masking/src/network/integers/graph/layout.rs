use std::rc::Rc;

use rten_onnx::onnx::NodeProto;

use super::Quantisation;
use crate::network::{
    integers::image::Image,
    tensors::{Attributes, Constants},
};

const MOST_VALUES: usize = 1 << 26;

/// Values of an image, as a tensor.
#[derive(Clone)]
pub struct Layout {
    pub image: usize,
    pub quantisation: Quantisation,
    pub shape: Vec<usize>,
    /// The place of each value in the image; `None` if it has all of them in their order.
    places: Option<Rc<[u32]>>,
}

impl Layout {
    pub fn whole(image: usize, shape: [usize; 4], quantisation: Quantisation) -> Self {
        Self {
            image,
            quantisation,
            shape: shape.to_vec(),
            places: None,
        }
    }

    /// Returns whether these are all values of the image in their order.
    pub fn is_whole(&self) -> bool {
        self.places.is_none()
    }

    pub fn places(&self, image: &Image) -> Vec<u32> {
        if let Some(places) = &self.places {
            return places.to_vec();
        }
        let mut places = Vec::new();
        for channel in 0..image.channels {
            for row in 0..image.rows {
                let first = image.place(channel, row, 0) as u32;
                places.extend(first..first + image.columns as u32);
            }
        }
        places
    }

    /// Returns the values as an operator moves them that computes nothing.
    pub fn moved(self, node: &NodeProto, constants: &Constants<'_>, image: &Image) -> Option<Self> {
        let Move { shape, source } = Move::of(&self, node, constants)?;
        is_bounded(&shape).then_some(())?;
        let (before, places) = (Strides::of(&self.shape), self.places(image));
        // Place 0 is one of the margin, and zero.
        let place = |at: Vec<usize>| match source(&at) {
            Some(source) => places.get(before.offset(&source)).copied(),
            None => Some(0),
        };
        let places = indices(&shape).map(place).collect::<Option<_>>()?;
        Some(Self {
            shape,
            places: Some(places),
            ..self
        })
    }
}

struct Move {
    shape: Vec<usize>,
    /// Returns the index of a value before; `None` of a zero that was not there.
    source: Source,
}

type Source = Box<dyn Fn(&[usize]) -> Option<Vec<usize>>>;

impl Move {
    fn of(from: &Layout, node: &NodeProto, constants: &Constants<'_>) -> Option<Self> {
        let operand = |index: usize| constants.sizes(node.input.get(index)?);
        let (attributes, shape) = (Attributes(&node.attribute), from.shape.clone());
        match node.op_type.as_deref()? {
            "Reshape" => Self::reshape(shape, operand(1)?),
            "Unsqueeze" => {
                let wanted = unsqueezed(&shape, &operand(1)?)?;
                Self::reshape(shape, wanted)
            }
            "Transpose" => Self::transpose(shape, attributes.sizes("perm")?),
            "Pad" if from.quantisation.zero == 0.0 && attributes.is_constant_padding() => {
                // The value defaults to 0.
                let value = node.input.get(2).filter(|name| !name.is_empty());
                let is_zero = value.is_none_or(|value| constants.number(value) == Some(0.0));
                Self::pad(shape, &operand(1)?).filter(|_| is_zero && node.input.len() <= 3)
            }
            "Slice" => {
                let [starts, ends, axes, steps] = [1, 2, 3, 4].map(operand);
                match (&starts?[..], &ends?[..], &axes?[..], &steps?[..]) {
                    ([start], [end], [axis], [1]) => Self::slice(shape, *axis, *start, *end),
                    _ => None,
                }
            }
            "DepthToSpace" if attributes.text("mode") == Some("CRD") => {
                Self::depth_to_space(&shape, attributes.integer("blocksize")?.try_into().ok()?)
            }
            _ => None,
        }
    }

    fn reshape(from: Vec<usize>, shape: Vec<usize>) -> Option<Self> {
        is_bounded(&shape).then_some(())?;
        let (before, after) = (Strides::of(&from), Strides::of(&shape));
        let fits = from.iter().product::<usize>() == shape.iter().product::<usize>();
        let source: Source = Box::new(move |at| Some(before.index(after.offset(at), &from)));
        fits.then_some(Self { shape, source })
    }

    fn transpose(from: Vec<usize>, order: Vec<usize>) -> Option<Self> {
        let shape = order.iter().map(|axis| from.get(*axis).copied());
        let shape: Vec<usize> = shape.collect::<Option<_>>()?;
        let fits = shape.len() == from.len();
        let source: Source = Box::new(move |at| {
            let mut before = vec![0; at.len()];
            for (axis, at) in order.iter().zip(at) {
                before[*axis] = *at;
            }
            Some(before)
        });
        fits.then_some(Self { shape, source })
    }

    fn pad(from: Vec<usize>, pads: &[usize]) -> Option<Self> {
        let (start, end) = pads.split_at_checked(from.len())?;
        let (start, wide) = (start.to_vec(), from.iter().zip(start).zip(end));
        let shape = wide
            .map(|((size, start), end)| start.saturating_add(*size).saturating_add(*end))
            .collect();
        let source: Source = Box::new(move |at| {
            let inside = |((at, start), size): ((&usize, &usize), &usize)| {
                at.checked_sub(*start).filter(|at| at < size)
            };
            at.iter().zip(&start).zip(&from).map(inside).collect()
        });
        Some(Self { shape, source })
    }

    fn slice(mut shape: Vec<usize>, axis: usize, start: usize, end: usize) -> Option<Self> {
        let size = shape.get_mut(axis)?;
        *size = end.min(*size).checked_sub(start)?;
        let source: Source = Box::new(move |at| {
            let mut before = at.to_vec();
            before[axis] += start;
            Some(before)
        });
        Some(Self { shape, source })
    }

    fn depth_to_space(from: &[usize], block: usize) -> Option<Self> {
        let [1, channels, rows, columns] = from[..] else {
            return None;
        };
        let of_block = block.checked_mul(block).filter(|cells| *cells > 0)?;
        let shape = vec![1, channels / of_block, rows * block, columns * block];
        let source: Source = Box::new(move |at| {
            let cell = at[2] % block * block + at[3] % block;
            Some(vec![
                0,
                at[1] * of_block + cell,
                at[2] / block,
                at[3] / block,
            ])
        });
        channels
            .is_multiple_of(of_block)
            .then_some(Self { shape, source })
    }
}

/// Returns whether a tensor has values, and no more than a network of the largest rasters.
pub fn is_bounded(shape: &[usize]) -> bool {
    let values = shape
        .iter()
        .try_fold(1_usize, |values, size| values.checked_mul(*size));
    values.is_some_and(|values| (1..=MOST_VALUES).contains(&values))
}

fn unsqueezed(shape: &[usize], axes: &[usize]) -> Option<Vec<usize>> {
    let mut shape = shape.to_vec();
    for axis in axes {
        (*axis <= shape.len()).then(|| shape.insert(*axis, 1))?;
    }
    Some(shape)
}

struct Strides(Vec<usize>);

impl Strides {
    fn of(shape: &[usize]) -> Self {
        let mut strides = vec![1; shape.len()];
        for axis in (1..shape.len()).rev() {
            strides[axis - 1] = strides[axis] * shape[axis];
        }
        Self(strides)
    }

    fn offset(&self, at: &[usize]) -> usize {
        self.0.iter().zip(at).map(|(stride, at)| stride * at).sum()
    }

    fn index(&self, offset: usize, shape: &[usize]) -> Vec<usize> {
        let axes = self.0.iter().zip(shape);
        axes.map(|(stride, size)| offset / stride % size).collect()
    }
}

fn indices(shape: &[usize]) -> impl Iterator<Item = Vec<usize>> + '_ {
    let strides = Strides::of(shape);
    let values = shape.iter().product();
    (0..values).map(move |value| strides.index(value, shape))
}
