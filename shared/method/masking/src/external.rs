//! The files that an ONNX file keeps tensors in, beside itself.
//!
//! Walks the protobuf messages that contain tensors in ONNX. The parser of the built-in runtime
//! leaves some of them out (functions, sparse weights), and ONNX Runtime reads them all.

/// A tensor's value of `data_location` when it is in another file.
const EXTERNAL: u32 = 1;

#[derive(Clone, Copy)]
enum Message {
    Model,
    Training,
    Function,
    Graph,
    Node,
    Attribute,
    SparseTensor,
    Tensor,
}

impl Message {
    /// Returns the kind of message in a field, by the numbers in `onnx.proto`.
    fn within(self, field: u64) -> Option<Self> {
        match (self, field) {
            (Self::Model, 7) | (Self::Training, 1 | 2) | (Self::Attribute, 6 | 11) => {
                Some(Self::Graph)
            }
            (Self::Model, 20) => Some(Self::Training),
            (Self::Model, 25) => Some(Self::Function),
            (Self::Function, 7) | (Self::Graph, 1) => Some(Self::Node),
            (Self::Function, 11) | (Self::Node, 5) => Some(Self::Attribute),
            (Self::Graph, 15) | (Self::Attribute, 22 | 23) => Some(Self::SparseTensor),
            (Self::Graph, 5) | (Self::Attribute, 5 | 10) | (Self::SparseTensor, 1 | 2) => {
                Some(Self::Tensor)
            }
            _ => None,
        }
    }
}

/// Returns the name of the first other file that a model keeps a tensor in; empty where a tensor is
/// outside without a name. A file that is not ONNX has none: the runtime rejects it.
pub(crate) fn external_file(model: &[u8]) -> Option<String> {
    // A list instead of recursion: graphs may be nested without limit.
    let mut left = vec![(Message::Model, model)];
    while let Some((message, bytes)) = left.pop() {
        if matches!(message, Message::Tensor)
            && let Some(file) = file_of(bytes)
        {
            return Some(file);
        }
        let within = Fields(bytes).filter_map(|(field, value)| match value {
            Value::Bytes(bytes) => Some((message.within(field)?, bytes)),
            Value::Number(_) => None,
        });
        left.extend(within);
    }
    None
}

fn file_of(tensor: &[u8]) -> Option<String> {
    // An enum has 32 bits, whatever a varint has beyond them.
    let is_external =
        |field| matches!(field, (14, Value::Number(place)) if place as u32 == EXTERNAL);
    Fields(tensor).any(is_external).then(|| {
        let entries = Fields(tensor).filter_map(|field| match field {
            (13, Value::Bytes(entry)) => Some((text(entry, 1)?, text(entry, 2)?)),
            _ => None,
        });
        let mut locations = entries.filter(|(key, _)| key == "location");
        locations.next().map_or_else(String::new, |(_, name)| name)
    })
}

fn text(message: &[u8], wanted: u64) -> Option<String> {
    Fields(message).find_map(|field| match field {
        (field, Value::Bytes(text)) if field == wanted => {
            Some(String::from_utf8_lossy(text).into_owned())
        }
        _ => None,
    })
}

enum Value<'a> {
    /// A varint, or nothing that is looked at.
    Number(u64),
    Bytes(&'a [u8]),
}

/// The fields of a protobuf message, up to its end or to the first invalid field.
struct Fields<'a>(&'a [u8]);

impl<'a> Iterator for Fields<'a> {
    type Item = (u64, Value<'a>);

    fn next(&mut self) -> Option<Self::Item> {
        let key = self.varint()?;
        let value = match key & 7 {
            0 => Value::Number(self.varint()?),
            1 => self.skip(8)?,
            2 => {
                let length = usize::try_from(self.varint()?).ok()?;
                Value::Bytes(self.0.split_off(..length)?)
            }
            // The ends of a group. Its fields are taken for the message's, so that none hides.
            3 | 4 => self.skip(0)?,
            5 => self.skip(4)?,
            _ => return None,
        };
        Some((key >> 3, value))
    }
}

impl<'a> Fields<'a> {
    fn varint(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = *self.0.split_off_first()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }

    fn skip(&mut self, bytes: usize) -> Option<Value<'a>> {
        self.0.split_off(..bytes).map(|_| Value::Number(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A field that is a message or a text of fewer than 128 bytes.
    fn field(number: u64, content: &[u8]) -> Vec<u8> {
        let key = number << 3 | 2;
        let mut field = match key {
            0..128 => vec![key as u8],
            _ => vec![key as u8 | 0x80, (key >> 7) as u8],
        };
        field.push(content.len() as u8);
        field.extend(content);
        field
    }

    /// A tensor that is in another file, with its name and a length.
    fn outside() -> Vec<u8> {
        let entry = |key: &str, value: &str| {
            let entry = [field(1, key.as_bytes()), field(2, value.as_bytes())].concat();
            field(13, &entry)
        };
        [
            entry("length", "36"),
            entry("location", "m.data"),
            vec![14 << 3, 1],
        ]
        .concat()
    }

    #[test]
    fn tensors_outside_are_found_wherever_onnx_has_tensors() {
        let paths: [&[u64]; 11] = [
            &[7, 5],           // weights
            &[7, 15, 1],       // sparse ones
            &[7, 15, 2],       // their places
            &[7, 1, 5, 5],     // a constant
            &[7, 1, 5, 10],    // one of several
            &[7, 1, 5, 22, 1], // a sparse one
            &[7, 1, 5, 23, 2],
            &[7, 1, 5, 6, 1, 5, 11, 5], // in branches of branches
            &[25, 7, 5, 5],             // in a function
            &[25, 11, 5],               // a default of its attributes
            &[20, 2, 5],                // for training
        ];
        for path in paths {
            let wrap = |tensor: Vec<u8>| {
                let whole = path.iter().rev();
                whole.fold(tensor, |content, number| field(*number, &content))
            };
            let before = [field(2, b"a name"), vec![1 << 3, 10]].concat();
            let model = [&before[..], &wrap(outside())].concat();
            assert_eq!(external_file(&model).as_deref(), Some("m.data"), "{path:?}");
            // The same, with the tensor in the file.
            let inside = [field(9, b"\0\0\0\0"), vec![14 << 3, 0]].concat();
            assert_eq!(external_file(&wrap(inside)), None, "{path:?}");
        }
    }

    #[test]
    fn what_is_not_protobuf_has_no_files() {
        let model = field(7, &field(5, &outside()));
        for end in 0..model.len() {
            assert_eq!(external_file(&model[..end]), None, "{end}");
        }
        assert_eq!(external_file(&[0xff; 40]), None);
        assert_eq!(external_file(b"no model"), None);
    }

    #[test]
    fn a_tensor_in_a_group_is_found() {
        // Fields 40 and 8 are unknown: a group around the weights, and eight bytes before them.
        let graph = [
            &[8 << 3 | 1][..],
            &[7; 8],
            &[3 | 0x80 | 0x40, 2],
            &field(5, &outside()),
            &[4 | 0x80 | 0x40, 2],
        ]
        .concat();
        assert_eq!(external_file(&field(7, &graph)).as_deref(), Some("m.data"));
    }
}
