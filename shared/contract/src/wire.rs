//! Types whose bytes travel between processes. Each type has a description, its [`Structure`]. The
//! checks of messages, the values by name and the layout for other languages use the description.

mod bounds;
mod codes;
mod value;

use bytemuck::Pod;

pub use bounds::{Bounds, Number, REACH, REACH_M};
pub(crate) use bounds::{field, require};
pub(crate) use codes::codes;
pub use value::Value;

use crate::limits::Limits;

/// A type whose bytes are part of a message.
pub trait Wire: Pod {
    const KIND: Kind;
}

/// A structure of a message.
pub trait Described: Wire {
    const STRUCTURE: Structure;
}

#[derive(Clone, Copy, Debug)]
pub enum Kind {
    U8,
    U16,
    U32,
    U64,
    I64,
    F32,
    F64,
    Array(&'static Kind, usize),
    Structure(&'static Structure),
}

#[derive(Clone, Copy, Debug)]
pub struct Structure {
    pub name: &'static str,
    /// The name with a version that the transport compares.
    pub type_name: &'static str,
    pub doc: &'static [&'static str],
    pub bytes: usize,
    pub fields: &'static [Field],
}

#[derive(Clone, Copy, Debug)]
pub struct Field {
    pub name: &'static str,
    pub kind: Kind,
    /// Bytes from the begin of the structure.
    pub offset: usize,
    pub doc: &'static [&'static str],
    pub bounds: Bounds,
}

impl Kind {
    pub const fn bytes(&self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
            Self::Array(element, count) => element.bytes() * *count,
            Self::Structure(structure) => structure.bytes,
        }
    }

    /// Reads a number; `None` for an array or a structure.
    fn number(&self, bytes: &[u8]) -> Option<Number> {
        let read = bytemuck::pod_read_unaligned::<u64>;
        Some(match self {
            Self::U8 => Number::Whole(bytes[0].into()),
            Self::U16 => Number::Whole(bytemuck::pod_read_unaligned::<u16>(bytes).into()),
            Self::U32 => Number::Whole(bytemuck::pod_read_unaligned::<u32>(bytes).into()),
            Self::U64 => Number::Whole(read(bytes)),
            Self::I64 => Number::Signed(read(bytes) as i64),
            Self::F32 => Number::Single(bytemuck::pod_read_unaligned(bytes)),
            Self::F64 => Number::Double(f64::from_bits(read(bytes))),
            Self::Array(..) | Self::Structure(_) => return None,
        })
    }
}

impl Structure {
    /// Returns a field by its name.
    pub const fn field(&self, name: &str) -> Option<&'static Field> {
        let mut index = 0;
        while index < self.fields.len() {
            if is_same(self.fields[index].name, name) {
                return Some(&self.fields[index]);
            }
            index += 1;
        }
        None
    }

    /// Checks that each field is within its bounds. A violation is a sentence with the field, its
    /// value and its bounds.
    pub fn check(&self, bytes: &[u8], limits: &Limits) -> Result<(), String> {
        let mut fields = self.fields.iter();
        fields.try_for_each(|it| field(it.name, it.check(self, bytes, limits)))
    }

    /// Returns the number of elements of an array that have a meaning: see [`Bounds::CountedBy`].
    fn counted(&self, field: &Field, bytes: &[u8], length: usize) -> usize {
        let Bounds::CountedBy(name) = field.bounds else {
            return length;
        };
        let count = self.field(name).and_then(|it| it.number(bytes));
        count.map_or(length, |it| it.as_f64() as usize).min(length)
    }
}

/// Compares strings in a constant.
const fn is_same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut at = 0;
    while at < one.len() && at < other.len() && one[at] == other[at] {
        at += 1;
    }
    at == one.len() && at == other.len()
}

impl Field {
    fn content<'a>(&self, bytes: &'a [u8]) -> &'a [u8] {
        &bytes[self.offset..][..self.kind.bytes()]
    }

    fn number(&self, bytes: &[u8]) -> Option<Number> {
        self.kind.number(self.content(bytes))
    }

    /// Checks the field; a violation begins behind the field's name.
    fn check(&self, of: &Structure, bytes: &[u8], limits: &Limits) -> Result<(), String> {
        let content = self.content(bytes);
        match self.kind {
            Kind::Structure(part) => part
                .check(content, limits)
                .map_err(|violation| format!(".{violation}")),
            Kind::Array(element, length) => match self.bounds {
                Bounds::Any if !matches!(element, Kind::Structure(_)) => Ok(()),
                whole if whole.is_of_all() => whole.check_all(content, limits),
                bounds => {
                    let count = of.counted(self, bytes, length);
                    let elements = content.chunks_exact(element.bytes()).take(count);
                    elements.enumerate().try_for_each(|(index, content)| {
                        let checked = match element {
                            Kind::Structure(part) => part
                                .check(content, limits)
                                .map_err(|violation| format!(".{violation}")),
                            number => bounds.check(number.number(content), limits),
                        };
                        checked.map_err(|violation| format!("[{index}]{violation}"))
                    })
                }
            },
            number => self.bounds.check(number.number(content), limits),
        }
    }
}

macro_rules! numbers {
    ($($number:ty: $kind:ident),+) => {
        $(impl Wire for $number {
            const KIND: Kind = Kind::$kind;
        })+
    };
}
numbers!(u8: U8, u16: U16, u32: U32, u64: U64, i64: I64, f32: F32, f64: F64);

impl<T: Wire, const N: usize> Wire for [T; N]
where
    [T; N]: Pod,
{
    const KIND: Kind = Kind::Array(&T::KIND, N);
}

/// Describes types that are defined elsewhere.
macro_rules! describe {
    ($(
        $(#[doc = $doc:literal])*
        $Name:ident = $type_name:literal {
            $($(#[doc = $of_field:literal])* $field:ident: $kind:ty $([$bounds:expr])?,)*
        }
    )*) => {
        $(
            impl $crate::wire::Described for $Name {
                const STRUCTURE: $crate::wire::Structure = $crate::wire::Structure {
                    name: stringify!($Name),
                    type_name: $type_name,
                    doc: &[$($doc),*],
                    bytes: size_of::<Self>(),
                    fields: &[$($crate::wire::Field {
                        name: stringify!($field),
                        kind: <$kind as $crate::wire::Wire>::KIND,
                        offset: std::mem::offset_of!(Self, $field),
                        doc: &[$($of_field),*],
                        bounds: $crate::wire::describe!(@bounds $($bounds)?),
                    }),*],
                };
            }

            impl $crate::wire::Wire for $Name {
                const KIND: $crate::wire::Kind =
                    $crate::wire::Kind::Structure(&<$Name as $crate::wire::Described>::STRUCTURE);
            }
        )*
    };
    (@bounds) => { $crate::wire::Bounds::Any };
    (@bounds $bounds:expr) => { $bounds };
}
pub(crate) use describe;

/// Defines structures with their description. Behind a field are its bounds; without them each
/// value is valid.
macro_rules! wire {
    ($(
        $(#[doc = $doc:literal])*
        pub struct $Name:ident = $type_name:literal {
            $($(#[doc = $of_field:literal])* pub $field:ident: $kind:ty $([$bounds:expr])?,)*
        }
    )*) => {
        $(
            $(#[doc = $doc])*
            #[repr(C)]
            #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
            pub struct $Name {
                $($(#[doc = $of_field])* pub $field: $kind,)*
            }

            impl Default for $Name {
                fn default() -> Self {
                    bytemuck::Zeroable::zeroed()
                }
            }

            $crate::wire::describe! {
                $(#[doc = $doc])*
                $Name = $type_name {
                    $($(#[doc = $of_field])* $field: $kind $([$bounds])?,)*
                }
            }
        )*
    };
}
pub(crate) use wire;

#[cfg(test)]
mod tests;
