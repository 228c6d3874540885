//! The files of the page, which are part of the program.

use axum::{
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};

const SCRIPT: &str = "text/javascript; charset=utf-8";

/// The path, the type and the content of each file.
pub const FILES: [(&str, &str, &str); 11] = [
    (
        "/",
        "text/html; charset=utf-8",
        include_str!("../page/index.html"),
    ),
    (
        "/style.css",
        "text/css; charset=utf-8",
        include_str!("../page/style.css"),
    ),
    (
        "/icon.svg",
        "image/svg+xml",
        include_str!("../page/icon.svg"),
    ),
    ("/main.js", SCRIPT, include_str!("../page/main.js")),
    (
        "/connection.js",
        SCRIPT,
        include_str!("../page/connection.js"),
    ),
    ("/canvas.js", SCRIPT, include_str!("../page/canvas.js")),
    ("/scan.js", SCRIPT, include_str!("../page/scan.js")),
    ("/objects.js", SCRIPT, include_str!("../page/objects.js")),
    ("/track.js", SCRIPT, include_str!("../page/track.js")),
    ("/delays.js", SCRIPT, include_str!("../page/delays.js")),
    ("/health.js", SCRIPT, include_str!("../page/health.js")),
];

/// Nothing but the page's own files is loaded, and nobody frames it.
const HEADERS: [(header::HeaderName, &str); 5] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
    (
        header::HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
];

/// Adds the headers that all answers have.
pub fn protect(headers: &mut HeaderMap) {
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
}

pub fn file(kind: &'static str, content: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind)], content).into_response()
}

/// Returns a refusal of one sentence, after which the connection is closed: who may not read does
/// not stay.
pub fn refusal(status: StatusCode, sentence: &'static str) -> Response {
    let close = [(header::CONNECTION, "close")];
    (status, close, format!("{sentence}\n")).into_response()
}
