//! Constants and attributes of a network in ONNX.

use std::collections::HashMap;

use rten_onnx::onnx::{
    AttributeProto, DataType, GraphProto, NodeProto, TensorProto, ValueInfoProto,
};

pub struct Constants<'a>(HashMap<&'a str, &'a TensorProto>);

/// Quantised weights with their scales, one for each output. All their zeros are 0.
#[derive(Clone)]
pub struct Weights {
    pub values: Vec<f32>,
    pub shape: Vec<usize>,
    pub scales: Vec<f32>,
}

impl<'a> Constants<'a> {
    pub fn of(graph: &'a GraphProto) -> Self {
        let named = |tensor: &'a TensorProto| Some((tensor.name.as_deref()?, tensor));
        Self(graph.initializer.iter().filter_map(named).collect())
    }

    pub fn number(&self, name: &str) -> Option<f32> {
        match self.values(name)?[..] {
            [number] => Some(number as f32),
            _ => None,
        }
    }

    pub fn sizes(&self, name: &str) -> Option<Vec<usize>> {
        let values = self.values(name)?.into_iter();
        let size = |value: f64| (value >= 0.0).then_some(value as usize);
        values.map(size).collect()
    }

    pub fn weights(&self, node: &NodeProto) -> Option<Weights> {
        let [weights, scales, zeros] = &node.input[..] else {
            return None;
        };
        let values = |name| self.values(name);
        if values(zeros)?.iter().any(|zero| *zero != 0.0) {
            return None;
        }
        let shape: Vec<usize> = dims(self.0.get(weights.as_str())?)?;
        let scales: Vec<f32> = values(scales)?.into_iter().map(|it| it as f32).collect();
        let fits = shape.first() == Some(&scales.len())
            && Attributes(&node.attribute).integer("axis").unwrap_or(1) == 0;
        fits.then_some(Weights {
            values: values(weights)?.into_iter().map(|it| it as f32).collect(),
            shape,
            scales,
        })
    }

    /// Returns the values of a constant of any type; values of a network of 8 bits are exact.
    fn values(&self, name: &str) -> Option<Vec<f64>> {
        let tensor = self.0.get(name)?;
        let raw = tensor.raw_data.as_ref().map(|raw| raw.borrow());
        let raw = raw
            .as_deref()
            .map(Vec::as_slice)
            .filter(|raw| !raw.is_empty());
        let values: Vec<f64> = match (tensor.data_type?, raw) {
            (DataType::FLOAT, Some(raw)) => of_bytes(raw, |bytes| f32::from_le_bytes(bytes).into()),
            (DataType::INT8, Some(raw)) => of_bytes(raw, |bytes| i8::from_le_bytes(bytes).into()),
            (DataType::UINT8, Some(raw)) => of_bytes(raw, |bytes| u8::from_le_bytes(bytes).into()),
            (DataType::INT32, Some(raw)) => of_bytes(raw, |bytes| i32::from_le_bytes(bytes).into()),
            (DataType::INT64, Some(raw)) => of_bytes(raw, |bytes| i64::from_le_bytes(bytes) as f64),
            (DataType::FLOAT, None) => tensor.float_data.iter().map(|it| f64::from(*it)).collect(),
            (DataType::INT8 | DataType::UINT8 | DataType::INT32, None) => {
                tensor.int32_data.iter().map(|it| f64::from(*it)).collect()
            }
            (DataType::INT64, None) => tensor.int64_data.iter().map(|it| *it as f64).collect(),
            _ => return None,
        };
        let mut sizes = dims(tensor)?.into_iter();
        let count = sizes.try_fold(1_usize, usize::checked_mul)?;
        (values.len() == count).then_some(values)
    }
}

fn of_bytes<const SIZE: usize>(raw: &[u8], value: impl Fn([u8; SIZE]) -> f64) -> Vec<f64> {
    let chunks = raw.as_chunks::<SIZE>().0;
    chunks.iter().map(|bytes| value(*bytes)).collect()
}

fn dims(tensor: &TensorProto) -> Option<Vec<usize>> {
    tensor
        .dims
        .iter()
        .map(|size| (*size).try_into().ok())
        .collect()
}

pub fn shape_of(input: &ValueInfoProto) -> Option<Vec<usize>> {
    let tensor = input.r#type.as_ref()?.tensor_type.as_ref()?;
    let sizes = tensor.shape.as_ref()?.dim.iter();
    sizes.map(|size| size.dim_value?.try_into().ok()).collect()
}

pub struct Attributes<'a>(pub &'a [AttributeProto]);

impl<'a> Attributes<'a> {
    fn find(&self, name: &str) -> Option<&'a AttributeProto> {
        self.0.iter().find(|it| it.name.as_deref() == Some(name))
    }

    pub fn integer(&self, name: &str) -> Option<i64> {
        self.find(name)?.i
    }

    pub fn text(&self, name: &str) -> Option<&'a str> {
        self.find(name)?.s.as_deref()
    }

    pub fn sizes(&self, name: &str) -> Option<Vec<usize>> {
        let sizes = self.find(name)?.ints.iter();
        sizes.map(|size| (*size).try_into().ok()).collect()
    }

    /// Returns whether a list has these values, or is left out.
    fn are(&self, name: &str, values: &[i64]) -> bool {
        self.find(name).is_none_or(|it| it.ints == values)
    }

    fn is(&self, name: &str, value: &str) -> bool {
        self.text(name).is_none_or(|text| text == value)
    }

    /// Returns whether they are of a convolution of 3 x 3 that keeps the size.
    pub fn are_of_plain_convolution(&self) -> bool {
        self.is("auto_pad", "NOTSET")
            && self.are("dilations", &[1, 1])
            && self.are("strides", &[1, 1])
            && self.integer("group").unwrap_or(1) == 1
            && self.sizes("pads") == Some(vec![1; 4])
    }

    pub fn are_of_plain_pool(&self) -> bool {
        self.is("auto_pad", "NOTSET")
            && self.are("dilations", &[1, 1])
            && self.are("pads", &[0; 4])
            && self.integer("ceil_mode").unwrap_or(0) == 0
            && self.sizes("kernel_shape") == Some(vec![2; 2])
            && self.sizes("strides") == Some(vec![2; 2])
    }

    pub fn are_of_linear_resize(&self) -> bool {
        self.text("mode") == Some("linear")
            && self.is("coordinate_transformation_mode", "half_pixel")
            && self.integer("antialias").unwrap_or(0) == 0
    }

    pub fn is_constant_padding(&self) -> bool {
        self.is("mode", "constant")
    }
}
