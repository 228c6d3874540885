//! Payloads and datagrams that do not fit their messages.

/// A payload that does not fit its message, or a datagram that is no part of an azimuth: a
/// sentence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Malformed(String);

impl Malformed {
    pub(crate) fn new(sentence: impl Into<String>) -> Self {
        Self(sentence.into())
    }
}

pub(crate) fn head<const N: usize>(message: &str, payload: &[u8]) -> Result<[u8; N], Malformed> {
    payload.first_chunk().copied().ok_or_else(|| {
        let actual = payload.len();
        Malformed::new(format!(
            "the payload of {message} has {actual} bytes, expected at least {N}"
        ))
    })
}
