//! Place indexes in files.
//!
//! Little-endian: the mark, the version, the sizes of a descriptor (sieve, spectrum) and the number
//! of places; for each place its id, its path, its sieve and its spectrum; the CRC-32 of all this.

use std::path::{Path, PathBuf};

use bytemuck::{cast_slice, pod_read_unaligned};
use gyre_storage::StorageError;

use super::{Descriptor, PlaceIndex, descriptor::SPECTRUM_BYTES};

const MARK: [u8; 8] = *b"GYREPLCS";
/// Increases with every change of the layout or of the meaning of descriptors.
const VERSION: u32 = 1;
const SIZES: [u32; 2] = [Descriptor::SIEVE_BYTES as u32, SPECTRUM_BYTES as u32];
const HEADER_BYTES: usize = MARK.len() + 4 + 8 + 8;
const PLACE_BYTES: usize = 16 + Descriptor::BYTES;
const CHECKSUM_BYTES: usize = 4;
/// The largest file, bytes: a million places.
const MAX_BYTES: u64 = 6 << 30;

#[derive(Debug, thiserror::Error)]
pub enum PlaceFileError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("{path} {reason}")]
    Unusable { path: PathBuf, reason: String },
}

impl PlaceIndex {
    /// Writes all places to a file, which is replaced only once it is complete.
    pub fn save(&self, path: &Path) -> Result<(), PlaceFileError> {
        let mut bytes = MARK.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(SIZES.iter().flat_map(|size| size.to_le_bytes()));
        bytes.extend((self.len() as u64).to_le_bytes());
        let sieves = self.sieves.chunks_exact(Descriptor::SIEVE_BYTES);
        let spectra = self.spectra.chunks_exact(SPECTRUM_BYTES);
        for (((id, path_m), sieve), spectrum) in self.places.iter().zip(sieves).zip(spectra) {
            bytes.extend(id.to_le_bytes());
            bytes.extend(path_m.to_le_bytes());
            bytes.extend_from_slice(sieve);
            bytes.extend_from_slice(cast_slice(spectrum));
        }
        let checksum = crc32fast::hash(&bytes);
        bytes.extend(checksum.to_le_bytes());
        Ok(gyre_storage::write(path, bytes)?)
    }

    pub fn load(path: &Path) -> Result<Self, PlaceFileError> {
        let bytes =
            gyre_storage::read_bytes(path, MAX_BYTES).map_err(StorageError::at("read", path))?;
        Self::decode(&bytes).map_err(|reason| PlaceFileError::Unusable {
            path: path.to_owned(),
            reason,
        })
    }

    fn decode(bytes: &[u8]) -> Result<Self, String> {
        let damaged = |reason: String| {
            format!("is damaged: {reason}; build the places again from their keyframes")
        };
        if bytes.len() < HEADER_BYTES + CHECKSUM_BYTES || !bytes.starts_with(&MARK) {
            return Err("is not a file of places".to_owned());
        }
        let [version, sizes @ ..] = pod_read_unaligned::<[u32; 3]>(&bytes[8..20]);
        if version != VERSION {
            return Err(format!(
                "has version {version} of places, but this program reads version {VERSION}: build the places again from their keyframes"
            ));
        }
        if sizes != SIZES {
            let reason = format!("its descriptors have {sizes:?} bytes instead of {SIZES:?}");
            return Err(damaged(reason));
        }
        let count: u64 = pod_read_unaligned(&bytes[20..HEADER_BYTES]);
        let (content, checksum) = bytes.split_at(bytes.len() - CHECKSUM_BYTES);
        let places = &content[HEADER_BYTES..];
        if count.checked_mul(PLACE_BYTES as u64) != Some(places.len() as u64) {
            let length = bytes.len();
            let reason = format!("it has {length} bytes, which do not fit its {count} places");
            return Err(damaged(reason));
        }
        if pod_read_unaligned::<u32>(checksum) != crc32fast::hash(content) {
            return Err(damaged("its checksum does not match".to_owned()));
        }
        let mut index = Self::with_capacity(count as usize);
        for place in places.chunks_exact(PLACE_BYTES) {
            let (id, path_m) = (&place[..8], &place[8..16]);
            // A place has the length of a descriptor.
            let descriptor = Descriptor::decode(&place[16..]).unwrap_or_default();
            index
                .insert(
                    pod_read_unaligned(id),
                    pod_read_unaligned(path_m),
                    &descriptor,
                )
                .map_err(|error| damaged(error.to_string()))?;
        }
        Ok(index)
    }
}
