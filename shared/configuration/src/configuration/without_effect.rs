//! Keys that are set and change nothing.

use toml::{Table, Value};

use super::Configuration;

/// The kinds of a sensor that give one of its keys an effect; the other keys have an effect with
/// all kinds except `none`.
const OF_KINDS: [(&str, &[&str]); 3] = [
    ("file", &["log"]),
    ("topic", &["auto", "ros2"]),
    ("listen", &["udp", "ros2"]),
];

impl Configuration {
    /// Returns a sentence for each of these overrides that has no effect, since the kind of its
    /// section is another.
    pub fn without_effect(&self, overrides: &[String]) -> Result<Vec<String>, toml::ser::Error> {
        let table = Table::try_from(self)?;
        let sentence = |setting: &String| {
            let (name, _) = setting.split_once('=')?;
            let (section, key) = name.trim().rsplit_once('.')?;
            let mut parts = section.split('.');
            let section_of = table.get(parts.next()?)?;
            let found = parts.try_fold(section_of, |value, part| value.get(part))?;
            let kind = found.get("kind").and_then(Value::as_str)?;
            let kinds = OF_KINDS.iter().find(|(of, _)| *of == key);
            let kinds =
                kinds.filter(|_| self.sensors().iter().any(|it| it.of().section() == section));
            let has_effect = match kinds {
                Some((_, kinds)) => kinds.contains(&kind),
                None => kind != "none" || key == "kind",
            };
            (!has_effect).then(|| {
                let wanted = kinds.map_or(String::new(), |(_, kinds)| {
                    format!(": it needs `{}`", kinds.join("` or `"))
                });
                format!("{section}.{key} is set and has no effect, since {section}.kind is `{kind}`{wanted}")
            })
        };
        Ok(overrides.iter().filter_map(sentence).collect())
    }
}
