//! Place indexes in files.
//!
//! Little-endian: the mark, the version, the sizes of a descriptor (sieve, spectrum) and the number
//! of places; for each place its id, its path, its sieve and its spectrum; the CRC-32 of all this.

use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use bytemuck::cast_slice;
use crc32fast::Hasher;

use super::descriptor::SPECTRUM_BYTES;
use super::{Descriptor, PlaceIndex};

const MARK: [u8; 8] = *b"GYREPLCS";
/// Increases with every change of the layout or of the meaning of descriptors.
const VERSION: u32 = 1;
const SIZES: [u32; 2] = [Descriptor::SIEVE_BYTES as u32, SPECTRUM_BYTES as u32];
const HEADER_BYTES: usize = MARK.len() + 4 + 8 + 8;
const PLACE_BYTES: usize = 16 + Descriptor::SIEVE_BYTES + SPECTRUM_BYTES;
const CHECKSUM_BYTES: usize = 4;

/// A file of places that cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum PlaceFileError {
    #[error("cannot write the places to {path}: {source}")]
    Write {
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    #[error("cannot read the places in {path}: {source}")]
    Read {
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    #[error("{path} is not a file of places")]
    Foreign { path: PathBuf },
    #[error(
        "{path} has version {version} of places, but this program reads version {VERSION}: build the places again from their keyframes"
    )]
    Version { path: PathBuf, version: u32 },
    #[error("{path} is damaged: {reason}; build the places again from their keyframes")]
    Damaged { path: PathBuf, reason: String },
}

impl PlaceIndex {
    /// Writes all places to a file, which is replaced only once it is complete.
    pub fn save(&self, path: &Path) -> Result<(), PlaceFileError> {
        let error = |source| PlaceFileError::Write {
            path: path.to_owned(),
            source,
        };
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let file = File::create(&part).map_err(error)?;
        self.write(file).map_err(error)?;
        fs::rename(&part, path).map_err(error)
    }

    fn write(&self, file: File) -> io::Result<()> {
        let mut out = Checked {
            stream: BufWriter::new(file),
            checksum: Hasher::new(),
        };
        out.write(&MARK)?;
        out.write(&VERSION.to_le_bytes())?;
        SIZES
            .iter()
            .try_for_each(|size| out.write(&size.to_le_bytes()))?;
        out.write(&(self.len() as u64).to_le_bytes())?;
        let descriptors = self
            .sieves
            .chunks_exact(Descriptor::SIEVE_BYTES)
            .zip(self.spectra.chunks_exact(SPECTRUM_BYTES));
        for (place, (sieve, spectrum)) in self.places.iter().zip(descriptors) {
            out.write(&place.id.to_le_bytes())?;
            out.write(&place.path_m.to_le_bytes())?;
            out.write(sieve)?;
            out.write(cast_slice(spectrum))?;
        }
        let checksum = out.checksum.clone().finalize();
        out.write(&checksum.to_le_bytes())?;
        out.stream.into_inner()?.sync_all()
    }

    /// Reads the places of a file.
    pub fn load(path: &Path) -> Result<Self, PlaceFileError> {
        let read = |source| PlaceFileError::Read {
            path: path.to_owned(),
            source,
        };
        let file = gyre_storage::open(path).map_err(read)?;
        let bytes = file.metadata().map_err(read)?.len();
        let mut from = Checked {
            stream: BufReader::new(file),
            checksum: Hasher::new(),
        };
        let count = header(&mut from, bytes, path)?;
        let mut index = Self::with_capacity(count);
        let mut descriptor = Descriptor::default();
        for _ in 0..count {
            let id = u64::from_le_bytes(from.array().map_err(read)?);
            let path_m = f64::from_le_bytes(from.array().map_err(read)?);
            from.read(&mut descriptor.sieve).map_err(read)?;
            from.read(bytemuck::cast_slice_mut(&mut descriptor.spectrum))
                .map_err(read)?;
            index
                .insert(id, path_m, &descriptor)
                .map_err(|error| damaged(path, error.to_string()))?;
        }
        let expected = from.checksum.clone().finalize();
        match u32::from_le_bytes(from.array().map_err(read)?) == expected {
            true => Ok(index),
            false => Err(damaged(path, "its checksum does not match".to_owned())),
        }
    }
}

/// Reads the header of a file of `bytes` bytes; returns the number of places.
fn header(from: &mut Checked<impl Read>, bytes: u64, path: &Path) -> Result<usize, PlaceFileError> {
    let read = |source| PlaceFileError::Read {
        path: path.to_owned(),
        source,
    };
    let foreign = || PlaceFileError::Foreign {
        path: path.to_owned(),
    };
    if bytes < (HEADER_BYTES + CHECKSUM_BYTES) as u64 || from.array().map_err(read)? != MARK {
        return Err(foreign());
    }
    let version = u32::from_le_bytes(from.array().map_err(read)?);
    if version != VERSION {
        return Err(PlaceFileError::Version {
            path: path.to_owned(),
            version,
        });
    }
    for size in SIZES {
        let actual = u32::from_le_bytes(from.array().map_err(read)?);
        if actual != size {
            let reason = format!("its descriptors have {actual} bytes instead of {size}");
            return Err(damaged(path, reason));
        }
    }
    let count = u64::from_le_bytes(from.array().map_err(read)?);
    let expected = count
        .checked_mul(PLACE_BYTES as u64)
        .and_then(|places| places.checked_add((HEADER_BYTES + CHECKSUM_BYTES) as u64));
    match expected == Some(bytes) {
        true => Ok(count as usize),
        false => {
            let reason = format!("it has {bytes} bytes, which do not fit its {count} places");
            Err(damaged(path, reason))
        }
    }
}

fn damaged(path: &Path, reason: String) -> PlaceFileError {
    PlaceFileError::Damaged {
        path: path.to_owned(),
        reason,
    }
}

/// A stream with the checksum of all that was read from it or written to it.
struct Checked<S> {
    stream: S,
    checksum: Hasher,
}

impl<S: Write> Checked<S> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.checksum.update(bytes);
        self.stream.write_all(bytes)
    }
}

impl<S: Read> Checked<S> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<()> {
        self.stream.read_exact(bytes)?;
        self.checksum.update(bytes);
        Ok(())
    }

    fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.read(&mut bytes)?;
        Ok(bytes)
    }
}
