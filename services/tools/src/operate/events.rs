//! The lines of `log.jsonl` for a person: `21:04:05.678 WARN masking: sentence, key=value`.

use serde_json::{Map, Value};

/// Returns an event as a line; `None` if it is of another process than `process`, or is no event.
pub fn readable(line: &str, process: Option<&str>) -> Option<String> {
    let event: Map<String, Value> = serde_json::from_str(line).ok()?;
    let text = |value: Option<&Value>| value?.as_str().map(str::to_owned);
    let stage = event.get("span").and_then(|span| span.get("stage"));
    let stage = text(stage).unwrap_or_default();
    if process.is_some_and(|process| process != stage) {
        return None;
    }
    let time = text(event.get("timestamp"))?;
    let level = text(event.get("level"))?;
    let fields = event.get("fields")?.as_object()?;
    let message = text(fields.get("message")).unwrap_or_default();
    let others = fields.iter().filter(|(key, _)| *key != "message");
    let others: String = others
        .map(|(key, value)| format!(", {key}={value}"))
        .collect();
    Some(format!(
        "{} {level} {stage}: {message}{others}",
        clock(&time)
    ))
}

/// Returns the time of day to the millisecond of `2026-11-23T21:04:05.678901Z`.
fn clock(time: &str) -> &str {
    let day = time.split_once('T').map_or(time, |(_, day)| day);
    day.get(..12).unwrap_or(day)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: &str = r#"{"timestamp":"2026-11-23T21:04:05.678901Z","level":"WARN","fields":{"message":"skipped: it is damaged","scan":7},"target":"gyre_stage::source","span":{"stage":"radar-replay","name":"process"},"spans":[]}"#;

    #[test]
    fn an_event_is_a_line_with_its_time_its_process_and_its_fields() {
        let line = "21:04:05.678 WARN radar-replay: skipped: it is damaged, scan=7";
        assert_eq!(readable(LINE, None).as_deref(), Some(line));
        assert_eq!(readable(LINE, Some("radar-replay")).as_deref(), Some(line));
    }

    #[test]
    fn events_of_others_and_what_is_no_event_are_left_out() {
        assert_eq!(readable(LINE, Some("masking")), None);
        assert_eq!(readable("{", None), None);
        assert_eq!(readable("[]", None), None);
    }
}
