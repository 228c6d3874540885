//! Zero copy: a payload is read where another process wrote it.

use std::{
    env, fs,
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
    time::Duration,
};

use gyre_messages::{Masked, MaskedHeader, StageId};

use super::{Run, reader, writer};
use crate::{Manifest, run, wake::Signals};

const RASTER: usize = 96;

/// The mapping of an address: file, offset and access rights.
#[derive(Debug)]
struct Mapping {
    inode: u64,
    offset: u64,
    path: String,
    rights: String,
}

fn place_of<T>(values: &[T]) -> Mapping {
    let address = values.as_ptr() as u64;
    let maps = fs::read_to_string("/proc/self/maps").unwrap();
    let hex = |text: &str| u64::from_str_radix(text, 16).unwrap();
    let found = maps.lines().find_map(|line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let (start, end) = fields[0].split_once('-').unwrap();
        (hex(start)..hex(end)).contains(&address).then(|| Mapping {
            inode: fields[4].parse().unwrap(),
            offset: address - hex(start) + hex(fields[2]),
            path: fields.get(5).unwrap_or(&"").to_string(),
            rights: fields[1].to_owned(),
        })
    });
    found.unwrap()
}

fn value(cell: usize) -> f32 {
    cell as f32 * 0.5
}

/// The publishing process, started by the test below.
#[test]
fn publisher() {
    let Some(root) = env::var_os(run::ENVIRONMENT) else {
        return;
    };
    let manifest = Manifest::read(root.as_ref()).unwrap();
    let masked = writer::<Masked>(&manifest);
    let mut draft = masked.loan().unwrap();
    *draft.header() = MaskedHeader {
        n: manifest.limits.side() as u32,
        rasters: 1,
        cell_m: manifest.limits.cell_m,
        ..MaskedHeader::default()
    };
    draft.header().item.seq = 7;
    let cells = draft.values::<f32>();
    let places = cells.iter_mut().enumerate();
    places.for_each(|(cell, v)| *v = value(cell));
    let place = place_of(cells);
    masked.send(draft, StageId::Masking).unwrap();
    println!("\nWROTE {place:?}");
    // Wait until the reader is done.
    let _ = std::io::stdin().lines().next();
}

fn start_publisher(manifest: &Manifest) -> Child {
    Command::new(env::current_exe().unwrap())
        .args(["--exact", "tests::zero_copy::publisher", "--nocapture"])
        .env(run::ENVIRONMENT, &manifest.root)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

#[test]
fn a_reader_in_another_process_maps_the_publishers_memory() {
    let run = Run::new();
    let signals = Signals::install().unwrap();
    let mut masked = reader::<Masked>(&run.manifest, None);
    let mut child = start_publisher(&run.manifest);
    let mut said = BufReader::new(child.stdout.take().unwrap())
        .lines()
        .map_while(Result::ok);
    let wrote = said.find(|line| line.starts_with("WROTE")).unwrap();
    while masked.head().unwrap().is_none() {
        let limit = Duration::from_secs(5);
        let woken = signals.wait(&[masked.listener()], None, limit).unwrap();
        assert!(!woken.timed_out);
    }
    let received = masked.current().unwrap();
    let cells = &received.values::<f32>()[..RASTER];
    assert!(cells.iter().enumerate().all(|(cell, v)| *v == value(cell)));
    let place = place_of(cells);
    assert_eq!(place.rights, "r--s", "readers map the payload read-only");
    let of_writer = Mapping {
        rights: "rw-s".to_owned(),
        ..place
    };
    assert_eq!(wrote, format!("WROTE {of_writer:?}"));
    let prefix = format!("/dev/shm/{}", run.manifest.prefix);
    assert!(of_writer.path.starts_with(&prefix) && of_writer.path.ends_with(".data"));
    assert_eq!(cells.as_ptr() as usize % 64, 0, "aligned for vector units");
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());
}
