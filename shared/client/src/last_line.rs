//! The reason that a program has printed before its end.

/// The line before the frames of a panic.
const BACKTRACE: &str = "\nstack backtrace:\n";

/// Returns the last line that is not empty: an ended program's own reason. A panic's backtrace, and
/// notes such as the one on how to get it, give no reason.
pub fn last_line(text: &str) -> Option<&str> {
    let is_silent = |line: &str| line.trim().is_empty() || line.starts_with("note: ");
    let traced = text.rfind(BACKTRACE).filter(|begin| {
        let frames = &text[begin + BACKTRACE.len()..];
        frames
            .lines()
            .all(|line| is_silent(line) || line.starts_with(' '))
    });
    let said = &text[..traced.unwrap_or(text.len())];
    said.lines().rfind(|line| !is_silent(line))
}

#[cfg(test)]
mod tests {
    use super::last_line;

    #[test]
    fn a_panic_is_said_by_its_message_with_a_backtrace_and_without() {
        let said = "begins\nthread 'main' (7) panicked at src/main.rs:3:5:\nit is 18, not 10\n";
        let note =
            "note: run with `RUST_BACKTRACE=1` environment variable to display a backtrace\n";
        let frames =
            "stack backtrace:\n   0: main\n             at ./src/main.rs:3\nnote: details\n";
        for ending in ["", note, frames] {
            let line = last_line(&format!("{said}{ending}")).map(str::to_owned);
            assert_eq!(line.as_deref(), Some("it is 18, not 10"), "{ending}");
        }
        let caught = format!("{said}{frames}cannot open the radar\n");
        assert_eq!(last_line(&caught), Some("cannot open the radar"));
    }
}
