//! The findings about a machine, with their remedies.

use std::fmt;

/// A check of the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    pub subject: &'static str,
    pub state: State,
    /// The finding, a sentence.
    pub found: String,
    /// The remedy; empty if there is nothing to do.
    pub remedy: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    Good,
    /// A run works, but more slowly, or without a part of it.
    Limited,
    /// A run cannot work.
    Bad,
}

impl Finding {
    pub fn good(subject: &'static str, found: impl Into<String>) -> Self {
        Self {
            subject,
            state: State::Good,
            found: found.into(),
            remedy: String::new(),
        }
    }

    pub fn limited(self, remedy: impl Into<String>) -> Self {
        Self {
            state: State::Limited,
            remedy: remedy.into(),
            ..self
        }
    }

    pub fn bad(self, remedy: impl Into<String>) -> Self {
        Self {
            state: State::Bad,
            remedy: remedy.into(),
            ..self
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = match self.state {
            State::Good => "ok",
            State::Limited => "note",
            State::Bad => "FAILS",
        };
        write!(f, "{state:<6}{:<15}{}", self.subject, self.found)?;
        if !self.remedy.is_empty() {
            write!(f, "\n{:21}-> {}", "", self.remedy)?;
        }
        Ok(())
    }
}
