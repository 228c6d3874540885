//! One browser: the layers that it wants, and the messages to it.

use std::{sync::Arc, time::Duration};

use axum::extract::ws::{Message, WebSocket};
use tokio::{
    sync::watch::Receiver,
    time::{self, MissedTickBehavior},
};

use crate::{
    messages::Layer,
    run_view::{Newest, RunView},
    track::Cursor,
};

const POSES_INTERVAL: Duration = Duration::from_millis(200);
const MAX_SEND: Duration = Duration::from_secs(10);
/// The layers by the names that a browser gives them, in the order of their numbers.
const LAYERS: [(&str, Layer); 4] = [
    ("scan", Layer::Scan),
    ("raster", Layer::Raster),
    ("points", Layer::Points),
    ("objects", Layer::Objects),
];

struct Wanted {
    view: Arc<RunView>,
    layers: [bool; 4],
}

impl Wanted {
    fn set(&mut self, names: &str) {
        for (name, layer) in LAYERS {
            let is_wanted = names.split(' ').any(|named| named == name);
            let was_wanted = &mut self.layers[layer as usize];
            if *was_wanted != is_wanted {
                self.view.want(layer, is_wanted);
                *was_wanted = is_wanted;
            }
        }
    }

    fn has(&self, layer: Layer) -> bool {
        self.layers[layer as usize]
    }
}

impl Drop for Wanted {
    fn drop(&mut self) {
        self.set("");
    }
}

pub async fn serve(mut socket: WebSocket, view: Arc<RunView>) {
    let updates = &view.updates;
    let subscribe = |to: &Newest| {
        let mut receiver = to.subscribe();
        // The newest is new to this browser.
        receiver.mark_changed();
        receiver
    };
    let (mut run, mut health) = (subscribe(&updates.run), subscribe(&updates.health));
    let [mut scan, mut raster, mut points, mut objects] =
        LAYERS.map(|(_, layer)| subscribe(updates.of(layer)));
    let mut stop = updates.stop.subscribe();
    let mut wanted = Wanted {
        view: Arc::clone(&view),
        layers: [false; 4],
    };
    let (mut cursor, mut last) = (Cursor::default(), None);
    let mut tick = time::interval(POSES_INTERVAL);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let message = tokio::select! {
            biased;
            _ = stop.wait_for(|stop| *stop) => Some(Message::Close(None)),
            received = socket.recv() => match received {
                Some(Ok(Message::Text(names))) => {
                    wanted.set(&names);
                    None
                }
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                Some(Ok(_)) => None,
            },
            Ok(()) = run.changed() => newest(&mut run),
            Ok(()) = health.changed() => newest(&mut health),
            _ = tick.tick() => view.poses(&mut cursor, &mut last),
            Ok(()) = objects.changed(), if wanted.has(Layer::Objects) => newest(&mut objects),
            Ok(()) = points.changed(), if wanted.has(Layer::Points) => newest(&mut points),
            Ok(()) = raster.changed(), if wanted.has(Layer::Raster) => newest(&mut raster),
            Ok(()) = scan.changed(), if wanted.has(Layer::Scan) => newest(&mut scan),
        };
        let Some(message) = message else { continue };
        let is_last = matches!(message, Message::Close(_));
        let sent = time::timeout(MAX_SEND, socket.send(message)).await;
        if is_last || !matches!(sent, Ok(Ok(()))) {
            return;
        }
    }
}

fn newest(updates: &mut Receiver<Option<Message>>) -> Option<Message> {
    updates.borrow_and_update().clone()
}
