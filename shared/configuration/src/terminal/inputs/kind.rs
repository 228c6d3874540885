//! The kinds of words of the command line.

use std::{
    fs::File,
    io::{self, Read},
    net::{IpAddr, SocketAddr},
    path::Path,
};

use crate::paths::shipped;

/// The endings of files that hold scans.
const RECORDINGS: [&str; 3] = ["mcap", "db3", "bag"];
/// Bytes at the start of a file that decide whether it is a text: a text has no zero byte.
const START: u64 = 4096;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A configuration: a file, or the name of one in the program.
    Configuration,
    Data,
    Results,
    Radar,
    Unknown,
}

impl Kind {
    /// Existing files go before the names in the program, and those before the form.
    pub fn of(word: &Path) -> Self {
        let ending = word.extension().and_then(|ending| ending.to_str());
        let is_recording = ending.is_some_and(|ending| RECORDINGS.contains(&ending));
        let text = word.to_str().unwrap_or_default();
        if word.is_dir() {
            let is_of_run = word.join("config.toml").is_file() && word.join("journal").is_dir();
            return match is_of_run {
                true => Self::Results,
                false => Self::Data,
            };
        }
        match () {
            () if is_recording => Self::Data,
            () if ending == Some("toml") || is_text(word) => Self::Configuration,
            () if word.is_file() => Self::Data,
            // A pipe, or a device, which is refused where it is read.
            () if word.exists() => Self::Configuration,
            () if shipped(word).is_some() => Self::Configuration,
            () if is_address(text) => Self::Radar,
            () => Self::Unknown,
        }
    }
}

fn is_text(path: &Path) -> bool {
    let start = || -> io::Result<Vec<u8>> {
        let mut start = Vec::new();
        File::open(path)?.take(START).read_to_end(&mut start)?;
        Ok(start)
    };
    // A pipe is not opened: it might wait for ever.
    path.is_file() && start().is_ok_and(|start| !start.contains(&0))
}

/// `192.168.0.1`, with or without a port, `udp://239.192.43.78:4378`, or `HOST:PORT`.
fn is_address(text: &str) -> bool {
    let is_host = |host: &str| !host.is_empty() && !host.contains('/');
    let has_port = text
        .rsplit_once(':')
        .is_some_and(|(host, port)| is_host(host) && port.parse::<u16>().is_ok());
    text.starts_with("udp://")
        || text.parse::<IpAddr>().is_ok()
        || text.parse::<SocketAddr>().is_ok()
        || has_port
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_word_is_what_is_there_then_a_name_then_an_address() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["drive", "run/journal", "oxford"] {
            fs::create_dir_all(at(name)).unwrap();
        }
        for name in ["run/config.toml", "robot.toml", "settings", "drive.mcap"] {
            fs::write(at(name), "").unwrap();
        }
        fs::write(at("scan"), [0x89, b'P', 0]).unwrap();
        for (name, kind) in [
            ("drive", Kind::Data),
            ("drive.mcap", Kind::Data),
            ("run", Kind::Results),
            ("robot.toml", Kind::Configuration),
            ("settings", Kind::Configuration),
            ("scan", Kind::Data),
            ("missing.toml", Kind::Configuration),
            ("missing", Kind::Unknown),
        ] {
            assert_eq!(Kind::of(&at(name)), kind, "{name}");
        }
    }

    #[test]
    fn names_in_the_program_are_configurations_and_addresses_are_radars() {
        for (word, kind) in [
            ("oxford", Kind::Configuration),
            ("configs/oxford.toml", Kind::Configuration),
            ("oxfrod", Kind::Unknown),
            ("192.168.0.1", Kind::Radar),
            ("192.168.0.1:6317", Kind::Radar),
            ("[::1]:6317", Kind::Radar),
            ("robot.local:6317", Kind::Radar),
            ("udp://239.192.43.78:4378", Kind::Radar),
            ("2019-01-10", Kind::Unknown),
            ("drives/monday:7", Kind::Unknown),
        ] {
            assert_eq!(Kind::of(Path::new(word)), kind, "{word}");
        }
    }
}
