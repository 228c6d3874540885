//! Networks with quantised activations, computed in floating point.

use std::collections::BTreeMap;

use tract_onnx::pb::{GraphProto, NodeProto, TensorProto, tensor_proto::DataType};

const QUANTIZE: &str = "QuantizeLinear";
const DEQUANTIZE: &str = "DequantizeLinear";

/// Takes the quantisation of activations out of a graph.
///
/// A pair of `QuantizeLinear` and `DequantizeLinear` stands for integers between two layers. A library without integer kernels computes
/// both, and the layers in floating point all the same. Beside rounding, a pair cuts off what its integers cannot hold: above, what
/// training hardly reaches; below, where the smallest integer stands for zero, negative values. This stays, as `Relu`. Weights are
/// dequantised once, when the network is loaded.
pub(super) fn keep_activations_in_floating_point(graph: &mut GraphProto) {
    let between = between_layers(graph);
    let of = |values: &[String]| between.get(values.first()?).copied();
    for node in &mut graph.node {
        if node.op_type == QUANTIZE
            && let Some(cuts_off) = of(&node.output)
        {
            replace(node, if cuts_off { "Relu" } else { "Identity" });
        } else if node.op_type == DEQUANTIZE && of(&node.input).is_some() {
            replace(node, "Identity");
        }
    }
}

/// Returns the quantised values that are dequantised again, and nothing else, and whether their quantisation cuts off negative values.
fn between_layers(graph: &GraphProto) -> BTreeMap<String, bool> {
    let smallest: BTreeMap<&str, bool> = graph
        .initializer
        .iter()
        .filter_map(|tensor| Some((&*tensor.name, is_smallest_integer(tensor)?)))
        .collect();
    let cuts_off = |node: &NodeProto| match node.input.get(2).map(String::as_str) {
        // By default it is 0, of the integers from 0 to 255.
        None | Some("") => Some(true),
        Some(zero) => smallest.get(zero).copied(),
    };
    let quantised = graph.node.iter().filter(|node| node.op_type == QUANTIZE);
    let mut between: BTreeMap<String, bool> = quantised
        .filter_map(|node| Some((node.output.first()?.clone(), cuts_off(node)?)))
        .collect();
    for node in graph.node.iter().filter(|node| node.op_type != DEQUANTIZE) {
        node.input.iter().for_each(|it| _ = between.remove(it));
    }
    for output in &graph.output {
        between.remove(&output.name);
    }
    between
}

fn replace(node: &mut NodeProto, by: &str) {
    node.op_type = by.to_owned();
    node.input.truncate(1);
    node.attribute.clear();
}

/// Returns whether all values are the smallest of their type of integers; `None` if they cannot be read here.
fn is_smallest_integer(tensor: &TensorProto) -> Option<bool> {
    let smallest = match DataType::try_from(tensor.data_type) {
        Ok(DataType::Uint8) => 0,
        Ok(DataType::Int8) => i8::MIN as u8,
        _ => return None,
    };
    let mut values = tensor
        .raw_data
        .iter()
        .copied()
        .chain(tensor.int32_data.iter().map(|value| *value as u8))
        .peekable();
    values.peek()?;
    Some(values.all(|value| value == smallest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(kind: &str, input: &[&str], output: &str) -> NodeProto {
        NodeProto {
            op_type: kind.to_owned(),
            input: input.iter().map(ToString::to_string).collect(),
            output: vec![output.to_owned()],
            ..NodeProto::default()
        }
    }

    fn integer(name: &str, kind: DataType, value: u8) -> TensorProto {
        TensorProto {
            name: name.to_owned(),
            data_type: kind as i32,
            raw_data: vec![value],
            ..TensorProto::default()
        }
    }

    fn kinds(nodes: &[NodeProto]) -> Vec<&str> {
        nodes.iter().map(|node| &*node.op_type).collect()
    }

    #[test]
    fn a_pair_between_layers_cuts_off_what_its_integers_cannot_hold() {
        let mut graph = GraphProto {
            initializer: vec![
                integer("zero", DataType::Uint8, 0),
                integer("lowest", DataType::Int8, 0x80),
                integer("middle", DataType::Uint8, 7),
            ],
            node: vec![
                node(QUANTIZE, &["a", "s", "zero"], "b"),
                node(DEQUANTIZE, &["b", "s", "zero"], "c"),
                node(QUANTIZE, &["c", "s", "lowest"], "d"),
                node(DEQUANTIZE, &["d", "s", "lowest"], "e"),
                node(QUANTIZE, &["e", "s", "middle"], "f"),
                node(DEQUANTIZE, &["f", "s", "middle"], "g"),
            ],
            ..GraphProto::default()
        };
        keep_activations_in_floating_point(&mut graph);
        let expected = [
            "Relu", "Identity", "Relu", "Identity", "Identity", "Identity",
        ];
        assert_eq!(kinds(&graph.node), expected);
        assert!(graph.node.iter().all(|node| node.input.len() == 1));
    }

    #[test]
    fn weights_and_integers_that_are_used_as_such_stay() {
        let nodes = vec![
            node(DEQUANTIZE, &["weights", "s", "zero"], "w"),
            node(QUANTIZE, &["a", "s", "zero"], "b"),
            node(DEQUANTIZE, &["b", "s", "zero"], "c"),
            node("ConvInteger", &["b", "k"], "d"),
            // A zero point that is not at hand.
            node(QUANTIZE, &["a", "s", "computed"], "e"),
            node(DEQUANTIZE, &["e", "s", "computed"], "f"),
        ];
        let mut graph = GraphProto {
            node: nodes.clone(),
            ..GraphProto::default()
        };
        keep_activations_in_floating_point(&mut graph);
        assert_eq!(graph.node, nodes);
    }
}
