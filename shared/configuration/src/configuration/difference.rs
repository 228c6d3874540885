//! Comparison of a configuration with the one that a run was begun with.

use toml::{Table, Value};

/// Returns the first difference, as `masking.threshold was 60 and is now 70`.
pub fn first(begun: &Table, now: &Table) -> Option<String> {
    let keys: std::collections::BTreeSet<&String> = begun.keys().chain(now.keys()).collect();
    keys.into_iter()
        .find_map(|key| of_key(key, begun.get(key), now.get(key)))
}

fn of_key(key: &str, begun: Option<&Value>, now: Option<&Value>) -> Option<String> {
    let empty = Table::new();
    let tables = [begun, now].map(|value| value.and_then(Value::as_table));
    match tables {
        [None, None] if begun == now => None,
        [None, None] => {
            let shown = |value: Option<&Value>| value.map_or("unset".to_owned(), Value::to_string);
            Some(format!(
                "{key} was {} and is now {}",
                shown(begun),
                shown(now)
            ))
        }
        [begun, now] => first(begun.unwrap_or(&empty), now.unwrap_or(&empty))
            .map(|difference| format!("{key}.{difference}")),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_first_key_that_differs_is_named_with_both_values() {
        let table = |text: &str| text.parse::<Table>().unwrap();
        let begun = table("[masking]\nthreshold = 60\n[raster]\nn = 127");
        assert_eq!(first(&begun, &begun), None);
        let named = |text: &str| first(&begun, &table(text)).unwrap();
        assert_eq!(
            named("[masking]\nthreshold = 70\n[raster]\nn = 255"),
            "masking.threshold was 60 and is now 70"
        );
        assert_eq!(
            named("[masking]\nthreshold = 60\n[raster]\nn = 127\n[simulation]\nseed = 2"),
            "simulation.seed was unset and is now 2"
        );
        assert_eq!(
            named("[masking]\nthreshold = 60"),
            "raster.n was 127 and is now unset"
        );
    }
}
