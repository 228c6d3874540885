//! Results that are complete but for taking their places.

use gyre_storage::{self as storage, Draft};

use crate::{Failure, out::Out};

/// Results that take their places together.
#[derive(Debug)]
pub struct Files<'a> {
    out: &'a Out,
    drafts: Vec<Draft>,
}

impl<'a> Files<'a> {
    /// Starts without any.
    pub fn new(out: &'a Out) -> Self {
        Self {
            out,
            drafts: Vec::new(),
        }
    }

    /// Creates a file that is written piece by piece.
    ///
    /// # Errors
    /// A file that cannot be created.
    pub fn create(&self, name: &str) -> Result<Draft, Failure> {
        Ok(Draft::create(&self.out.join(name))?)
    }

    /// Adds a file that is written.
    pub fn push(&mut self, draft: Draft) {
        self.drafts.push(draft);
    }

    /// Writes a file and adds it.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn add(&mut self, name: &str, content: impl AsRef<[u8]>) -> Result<(), Failure> {
        let mut draft = self.create(name)?;
        draft.append(content)?;
        self.push(draft);
        Ok(())
    }

    /// Makes all of them the results.
    ///
    /// # Errors
    /// A file that cannot take its place.
    pub fn commit(self) -> Result<(), Failure> {
        self.drafts.into_iter().try_for_each(Draft::commit)?;
        Ok(storage::sync_folder(self.out.path())?)
    }
}
