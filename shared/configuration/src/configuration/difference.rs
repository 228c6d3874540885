//! Comparison of a configuration with the one that a run was begun with.

use std::collections::{BTreeMap, BTreeSet};

use toml::{Table, Value};

/// Returns the values of all keys by their whole names, as `masking.threshold`.
pub fn keys(table: &Table) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    collect("", table, &mut found);
    found
}

fn collect(section: &str, table: &Table, found: &mut BTreeMap<String, String>) {
    for (name, value) in table {
        let key = match section {
            "" => name.clone(),
            _ => format!("{section}.{name}"),
        };
        match value {
            Value::Table(table) => collect(&key, table, found),
            value => drop(found.insert(key, value.to_string())),
        }
    }
}

/// Returns the first difference, as `masking.threshold was 60 and is now 70`.
pub fn first(begun: &Table, now: &Table) -> Option<String> {
    let (begun, now) = (keys(begun), keys(now));
    let all: BTreeSet<&String> = begun.keys().chain(now.keys()).collect();
    let differs = |key: &&String| begun.get(*key) != now.get(*key);
    let key = all.into_iter().find(differs)?;
    let [was, is] = [&begun, &now].map(|it| it.get(key).map_or("unset", String::as_str));
    Some(format!("{key} was {was} and is now {is}"))
}

#[cfg(test)]
mod tests {
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
