//! The file of all keyframes of a run.
//!
//! A keyframe is appended before its pose is journalled. So each pose of the journal that the selection of keyframes takes has its
//! keyframe here. The end of the stream is a record without bytes.

use std::path::{Path, PathBuf};

use gyre_storage::{Log, LogError, LogMagic, LogReader};
use thiserror::Error;

use crate::{Keyframe, MalformedKeyframe};

/// The start of the file, with the version of [`Keyframe::encode`].
const MAGIC: LogMagic = *b"gyre keyframe 1\n";

/// An error of a file of keyframes.
#[derive(Debug, Error)]
pub enum KeyframeError {
    /// The file cannot be read or written, is of another kind or damaged.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A record is whole and not a keyframe.
    #[error("keyframe {index}: {source}")]
    Malformed {
        /// The number of the keyframe, from 0.
        index: usize,
        /// What it is.
        source: MalformedKeyframe,
    },
}

/// Returns the path of the keyframes of the run that writes to `out`.
pub fn keyframes_path(out: &Path) -> PathBuf {
    out.join("journal").join("keyframes.log")
}

/// The keyframes of a run, open for appending.
#[derive(Debug)]
pub struct KeyframeLog {
    log: Log,
    ended: bool,
    buffer: Vec<u8>,
}

impl KeyframeLog {
    /// Opens or creates the file, and cuts off what a death or a power failure has left of the last keyframes.
    ///
    /// # Errors
    /// A file that cannot be read or written, is of another kind, is damaged, or to which another process writes.
    pub fn open(path: &Path) -> Result<Self, KeyframeError> {
        let log = Log::open(path, MAGIC)?;
        let mut buffer = Vec::new();
        let ended = match log.len().checked_sub(1) {
            Some(last) => {
                log.read(last, &mut buffer)?;
                buffer.is_empty()
            }
            None => false,
        };
        Ok(Self { log, ended, buffer })
    }

    /// Returns the number of keyframes.
    pub fn len(&self) -> usize {
        self.log.len() - usize::from(self.ended)
    }

    /// Returns whether there are no keyframes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Reads a keyframe.
    ///
    /// # Errors
    /// A file that cannot be read or is damaged there.
    ///
    /// # Panics
    /// There are no more than `index` keyframes.
    pub fn read(&mut self, index: usize) -> Result<Keyframe, KeyframeError> {
        self.log.read(index, &mut self.buffer)?;
        decode(index, &self.buffer)
    }

    /// Appends a keyframe. A reader sees it when this returns.
    ///
    /// # Errors
    /// A file that cannot be written or synchronised.
    pub fn append(&mut self, keyframe: &Keyframe) -> Result<(), KeyframeError> {
        self.buffer.clear();
        keyframe.encode(&mut self.buffer);
        Ok(self.log.append(&self.buffer)?)
    }

    /// Counts a pose that is about to be journalled and that is of use only with the keyframes before it.
    /// See [`Log::rely`].
    ///
    /// # Errors
    /// A file that cannot be synchronised.
    pub fn rely(&mut self) -> Result<(), KeyframeError> {
        Ok(self.log.rely()?)
    }

    /// Says that no more keyframes follow. All of them survive a power failure when this returns.
    ///
    /// # Errors
    /// A file that cannot be written or synchronised.
    pub fn end(&mut self) -> Result<(), KeyframeError> {
        if !self.ended {
            self.log.append(&[])?;
            self.ended = true;
        }
        Ok(self.log.sync()?)
    }

    /// Keeps the first `keyframes` keyframes, and cuts off those behind them and the end. The cut survives a power failure.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn cut(&mut self, keyframes: usize) -> Result<(), KeyframeError> {
        self.log.cut(keyframes.min(self.len()))?;
        self.ended = false;
        Ok(())
    }
}

/// Reads the keyframes of a run to which pose-integration may append.
#[derive(Debug)]
pub struct KeyframeReader {
    log: LogReader,
    ended: bool,
    buffer: Vec<u8>,
}

impl KeyframeReader {
    /// Opens the file and finds its complete keyframes. One that does not exist yet is empty.
    ///
    /// # Errors
    /// A file that cannot be read, is of another kind or damaged.
    pub fn open(path: &Path) -> Result<Self, KeyframeError> {
        let mut reader = Self {
            log: LogReader::open(path, MAGIC)?,
            ended: false,
            buffer: Vec::new(),
        };
        reader.refresh()?;
        Ok(reader)
    }

    /// Looks for keyframes that were appended or cut off meanwhile; returns the number of complete ones now.
    ///
    /// # Errors
    /// A file that cannot be read, is of another kind or damaged.
    pub fn refresh(&mut self) -> Result<usize, KeyframeError> {
        self.ended = match self.log.refresh()?.checked_sub(1) {
            Some(last) => {
                self.log.read(last, &mut self.buffer)?;
                self.buffer.is_empty()
            }
            None => false,
        };
        Ok(self.len())
    }

    /// Returns the number of complete keyframes at the last [`refresh`](Self::refresh).
    pub fn len(&self) -> usize {
        self.log.len() - usize::from(self.ended)
    }

    /// Returns how many of the first keyframes were known before the last [`refresh`](Self::refresh), and are the same. Fewer than
    /// were known if pose-integration was restarted and has cut some off; it may have appended others since.
    pub fn unchanged(&self) -> usize {
        self.log.unchanged().min(self.len())
    }

    /// Returns whether there were no keyframes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns whether the stream had ended: no more keyframes follow.
    pub fn has_ended(&self) -> bool {
        self.ended
    }

    /// Reads a keyframe.
    ///
    /// # Errors
    /// A file that cannot be read or is damaged there.
    ///
    /// # Panics
    /// There are no more than `index` keyframes.
    pub fn read(&mut self, index: usize) -> Result<Keyframe, KeyframeError> {
        self.log.read(index, &mut self.buffer)?;
        decode(index, &self.buffer)
    }
}

fn decode(index: usize, bytes: &[u8]) -> Result<Keyframe, KeyframeError> {
    Keyframe::decode(bytes).map_err(|source| KeyframeError::Malformed { index, source })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_geometry::{Pose, SparsePoint, Twist, UncertainMotion};

    use super::*;

    fn keyframe(seq: u64) -> Keyframe {
        let still = UncertainMotion {
            motion: Pose::identity(),
            covariance: nalgebra::Matrix3::zeros(),
        };
        Keyframe {
            seq,
            scan: seq,
            stamp_ns: 0,
            pose: still,
            motion: still,
            twist: Twist::default(),
            path_m: 0.0,
            points: vec![SparsePoint::default(); seq as usize],
        }
    }

    #[test]
    fn keyframes_are_read_while_they_are_appended_until_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = keyframes_path(folder.path());
        let mut reader = KeyframeReader::open(&path).unwrap();
        assert_eq!((reader.len(), reader.has_ended()), (0, false));
        let mut log = KeyframeLog::open(&path).unwrap();
        for seq in 0..3 {
            log.append(&keyframe(seq)).unwrap();
            assert_eq!(reader.refresh().unwrap() as u64, seq + 1);
            assert_eq!(reader.read(seq as usize).unwrap(), keyframe(seq));
        }
        log.end().unwrap();
        log.end().unwrap();
        assert_eq!((reader.refresh().unwrap(), reader.has_ended()), (3, true));
    }

    #[test]
    fn a_cut_removes_keyframes_and_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = keyframes_path(folder.path());
        let mut log = KeyframeLog::open(&path).unwrap();
        (0..3).for_each(|seq| log.append(&keyframe(seq)).unwrap());
        log.end().unwrap();
        drop(log);
        let mut log = KeyframeLog::open(&path).unwrap();
        assert_eq!(log.len(), 3);
        log.cut(3).unwrap();
        let mut reader = KeyframeReader::open(&path).unwrap();
        assert_eq!((reader.len(), reader.has_ended()), (3, false));
        log.cut(1).unwrap();
        log.append(&keyframe(7)).unwrap();
        assert_eq!((reader.refresh().unwrap(), log.len()), (2, 2));
        assert_eq!(reader.unchanged(), 1);
        assert_eq!(log.read(1).unwrap().seq, 7);
    }
}
