pub(crate) mod planes;
pub mod runtime;

pub use planes::{PlanesError, PlanesNetwork};

/// Returns a message of a library as one line, without the location in ONNX Runtime's source code.
pub fn one_line(message: &str) -> String {
    let text = match message.split_once("/onnxruntime_src/") {
        Some((_, location)) => location.split_once(") ").map_or(location, |(_, text)| text),
        None => message,
    };
    text.trim_end_matches(['.', '\n'])
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_onnx_runtime_become_one_line_without_source_location() {
        let message = "Load failed:/onnxruntime_src/core/graph.cc:46 void check(int, bool) Opset 99 is (still)\nnew. Or not.\n";
        assert_eq!(one_line(message), "Opset 99 is (still) new. Or not");
        assert_eq!(
            one_line("Protobuf\n  parsing failed."),
            "Protobuf parsing failed"
        );
    }
}
