//! Recordings: the metadata in the pixels, the image files, the lists beside them.

use std::{fs, path::Path};

use bolero::{TypeGenerator, check};
use gyre_datasets::{DatasetOptions, Format, inspect, open};
use gyre_fuzz::{
    Failure, Target,
    edit::{ByteEdit, Number, TextEdit, edit_bytes, edit_text},
};
use tempfile::TempDir;

use self::common::{PERIOD_US, START_US, Sweep, write_png, written};

#[path = "../../shared/formats/datasets/tests/common/mod.rs"]
mod common;

const AZIMUTHS: i64 = 16;
const BINS: usize = 40;

struct Image {
    /// The name of the file, relative to the recording.
    name: String,
    /// Pixels a row.
    width: usize,
    pixels: Vec<u8>,
}

/// A small recording.
struct Recording {
    format: Format,
    images: Vec<Image>,
    /// Texts beside them: names and contents.
    texts: Vec<(String, String)>,
}

impl Recording {
    /// A valid recording of three scans.
    fn of(format: Format) -> Self {
        let (middle, last) = (AZIMUTHS / 2 - 1, AZIMUTHS - 1);
        let folder = format.folders()[0];
        let (named_row, unit) = match format {
            Format::Boreas | Format::BoreasRt => (middle, 1),
            Format::Mulran | Format::MulranOxfordForm => (last, 1000),
            _ => (0, 1),
        };
        let transposed = matches!(format, Format::Mulran | Format::Radiate);
        let image = |k: i64| {
            let sweep = Sweep {
                rows: AZIMUTHS as usize,
                bins: BINS,
                step: 5600 / AZIMUTHS as u16,
                row_interval: PERIOD_US / AZIMUTHS * unit,
                ..Sweep::at((START_US + k * PERIOD_US) * unit)
            };
            let number = match format {
                Format::Radiate => format!("{:06}", k + 7),
                _ => (sweep.start + named_row * sweep.row_interval).to_string(),
            };
            let plain = || (0..AZIMUTHS as usize * BINS).map(|pixel| (pixel * 7) as u8);
            let (width, pixels) = match transposed {
                true => (sweep.rows, plain().collect()),
                false => (sweep.width(), sweep.pixels()),
            };
            Image {
                name: format!("{folder}/{number}.png"),
                width,
                pixels,
            }
        };
        let options = format!(
            "format = \"{format}\"\nrange_resolution_m = 0.5\nrange_offset_m = -0.25\ndoppler_s = 0.04\n"
        );
        let mut texts = vec![("dataset.toml".to_owned(), options)];
        let mut list = |name: &str, line: &dyn Fn(i64) -> String| {
            texts.push((name.to_owned(), (0..3).map(line).collect()));
        };
        match format {
            Format::Oxford => list("radar.timestamps", &|k| {
                format!("{} 1\n", START_US + k * PERIOD_US)
            }),
            Format::Radiate => list("Navtech_Polar.txt", &|k| {
                let (frame, ns) = (k + 7, 250_000_000 * k + 3_000_000);
                format!("Frame: {frame:06} Time: 1549986607.{ns}\n")
            }),
            _ => {}
        }
        Self {
            format,
            images: (0..3).map(image).collect(),
            texts,
        }
    }

    /// Writes it into an empty folder.
    fn write(&self, folder: &TempDir) {
        for image in &self.images {
            let height = image.pixels.len() / image.width;
            let path = folder.path().join(&image.name);
            write_png(&path, image.width, height, &image.pixels);
        }
        for (name, text) in &self.texts {
            written(folder, name, text);
        }
    }
}

/// An edit of a row's metadata, or of its pixels.
#[derive(Clone, Debug, TypeGenerator)]
enum RowEdit {
    /// The stamp: a number, in place of the one that is there or added to it.
    Stamp(u8, Number, bool),
    /// The encoder count.
    Count(u8, u16),
    /// The encoder counts of all rows from this one on, shifted.
    CountsFrom(u8, u16),
    Flags(u8, u8),
    /// All rows alike.
    Copy(u8),
    /// Any pixel.
    Pixel(u16, u8),
}

fn edit_rows(pixels: &mut [u8], width: usize, edits: &[RowEdit]) {
    let rows = pixels.len() / width;
    let row = |index: u8| usize::from(index) % rows * width;
    let count = |pixels: &[u8], at: usize| u16::from_le_bytes([pixels[at + 8], pixels[at + 9]]);
    for edit in edits {
        match *edit {
            RowEdit::Stamp(index, number, add) => {
                let stamp = &mut pixels[row(index)..][..8];
                let there = u64::from_le_bytes(stamp.try_into().unwrap());
                let by = number.bits();
                stamp.copy_from_slice(&if add { there.wrapping_add(by) } else { by }.to_le_bytes());
            }
            RowEdit::Count(index, count) => {
                pixels[row(index) + 8..][..2].copy_from_slice(&count.to_le_bytes());
            }
            RowEdit::CountsFrom(index, by) => {
                for at in (row(index)..pixels.len()).step_by(width) {
                    let shifted = count(pixels, at).wrapping_add(by).to_le_bytes();
                    pixels[at + 8..][..2].copy_from_slice(&shifted);
                }
            }
            RowEdit::Flags(index, flags) => pixels[row(index) + 10] = flags,
            RowEdit::Copy(index) => {
                let metadata = pixels[row(index)..][..11].to_vec();
                let rows = pixels.chunks_exact_mut(width);
                rows.for_each(|row| row[..11].copy_from_slice(&metadata));
            }
            RowEdit::Pixel(at, value) => {
                let at = usize::from(at) % pixels.len();
                pixels[at] = value;
            }
        }
    }
}

/// Opens a recording, reads all scans and inspects it. An accepted recording must be consistent.
fn use_recording(root: &Path, options: &DatasetOptions) -> Result<(), Failure> {
    let mut dataset = open(root, options)?;
    let mut refused = None;
    for index in 0..dataset.len() {
        match dataset.scan(index) {
            Ok(scan) => {
                scan.view().check().unwrap();
                assert!(scan.azimuth_rad.iter().all(|azimuth| azimuth.is_finite()));
            }
            Err(error) => refused = Some(error),
        }
        dataset.nominal_stamp_ns(index);
        dataset.logged_stamp_ns(index);
    }
    let report = inspect(root, options)?;
    assert!(!report.to_string().is_empty());
    refused.map_or(Ok(()), |error| Err(error.into()))
}

/// A format, by its index, and whether it is named.
#[derive(Clone, Copy, Debug, TypeGenerator)]
struct Chosen {
    format: u8,
    named: bool,
}

impl Chosen {
    fn recording(self) -> Recording {
        Recording::of(Format::OF_IMAGES[usize::from(self.format) % Format::OF_IMAGES.len()])
    }

    fn options(self) -> DatasetOptions {
        DatasetOptions {
            format: self.named.then(|| self.recording().format),
            ..DatasetOptions::default()
        }
    }
}

#[test]
fn pixels() {
    let target = Target::new(64);
    check!()
        .with_type::<(Chosen, u8, Vec<RowEdit>)>()
        .for_each(|(chosen, image, edits)| {
            let (folder, mut recording) = (folder(), chosen.recording());
            let count = recording.images.len();
            let image = &mut recording.images[usize::from(*image) % count];
            edit_rows(&mut image.pixels, image.width, edits);
            recording.write(&folder);
            target.run(|| use_recording(folder.path(), &chosen.options()));
        });
}

/// An edit of a PNG file. All but `Bytes` leave the checksums right.
#[derive(Clone, Debug, TypeGenerator)]
enum FileEdit {
    Bytes(Vec<ByteEdit>),
    /// Edits of the bytes, and of the checksums of all chunks that are still there.
    Checked(Vec<ByteEdit>),
    /// A byte of the width, the height, the bit depth, and of what follows them.
    Header(u8, u8),
    /// A chunk of this name and length before the image data; its content is shorter.
    Chunk([u8; 4], u32, u8),
}

fn edit_file(file: &mut Vec<u8>, edit: &FileEdit) {
    match edit {
        FileEdit::Bytes(edits) => return edit_bytes(file, edits),
        FileEdit::Checked(edits) => edit_bytes(file, edits),
        FileEdit::Header(at, value) => set(file, 16 + usize::from(at % 13), &[*value]),
        FileEdit::Chunk(name, length, content) if file.len() > 33 => {
            let content = vec![7; usize::from(*content) + 4];
            let chunk = [&length.to_be_bytes()[..], name, &content].concat();
            file.splice(33..33, chunk);
        }
        FileEdit::Chunk(..) => {}
    }
    mend_checksums(file);
}

fn set(file: &mut [u8], at: usize, bytes: &[u8]) {
    let there = file.iter_mut().skip(at);
    there.zip(bytes).for_each(|(to, from)| *to = *from);
}

fn mend_checksums(file: &mut [u8]) {
    let mut at = 8;
    while let Some(length) = file.get(at..at + 4) {
        let length = u32::from_be_bytes(length.try_into().unwrap()) as usize;
        let Some(content) = file.get(at + 4..at.saturating_add(8).saturating_add(length)) else {
            return;
        };
        let checksum = crc32fast::hash(content).to_be_bytes();
        set(file, at + 8 + length, &checksum);
        at += 12 + length;
    }
}

#[test]
fn image_files() {
    let target = Target::new(96);
    check!()
        .with_type::<(Chosen, bool, Vec<FileEdit>)>()
        .for_each(|(chosen, all, edits)| {
            let (folder, recording) = (folder(), chosen.recording());
            recording.write(&folder);
            for image in recording.images.iter().take(if *all { 3 } else { 1 }) {
                let path = folder.path().join(&image.name);
                let mut file = fs::read(&path).unwrap();
                edits.iter().for_each(|edit| edit_file(&mut file, edit));
                fs::write(&path, file).unwrap();
            }
            target.run(|| use_recording(folder.path(), &chosen.options()));
        });
}

/// An edit of what lies in a recording's folder beside the pixels.
#[derive(Clone, Debug, TypeGenerator)]
enum FolderEdit {
    Text(u8, Vec<TextEdit>),
    /// The number in the name of an image.
    Name(u8, Number),
    /// Added to the number in the name of an image.
    Shift(u8, i32),
    /// A name of words for an image: `scanN`, a copy, a hidden file.
    Words(u8, u8),
    /// Rows that an image has lost.
    Short(u8, u8),
    /// An encoder of another size.
    Encoder(u16),
    Remove(u8),
}

#[test]
fn lists_and_names() {
    let target = Target::new(64);
    check!()
        .with_type::<(Chosen, Vec<FolderEdit>)>()
        .for_each(|(chosen, edits)| {
            let (folder, mut recording) = (folder(), chosen.recording());
            for edit in edits {
                edit_folder(&mut recording, edit);
            }
            recording.write(&folder);
            target.run(|| use_recording(folder.path(), &chosen.options()));
        });
}

fn edit_folder(recording: &mut Recording, edit: &FolderEdit) {
    let images = recording.images.len().max(1);
    let mut of_image = |index: &u8, change: &dyn Fn(&mut Image)| {
        if let Some(image) = recording.images.get_mut(usize::from(*index) % images) {
            change(image);
        }
    };
    let mut rename = |index: &u8, name: &dyn Fn(&str) -> String| {
        of_image(index, &|image| {
            let (folder, file) = image.name.rsplit_once('/').unwrap();
            image.name = format!("{folder}/{}.png", name(file.trim_end_matches(".png")));
        });
    };
    match edit {
        FolderEdit::Name(index, number) => {
            rename(index, &|_| (number.bits() as i64).to_string());
        }
        FolderEdit::Shift(index, by) => rename(index, &|name| {
            let there: i64 = name.parse().unwrap_or(0);
            there.wrapping_add(i64::from(*by) * 1000).to_string()
        }),
        FolderEdit::Words(index, kind) => rename(index, &|name| match kind % 3 {
            0 => format!("scan{kind}"),
            1 => format!("{name} (1)"),
            _ => format!("._{name}"),
        }),
        FolderEdit::Short(index, rows) => of_image(index, &|image| {
            let lost = usize::from(*rows) * image.width;
            let left = image.pixels.len().saturating_sub(lost);
            image.pixels.truncate(left.max(image.width));
        }),
        FolderEdit::Encoder(size) => {
            let images = recording.images.iter_mut();
            images.for_each(|image| set_encoder(&mut image.pixels, image.width, *size));
        }
        FolderEdit::Remove(_) if recording.images.is_empty() => {}
        FolderEdit::Remove(index) => {
            recording.images.remove(usize::from(*index) % images);
        }
        FolderEdit::Text(index, edits) => {
            let texts = recording.texts.len();
            let (_, text) = &mut recording.texts[usize::from(*index) % texts];
            *text = edit_text(text, edits);
        }
    }
}

/// Gives rows the counts that an encoder of another size than 5600 counts has at their angles.
fn set_encoder(pixels: &mut [u8], width: usize, size: u16) {
    for row in pixels.chunks_exact_mut(width) {
        if let Some([low, high]) = row.get_mut(8..10) {
            let count = u32::from(u16::from_le_bytes([*low, *high]));
            [*low, *high] = ((count * u32::from(size) / 5600) as u16).to_le_bytes();
        }
    }
}

/// A folder in memory, where there is one.
pub fn folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    let parent = match memory.is_dir() {
        true => memory.to_owned(),
        false => std::env::temp_dir(),
    };
    let mut folder = tempfile::Builder::new();
    folder.prefix("fuzz-").tempdir_in(parent).unwrap()
}

#[test]
fn a_recording_without_edits_is_accepted_in_every_format() {
    for format in 0..Format::OF_IMAGES.len() as u8 {
        for named in [true, false] {
            let (folder, chosen) = (folder(), Chosen { format, named });
            chosen.recording().write(&folder);
            use_recording(folder.path(), &chosen.options()).unwrap();
            assert!(fs::read_dir(folder.path()).unwrap().count() > 0);
        }
    }
}
