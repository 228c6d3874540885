//! The commands of the run: masking decides from which scan on a command applies, since it numbers
//! the scans.

use gyre_contract::{Command, Commands, Item, flag};
use gyre_transport::RunError;

pub struct AppliedCommands {
    commands: Commands,
    /// Number of scans that can be in flight.
    window: usize,
    /// The first scan that no earlier masking has published: from there on new commands can apply.
    unseen_from: Option<u64>,
    /// The number of commands that applied to the last scan.
    last: Option<u64>,
}

impl AppliedCommands {
    pub fn new(commands: Commands, window: usize) -> Self {
        Self {
            commands,
            window,
            unseen_from: None,
            last: None,
        }
    }

    /// Writes the number of commands that apply to a scan into its item, and starts a chain of
    /// motions there if one of them is new and resets the run; once for each scan that is
    /// processed. `resume_at` is the item of the newest pose at the last start of the sink: nothing
    /// of it or of earlier scans changes any more.
    pub fn mark(&mut self, item: &Item, resume_at: &Item) -> Result<Item, RunError> {
        let newest = (!resume_at.is(flag::BASE)).then_some(resume_at.seq);
        let first_in_flight = newest.map_or(0, |newest| newest + 1);
        let unseen_from = first_in_flight.saturating_add(self.window as u64);
        let is_unseen = item.seq >= *self.unseen_from.get_or_insert(unseen_from);
        let is_old = item.seq < first_in_flight;
        let before = self.last.unwrap_or(resume_at.commands);
        let apply = match is_old {
            true => resume_at.commands,
            false => {
                let apply = self.commands.apply(item.stamp_ns, is_unseen);
                apply.map_err(RunError::input)?.max(before)
            }
        };
        let mut marked = Item {
            commands: apply,
            ..*item
        };
        let mut new = self.commands.between(before, apply);
        if new.any(Command::starts_chain) {
            marked.flags |= flag::BREAK;
            marked.previous_scan = marked.scan;
        }
        self.last = Some(apply);
        Ok(marked)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use gyre_contract::GivenPose;

    use super::*;

    fn item(seq: u64) -> Item {
        Item {
            scan: seq,
            previous_scan: seq.saturating_sub(1),
            stamp_ns: seq as i64,
            ..Item::numbered(seq)
        }
    }

    #[test]
    fn a_reset_starts_the_chain_once_also_in_a_masking_that_is_started_again() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("journal")).unwrap();
        let open = || Commands::open(folder.path()).unwrap();
        let (base, at) = (Item::default().flagged(flag::BASE), GivenPose::default());
        let mut first = AppliedCommands::new(open(), 0);
        let mut given = open();
        given.add(Command::Locate { at }).unwrap();
        assert_eq!(first.mark(&item(3), &base).unwrap().commands, 1);
        let reset = Command::Reset {
            at,
            keep_map: false,
        };
        given.add(reset).unwrap();
        for masking in [&mut first, &mut AppliedCommands::new(open(), 0)] {
            let mut marked = |seq| masking.mark(&item(seq), &item(3).with_commands(1)).unwrap();
            let states = [4, 5].map(|seq| {
                let it = marked(seq);
                (it.commands, it.is(flag::BREAK), it.previous_scan)
            });
            assert_eq!(states, [(2, true, 4), (2, false, 4)]);
        }
        // An earlier masking may have published a window of scans.
        let mut behind = AppliedCommands::new(open(), 2);
        let newest = item(4).with_commands(2);
        given.add(reset).unwrap();
        let breaks = [5, 6, 7].map(|seq| {
            let it = behind.mark(&item(seq), &newest).unwrap();
            (it.commands, it.is(flag::BREAK))
        });
        assert_eq!(breaks, [(2, false), (2, false), (3, true)]);
        // The newest pose is of the scan with the reset.
        let mut resumed = AppliedCommands::new(open(), 0);
        let newest = item(4).with_commands(2);
        let commands = |it: Item| (it.commands, it.is(flag::BREAK));
        assert_eq!(
            commands(resumed.mark(&item(4), &newest).unwrap()),
            (2, false)
        );
        assert_eq!(
            commands(resumed.mark(&item(5), &newest).unwrap()),
            (2, false)
        );
    }

    trait WithCommands {
        fn with_commands(self, commands: u64) -> Self;
    }

    impl WithCommands for Item {
        fn with_commands(self, commands: u64) -> Self {
            Self { commands, ..self }
        }
    }
}
