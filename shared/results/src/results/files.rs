//! Results that are complete but for taking their places.

use std::path::Path;

use gyre_configuration::terminal::Failure;
use gyre_storage::{self as storage, Draft};

use crate::out::{FILES, Out, SIMULATED_TRUTH};

#[derive(Debug)]
pub struct Files<'a> {
    out: &'a Out,
    drafts: Vec<Draft>,
}

impl<'a> Files<'a> {
    pub fn new(out: &'a Out) -> Self {
        Self {
            out,
            drafts: Vec::new(),
        }
    }

    pub fn create(&self, name: &str) -> Result<Draft, Failure> {
        Ok(Draft::create(&self.out.join(name))?)
    }

    pub fn push(&mut self, draft: Draft) {
        self.drafts.push(draft);
    }

    pub fn add(&mut self, name: &str, content: impl AsRef<[u8]>) -> Result<(), Failure> {
        let mut draft = self.create(name)?;
        draft.append(content)?;
        self.push(draft);
        Ok(())
    }

    /// Makes all of them the results. Any other result is of fewer poses, and is removed.
    pub fn commit(self) -> Result<(), Failure> {
        let made = |path: &Path| self.drafts.iter().any(|draft| draft.path() == path);
        // The truth of a simulation is written when the run begins.
        let results = FILES.iter().filter(|name| **name != SIMULATED_TRUTH);
        let paths = results.map(|name| self.out.join(name));
        let others: Vec<_> = paths.filter(|path| !made(path)).collect();
        self.drafts.into_iter().try_for_each(Draft::commit)?;
        others.iter().try_for_each(|path| storage::remove(path))?;
        Ok(storage::sync_folder(self.out.path())?)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_result_that_is_not_made_again_is_removed_and_other_files_stay() {
        let folder = tempfile::tempdir().unwrap();
        let out = Out::lock(folder.path()).unwrap();
        let others = [SIMULATED_TRUTH, "notes.txt"];
        // The judgement of a run with ground truth, and a map.
        let old = ["errors.svg", "bands.svg", "map.png"];
        for name in [&others[..], &old, &["odometry.csv"]].concat() {
            fs::write(out.join(name), "old").unwrap();
        }
        let mut files = Files::new(&out);
        files.add("odometry.csv", "new").unwrap();
        files.commit().unwrap();
        assert_eq!(fs::read_to_string(out.join("odometry.csv")).unwrap(), "new");
        assert!(!old.iter().any(|name| out.join(name).exists()));
        assert!(others.iter().all(|name| out.join(name).exists()));
    }
}
