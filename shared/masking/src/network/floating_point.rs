//! Networks with quantised activations, computed in floating point.

use std::collections::BTreeSet;

use tract_onnx::pb::{GraphProto, NodeProto, TensorProto, tensor_proto::DataType};

const QUANTIZE: &str = "QuantizeLinear";
const DEQUANTIZE: &str = "DequantizeLinear";

/// Takes the quantisation of activations out of a graph.
///
/// A pair of `QuantizeLinear` and `DequantizeLinear` stands for integers between two layers. A library without integer kernels computes
/// both, and the layers in floating point all the same. What a pair does beside rounding is to cut off negative values where its smallest
/// integer stands for zero: this stays, as `Relu`. Weights are dequantised once, when the network is loaded.
pub(super) fn keep_activations_in_floating_point(graph: &mut GraphProto) {
    let between = between_layers(graph);
    let cut_off: BTreeSet<String> = graph
        .initializer
        .iter()
        .filter(|tensor| is_smallest_integer(tensor))
        .map(|tensor| tensor.name.clone())
        .collect();
    for node in &mut graph.node {
        let pair_of = |values: &[String]| values.first().is_some_and(|it| between.contains(it));
        if node.op_type == QUANTIZE && pair_of(&node.output) {
            let cuts_off = node.input.get(2).is_none_or(|zero| cut_off.contains(zero));
            replace(node, if cuts_off { "Relu" } else { "Identity" });
        } else if node.op_type == DEQUANTIZE && pair_of(&node.input) {
            replace(node, "Identity");
        }
    }
}

/// Returns the quantised values that are dequantised again, and nothing else.
fn between_layers(graph: &GraphProto) -> BTreeSet<String> {
    let of = |kind: &'static str| graph.node.iter().filter(move |node| node.op_type == kind);
    let mut between: BTreeSet<String> = of(QUANTIZE).flat_map(|q| q.output.clone()).collect();
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

/// Returns whether all values are the smallest of their type of integers.
fn is_smallest_integer(tensor: &TensorProto) -> bool {
    let smallest = match DataType::try_from(tensor.data_type) {
        Ok(DataType::Uint8) => 0,
        Ok(DataType::Int8) => i8::MIN as u8,
        _ => return false,
    };
    let mut values = tensor
        .raw_data
        .iter()
        .copied()
        .chain(tensor.int32_data.iter().map(|value| *value as u8))
        .peekable();
    values.peek().is_some() && values.all(|value| value == smallest)
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
        ];
        let mut graph = GraphProto {
            node: nodes.clone(),
            ..GraphProto::default()
        };
        keep_activations_in_floating_point(&mut graph);
        assert_eq!(graph.node, nodes);
    }
}
