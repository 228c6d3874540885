//! The fixes of a live GNSS receiver: messages of `gnss` are appended to `journal/gnss.csv`, from
//! where the trajectory and the results have them.

use std::mem;

use gyre_contract::{Gnss, GnssHeader};
use gyre_datasets::SampleLog;
use gyre_geometry::samples::GnssConfig;
use gyre_recording::{ReceivedFixes, received_fixes};
use gyre_slam::Fixes;
use gyre_stage::source::fixes_sent;
use gyre_storage::{File, GroupSync};
use gyre_transport::{
    Manifest, RunError,
    numbers::{self, Numbers},
    reader::Port,
    transport::Node,
};

/// The file with the number of the next message, and the length of the log: a trajectory that is
/// restarted continues there.
const TAKEN: &str = "trajectory.fixes";
/// Maximum size of the log, bytes: several days of fixes.
const MAX_LOG: u64 = 1 << 30;
/// The time to examine all fixes grows with their number. So during the run they are examined when
/// one in so many is new: after ten hours at 20 Hz that is every 18 s.
const NEW_SHARE: usize = 2000;

pub(super) struct LiveFixes {
    config: GnssConfig,
    manifest: Manifest,
    port: Port<Gnss>,
    /// The next message.
    next: u64,
    file: File,
    end: u64,
    /// Lost messages that no row of the log counts yet.
    lost: u64,
    sync: GroupSync,
    taken: Numbers<2>,
    received: ReceivedFixes,
    examined: usize,
    has_ended: bool,
}

fn taken(manifest: &Manifest) -> Option<[u64; 2]> {
    numbers::read(&manifest.root.join(TAKEN))
}

impl LiveFixes {
    /// Returns whether the run has logged messages. One that has not, and has no scan to come, logs
    /// none: they may be of another drive.
    pub fn have_begun(manifest: &Manifest) -> bool {
        taken(manifest).is_some()
    }

    /// Subscribes to the topic, and continues the log if there is one.
    pub fn open(config: GnssConfig, node: &Node, manifest: &Manifest) -> Result<Self, RunError> {
        let path = received_fixes(&manifest.out);
        let file = File::open_or_create(&path)?;
        let length = file.length()?;
        let [next, end] = taken(manifest).unwrap_or([0, length]);
        file.cut_to(end)?;
        let start = match end {
            0 => SampleLog::table_of_fixes(&[], false),
            // A kill of the run may have cut the last row.
            _ => "\n".to_owned(),
        };
        file.write_at(start.as_bytes(), end)?;
        let mut fixes = Self {
            port: Port::open(node, manifest)?,
            next,
            sync: GroupSync::start(&file)?,
            end: file.length()?,
            lost: 0,
            file,
            taken: Numbers::open(manifest, TAKEN)?,
            received: ReceivedFixes::read(&path).map_err(RunError::input)?,
            examined: 0,
            has_ended: false,
            manifest: manifest.clone(),
            config,
        };
        fixes.taken.write([fixes.next, fixes.end])?;
        Ok(fixes)
    }

    /// Logs the messages that have arrived.
    pub fn take(&mut self) -> Result<(), RunError> {
        self.take_until(0)
    }

    /// Logs the messages that have arrived, and ends: the log does not change any more.
    pub fn finish(&mut self) -> Result<(), RunError> {
        self.take_until(fixes_sent(&self.manifest))?;
        self.has_ended = true;
        Ok(self.sync.finish()?)
    }

    /// Logs the messages that have arrived; those before number `sent` that have not are lost.
    fn take_until(&mut self, sent: u64) -> Result<(), RunError> {
        if self.has_ended {
            return Ok(());
        }
        let mut rows = String::new();
        while let Some(message) = self.port.receive()? {
            let message = message.header();
            // A trajectory that is restarted also receives messages that it has logged before.
            let Some(missing) = message.item.seq.checked_sub(self.next) else {
                continue;
            };
            self.next = message.item.seq.saturating_add(1);
            let lost = missing.saturating_add(message.lost);
            self.lost = self.lost.saturating_add(lost);
            match self.end < MAX_LOG {
                true => rows += &row(message),
                false => self.lost = self.lost.saturating_add(1),
            }
        }
        let unsent = sent.saturating_sub(self.next);
        self.lost = self.lost.saturating_add(unsent);
        self.next = self.next.max(sent);
        // A full log gets one row of them, at its end.
        if self.lost > 0 && (self.end < MAX_LOG || sent > 0) {
            rows += &format!("lost,{}\n", mem::take(&mut self.lost));
        }
        match rows.is_empty() {
            true => Ok(()),
            false => self.append(&rows),
        }
    }

    fn append(&mut self, rows: &str) -> Result<(), RunError> {
        self.received.add(rows);
        self.file.write_at(rows.as_bytes(), self.end)?;
        self.end += rows.len() as u64;
        self.taken.write([self.next, self.end])?;
        Ok(self.sync.changed()?)
    }

    /// Returns all fixes of the log; `None` if no fix is new, or few are new beside all. After
    /// `is_last` no fix follows.
    pub fn examine(&mut self, is_last: bool) -> Result<Option<Fixes>, RunError> {
        if is_last {
            self.finish()?;
        }
        let new = self.received.count() - self.examined;
        let least = if is_last {
            1
        } else {
            self.examined / NEW_SHARE + 1
        };
        Ok((new >= least).then(|| {
            self.examined += new;
            let fixes = self.received.log().on_radar(&self.config);
            Fixes::new(fixes, &self.config)
        }))
    }
}

/// Returns the rows of the log for a message, without those that were lost.
fn row(message: &GnssHeader) -> String {
    match (message.fix(), message.unreadable, message.lost) {
        (Some(fix), ..) => SampleLog::row_of_fix(&fix),
        (None, 0, 0) => format!("{},,,,0\n", message.item.stamp_ns),
        (None, 0, _) => String::new(),
        (None, unreadable, _) => format!("unreadable,{unreadable}\n"),
    }
}
