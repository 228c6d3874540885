//! Waiting for the very moment of a write to a file.

use std::{mem::MaybeUninit, path::Path, time::Duration};

use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    fd::OwnedFd,
    fs::inotify::{self, CreateFlags, Reader, WatchFlags},
    io::Errno,
};

/// A watch of a file, or of the files in a folder.
pub struct Watch(OwnedFd);

impl Watch {
    /// Begins to watch. `None` if there is no such file.
    pub fn of(path: &Path) -> Option<Self> {
        let watch = inotify::init(CreateFlags::NONBLOCK | CreateFlags::CLOEXEC).unwrap();
        inotify::add_watch(
            &watch,
            path,
            WatchFlags::MODIFY | WatchFlags::CREATE | WatchFlags::MOVED_TO,
        )
        .ok()?;
        Some(Self(watch))
    }

    /// Waits until `writes` writes pass `counts`, which has the name of the file in a watched
    /// folder. `None` after `limit` without a match.
    pub fn wait(
        &self,
        mut writes: usize,
        limit: Duration,
        counts: impl Fn(&str) -> bool,
    ) -> Option<()> {
        let limit = Timespec::try_from(limit).unwrap();
        let mut buffer = [MaybeUninit::uninit(); 4096];
        let mut events = Reader::new(&self.0, &mut buffer);
        loop {
            match events.next() {
                Ok(event) => {
                    let name = event
                        .file_name()
                        .map_or("".into(), |name| name.to_string_lossy());
                    writes -= usize::from(counts(&name));
                    if writes == 0 {
                        return Some(());
                    }
                }
                Err(Errno::WOULDBLOCK) => {
                    let ready =
                        poll(&mut [PollFd::new(&self.0, PollFlags::IN)], Some(&limit)).unwrap();
                    (ready > 0).then_some(())?;
                }
                Err(error) => panic!("inotify: {error}"),
            }
        }
    }
}
