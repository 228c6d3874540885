//! Single questions and answers between the two sides, in JSON.

use std::time::Duration;

use gyre_stage::StageError;
use serde::{Serialize, de::DeserializeOwned};
use zenoh::{
    Session, Wait, bytes::ZBytes, handlers::FifoChannelHandler, query::Queryable, query::Reply,
};

use crate::error::{failed, other_version};

const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);

/// A question that is asked again until it is answered: the action, as in "ask for a run", and the
/// side that answers.
#[derive(Clone, Copy)]
pub(crate) struct Question(pub &'static str, pub &'static str);

pub(crate) type Answers = FifoChannelHandler<Reply>;

impl Question {
    pub fn send(
        self,
        session: &Session,
        key: String,
        payload: impl Into<ZBytes>,
    ) -> Result<Answers, StageError> {
        let asked = session.get(key).payload(payload).timeout(ANSWER_TIMEOUT);
        asked.wait().map_err(|e| failed(self.0, &e))
    }

    /// Sends the question and waits for the answer; returns `None` without an answer.
    pub fn ask<A: DeserializeOwned>(
        self,
        session: &Session,
        key: String,
        payload: impl Into<ZBytes>,
    ) -> Result<Option<A>, StageError> {
        match self.send(session, key, payload)?.recv() {
            Ok(reply) => self.parse(reply),
            Err(_) => Ok(None),
        }
    }

    /// Parses an answer; `None` if it is an error of the network layer.
    pub fn parse<A: DeserializeOwned>(self, reply: Reply) -> Result<Option<A>, StageError> {
        let Ok(sample) = reply.into_result() else {
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
) -> Result<Queryable<()>, StageError> {
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
