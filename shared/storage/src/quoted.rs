//! Words of a file in error messages.

/// Characters that are quoted at most: a damaged file may have no line breaks.
const MOST: usize = 40;

/// Quotes the start of a text of a file for an error message; what cannot be printed is escaped.
pub fn quoted(text: &str) -> String {
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{:?}...", &text[..end]),
        None => format!("{text:?}"),
    }
}
