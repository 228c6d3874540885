//! The machine and the date of a measurement.

use std::{
    fmt, fs, thread,
    time::{SystemTime, UNIX_EPOCH},
};

use serde::Serialize;

#[derive(Debug, Serialize)]
pub struct Machine {
    pub processor: String,
    pub cores: usize,
}

impl Machine {
    pub fn this() -> Self {
        let model = |text: String| {
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        };
        let processor = fs::read_to_string("/proc/cpuinfo").ok().and_then(model);
        Self {
            processor: processor.unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: thread::available_parallelism().map_or(1, usize::from),
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.cores == 1 { "" } else { "s" };
        write!(f, "{}, {} core{plural}", self.processor, self.cores)
    }
}

/// Today's date (UTC) as `2024-02-29`.
pub fn today() -> String {
    date(seconds(SystemTime::now()) / DAY_S)
}

/// Returns a time (UTC) as a part of the name of a file: `2024-02-29T21-04-05Z`.
pub fn file_time(time: SystemTime) -> String {
    let (day, of_day) = (seconds(time) / DAY_S, seconds(time) % DAY_S);
    let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{}T{hour:02}-{minute:02}-{second:02}Z", date(day))
}

const DAY_S: u64 = 86_400;

fn seconds(time: SystemTime) -> u64 {
    time.duration_since(UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs()
}

/// The Gregorian date of a day counted from 1970-01-01: years begin in March here, so that a leap
/// day is a year's last.
fn date(day: u64) -> String {
    const DAYS_TO_1970: u64 = 719_468; // from March 1 of the year 0
    const CYCLE: u64 = 146_097; // days of 400 years
    let day = day + DAYS_TO_1970;
    let (cycle, of_cycle) = (day / CYCLE, day % CYCLE);
    let year = (of_cycle - of_cycle / 1_460 + of_cycle / 36_524 - of_cycle / 146_096) / 365;
    let of_year = of_cycle - (365 * year + year / 4 - year / 100);
    let from_march = (5 * of_year + 2) / 153;
    let (month, next) = match from_march < 10 {
        true => (from_march + 3, 0),
        false => (from_march - 9, 1),
    };
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    format!("{:04}-{month:02}-{day:02}", cycle * 400 + year + next)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_time_in_a_name_has_its_date_and_its_time_of_day() {
        let time = UNIX_EPOCH + Duration::from_secs(11_016 * DAY_S + 75_845);
        assert_eq!(file_time(time), "2000-02-29T21-04-05Z");
    }

    #[test]
    fn days_become_dates_leap_days_included() {
        for (day, expected) in [
            (0, "1970-01-01"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (19_783, "2024-03-01"),
            (20_088, "2024-12-31"),
            (47_541, "2100-03-01"),
        ] {
            assert_eq!(date(day), expected, "{day}");
        }
    }
}
