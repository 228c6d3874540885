//! Wrong values of a file or an override, in the words of a person.

/// Returns a deserialiser's message on the value of `key` in plain words; `None` if the message
/// does not report a wrong type.
pub fn in_plain_words(key: &str, message: &str) -> Option<String> {
    if let Some(variants) = message.strip_prefix("unknown variant ") {
        let (found, expected) = variants.split_once(", expected ")?;
        let found = clipped(found);
        return Some(format!("{key} is {found}, but must be {expected}"));
    }
    let types = message
        .strip_prefix("invalid type: ")
        .or_else(|| message.strip_prefix("invalid value: "))?;
    let (found, expected) = types.rsplit_once(", expected ")?;
    let (kind, value) = match found.find(['"', '`']) {
        Some(start) => (&found[..start], Some(&found[start..])),
        None => (found, None),
    };
    let found = value.unwrap_or(match kind {
        "sequence" => "a list",
        "map" => "a section",
        _ => "of another kind",
    });
    let must = must_be(expected, value.filter(|_| kind == "string "));
    Some(format!("{key} is {}, but must be {must}", clipped(found)))
}

/// Returns the begin of a word that is longer than a line, so that a sentence with it stays
/// readable.
pub fn clipped(word: &str) -> String {
    match word.char_indices().nth(100) {
        Some((at, _)) => format!("{}...", &word[..at]),
        None => word.to_owned(),
    }
}

fn must_be(expected: &str, text: Option<&str>) -> String {
    let fixed = match expected {
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" | "u64" | "usize" => "a whole number, 0 or more",
        "a nonzero u32" | "a nonzero u64" | "a nonzero usize" => "a whole number, 1 or more",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "f32" | "f64" => "a number",
        "a boolean" => "true or false",
        "a string" | "string only" | "path string" => "a text",
        "a map" => "a section of keys",
        "a sequence" => {
            let example = text.filter(|it| it.len() < 100).unwrap_or("\"a\"");
            return format!("a list, as in [{example}]");
        }
        _ if expected.starts_with("struct ") => "a section of keys",
        _ => return expected.replace("an array of length", "a list of the length"),
    };
    fixed.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_of_another_kind_is_named_with_what_it_must_be() {
        for case in [
            "invalid value: integer `300`, expected u8|`300`|a whole number from 0 to 255",
            "invalid type: floating point `1.5`, expected usize|`1.5`|a whole number, 0 or more",
            "invalid type: string \"./x\", expected a sequence|\"./x\"|a list, as in [\"./x\"]",
            "invalid type: string \"a, expected b\", expected f32|\"a, expected b\"|a number",
            "invalid type: sequence, expected a boolean|a list|true or false",
            "invalid type: unit variant, expected string only|of another kind|a text",
            "unknown variant `graf`, expected one of `none`, `graph`|`graf`|one of `none`, `graph`",
            "invalid type: map, expected an array of length 3|a section|a list of the length 3",
        ] {
            let parts: Vec<&str> = case.split('|').collect();
            let said = in_plain_words("threshold", parts[0]).unwrap_or_default();
            let [found, expected] = [parts[1], parts[2]];
            let words = format!("threshold is {found}, but must be {expected}");
            assert_eq!(said, words);
        }
        let long = format!(
            "unknown variant `{}`, expected `none`",
            "\u{fffd}".repeat(200)
        );
        let said = in_plain_words("kind", &long).unwrap_or_default();
        assert!(said.len() < 350 && said.ends_with("..., but must be `none`"));
        for other in ["missing field `sha256`", "rate is `abc`, but must be `max`"] {
            assert_eq!(in_plain_words("rate", other), None);
        }
    }
}
