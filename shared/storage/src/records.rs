//! The logs of a run, each of one type of record. The end of the stream is a record without bytes.

use std::{
    marker::PhantomData,
    path::{Path, PathBuf},
};

use crate::log::{Log, LogError, LogKind, LogMagic, LogReader};

pub trait Record: Sized {
    const FILE: &'static str;
    /// The start of the file, with the version of the records.
    const MAGIC: LogMagic;
    /// The bytes of each record if all have the same number, and the log has no end: a log of any
    /// length is then opened at once.
    const LENGTH: Option<usize> = None;

    /// Appends the form in a file, which is not empty.
    fn encode(&self, bytes: &mut Vec<u8>);
    /// Decodes what [`encode`](Self::encode) has written; `None` if it is something else.
    fn decode(bytes: &[u8]) -> Option<Self>;
}

const fn kind<R: Record>() -> LogKind {
    LogKind {
        magic: R::MAGIC,
        length: R::LENGTH,
    }
}

pub fn records_path<R: Record>(out: &Path) -> PathBuf {
    out.join("journal").join(R::FILE)
}

#[derive(Debug)]
pub struct RecordLog<R> {
    log: Log,
    ended: bool,
    buffer: Vec<u8>,
    records: PhantomData<R>,
}

impl<R: Record> RecordLog<R> {
    /// Opens or creates the file of the run that writes to `out`, and cuts off incomplete last
    /// records, left by a death or a power failure.
    pub fn open(out: &Path) -> Result<Self, LogError> {
        Self::open_file(&records_path::<R>(out))
    }

    pub fn open_file(path: &Path) -> Result<Self, LogError> {
        let log = Log::open(path, kind::<R>())?;
        let mut buffer = Vec::new();
        if let Some(last) = log.len().checked_sub(1) {
            log.read(last, &mut buffer)?;
        }
        Ok(Self {
            ended: !log.is_empty() && buffer.is_empty(),
            log,
            buffer,
            records: PhantomData,
        })
    }

    pub fn len(&self) -> usize {
        self.log.len() - usize::from(self.ended)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Allocates the memory for appending records of up to `bytes` bytes in the file: later appends
    /// allocate nothing.
    pub fn reserve(&mut self, bytes: usize) {
        self.buffer.reserve(bytes);
        self.log.reserve(bytes);
    }

    /// Reads a record; panics beyond the last one.
    pub fn read(&mut self, index: usize) -> Result<R, LogError> {
        self.log.read(index, &mut self.buffer)?;
        R::decode(&self.buffer).ok_or_else(|| self.log.malformed(index))
    }

    pub fn append(&mut self, record: &R) -> Result<(), LogError> {
        self.buffer.clear();
        record.encode(&mut self.buffer);
        self.log.append(&self.buffer)
    }

    /// Counts a change of another file that is of use only with the records that were appended. See
    /// [`Log::rely`].
    pub fn rely(&mut self) -> Result<(), LogError> {
        self.log.rely()
    }

    /// Marks the end of the records. All of them survive a power failure when this returns.
    pub fn end(&mut self) -> Result<(), LogError> {
        if !self.ended {
            self.log.append(&[])?;
            self.ended = true;
        }
        self.sync()
    }

    pub fn sync(&self) -> Result<(), LogError> {
        self.log.sync()
    }

    /// Keeps the first `records` records, and cuts off those behind them and the end. The cut
    /// survives a power failure.
    pub fn cut(&mut self, records: usize) -> Result<(), LogError> {
        self.log.cut(records.min(self.len()))?;
        self.ended = false;
        Ok(())
    }
}

/// Reads a file of records while another process may append to it.
#[derive(Debug)]
pub struct RecordReader<R> {
    log: LogReader,
    ended: bool,
    buffer: Vec<u8>,
    records: PhantomData<R>,
}

impl<R: Record> RecordReader<R> {
    /// Opens the file of the run that writes to `out` and finds its complete records. One that does
    /// not exist yet is empty.
    pub fn open(out: &Path) -> Result<Self, LogError> {
        Self::open_file(&records_path::<R>(out))
    }

    pub fn open_file(path: &Path) -> Result<Self, LogError> {
        let mut reader = Self {
            log: LogReader::open(path, kind::<R>())?,
            ended: false,
            buffer: Vec::new(),
            records: PhantomData,
        };
        reader.refresh()?;
        Ok(reader)
    }

    /// Looks for records that were appended or cut off meanwhile; returns the number of complete
    /// ones now.
    pub fn refresh(&mut self) -> Result<usize, LogError> {
        self.ended = match self.log.refresh()?.checked_sub(1) {
            Some(last) => {
                self.log.read(last, &mut self.buffer)?;
                self.buffer.is_empty()
            }
            None => false,
        };
        Ok(self.len())
    }

    /// Returns the number of complete records at the last [`refresh`](Self::refresh).
    pub fn len(&self) -> usize {
        self.log.len() - usize::from(self.ended)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of records behind the complete ones: those that a power failure has left
    /// in part. Only for records of one length.
    pub fn torn(&self) -> usize {
        self.log.torn()
    }

    /// Reads the records from `first` on.
    pub fn from(mut self, first: usize) -> impl Iterator<Item = Result<R, LogError>> {
        (first..self.len()).map(move |index| self.read(index))
    }

    /// Returns how many of the first records were known before the last [`refresh`](Self::refresh),
    /// and are the same: fewer than were known if some were cut off.
    pub fn unchanged(&self) -> usize {
        self.log.unchanged().min(self.len())
    }

    pub fn has_ended(&self) -> bool {
        self.ended
    }

    /// Reads a record; panics beyond the last one.
    pub fn read(&mut self, index: usize) -> Result<R, LogError> {
        self.log.read(index, &mut self.buffer)?;
        R::decode(&self.buffer).ok_or_else(|| self.log.malformed(index))
    }

    /// Decodes the first `length` bytes of a record, which are not checked: the checksum covers the
    /// whole record. Panics beyond the last one.
    pub fn read_start(&mut self, index: usize, length: usize) -> Result<R, LogError> {
        self.log.read_start(index, length, &mut self.buffer)?;
        R::decode(&self.buffer).ok_or_else(|| self.log.malformed(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq)]
    struct Number(u32);

    impl Record for Number {
        const FILE: &'static str = "numbers.log";
        const MAGIC: LogMagic = *b"gyre numbers 1  ";

        fn encode(&self, bytes: &mut Vec<u8>) {
            bytes.extend(self.0.to_le_bytes());
        }

        fn decode(bytes: &[u8]) -> Option<Self> {
            let number = <[u8; 4]>::try_from(bytes).ok()?;
            Some(Self(u32::from_le_bytes(number)))
        }
    }

    #[test]
    fn records_are_read_while_they_are_appended_until_the_end() {
        let out = tempfile::tempdir().unwrap();
        let mut reader = RecordReader::<Number>::open(out.path()).unwrap();
        assert_eq!((reader.len(), reader.has_ended()), (0, false));
        let mut log = RecordLog::open(out.path()).unwrap();
        for number in 0..3 {
            log.append(&Number(number)).unwrap();
            assert_eq!(reader.refresh().unwrap(), number as usize + 1);
            assert_eq!(reader.read(number as usize).unwrap(), Number(number));
        }
        log.end().unwrap();
        log.end().unwrap();
        assert_eq!((reader.refresh().unwrap(), reader.has_ended()), (3, true));
        let rest: Result<Vec<_>, _> = reader.from(1).collect();
        assert_eq!(rest.unwrap(), [Number(1), Number(2)]);
    }

    #[test]
    fn a_cut_removes_records_and_the_end_and_its_readers_know() {
        let out = tempfile::tempdir().unwrap();
        let mut log = RecordLog::open(out.path()).unwrap();
        (0..3).for_each(|number| log.append(&Number(number)).unwrap());
        log.end().unwrap();
        drop(log);
        let mut reader = RecordReader::<Number>::open(out.path()).unwrap();
        let mut log = RecordLog::open(out.path()).unwrap();
        assert_eq!(log.len(), 3);
        log.cut(1).unwrap();
        log.append(&Number(7)).unwrap();
        assert_eq!((reader.refresh().unwrap(), reader.has_ended()), (2, false));
        assert_eq!(reader.unchanged(), 1);
        assert_eq!(log.read(1).unwrap(), Number(7));
    }

    #[test]
    fn a_whole_record_of_another_kind_is_refused_with_its_number() {
        let out = tempfile::tempdir().unwrap();
        let path = records_path::<Number>(out.path());
        let mut log = Log::open(&path, kind::<Number>()).unwrap();
        log.append(&[1, 2, 3]).unwrap();
        let mut reader = RecordReader::<Number>::open(out.path()).unwrap();
        let refused = reader.read(0).unwrap_err();
        assert!(refused.to_string().contains("record 0 of"), "{refused}");
        assert!(matches!(refused, LogError::Malformed { .. }));
    }
}
