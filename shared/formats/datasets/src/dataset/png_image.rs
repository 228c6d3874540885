//! Grey PNG images, decoded into the caller's memory.

use std::io::{self, BufRead, BufReader, Cursor, Read, Seek};
use std::ops::RangeInclusive;
use std::path::Path;

use super::error::ReadError;
use super::image_size::ImageSize;

/// Maximum size of an image, bytes: 1024 azimuths of 32,768 range bins and their metadata.
const MAX_IMAGE_BYTES: u64 = 1024 * (32_768 + 11);
/// Length of the signature and the header chunk up to the interlace method.
const HEADER_BYTES: usize = 29;
const SIGNATURE: [u8; 8] = [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n'];
/// Memory limit of the decoder beside the image: rows, tables, text chunks.
const DECODER_BYTES: usize = 4 << 20;

/// Reads the size of a PNG from its header.
pub(crate) fn read_size(path: &Path) -> Result<ImageSize, ReadError> {
    let mut header = [0; HEADER_BYTES];
    let mut file = gyre_storage::open(path).map_err(|e| io_error(path, e))?;
    let mut filled = 0;
    while filled < HEADER_BYTES {
        match file.read(&mut header[filled..]) {
            Ok(0) => break,
            Ok(n) => filled += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(io_error(path, e)),
        }
    }
    parse_header(path, &header[..filled])
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
    let limits = png::Limits {
        bytes: DECODER_BYTES,
    };
    let mut decoder = png::Decoder::new_with_limits(file, limits);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    decoder
}

/// Parses the header chunk. Rejects pixels other than 8-bit grey and images too large for a radar
/// scan.
fn parse_header(path: &Path, bytes: &[u8]) -> Result<ImageSize, ReadError> {
    let shown = bytes.len().min(SIGNATURE.len());
    if bytes[..shown] != SIGNATURE[..shown] {
        return Err(ReadError::NotPng {
            path: path.to_owned(),
        });
    }
    let Some(header) = bytes.get(..HEADER_BYTES) else {
        return Err(ReadError::Truncated {
            path: path.to_owned(),
            bytes: bytes.len(),
        });
    };
    if &header[12..16] != b"IHDR" {
        return Err(ReadError::NotPng {
            path: path.to_owned(),
        });
    }
    let word = |at: usize| {
        u32::from_be_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]])
    };
    check_pixels(path, header[24], header[25])?;
    check_size(path, u64::from(word(16)), u64::from(word(20)))
}

fn check_pixels(path: &Path, bits: u8, colour: u8) -> Result<(), ReadError> {
    if bits == 8 && colour == 0 {
        return Ok(());
    }
    let colour = match colour {
        0 => "grey",
        2 => "colour",
        3 => "palette",
        4 => "grey and alpha",
        6 => "colour and alpha",
        _ => "unknown",
    };
    Err(ReadError::WrongPixels {
        path: path.to_owned(),
        actual: format!("{bits}-bit {colour}"),
    })
}

fn check_size(path: &Path, width: u64, height: u64) -> Result<ImageSize, ReadError> {
    let bytes = width.saturating_mul(height);
    if bytes == 0 {
        return Err(ReadError::Damaged {
            path: path.to_owned(),
            reason: "its header gives a size of zero".to_owned(),
        });
    }
    if bytes > MAX_IMAGE_BYTES {
        return Err(ReadError::TooLarge {
            path: path.to_owned(),
            actual: bytes,
            limit: MAX_IMAGE_BYTES,
        });
    }
    Ok(ImageSize {
        width: width as usize,
        height: height as usize,
    })
}

/// Decodes images, and reuses the memory for the bytes of the file.
#[derive(Debug, Default)]
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
            return Err(ReadError::WrongSize {
                path: path.to_owned(),
                actual,
                expected,
            });
        }
        self.inflate(&mut pixels[..actual.bytes()])
            .map_err(|e| self.decoding_error(path, e))?;
        Ok(actual)
    }

    fn load(&mut self, path: &Path) -> Result<(), ReadError> {
        let file = gyre_storage::open(path).map_err(|e| io_error(path, e))?;
        self.file.clear();
        // One byte more than accepted distinguishes a file of exactly the maximum size from a
        // larger one.
        file.take(MAX_IMAGE_BYTES + 1)
            .read_to_end(&mut self.file)
            .map_err(|e| io_error(path, e))?;
        if self.file.len() as u64 > MAX_IMAGE_BYTES {
            return Err(ReadError::TooLarge {
                path: path.to_owned(),
                actual: self.file.len() as u64,
                limit: MAX_IMAGE_BYTES,
            });
        }
        Ok(())
    }

    fn inflate(&self, pixels: &mut [u8]) -> Result<(), png::DecodingError> {
        let mut reader = decoder(Cursor::new(self.file.as_slice())).read_info()?;
        reader.next_frame(pixels).map(|_| ())
    }

    fn decoding_error(&self, path: &Path, error: png::DecodingError) -> ReadError {
        match error {
            png::DecodingError::IoError(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
                ReadError::Truncated {
                    path: path.to_owned(),
                    bytes: self.file.len(),
                }
            }
            other => ReadError::Damaged {
                path: path.to_owned(),
                reason: plain(&other.to_string()).to_owned(),
            },
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

fn io_error(path: &Path, source: io::Error) -> ReadError {
    ReadError::Io {
        path: path.to_owned(),
        source,
    }
}
