//! Single questions and answers between the two sides, in JSON.

use std::time::Duration;

use gyre_client::RunError;
use serde::{Serialize, de::DeserializeOwned};
use zenoh::{
    Session, Wait,
    bytes::ZBytes,
    query::{Queryable, Reply},
};

use crate::error::{failed, other_version};

const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);

/// A question that is asked again until it is answered: the action, as in "ask for a run", and the
/// side that answers.
#[derive(Clone, Copy)]
pub(crate) struct Question(pub &'static str, pub &'static str);

impl Question {
    /// Sends the question and waits for the answer; returns `None` without an answer, or for an
    /// error of the network layer.
    pub fn ask<A: DeserializeOwned>(
        self,
        session: &Session,
        key: String,
        payload: impl Into<ZBytes>,
    ) -> Result<Option<A>, RunError> {
        let asked = session.get(key).payload(payload).timeout(ANSWER_TIMEOUT);
        let answers = asked.wait().map_err(|e| failed(self.0, &e))?;
        let answer = answers.recv().ok().map(Reply::into_result);
        let Some(Ok(sample)) = answer else {
            return Ok(None);
        };
        let answer = serde_json::from_slice(&sample.payload().to_bytes());
        answer.map(Some).map_err(|_| other_version(self.1))
    }
}

/// Answers the questions of a key until the queryable is dropped.
pub(crate) fn answer<A: Serialize>(
    session: &Session,
    key: String,
    action: &str,
    answer: impl Fn() -> A + Send + Sync + 'static,
) -> Result<Queryable<()>, RunError> {
    let reply_key = key.clone();
    session
        .declare_queryable(key)
        .callback(move |query| {
            if let Ok(text) = serde_json::to_vec(&answer()) {
                let _ = query.reply(&reply_key, text).wait();
            }
        })
        .wait()
        .map_err(|e| failed(action, &e))
}
