//! A build without `--features full` prints one sentence: the missing feature, and how to get it.

use crate::common::{Run, finished};

const REMEDY: &str = "cargo run --release --locked --features full --";

#[test]
fn a_build_without_link_says_how_to_get_it() {
    let endpoint = "tcp/127.0.0.1:7447";
    for (end, option) in [("send", "--listen"), ("receive", "--connect")] {
        finished!["link", end, "out", option, endpoint].refused_with(&["zenoh", REMEDY]);
    }
    for (side, key) in [("robot", "connect"), ("base", "listen")] {
        let settings = format!("link.side='{side}' link.{key}=['{endpoint}']");
        let run = Run::of_recording().sets(&settings);
        run.finish().refused_with(&["zenoh", REMEDY]);
    }
}
