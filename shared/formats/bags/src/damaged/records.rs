//! The records in a part of a file.

use mcap::{
    McapError,
    records::Record,
    sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use super::parse::{chunks_hold_their_records, parse};

/// Calls `each` with all records in the bytes of a file, of chunks with those in them. Their
/// checksums are compared.
///
/// # Errors
/// The bytes are damaged, a record is larger than `max_record_bytes`, or `each` has failed. Records
/// at the end that are not whole are none.
pub fn records(
    mut bytes: &[u8],
    max_record_bytes: usize,
    mut each: impl FnMut(Record<'_>) -> Result<(), McapError>,
) -> Result<(), McapError> {
    if !chunks_hold_their_records(bytes) {
        return Err(McapError::UnexpectedEoc);
    }
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(max_record_bytes);
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(_) if bytes.is_empty() => break,
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = bytes.split_at(wanted.min(bytes.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                bytes = later;
            }
            LinearReadEvent::Record { data, opcode } => each(parse(opcode, data)?)?,
        }
    }
    Ok(())
}
