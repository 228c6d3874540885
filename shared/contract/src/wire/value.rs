//! The values of a structure by name.

use serde::{
    Serialize, Serializer,
    ser::{SerializeMap, SerializeSeq},
};

use super::{Kind, Number, Structure};

/// A part of a message: its kind and its bytes. It is serialised as numbers, lists and maps.
#[derive(Clone, Copy, Debug)]
pub struct Value<'a> {
    pub kind: Kind,
    pub bytes: &'a [u8],
    /// Elements of an array that have a meaning.
    count: usize,
}

impl Structure {
    /// Returns the part of this structure that a path names, as `motion.x_m`; `None` if there is no
    /// such part.
    pub fn value<'a>(&self, path: &str, bytes: &'a [u8]) -> Option<Value<'a>> {
        let (name, rest) = match path.split_once('.') {
            Some((name, rest)) => (name, Some(rest)),
            None => (path, None),
        };
        let field = self.field(name)?;
        let content = field.content(bytes);
        match (field.kind, rest) {
            (Kind::Structure(part), Some(rest)) => part.value(rest, content),
            (_, Some(_)) => None,
            (kind, None) => Some(Value {
                kind,
                bytes: content,
                count: match kind {
                    Kind::Array(_, length) => self.counted(field, bytes, length),
                    _ => 1,
                },
            }),
        }
    }

    /// Returns the values of all fields.
    pub fn values<'a>(&'static self, bytes: &'a [u8]) -> Value<'a> {
        Value {
            kind: Kind::Structure(self),
            bytes,
            count: 1,
        }
    }
}

impl<'a> Value<'a> {
    /// Returns a number; `None` for an array or a structure.
    pub fn number(&self) -> Option<Number> {
        self.kind.number(self.bytes)
    }

    /// Returns the bytes of the elements that have a meaning.
    pub fn content(&self) -> &'a [u8] {
        match self.kind {
            Kind::Array(element, _) => &self.bytes[..element.bytes() * self.count],
            _ => self.bytes,
        }
    }

    pub fn elements(&self) -> impl Iterator<Item = Value<'a>> + use<'a> {
        let (kind, content) = match self.kind {
            Kind::Array(kind, _) => (*kind, self.content()),
            kind => (kind, &[][..]),
        };
        content.chunks_exact(kind.bytes()).map(move |bytes| Value {
            kind,
            bytes,
            count: match kind {
                Kind::Array(_, length) => length,
                _ => 1,
            },
        })
    }

    /// Returns the fields of a structure with their names.
    pub fn fields(&self) -> impl Iterator<Item = (&'static str, Value<'a>)> + use<'a> {
        let structure = match self.kind {
            Kind::Structure(structure) => Some(structure),
            _ => None,
        };
        let bytes = self.bytes;
        let fields = structure
            .into_iter()
            .flat_map(|it| it.fields.iter().map(move |of| (it, of)));
        fields.filter_map(move |(structure, field)| {
            Some((field.name, structure.value(field.name, bytes)?))
        })
    }
}

impl Serialize for Value<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.number() {
            Some(Number::Whole(number)) => return serializer.serialize_u64(number),
            Some(Number::Signed(number)) => return serializer.serialize_i64(number),
            Some(Number::Single(number)) => return serializer.serialize_f32(number),
            Some(Number::Double(number)) => return serializer.serialize_f64(number),
            None => {}
        }
        match self.kind {
            Kind::Structure(_) => {
                let mut map = serializer.serialize_map(None)?;
                for (name, value) in self.fields() {
                    map.serialize_entry(name, &value)?;
                }
                map.end()
            }
            _ => {
                let mut list = serializer.serialize_seq(Some(self.count))?;
                for element in self.elements() {
                    list.serialize_element(&element)?;
                }
                list.end()
            }
        }
    }
}
