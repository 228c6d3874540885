//! Edits of bytes and texts.

use bolero::TypeGenerator;

/// An edit of bytes at a place, which is taken modulo the length.
#[derive(Clone, Debug, TypeGenerator)]
pub enum ByteEdit {
    Set(u32, u8),
    Flip(u32, u8),
    /// Replaces eight bytes by a number.
    Word(u32, Number),
    /// Inserts a byte some times.
    Insert(u32, u8, u8),
    Remove(u32, u8),
    Repeat(u32, u8),
    /// Cuts all that follows.
    Truncate(u32),
}

/// A number that often reveals faults of programs.
#[derive(Clone, Copy, Debug, TypeGenerator)]
pub enum Number {
    Any(u64),
    /// A small number, or a small negative one.
    Small(i8),
    /// A power of two, more or less.
    NearPower(u8, i8),
    /// One of `FLOATS`.
    Float(u8),
}

/// Floating-point numbers that often reveal faults of programs, with spaces between.
const FLOATS: &str = "0 -0 1 -1 nan inf -inf 1.7976931348623157e308 -1.7976931348623157e308 \
    2.2250738585072014e-308 1e20 -1e154";

impl Number {
    pub fn bits(self) -> u64 {
        match self {
            Self::Any(bits) => bits,
            Self::Small(number) => i64::from(number) as u64,
            Self::NearPower(power, by) => {
                (1_u64 << (power % 64)).wrapping_add_signed(i64::from(by))
            }
            Self::Float(index) => {
                let number: f64 = word(FLOATS, index).parse().unwrap_or_default();
                number.to_bits()
            }
        }
    }

    pub fn f64(self) -> f64 {
        match self {
            Self::Any(_) | Self::Float(_) => f64::from_bits(self.bits()),
            Self::Small(number) => f64::from(number) * 0.1,
            Self::NearPower(power, by) => 2f64.powi(i32::from(power) - 128) * f64::from(by),
        }
    }
}

fn change(bytes: &mut [u8], at: usize, to: impl Fn(u8) -> u8) {
    if let Some(byte) = bytes.get_mut(at) {
        *byte = to(*byte);
    }
}

pub fn edit_bytes(bytes: &mut Vec<u8>, edits: &[ByteEdit]) {
    for edit in edits {
        let len = bytes.len();
        let place = |at: u32| at as usize % (len + 1);
        match *edit {
            ByteEdit::Set(at, byte) => change(bytes, place(at), |_| byte),
            ByteEdit::Flip(at, bit) => change(bytes, place(at), |it| it ^ (1 << (bit % 8))),
            ByteEdit::Word(at, number) => {
                let word = number.bits().to_le_bytes();
                let there = bytes[place(at)..].iter_mut();
                there.zip(word).for_each(|(it, byte)| *it = byte);
            }
            ByteEdit::Insert(at, byte, times) => {
                let place = place(at);
                bytes.splice(place..place, vec![byte; times.into()]);
            }
            ByteEdit::Remove(at, count) => {
                let place = place(at);
                bytes.drain(place..len.min(place + usize::from(count)));
            }
            ByteEdit::Repeat(at, count) => {
                let place = place(at);
                let part = bytes[place..len.min(place + usize::from(count))].to_vec();
                bytes.splice(place..place, part);
            }
            ByteEdit::Truncate(at) => bytes.truncate(place(at)),
        }
    }
}

/// An edit of a text. Lines and words are taken modulo their number.
#[derive(Clone, Debug, TypeGenerator)]
pub enum TextEdit {
    /// Replaces a word of a line by one of `WORDS`.
    Word(u16, u8, u8),
    /// Replaces a number of a line by another.
    Number(u16, u8, Number),
    /// Inserts a line of such a word.
    Line(u16, u8),
    RemoveLine(u16),
    RepeatLine(u16),
    SwapLines(u16, u16),
    /// Edits the bytes; invalid UTF-8 is then replaced.
    Bytes(ByteEdit),
    /// Writes the text as another program does: see `WAYS`.
    Way(u8),
}

/// Exchanges as spreadsheets and editors make them: decimal commas, separators, ends of lines.
const WAYS: [(&str, &str); 7] = [
    (".", ","),
    (",", ";"),
    (" ", ";"),
    (" ", "\t"),
    (",", " , "),
    (" ", "  "),
    ("\n", "\r\n"),
];
/// A byte order mark, before a text.
const MARK: char = '\u{feff}';

/// Words that often reveal faults of parsers, with spaces between; the first is empty.
const WORDS: &str = " 0 -0 -1 1 nan NaN inf -inf 1e308 -1e308 1e-320 1e400 9223372036854775807 \
    -9223372036854775808 18446744073709551616 4294967296 1547131046000000 1547131046.5 \
    1547131046000000000 . - \" ' [ ] {} [[a]] = # , ,,,,,,,,,,,, \t true false null [1,2] \
    ä€\u{1f980} \u{0} \u{202e}";

fn word(words: &str, index: u8) -> &str {
    let count = words.split(' ').count();
    words
        .split(' ')
        .nth(usize::from(index) % count)
        .unwrap_or_default()
}

pub fn edit_text(text: &str, edits: &[TextEdit]) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for edit in edits {
        let count = lines.len().max(1);
        let place = |at: u16| usize::from(at) % count;
        match edit {
            TextEdit::Word(line, at, by) => {
                replace(&mut lines, place(*line), *at, word(WORDS, *by))
            }
            TextEdit::Number(line, at, by) => {
                let number = match by {
                    Number::Float(_) => format!("{:e}", by.f64()),
                    _ => (by.bits() as i64).to_string(),
                };
                replace(&mut lines, place(*line), *at, &number);
            }
            TextEdit::Line(at, by) => lines.insert(place(*at), word(WORDS, *by).to_owned()),
            TextEdit::RemoveLine(_) | TextEdit::RepeatLine(_) | TextEdit::SwapLines(..)
                if lines.is_empty() => {}
            TextEdit::RemoveLine(at) => drop(lines.remove(place(*at))),
            TextEdit::RepeatLine(at) => {
                let at = place(*at);
                lines.insert(at, lines[at].clone());
            }
            TextEdit::SwapLines(one, two) => lines.swap(place(*one), place(*two)),
            TextEdit::Way(way) => match WAYS.get(usize::from(*way) % (WAYS.len() + 1)) {
                Some((from, to)) => {
                    let text = (lines.join("\n") + "\n").replace(from, to);
                    lines = text.split('\n').map(str::to_owned).collect();
                }
                None => lines.first_mut().map_or((), |line| line.insert(0, MARK)),
            },
            TextEdit::Bytes(edit) => {
                let mut bytes = lines.join("\n").into_bytes();
                edit_bytes(&mut bytes, std::slice::from_ref(edit));
                let text = String::from_utf8_lossy(&bytes);
                lines = text.lines().map(str::to_owned).collect();
            }
        }
    }
    lines.join("\n") + "\n"
}

/// Replaces a word of a line: what lies between separators.
fn replace(lines: &mut [String], line: usize, word: u8, by: &str) {
    let Some(line) = lines.get_mut(line) else {
        return;
    };
    let is_separator = |c: char| c.is_whitespace() || ",=[]{}\"".contains(c);
    let words = line.split(is_separator).filter(|word| !word.is_empty());
    let words: Vec<&str> = words.collect();
    if let Some(chosen) = words.get(usize::from(word) % words.len().max(1)) {
        // The words are slices of the line.
        let start = chosen.as_ptr() as usize - line.as_ptr() as usize;
        let end = start + chosen.len();
        line.replace_range(start..end, by);
    }
}
