//! The processes of this machine, as the kernel lists them in `/proc`.

use std::{fs, str::FromStr};

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProcessStat {
    pub pid: u32,
    pub group: u32,
    /// True if it has ended, and nobody has waited for it yet.
    pub has_ended: bool,
    pub cpu_s: f64,
    /// When it was started, ticks of the system since its start: another process that is given the
    /// same number has another time.
    pub started: u64,
}

impl ProcessStat {
    /// Returns a process; `None` if it has ended.
    pub fn of(pid: u32) -> Option<Self> {
        Self::parse(pid, &fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)
    }

    pub fn all() -> impl Iterator<Item = Self> {
        let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
        entries.filter_map(|entry| Self::of(entry.file_name().to_str()?.parse().ok()?))
    }

    /// Parses `/proc/PID/stat`: the name in parentheses, which may hold any characters, then
    /// numbers.
    fn parse(pid: u32, stat: &str) -> Option<Self> {
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let (user, system): (u64, u64) = (field(&fields, 11)?, field(&fields, 12)?);
        Some(Self {
            pid,
            group: field(&fields, 2)?,
            has_ended: matches!(*fields.first()?, "Z" | "X"),
            cpu_s: (user + system) as f64 / rustix::param::clock_ticks_per_second() as f64,
            started: field(&fields, 19)?,
        })
    }
}

fn field<T: FromStr>(fields: &[&str], place: usize) -> Option<T> {
    fields.get(place)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn a_child_is_found_among_all_processes_until_it_has_been_waited_for() {
        let mut child = Command::new("sleep").arg("60").spawn().unwrap();
        let of_child = || ProcessStat::all().find(|it| it.pid == child.id());
        let stat = of_child().unwrap();
        let own = ProcessStat::of(std::process::id()).unwrap();
        assert_eq!(stat.group, own.group);
        assert!(!stat.has_ended && stat.started >= own.started);
        rustix::process::kill_process(
            rustix::process::Pid::from_child(&child),
            rustix::process::Signal::KILL,
        )
        .unwrap();
        while !of_child().unwrap().has_ended {}
        child.wait().unwrap();
        assert_eq!(ProcessStat::of(child.id()), None);
    }

    #[test]
    fn a_name_may_hold_parentheses_and_spaces() {
        let stat = "7 (a) b (c) S 3 5 5 0 -1 4194560 1 2 3 4 150 50 7 8 20 0 1 0 999 1 2";
        let parsed = ProcessStat::parse(7, stat).unwrap();
        assert_eq!((parsed.group, parsed.started), (5, 999));
        assert!(!parsed.has_ended && parsed.cpu_s > 0.0);
        assert_eq!(ProcessStat::parse(7, "7 (a) S 3 5"), None);
    }
}
