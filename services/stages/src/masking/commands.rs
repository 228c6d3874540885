//! The commands of the run: masking numbers the scans, so it decides which scan is the first of a
//! command.

use gyre_contract::{Command, Commands, Item, Window, flag};
use gyre_transport::RunError;

pub struct AppliedCommands {
    commands: Commands,
    /// The number of commands that applied to the last scan.
    last: Option<u64>,
    /// In lossless mode: scans in the window of the start may have been published by the masking
    /// before, and their readers have them without the commands that are new now. In live mode all
    /// stages start again with masking.
    window: Option<Window>,
    /// The number of the newest pose at the start.
    begun_at: Option<Option<u64>>,
}

impl AppliedCommands {
    pub fn new(commands: Commands, window: Option<Window>) -> Self {
        Self {
            commands,
            last: None,
            window,
            begun_at: None,
        }
    }

    /// Writes the number of commands that apply to a scan into its item, and starts a chain of
    /// motions there if one of them is new and resets the run; once for each scan that is
    /// processed. `resume_at` is the item of the newest pose at the last start of the sink: nothing
    /// of it or of earlier scans changes any more.
    pub fn mark(&mut self, item: &Item, resume_at: &Item) -> Result<Item, RunError> {
        let newest = (!resume_at.is(flag::BASE)).then_some(resume_at.seq);
        let begun_at = *self.begun_at.get_or_insert(newest);
        let is_old = newest.is_some_and(|newest| item.seq <= newest);
        let mut window = self.window.iter();
        let takes_new = !window.any(|window| window.admits(item.seq, begun_at));
        let before = self.last.unwrap_or(resume_at.commands);
        let apply = match is_old {
            true => resume_at.commands,
            false => {
                let apply = self.commands.apply(item.stamp_ns, takes_new);
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
        let mut first = AppliedCommands::new(open(), None);
        let mut given = open();
        given.add(Command::Locate { at }).unwrap();
        assert_eq!(first.mark(&item(3), &base).unwrap().commands, 1);
        let reset = Command::Reset {
            at,
            keep_map: false,
        };
        given.add(reset).unwrap();
        for masking in [&mut first, &mut AppliedCommands::new(open(), None)] {
            let mut marked = |seq| masking.mark(&item(seq), &item_with(3, 1)).unwrap();
            let states = [4, 5].map(|seq| {
                let it = marked(seq);
                (it.commands, it.is(flag::BREAK), it.previous_scan)
            });
            assert_eq!(states, [(2, true, 4), (2, false, 4)]);
        }
        // The newest pose is of the scan with the reset.
        let mut resumed = AppliedCommands::new(open(), None);
        let newest = item_with(4, 2);
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

    #[test]
    fn a_new_command_waits_for_a_scan_that_no_masking_before_has_published() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("journal")).unwrap();
        let open = || Commands::open(folder.path()).unwrap();
        open().add(Command::NewMap {}).unwrap();
        let window = Window {
            scans: 2,
            ..Window::default()
        };
        for _ in 0..2 {
            let mut masking = AppliedCommands::new(open(), Some(window));
            let mut commands = |seq| masking.mark(&item(seq), &item(3)).unwrap().commands;
            assert_eq!([4, 5, 6].map(&mut commands), [0, 0, 1]);
        }
    }

    fn item_with(seq: u64, commands: u64) -> Item {
        Item {
            commands,
            ..item(seq)
        }
    }
}
