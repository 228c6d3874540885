//! The recording that the runs play: simulated once for each build of the tests, and shared by all
//! of them.

use std::{
    env, fs,
    fs::File,
    io::Cursor,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use gyre_simulator::{SimulationConfig, write_dataset};
use tempfile::TempDir;

use super::{Run, entries_of};

pub const SCANS: usize = 24;
/// A rate at which the small recording's six seconds take one: slow enough to disturb the middle.
pub const MODERATE: &str = "6";
pub const MIDDLE: usize = SCANS / 3;

/// The radar of the small recordings in a section `[simulation]`. It has a sixth of the default
/// one's bins: what happens between processes does not depend on them.
pub const SENSOR: &str = "sensor.profile = 'cts350x-radiate'\noutput.format = 'oxford'\n";

/// A drive whose recording has the form of RADIATE.
pub const RADIATE: &str = "scans = 24\nsensor.profile = 'cts350x-radiate'\n\
    output.format = 'radiate'\ndrive.speed_mps = 5.0\n";

pub fn small() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| of_a_block(SCANS))
}

/// Returns a run with the constants that the small recording has in its `dataset.toml`.
pub fn with_constants(run: Run) -> Run {
    let settings = fs::read_to_string(small().join("dataset.toml")).unwrap();
    let settings: toml::Table = settings.parse().unwrap();
    let constants = settings.iter().filter(|(key, _)| *key != "format");
    constants.fold(run, |run, (key, value)| {
        run.set(&format!("dataset.{key}={value}"))
    })
}

/// Scans of the recording once around a block and a bit further.
pub const SCANS_AROUND: usize = 120;

pub fn around_a_block() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| of_a_block(SCANS_AROUND))
}

/// The drive of the demo, with another radar.
pub fn demo() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| configured("demo", SENSOR))
}

/// The recording of a drive with this section `[simulation]`.
pub fn configured(name: &str, settings: &str) -> PathBuf {
    let config: SimulationConfig = toml::from_str(settings).unwrap();
    prepared(name, |recording| {
        write_dataset(&config, recording, &mut |_, _| ()).unwrap();
    })
}

/// The recording of a drive along a trajectory in the format TUM.
pub fn along(name: &str, trajectory: &str) -> PathBuf {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(&file, trajectory).unwrap();
    configured(name, &format!("drive.file = '{}'", file.path().display()))
}

fn of_a_block(scans: usize) -> PathBuf {
    configured(&scans.to_string(), &format!("scans = {scans}\n{SENSOR}"))
}

/// A recording as RADIATE has them, whose host loses azimuths or not.
pub fn of_radiate(loses_azimuths: bool) -> PathBuf {
    let settings = format!("{RADIATE}sensor.lost_azimuths = {loses_azimuths}\n");
    configured(&format!("radiate-{loses_azimuths}"), &settings)
}

/// A copy of the small recording's first `scans` scans, to be corrupted. Its images are links:
/// replace them instead of writing into them.
pub fn copy(scans: usize) -> TempDir {
    let copy = linked(small(), |scan| scan < scans);
    // As in a real recording, the truth is in `gt` alone.
    fs::remove_file(copy.path().join("ground_truth.tum")).unwrap();
    copy
}

/// A copy of a recording with the images that are kept by their numbers, which are links.
pub fn linked(recording: &Path, keep: impl Fn(usize) -> bool) -> TempDir {
    let folder = tempfile::Builder::new()
        .prefix("gyre-recording-")
        .tempdir()
        .unwrap();
    link(recording, folder.path(), keep);
    folder
}

/// A damaged recording: a copy of the small one whose images `damage` may replace.
pub fn damaged(name: &str, damage: impl FnOnce(&[PathBuf])) -> PathBuf {
    prepared(name, |folder| {
        fs::create_dir(folder).unwrap();
        link(small(), folder, |_| true);
        fs::remove_file(folder.join("ground_truth.tum")).unwrap();
        damage(&images(folder));
    })
}

fn link(recording: &Path, folder: &Path, keep: impl Fn(usize) -> bool) {
    copy_files(recording, folder);
    let images = images(recording);
    let place = folder.join(images[0].parent().unwrap().strip_prefix(recording).unwrap());
    for (_, image) in images.iter().enumerate().filter(|(scan, _)| keep(*scan)) {
        symlink(image, place.join(image.file_name().unwrap())).unwrap();
    }
}

fn copy_files(from: &Path, to: &Path) {
    for path in entries_of(from) {
        let copy = to.join(path.file_name().unwrap());
        if path.is_dir() {
            fs::create_dir(&copy).unwrap();
            copy_files(&path, &copy);
        } else if !is_image(&path) {
            fs::write(&copy, fs::read(&path).unwrap()).unwrap();
        }
    }
}

fn is_image(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "png")
}

/// The images of a recording in the order of their times; none before the first is complete.
pub fn images(recording: &Path) -> Vec<PathBuf> {
    let images_in = |folder: PathBuf| {
        let mut files = entries_of(&folder);
        files.retain(|file| is_image(file));
        (!files.is_empty()).then_some(files)
    };
    let folders = entries_of(recording).into_iter();
    folders.filter_map(images_in).next().unwrap_or_default()
}

pub fn truncate(image: &Path, bytes: usize) {
    let whole = fs::read(image).unwrap();
    replace(image, &whole[..bytes.min(whole.len())]);
}

fn encoded(width: u32, height: u32, pixels: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(pixels).unwrap();
    writer.finish().unwrap();
    bytes
}

/// Replaces the times of an image's rows, us since 1970: `stamp_us` returns the time of a row, from
/// 0, for its present time.
pub fn restamp(image: &Path, stamp_us: impl Fn(usize, i64) -> i64) {
    const STAMP: usize = 8;
    rewrite(image, |row, pixels| {
        let stamp: &mut [u8; STAMP] = (&mut pixels[..STAMP]).try_into().unwrap();
        *stamp = stamp_us(row, i64::from_le_bytes(*stamp)).to_le_bytes();
    });
}

pub fn complete(image: &Path) {
    const VALIDITY: usize = 10;
    rewrite(image, |_, pixels| pixels[VALIDITY] = 255);
}

fn rewrite(image: &Path, edit: impl Fn(usize, &mut [u8])) {
    let bytes = fs::read(image).unwrap();
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let size = reader.next_frame(&mut pixels).unwrap();
    for (row, pixels) in pixels.chunks_exact_mut(size.width as usize).enumerate() {
        edit(row, pixels);
    }
    replace(image, &encoded(size.width, size.height, &pixels));
}

/// Moves a scan by `by_us` in time: the stamps of its rows, and the name of its file.
pub fn shift(image: &Path, by_us: i64) {
    restamp(image, |_, stamp_us| stamp_us + by_us);
    let name: i64 = image
        .file_stem()
        .unwrap()
        .to_str()
        .unwrap()
        .parse()
        .unwrap();
    fs::rename(image, image.with_file_name(format!("{}.png", name + by_us))).unwrap();
}

fn replace(image: &Path, bytes: &[u8]) {
    fs::remove_file(image).unwrap();
    fs::write(image, bytes).unwrap();
}

/// Makes a recording in a new folder where the build keeps its temporary files, unless this build
/// of the tests has made the recording already. Test processes that start at the same time wait for
/// the first.
pub fn prepared(name: &str, make: impl FnOnce(&Path)) -> PathBuf {
    let test = env::current_exe().unwrap();
    let name = format!("{}-{name}", test.file_stem().unwrap().to_string_lossy());
    let place = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let recording = place.join(&name);
    let lock = File::create(place.join(format!("{name}.lock"))).unwrap();
    lock.lock().unwrap();
    let built = fs::metadata(&test).unwrap().modified().unwrap();
    let made_by = place.join(format!("{name}.made_by"));
    if fs::read_to_string(&made_by).is_ok_and(|text| text == format!("{built:?}")) {
        return recording;
    }
    let _ = fs::remove_dir_all(&recording);
    make(&recording);
    fs::write(&made_by, format!("{built:?}")).unwrap();
    recording
}
