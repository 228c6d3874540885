//! Parts of a document in HTML.

use base64::{Engine, engine::general_purpose::STANDARD};

pub fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns a section with a title; nothing without a content.
pub fn section(title: &str, content: &str) -> String {
    match content.is_empty() {
        true => String::new(),
        false => {
            let title = escaped(title);
            format!("<section><h2>{title}</h2>\n{content}\n</section>\n")
        }
    }
}

pub fn png(bytes: &[u8], what: &str) -> String {
    let what = escaped(what);
    let data = STANDARD.encode(bytes);
    format!("<figure><img alt=\"{what}\" src=\"data:image/png;base64,{data}\"></figure>")
}

/// Returns a picture that is a document of SVG, which a reader of screens names.
pub fn svg(text: &str, what: &str) -> String {
    let what = escaped(what);
    let text = text.find("<svg").map_or("", |start| &text[start..]);
    format!("<figure role=\"img\" aria-label=\"{what}\">{text}</figure>")
}
