//! The order of a bag's files by the times of their messages. Names do not give it: tools number
//! parts in several ways, and a folder may have several bags.

use std::path::{Path, PathBuf};

use crate::{
    BagError,
    spans::{Times, joined, spans},
};

/// Files of one recorder overlap by no more than this, ns: messages are a little out of order where
/// one file ends.
const OVERLAP_NS: u64 = 1_000_000_000;

/// A file and the times of its messages.
struct Timed {
    path: PathBuf,
    times_ns: Times,
}

/// Returns the files of a folder in the order of their first messages; those without messages come
/// first.
///
/// # Errors
/// A file cannot be read, or files are of the same time.
pub(crate) fn by_time(folder: &Path, paths: Vec<PathBuf>) -> Result<Vec<PathBuf>, BagError> {
    let mut files = Vec::new();
    for path in paths {
        let file = gyre_storage::open(&path).map_err(|error| BagError::io(&path, error))?;
        let spans = spans(&path, &file)?.messages.into_iter();
        let times_ns = spans.map(|span| span.times_ns).fold(None, joined);
        files.push(Timed { path, times_ns });
    }
    files.sort_by_key(|file| file.times_ns);
    for pair in files.windows(2) {
        require_order(folder, &pair[0], &pair[1])?;
    }
    Ok(files.into_iter().map(|file| file.path).collect())
}

fn require_order(folder: &Path, earlier: &Timed, later: &Timed) -> Result<(), BagError> {
    let (Some((_, end)), Some((begin, _))) = (earlier.times_ns, later.times_ns) else {
        return Ok(());
    };
    if begin.saturating_add(OVERLAP_NS) >= end {
        return Ok(());
    }
    let name = |file: &Timed| file.path.file_name().unwrap_or_default().to_owned();
    let overlap_s = (end - begin) as f64 * 1e-9;
    let reason = format!(
        "has files of the same time: {} begins {overlap_s:.1} s before {} ends, so that they are of several bags; give each a folder of \
         its own, or name one file",
        name(later).display(),
        name(earlier).display()
    );
    Err(BagError::unreadable(folder, reason))
}
