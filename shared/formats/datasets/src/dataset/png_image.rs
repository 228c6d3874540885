//! Grey PNG images, decoded into the caller's memory.

use std::fmt;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek};
use std::ops::RangeInclusive;
use std::path::Path;

use super::error::ReadError;

/// Maximum size of an image, bytes: 1024 azimuths of 32,768 range bins and their metadata.
const MAX_IMAGE_BYTES: u64 = 1024 * (32_768 + 11);
/// Length of the signature and the header chunk up to the interlace method.
const HEADER_BYTES: usize = 29;
const SIGNATURE: [u8; 8] = [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n'];
/// Memory limit of the decoder beside the image: rows, tables, text chunks.
const DECODER_BYTES: usize = 4 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct ImageSize {
    pub width: usize,
    pub height: usize,
}

impl ImageSize {
    /// Bytes of the image: one per pixel.
    pub fn bytes(self) -> usize {
        self.width * self.height
    }
}

impl fmt::Display for ImageSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} columns x {} rows", self.width, self.height)
    }
}

pub(crate) fn read_size(path: &Path) -> Result<ImageSize, ReadError> {
    let mut header = Vec::with_capacity(HEADER_BYTES);
    let file = gyre_storage::open(path).map_err(|e| ReadError::io(path, e))?;
    file.take(HEADER_BYTES as u64)
        .read_to_end(&mut header)
        .map_err(|e| ReadError::io(path, e))?;
    parse_header(path, &header)
}

/// Reads the first bytes of the first row of a PNG, and no more of the file than that needs; `None`
/// if it cannot be read, or has no such row.
pub(crate) fn first_bytes<const N: usize>(path: &Path) -> Option<[u8; N]> {
    read_size(path).ok()?;
    let file = BufReader::new(gyre_storage::open(path).ok()?);
    let mut reader = decoder(file).read_info().ok()?;
    // The first row of an interlaced image belongs to its first pass.
    if reader.info().interlaced {
        return None;
    }
    let row = reader.next_row().ok()??;
    row.data().first_chunk().copied()
}

fn decoder<R: BufRead + Seek>(file: R) -> png::Decoder<R> {
    let bytes = DECODER_BYTES;
    let mut decoder = png::Decoder::new_with_limits(file, png::Limits { bytes });
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    decoder
}

/// Parses the header chunk. Rejects pixels other than 8-bit grey and images too large for a radar
/// scan.
fn parse_header(path: &Path, bytes: &[u8]) -> Result<ImageSize, ReadError> {
    let not_png = || ReadError::image(path, " is not a PNG image");
    let shown = bytes.len().min(SIGNATURE.len());
    if bytes[..shown] != SIGNATURE[..shown] {
        return Err(not_png());
    }
    let Some(header) = bytes.get(..HEADER_BYTES) else {
        return Err(truncated(path, bytes.len()));
    };
    if &header[12..16] != b"IHDR" {
        return Err(not_png());
    }
    let word = |at: usize| {
        u32::from_be_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]])
    };
    check_pixels(path, header[24], header[25])?;
    let (width, height) = (u64::from(word(16)), u64::from(word(20)));
    match width.saturating_mul(height) {
        0 => Err(damaged(path, "its header gives a size of zero")),
        1..=MAX_IMAGE_BYTES => Ok(ImageSize {
            width: width as usize,
            height: height as usize,
        }),
        bytes => Err(too_large(path, bytes)),
    }
}

fn check_pixels(path: &Path, bits: u8, colour: u8) -> Result<(), ReadError> {
    let colour = match colour {
        0 if bits == 8 => return Ok(()),
        0 => "grey",
        2 => "colour",
        3 => "palette",
        4 => "grey and alpha",
        6 => "colour and alpha",
        _ => "unknown",
    };
    let fault = format!(
        " has {bits}-bit {colour} pixels instead of 8-bit grey: it was converted from the original"
    );
    Err(ReadError::image(path, fault))
}

fn too_large(path: &Path, bytes: u64) -> ReadError {
    let fault = format!(
        " is too large for a radar scan: {bytes} bytes, at most {MAX_IMAGE_BYTES} are accepted"
    );
    ReadError::image(path, fault)
}

fn truncated(path: &Path, bytes: usize) -> ReadError {
    let fault = format!(" is truncated after {bytes} bytes; copy or download it again");
    ReadError::image(path, fault)
}

fn damaged(path: &Path, reason: &str) -> ReadError {
    ReadError::Damaged {
        path: path.to_owned(),
        reason: reason.to_owned(),
    }
}

#[derive(Default)]
pub(crate) struct ImageReader {
    file: Vec<u8>,
}

impl ImageReader {
    /// Decodes `path`, an image of the width of `expected` with as many rows as are accepted, into
    /// `pixels`, row-major, which have room for most rows. Returns its size.
    pub(crate) fn decode(
        &mut self,
        path: &Path,
        expected: ImageSize,
        rows: RangeInclusive<usize>,
        pixels: &mut [u8],
    ) -> Result<ImageSize, ReadError> {
        self.load(path)?;
        let actual = parse_header(path, &self.file[..self.file.len().min(HEADER_BYTES)])?;
        if actual.width != expected.width || !rows.contains(&actual.height) {
            let is_square = actual.width == actual.height;
            let is_rotated = [actual.height, actual.width] == [expected.width, expected.height];
            let rotated = match is_rotated && !is_square {
                true => ": it is rotated by 90 degrees",
                false => "",
            };
            let fault =
                format!(" is {actual}, but most images of the dataset are {expected}{rotated}");
            return Err(ReadError::image(path, fault));
        }
        self.inflate(&mut pixels[..actual.bytes()])
            .map_err(|e| self.decoding_error(path, e))?;
        Ok(actual)
    }

    fn load(&mut self, path: &Path) -> Result<(), ReadError> {
        let file = gyre_storage::open(path).map_err(|e| ReadError::io(path, e))?;
        self.file.clear();
        // One byte more than accepted distinguishes a file of exactly the maximum size from a
        // larger one.
        file.take(MAX_IMAGE_BYTES + 1)
            .read_to_end(&mut self.file)
            .map_err(|e| ReadError::io(path, e))?;
        match self.file.len() as u64 {
            bytes if bytes > MAX_IMAGE_BYTES => Err(too_large(path, bytes)),
            _ => Ok(()),
        }
    }

    fn inflate(&self, pixels: &mut [u8]) -> Result<(), png::DecodingError> {
        let mut reader = decoder(Cursor::new(self.file.as_slice())).read_info()?;
        reader.next_frame(pixels).map(|_| ())
    }

    fn decoding_error(&self, path: &Path, error: png::DecodingError) -> ReadError {
        match error {
            png::DecodingError::IoError(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
                truncated(path, self.file.len())
            }
            other => damaged(path, plain(&other.to_string())),
        }
    }
}

/// Cuts the name of a chunk, which the decoder shows in a debugging format, with bytes of the file
/// as they are.
fn plain(reason: &str) -> &str {
    let words = reason.split("ChunkType").next().unwrap_or(reason);
    let words = words.trim_end().trim_end_matches(':');
    words.trim_end_matches(" while decoding")
}
