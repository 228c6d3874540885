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

/// Breaks lines of names and values like [`wrap`]; a value continues below its own column.
pub fn wrap_values(text: &str, columns: usize) -> Vec<String> {
    let lines = text.split('\n').flat_map(|line| {
        let (name, value) = line.split_at(value_start(line, columns / 2));
        let indent = name.chars().count();
        let values = wrapped(value, columns - indent).into_iter().enumerate();
        values.map(move |(number, value)| match number {
            0 => format!("{name}{value}"),
            _ => format!("{:indent$}{value}", ""),
        })
    });
    lines.collect()
}

/// Returns where the value of a line begins, in bytes: behind the last gap of two spaces or more
/// within so many columns, and the sign of a list.
fn value_start(line: &str, columns: usize) -> usize {
    let reach = line
        .char_indices()
        .nth(columns)
        .map_or(line.len(), |it| it.0);
    let gap = line[..reach].rfind("  ").map_or(0, |gap| gap + 2);
    let start = gap + line[gap..].len() - line[gap..].trim_start().len();
    let sign = ["- ", "-> "]
        .iter()
        .find(|sign| line[start..].starts_with(**sign));
    start + sign.map_or(0, |sign| sign.len())
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

    #[test]
    fn values_go_on_below_themselves() {
        let text =
            "ok    memory  one two three four five six\n              -> do this or that\n  - ä b";
        let expected = [
            "ok    memory  one two three",
            "              four five six",
            "              -> do this or",
            "                 that",
            "  - ä b",
        ];
        assert_eq!(wrap_values(text, 28), expected);
        assert_eq!(wrap_values("  stamps   a b\n", 80), ["  stamps   a b", ""]);
        assert_eq!(wrap_values("one two three", 7), ["one two", "three"]);
    }
}
