//! Lines that fit a terminal.

/// Columns of a terminal that is not asked.
pub const WIDTH: usize = 80;

/// Breaks a text between its words into lines of so many columns at most; a longer word has a line
/// of its own. Line breaks of the text stay.
pub fn wrap(text: &str, columns: usize) -> Vec<String> {
    text.split('\n')
        .flat_map(|paragraph| wrapped(paragraph, columns))
        .collect()
}

fn wrapped(paragraph: &str, columns: usize) -> Vec<String> {
    if paragraph.chars().count() <= columns {
        return vec![paragraph.to_owned()];
    }
    let mut lines = vec![String::new()];
    for word in paragraph.split(' ') {
        let line = lines.last().map_or(0, |line| line.chars().count());
        let is_first = line == 0;
        match lines.last_mut() {
            Some(last) if is_first || line + 1 + word.chars().count() <= columns => {
                if !is_first {
                    last.push(' ');
                }
                last.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_broken_between_words() {
        assert_eq!(wrap("one two three", 7), ["one two", "three"]);
        assert_eq!(wrap("one two three", 13), ["one two three"]);
        assert_eq!(wrap("a very-long-word b", 5), ["a", "very-long-word", "b"]);
        assert_eq!(wrap("a\nb c", 80), ["a", "b c"]);
        assert_eq!(wrap("  a  b", 80), ["  a  b"]);
    }
}
