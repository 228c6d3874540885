//! The files of the page, which are part of the program.

use axum::{
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};

const HTML: &str = "text/html; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const ICON: &str = "image/svg+xml";
const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! files {
    ($($path:literal $kind:ident $file:literal),* $(,)?) => {
        [$(($path, $kind, include_str!(concat!("../page/", $file)))),*]
    };
}

pub const FILES: [(&str, &str, &str); 11] = files![
    "/" HTML "index.html",
    "/style.css" STYLE "style.css",
    "/icon.svg" ICON "icon.svg",
    "/main.js" SCRIPT "main.js",
    "/connection.js" SCRIPT "connection.js",
    "/canvas.js" SCRIPT "canvas.js",
    "/scan.js" SCRIPT "scan.js",
    "/objects.js" SCRIPT "objects.js",
    "/track.js" SCRIPT "track.js",
    "/delays.js" SCRIPT "delays.js",
    "/health.js" SCRIPT "health.js",
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

pub fn protect(headers: &mut HeaderMap) {
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
}

/// Returns a refusal of one sentence, after which the connection is closed: who may not read does
/// not stay.
pub fn refusal(status: StatusCode, sentence: &'static str) -> Response {
    let close = [(header::CONNECTION, "close")];
    (status, close, format!("{sentence}\n")).into_response()
}
