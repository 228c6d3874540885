//! Memory that programs can still get, by the machine and by the control groups of this process.

use std::{
    fs,
    path::{Path, PathBuf},
};

const CGROUPS: &str = "/sys/fs/cgroup";

/// Returns the bytes that programs can still allocate: the least that the machine and the control
/// groups leave, as far as the kernel reports it.
pub fn left() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let left = left_by_groups(Path::new(CGROUPS), &groups);
    let meminfo = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    available(&meminfo).into_iter().chain(left).min()
}

fn available(meminfo: &str) -> Option<u64> {
    let line = meminfo
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kilobytes * 1024)
}

/// Returns the memory, bytes, that the control groups in `/proc/self/cgroup` (version 1 or 2)
/// leave, and the groups above them that have a limit.
fn left_by_groups(root: &Path, groups: &str) -> Vec<u64> {
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
    let number =
        |path: PathBuf| -> Option<u64> { fs::read_to_string(path).ok()?.trim().parse().ok() };
    folders
        .filter_map(|(folder, (limit, used))| {
            let limit = number(folder.join(limit))?;
            let used = number(folder.join(used)).unwrap_or(0);
            // Version 1 writes the largest multiple of a page where there is no limit.
            (limit < i64::MAX as u64 / 2).then(|| limit.saturating_sub(used))
        })
        .collect()
}

type Files = (&'static str, &'static str);
const V2: Files = ("memory.max", "memory.current");
const V1: Files = ("memory.limit_in_bytes", "memory.usage_in_bytes");

#[cfg(test)]
mod tests {
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
        for (groups, left) in [
            ("0::/user/session\n", vec![4_000_000]),
            ("8:pids:/\n4:memory:/box\n0::/\n", vec![3_000_000]),
            ("4:memory:/\n", vec![]),
            ("", vec![]),
        ] {
            assert_eq!(left_by_groups(root.path(), groups), left, "{groups}");
        }
    }

    #[test]
    fn available_memory_is_in_meminfo() {
        let meminfo = "MemTotal:  100 kB\nMemAvailable:   42 kB\n";
        assert_eq!(available(meminfo), Some(42 * 1024));
        assert_eq!(available("MemTotal: 100 kB"), None);
    }
}
