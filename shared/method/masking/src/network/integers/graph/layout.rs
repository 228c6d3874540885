use std::rc::Rc;

use ndarray::{ArrayD, Axis, AxisDescription, Slice};
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
        let places = ArrayD::from_shape_vec(self.shape.clone(), self.places(image)).ok()?;
        let operand = |index: usize| constants.sizes(node.input.get(index)?);
        let attributes = Attributes(&node.attribute);
        let moved = match node.op_type.as_deref()? {
            "Reshape" => places.into_shape_with_order(operand(1)?).ok()?,
            "Unsqueeze" => operand(1)?.into_iter().try_fold(places, |places, axis| {
                (axis <= places.ndim()).then(|| places.insert_axis(Axis(axis)))
            })?,
            "Transpose" => {
                let order = attributes.sizes("perm")?;
                let mut axes = order.clone();
                axes.sort_unstable();
                let is_order = axes.into_iter().eq(0..places.ndim());
                is_order.then(|| places.permuted_axes(order))?
            }
            "Pad" if self.quantisation.zero == 0.0 && attributes.is_constant_padding() => {
                // The value defaults to 0.
                let value = node.input.get(2).filter(|name| !name.is_empty());
                let is_zero = value.is_none_or(|value| constants.number(value) == Some(0.0));
                (is_zero && node.input.len() <= 3).then_some(())?;
                padded(&places, &operand(1)?)?
            }
            "Slice" => {
                let [starts, ends, axes, steps] = [1, 2, 3, 4].map(operand);
                match (&starts?[..], &ends?[..], &axes?[..], &steps?[..]) {
                    (&[start], &[end], &[axis], [1]) => {
                        let end = end.min(*places.shape().get(axis)?);
                        (start < end).then_some(())?;
                        let part = Slice::from(start..end);
                        places.slice_axis(Axis(axis), part).to_owned()
                    }
                    _ => return None,
                }
            }
            "DepthToSpace" if attributes.text("mode") == Some("CRD") => {
                depth_to_space(places, attributes.integer("blocksize")?.try_into().ok()?)?
            }
            _ => return None,
        };
        Some(Self {
            shape: moved.shape().to_vec(),
            places: Some(moved.iter().copied().collect()),
            ..self
        })
    }
}

fn padded(places: &ArrayD<u32>, pads: &[usize]) -> Option<ArrayD<u32>> {
    let (start, end) = pads.split_at_checked(places.ndim())?;
    let sizes = places.shape().iter().zip(start).zip(end);
    let shape: Vec<usize> = sizes
        .map(|((size, start), end)| start.saturating_add(*size).saturating_add(*end))
        .collect();
    (start.len() == end.len() && is_bounded(&shape)).then_some(())?;
    // Place 0 is one of the margin, and zero.
    let mut padded = ArrayD::zeros(shape);
    let inside = |axis: AxisDescription| {
        let axis = axis.axis.index();
        Slice::from(start[axis]..start[axis] + places.shape()[axis])
    };
    padded.slice_each_axis_mut(inside).assign(places);
    Some(padded)
}

fn depth_to_space(places: ArrayD<u32>, block: usize) -> Option<ArrayD<u32>> {
    let [1, channels, rows, columns] = *places.shape() else {
        return None;
    };
    let channels = channels / block.checked_mul(block).filter(|cells| *cells > 0)?;
    let blocks = vec![channels, block, block, rows, columns];
    let blocks = places.into_shape_with_order(blocks).ok()?;
    let moved = blocks.permuted_axes(vec![0, 3, 1, 4, 2]);
    let shape = vec![1, channels, rows * block, columns * block];
    Some(moved.to_shape(shape).ok()?.into_owned())
}

/// Returns whether a tensor has values, and no more than a network of the largest rasters.
pub fn is_bounded(shape: &[usize]) -> bool {
    let values = shape
        .iter()
        .try_fold(1_usize, |values, size| values.checked_mul(*size));
    values.is_some_and(|values| (1..=MOST_VALUES).contains(&values))
}
