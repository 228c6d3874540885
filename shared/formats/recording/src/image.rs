//! The image in a payload: its rows, which a viewer draws, and the rest.

use bytemuck::pod_read_unaligned;
use gyre_contract::{Masked, MaskedHeader, Message, Scan, ScanHeader};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rows {
    pub first: usize,
    /// Bytes from one row to the next.
    pub stride: usize,
    pub width: usize,
    pub count: usize,
    pub cell: usize,
    /// The encoding of the cells, as viewers name it.
    pub encoding: &'static str,
}

impl Rows {
    /// Returns the image of a message; `None` for a topic without one, or a header without rows.
    pub fn of(topic: &str, header: &[u8]) -> Option<Self> {
        let rows = match topic {
            // The powers, azimuth x range bin.
            Scan::TOPIC => {
                let header: ScanHeader = read(header)?;
                Self {
                    first: header.first_byte as usize,
                    // Of a single row it has no meaning.
                    stride: header.stride.max(header.bins) as usize,
                    width: header.bins as usize,
                    count: header.azimuths as usize,
                    cell: 1,
                    encoding: "mono8",
                }
            }
            // The first raster, n x n.
            Masked::TOPIC => {
                let count = read::<MaskedHeader>(header)?.n as usize;
                let width = count * size_of::<f32>();
                Self {
                    first: 0,
                    stride: width,
                    width,
                    count,
                    cell: size_of::<f32>(),
                    encoding: "32FC1",
                }
            }
            _ => return None,
        };
        (rows.count > 0 && rows.width > 0 && rows.width <= rows.stride).then_some(rows)
    }

    /// Returns the image and the rest of a payload, in order; `None` if the payload is shorter than
    /// the image.
    pub fn split(&self, payload: &[u8]) -> Option<(Vec<u8>, Vec<u8>)> {
        let mut image = Vec::with_capacity(self.count.checked_mul(self.width)?.min(payload.len()));
        let mut rest = payload.get(..self.first)?.to_vec();
        let mut at = self.first;
        for row in 0..self.count {
            let end = at.checked_add(self.width)?;
            image.extend_from_slice(payload.get(at..end)?);
            at = match row + 1 == self.count {
                true => end,
                false => at.checked_add(self.stride)?,
            };
            rest.extend_from_slice(payload.get(end..at)?);
        }
        rest.extend_from_slice(payload.get(at..)?);
        Some((image, rest))
    }

    /// Returns the payload of an image and its rest; `None` if they are not of these rows.
    pub fn join(&self, image: &[u8], rest: &[u8]) -> Option<Vec<u8>> {
        if image.len() != self.count.checked_mul(self.width)? {
            return None;
        }
        let (mut rows, between) = (image.chunks_exact(self.width), self.stride - self.width);
        let (before, mut rest) = rest.split_at_checked(self.first)?;
        let mut payload = [before, rows.next()?].concat();
        for row in rows {
            let (gap, after) = rest.split_at_checked(between)?;
            payload.extend_from_slice(gap);
            payload.extend_from_slice(row);
            rest = after;
        }
        payload.extend_from_slice(rest);
        Some(payload)
    }
}

/// Reads a header; `None` if it has not its size.
pub(crate) fn read<H: bytemuck::AnyBitPattern>(header: &[u8]) -> Option<H> {
    (header.len() == size_of::<H>()).then(|| pod_read_unaligned(header))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(first: usize, stride: usize, width: usize, count: usize) -> Rows {
        Rows {
            first,
            stride,
            width,
            count,
            cell: 1,
            encoding: "mono8",
        }
    }

    #[test]
    fn a_payload_is_put_together_as_it_was_taken_apart() {
        let payload: Vec<u8> = (0..=255).collect();
        for rows in [
            rows(0, 8, 8, 4),
            rows(11, 20, 9, 3),
            rows(3, 64, 64, 1),
            rows(5, 7, 1, 30),
        ] {
            let (image, rest) = rows.split(&payload).unwrap();
            assert_eq!(image.len(), rows.width * rows.count);
            assert_eq!(image[0], rows.first as u8);
            assert_eq!(image.len() + rest.len(), payload.len());
            assert_eq!(rows.join(&image, &rest).unwrap(), payload, "{rows:?}");
            assert_eq!(rows.join(&image[1..], &rest), None);
        }
    }

    #[test]
    fn an_image_beyond_its_payload_is_none() {
        assert_eq!(rows(0, 10, 10, 3).split(&[0; 29]), None);
        let absurd = rows(usize::MAX, usize::MAX, 10, 3);
        assert_eq!(absurd.split(&[0; 29]), None);
        assert_eq!(absurd.join(&[0; 30], &[]), None);
    }
}
