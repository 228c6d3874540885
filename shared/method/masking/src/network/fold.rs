//! Networks that fold blocks of cells into channels, written so that ONNX Runtime moves the cells
//! at once.

use rten_onnx::onnx::{AttributeProto, AttributeType, GraphProto, ModelProto, NodeProto};

use super::tensors::{Attributes, Constants};

/// The operators that fold cells, as PyTorch exports them. If layers are quantised, their values
/// are quantised again between them, which changes no value.
const FOLDING: [&str; 4] = ["Unsqueeze", "Reshape", "Transpose", "Reshape"];

/// Returns a network in ONNX that computes the same, with one operator for the cells that are
/// folded; `None` without such cells.
pub fn folded(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut file = ModelProto::parse_buf(bytes).ok()?;
    fold(file.graph.as_mut()?)?;
    file.write_buf().ok()
}

fn fold(graph: &mut GraphProto) -> Option<()> {
    let is_first = |node: &NodeProto| node.op_type.as_deref() == Some(FOLDING[0]);
    let first = graph.node.iter().position(is_first)?;
    let chain = chain(graph, first)?;
    let nodes: Vec<&NodeProto> = chain.iter().map(|index| &graph.node[*index]).collect();
    let constants = Constants::of(graph);
    let (quantised, folding): (Vec<_>, Vec<_>) =
        nodes.iter().partition(|node| is_quantisation(node));
    let before = producer(graph, nodes[0].input.first()?);
    if !are_alike(&constants, quantised.into_iter().chain(before)) {
        return None;
    }
    let node = NodeProto {
        name: Some("fold".to_owned()),
        op_type: Some("SpaceToDepth".to_owned()),
        input: vec![nodes[0].input.first()?.clone()],
        output: nodes.last()?.output.clone(),
        attribute: vec![AttributeProto {
            name: Some("blocksize".to_owned()),
            i: Some(block(&constants, folding.try_into().ok()?)?),
            r#type: Some(AttributeType::INT),
            ..AttributeProto::default()
        }],
        ..NodeProto::default()
    };
    let mut index = 0..;
    graph
        .node
        .retain(|_| index.next().is_none_or(|index| !chain.contains(&index)));
    graph.node.insert(first, node);
    Some(())
}

fn is_quantisation(node: &NodeProto) -> bool {
    let kind = node.op_type.as_deref();
    matches!(kind, Some("QuantizeLinear" | "DequantizeLinear"))
}

/// Returns the operators from one to the end of the folding, each the only reader of the one
/// before.
fn chain(graph: &GraphProto, first: usize) -> Option<Vec<usize>> {
    let mut chain = vec![first];
    let mut folding = FOLDING[1..].iter();
    let mut next = folding.next();
    while let Some(wanted) = next {
        let output = graph.node[*chain.last()?].output.first()?;
        let reads = |(_, node): &(usize, &NodeProto)| node.input.contains(output);
        let mut readers = graph.node.iter().enumerate().filter(reads);
        let ((index, reader), None) = (readers.next()?, readers.next()) else {
            return None;
        };
        match reader.op_type.as_deref()? {
            kind if kind == *wanted => next = folding.next(),
            _ if is_quantisation(reader) => {}
            _ => return None,
        }
        chain.push(index);
    }
    Some(chain)
}

fn producer<'a>(graph: &'a GraphProto, tensor: &String) -> Option<&'a NodeProto> {
    graph.node.iter().find(|node| node.output.contains(tensor))
}

/// Returns whether all quantise values in the same way, if they do.
fn are_alike<'a>(constants: &Constants<'_>, nodes: impl Iterator<Item = &'a NodeProto>) -> bool {
    let numbers = |node: &NodeProto| {
        let number = |index: usize| constants.number(node.input.get(index)?);
        Some((number(1)?, number(2)?))
    };
    let mut all = nodes.map(numbers);
    match all.next() {
        Some(first) => first.is_some() && all.all(|other| other == first),
        None => true,
    }
}

/// Returns the size of the blocks that these operators fold, each cell of one into a channel.
fn block(constants: &Constants<'_>, nodes: [&NodeProto; 4]) -> Option<i64> {
    let [_, apart, order, together] = nodes;
    let [1, 1, rows, block, columns, of_columns] = constants.sizes(apart.input.get(1)?)?[..] else {
        return None;
    };
    let fits = block == of_columns
        && Attributes(&order.attribute).sizes("perm")? == [0, 1, 3, 5, 2, 4]
        && constants.sizes(together.input.get(1)?)? == [1, block * block, rows, columns];
    fits.then(|| i64::try_from(block).ok())?
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{fs, path::Path};

    use super::*;

    fn model(name: &str) -> Vec<u8> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../models");
        fs::read(folder.join(name)).unwrap()
    }

    /// The kinds of a network's operators.
    fn kinds(bytes: &[u8]) -> Vec<String> {
        let graph = ModelProto::parse_buf(bytes).unwrap().graph.unwrap();
        let kinds = graph.node.into_iter().map(|node| node.op_type.unwrap());
        kinds.collect()
    }

    #[test]
    fn the_operators_that_fold_become_one_and_the_others_stay() {
        let before = model("gyre-255.onnx");
        let (before, after) = (kinds(&before), kinds(&folded(&before).unwrap()));
        let count = |kinds: &[String], kind: &str| kinds.iter().filter(|it| *it == kind).count();
        for kind in FOLDING {
            assert_eq!(count(&after, kind), 0, "{kind}");
        }
        assert_eq!(count(&after, "SpaceToDepth"), 1);
        for kind in ["Conv", "Pad", "DepthToSpace", "Sigmoid"] {
            assert_eq!(count(&after, kind), count(&before, kind), "{kind}");
        }
        // Three pairs between the four.
        assert_eq!(after.len(), before.len() - 4 - 6 + 1);
    }

    #[test]
    fn a_network_that_folds_nothing_or_in_another_way_stays_as_it_is() {
        assert_eq!(folded(&model("mbym-255.onnx")), None);
        assert_eq!(folded(b"not a network"), None);
        let mut file = ModelProto::parse_buf(&model("gyre-255.onnx")).unwrap();
        let graph = file.graph.as_mut().unwrap();
        let mut nodes = graph.node.iter_mut();
        let transpose = nodes
            .find(|it| it.op_type.as_deref() == Some("Transpose"))
            .unwrap();
        transpose.attribute[0].ints.swap(2, 3);
        assert_eq!(folded(&file.write_buf().unwrap()), None);
    }
}
