//! The recording that the runs play: simulated once for each build of the tests, and shared by all of them.

use std::{
    env, fs,
    fs::File,
    io::Cursor,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use gyre_simulator::{SimulationConfig, write_dataset};
use tempfile::TempDir;

/// Scans of the small recording.
pub const SCANS: usize = 24;

/// The small recording.
pub fn small() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| simulated(SCANS))
}

/// A copy of the small recording's first `scans` scans, to be corrupted. Its images are links: replace them instead of writing into them.
pub fn copy(scans: usize) -> TempDir {
    let folder = tempfile::Builder::new()
        .prefix("gyre-recording-")
        .tempdir()
        .unwrap();
    for name in ["radar", "gt"] {
        fs::create_dir(folder.path().join(name)).unwrap();
    }
    for file in ["radar.timestamps", "dataset.toml", "gt/radar_odometry.csv"] {
        fs::copy(small().join(file), folder.path().join(file)).unwrap();
    }
    for image in images(small()).iter().take(scans) {
        std::os::unix::fs::symlink(
            image,
            folder.path().join("radar").join(image.file_name().unwrap()),
        )
        .unwrap();
    }
    folder
}

/// The images of a recording in the order of their times.
pub fn images(recording: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(recording.join("radar")).unwrap();
    let mut images: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    images.sort();
    images
}

/// Replaces an image by the first `bytes` bytes of it.
pub fn truncate(image: &Path, bytes: usize) {
    let whole = fs::read(image).unwrap();
    replace(image, &whole[..bytes.min(whole.len())]);
}

/// Replaces an image by black pixels of another size.
pub fn resize(image: &Path, width: u32, height: u32) {
    let black = vec![0; (width * height) as usize];
    replace(image, &encoded(width, height, &black));
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

/// Replaces an image by itself with other times of its rows, us since 1970: `stamp_us` returns that of a row, from 0, given the
/// one that it has.
pub fn restamp(image: &Path, stamp_us: impl Fn(usize, i64) -> i64) {
    const STAMP: usize = 8;
    let bytes = fs::read(image).unwrap();
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let size = reader.next_frame(&mut pixels).unwrap();
    for (row, pixels) in pixels.chunks_exact_mut(size.width as usize).enumerate() {
        let stamp: &mut [u8; STAMP] = (&mut pixels[..STAMP]).try_into().unwrap();
        *stamp = stamp_us(row, i64::from_le_bytes(*stamp)).to_le_bytes();
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

/// Simulates where the build keeps its temporary files, unless this build of the tests has done so already. Test processes that
/// start at the same time wait for the first.
fn simulated(scans: usize) -> PathBuf {
    let test = env::current_exe().unwrap();
    let name = format!("{}-{scans}", test.file_stem().unwrap().to_string_lossy());
    let place = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let recording = place.join(&name);
    let lock = File::create(place.join(format!("{name}.lock"))).unwrap();
    lock.lock().unwrap();
    let built = fs::metadata(&test).unwrap().modified().unwrap();
    let made_by = recording.join("made_by.txt");
    if fs::read_to_string(&made_by).is_ok_and(|text| text == format!("{built:?}")) {
        return recording;
    }
    let _ = fs::remove_dir_all(&recording);
    let config = SimulationConfig {
        scans,
        ..SimulationConfig::default()
    };
    write_dataset(&config, &recording, &mut |_, _| ()).unwrap();
    fs::write(&made_by, format!("{built:?}")).unwrap();
    recording
}
