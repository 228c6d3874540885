//! One browser: the layers that it wants, and the messages to it.

use std::{future, sync::Arc, time::Duration};

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

type Changes = Receiver<Option<Message>>;

const POSES_INTERVAL: Duration = Duration::from_millis(200);
const MAX_SEND: Duration = Duration::from_secs(10);
/// The layers by the names that a browser gives them, the smallest first.
const LAYERS: [(&str, Layer); 4] = [
    ("objects", Layer::Objects),
    ("points", Layer::Points),
    ("raster", Layer::Raster),
    ("scan", Layer::Scan),
];

pub async fn serve(mut socket: WebSocket, view: Arc<RunView>) {
    let updates = &view.updates;
    let subscribe = |to: &Newest| {
        let mut receiver = to.subscribe();
        // The newest is new to this browser.
        receiver.mark_changed();
        receiver
    };
    let (mut run, mut health) = (subscribe(&updates.run), subscribe(&updates.health));
    // Of the layers that this browser wants: they are made while somebody receives them.
    let mut layers: [Option<Changes>; 4] = Default::default();
    let mut stop = updates.stop.subscribe();
    let (mut cursor, mut last) = (Cursor::default(), None);
    let mut tick = time::interval(POSES_INTERVAL);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let [objects, points, raster, scan] = &mut layers;
        let message = tokio::select! {
            biased;
            _ = stop.wait_for(|stop| *stop) => Some(Message::Close(None)),
            received = socket.recv() => match received {
                Some(Ok(Message::Text(names))) => {
                    for ((name, layer), receiver) in LAYERS.into_iter().zip(&mut layers) {
                        if !names.split(' ').any(|named| named == name) {
                            *receiver = None;
                        } else if receiver.is_none() {
                            *receiver = Some(subscribe(updates.of(layer)));
                        }
                    }
                    None
                }
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                Some(Ok(_)) => None,
            },
            message = next(Some(&mut run)) => message,
            message = next(Some(&mut health)) => message,
            _ = tick.tick() => view.poses(&mut cursor, &mut last),
            message = next(objects.as_mut()) => message,
            message = next(points.as_mut()) => message,
            message = next(raster.as_mut()) => message,
            message = next(scan.as_mut()) => message,
        };
        let Some(message) = message else { continue };
        let is_last = matches!(message, Message::Close(_));
        let sent = time::timeout(MAX_SEND, socket.send(message)).await;
        if is_last || !matches!(sent, Ok(Ok(()))) {
            return;
        }
    }
}

/// Waits for the next change; for ever without a receiver.
async fn next(changes: Option<&mut Changes>) -> Option<Message> {
    let Some(changes) = changes else {
        return future::pending().await;
    };
    // The view is not dropped before its browsers.
    let _ = changes.changed().await;
    changes.borrow_and_update().clone()
}
