//! Memory that programs can still get, by the machine and by the control groups of this process.

use std::{
    fs,
    path::{Path, PathBuf},
};

const CGROUPS: &str = "/sys/fs/cgroup";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Bytes that programs of the machine can still allocate, if the kernel reports them.
    pub available: Option<u64>,
    /// The lowest limit of the control groups, bytes.
    pub limit: Option<u64>,
    /// The least that the control groups leave, bytes.
    pub left: Option<u64>,
}

impl Room {
    pub fn now() -> Self {
        let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
        let groups = limits(Path::new(CGROUPS), &groups);
        Self {
            available: available(&fs::read_to_string("/proc/meminfo").unwrap_or_default()),
            limit: groups.iter().map(|group| group.limit).min(),
            left: groups
                .iter()
                .map(|group| group.limit.saturating_sub(group.used))
                .min(),
        }
    }

    pub fn least(&self) -> Option<u64> {
        self.available.into_iter().chain(self.left).min()
    }
}

fn available(meminfo: &str) -> Option<u64> {
    let line = meminfo
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kilobytes * 1024)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Group {
    limit: u64,
    used: u64,
}

/// Returns the limits of the control groups in `/proc/self/cgroup` (version 1 or 2) and of those
/// above them.
fn limits(root: &Path, groups: &str) -> Vec<Group> {
    let hierarchies = groups.lines().filter_map(|line| {
        let mut fields = line.splitn(3, ':').skip(1);
        let (controllers, group) = (fields.next()?, fields.next()?.trim_start_matches('/'));
        match controllers {
            "" => Some((root.to_owned(), group.to_owned(), V2)),
            "memory" => Some((root.join("memory"), group.to_owned(), V1)),
            _ => None,
        }
    });
    let folders = hierarchies.flat_map(|(root, group, files)| {
        let above: Vec<PathBuf> = Path::new(&group)
            .ancestors()
            .map(|it| root.join(it))
            .collect();
        above.into_iter().map(move |folder| (folder, files))
    });
    let number = |path: PathBuf| fs::read_to_string(path).ok()?.trim().parse().ok();
    folders
        .filter_map(|(folder, (limit, used))| {
            Some(Group {
                limit: number(folder.join(limit))?,
                used: number(folder.join(used)).unwrap_or(0),
            })
        })
        // Version 1 writes the largest multiple of a page where there is no limit.
        .filter(|group| group.limit < i64::MAX as u64 / 2)
        .collect()
}

type Files = (&'static str, &'static str);
const V2: Files = ("memory.max", "memory.current");
const V1: Files = ("memory.limit_in_bytes", "memory.usage_in_bytes");

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_limits_of_the_groups_above_count() {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write("user/session/memory.max", "max\n");
        write("user/memory.max", "5000000\n");
        write("user/memory.current", "1000000\n");
        write("memory/box/memory.limit_in_bytes", "3000000\n");
        write("memory/memory.limit_in_bytes", "9223372036854771712\n");
        let groups = |groups| limits(root.path(), groups);
        let group = |limit, used| Group { limit, used };
        assert_eq!(groups("0::/user/session\n"), [group(5_000_000, 1_000_000)]);
        assert_eq!(
            groups("8:pids:/\n4:memory:/box\n0::/\n"),
            [group(3_000_000, 0)]
        );
        assert_eq!(groups("4:memory:/\n"), []);
        assert_eq!(groups(""), []);
    }

    #[test]
    fn available_memory_is_in_meminfo() {
        let meminfo = "MemTotal:  100 kB\nMemAvailable:   42 kB\n";
        assert_eq!(available(meminfo), Some(42 * 1024));
        assert_eq!(available("MemTotal: 100 kB"), None);
    }
}
