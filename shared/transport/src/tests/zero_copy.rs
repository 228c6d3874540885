//! Zero copy: a payload is read where its publisher wrote it.

use std::fs;

use gyre_contract::{Masked, MaskedHeader, StageId};

use super::{Run, reader, writer};

/// The mapping of an address: file, offset and access rights.
#[derive(Debug, PartialEq)]
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

#[test]
fn a_reader_maps_the_publishers_memory_and_cannot_write_to_it() {
    let run = Run::begin();
    let limits = &run.manifest.limits;
    let mut reader = reader::<Masked>(&run.manifest, None);
    let masked = writer::<Masked>(&run.manifest);
    let mut draft = masked.loan().unwrap();
    *draft.header() = MaskedHeader {
        n: limits.side() as u32,
        rasters: 1,
        cell_m: limits.cell_m,
        ..MaskedHeader::default()
    };
    let cells = draft.values::<f32>();
    let values = cells.iter_mut().zip(0_u8..);
    values.for_each(|(cell, value)| *cell = f32::from(value));
    let written = place_of(cells);
    masked.send(draft, StageId::Masking).unwrap();
    let received = reader.head().unwrap().unwrap();
    let cells = received.values::<f32>();
    let mut values = cells.iter().zip(0_u8..100);
    assert!(values.all(|(cell, value)| *cell == f32::from(value)));
    let read = place_of(cells);
    assert_eq!((&*written.rights, &*read.rights), ("rw-s", "r--s"));
    let prefix = format!("/dev/shm/{}", run.manifest.prefix);
    assert!(read.path.starts_with(&prefix) && read.path.ends_with(".data"));
    let of_writer = Mapping {
        rights: written.rights.clone(),
        ..read
    };
    assert_eq!(of_writer, written);
    assert_eq!(cells.as_ptr() as usize % 64, 0, "aligned for vector units");
}
