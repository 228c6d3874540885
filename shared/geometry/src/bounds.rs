use thiserror::Error;

#[derive(Clone, Debug, PartialEq, Error)]
#[error("{section}.{key} is {value}, but must be {expected}")]
pub struct SettingError {
    pub section: &'static str,
    pub key: &'static str,
    pub value: f64,
    pub expected: &'static str,
}

/// The least and the largest value, and the bounds in words.
pub type Bounds = ([f64; 2], &'static str);

pub(crate) const DELAY: Bounds = ([-1e6, 1e6], "seconds, at most a million");
pub(crate) const WAIT: Bounds = ([0.0, 1e3], "milliseconds, 0 to 1000");
pub(crate) const SCALE: Bounds = ([0.5, 2.0], "a factor, 0.5 to 2");
pub(crate) const SHARE: Bounds = ([0.0, 1.0], "a share, 0 to 1");
pub(crate) const NOISE: Bounds = ([0.0, 1.0], "0 to 1");
pub(crate) const GAP: Bounds = ([1e-3, 10.0], "seconds, 0.001 to 10");

pub fn check(
    section: &'static str,
    key: &'static str,
    value: f64,
    ([least, most], expected): Bounds,
) -> Result<(), SettingError> {
    match (least..=most).contains(&value) {
        true => Ok(()),
        false => Err(SettingError {
            section,
            key,
            value,
            expected,
        }),
    }
}

/// Checks fields of the settings of a section in their order. The name of a field is its key.
#[macro_export]
macro_rules! check_bounds {
    ($config:ident, $section:literal: $($field:ident in $bounds:expr),+ $(,)?) => {
        $($crate::check($section, stringify!($field), f64::from($config.$field), $bounds)?;)+
    };
}
