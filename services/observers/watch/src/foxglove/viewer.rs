//! One viewer: its requests, and the messages to it.

use std::{sync::Arc, time::Duration};

use axum::extract::ws::{Message, WebSocket};
use gyre_client::clock;
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::time::{self, Instant};

use super::{
    Hub,
    hub::{EncodedMessage, Subscriptions},
};
use crate::run_view::RunView;

pub const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// The longest time that a viewer may take for one message.
const MAX_SEND: Duration = Duration::from_secs(10);
const SENTENCE_PERIOD: Duration = Duration::from_secs(2);
/// The first byte of a message of a channel, and of one that sets the viewer's clock.
const MESSAGE_DATA: u8 = 1;
const TIME: u8 = 2;
const WARNING: u8 = 1;
const ERROR: u8 = 2;

/// A request of a viewer. All others of the protocol are not offered, and ignored.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Request {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: usize,
}

struct Viewer {
    socket: WebSocket,
    hub: Arc<Hub>,
    subscriptions: Subscriptions,
    advertised: Vec<usize>,
    /// The viewer's clock: the newest time of the sensor that it was sent, ns.
    time_ns: i64,
    /// The skipped messages that the viewer knows of.
    reported: u64,
    last_warning: Option<Instant>,
}

struct Disconnected;

pub async fn serve(socket: WebSocket, hub: Arc<Hub>, view: Arc<RunView>) {
    let mut viewer = Viewer {
        socket,
        subscriptions: Subscriptions::of(Arc::clone(&hub)),
        hub,
        advertised: Vec::new(),
        time_ns: 0,
        reported: 0,
        last_warning: None,
    };
    // Nothing more can be sent.
    let _ = viewer.serve(&view).await;
}

impl Viewer {
    async fn serve(&mut self, view: &RunView) -> Result<(), Disconnected> {
        let mut stop = view.updates.stop.subscribe();
        let (mut of_run, mut notice) = (self.hub.of_run.subscribe(), self.hub.notice.subscribe());
        of_run.mark_changed();
        let mut run = view.run().id;
        self.send_json(&server_info()).await?;
        loop {
            tokio::select! {
                biased;
                Ok(()) = stop.changed() => return self.send(Message::Close(None)).await,
                received = self.socket.recv() => match received {
                    Some(Ok(Message::Text(text))) => self.answer(&text).await?,
                    Some(Ok(Message::Close(_)) | Err(_)) | None => return Err(Disconnected),
                    Some(Ok(_)) => {}
                },
                Ok(()) = of_run.changed() => {
                    let channels = of_run.borrow_and_update().clone();
                    self.advertise(channels).await?;
                }
                Ok(()) = notice.changed() => {
                    let sentence = notice.borrow_and_update().clone();
                    self.send_status(WARNING, "run", &sentence).await?;
                }
                (subscription, message) = self.subscriptions.next() => {
                    let current = view.run().id;
                    if current != run {
                        // Another run: its sensor's time may be earlier.
                        (run, self.time_ns) = (current, 0);
                    }
                    self.send_data(subscription, &message).await?;
                }
            }
        }
    }

    async fn answer(&mut self, text: &str) -> Result<(), Disconnected> {
        match serde_json::from_str(text) {
            Ok(Request::Subscribe { subscriptions }) => {
                for Subscription { id, channel_id } in subscriptions {
                    if !self.subscriptions.add(channel_id, id) {
                        let sentence = format!("There is no channel {channel_id}.");
                        self.send_status(ERROR, "request", &sentence).await?;
                    }
                }
                Ok(())
            }
            Ok(Request::Unsubscribe { subscription_ids }) => {
                let ids = subscription_ids.into_iter();
                ids.for_each(|id| self.subscriptions.remove(id));
                Ok(())
            }
            Ok(Request::Other) => Ok(()),
            Err(error) => {
                let sentence = format!("This is no request of the protocol: {error}.");
                self.send_status(ERROR, "request", &sentence).await
            }
        }
    }

    /// Advertises the new channels of a run, and unadvertises those that it does not have.
    async fn advertise(&mut self, of_run: Vec<usize>) -> Result<(), Disconnected> {
        let is_in = |channels: &[usize], channel: &usize| channels.contains(channel);
        let gone = self.advertised.iter().filter(|it| !is_in(&of_run, it));
        let gone: Vec<usize> = gone.copied().collect();
        let new = of_run.iter().filter(|it| !is_in(&self.advertised, it));
        let new = new.map(|channel| self.hub.channels[*channel].advertised.clone());
        let new: Vec<Value> = new.collect();
        self.advertised = of_run;
        if !gone.is_empty() {
            let message = json!({"op": "unadvertise", "channelIds": gone});
            self.send_json(&message).await?;
        }
        if !new.is_empty() {
            let message = json!({"op": "advertise", "channels": new});
            self.send_json(&message).await?;
        }
        Ok(())
    }

    async fn send_data(
        &mut self,
        subscription: u32,
        message: &EncodedMessage,
    ) -> Result<(), Disconnected> {
        let log_ns = message.stamp_ns.max(0) as u64;
        if message.stamp_ns > self.time_ns {
            self.time_ns = message.stamp_ns;
            let mut time = vec![TIME];
            time.extend(log_ns.to_le_bytes());
            self.send(Message::Binary(time.into())).await?;
        }
        let mut data = Vec::with_capacity(13 + message.data.len());
        data.push(MESSAGE_DATA);
        data.extend(subscription.to_le_bytes());
        data.extend(log_ns.to_le_bytes());
        data.extend(&message.data);
        self.send(Message::Binary(data.into())).await?;
        self.warn_of_skipped().await
    }

    async fn warn_of_skipped(&mut self) -> Result<(), Disconnected> {
        let is_recent = |at: Instant| at.elapsed() < SENTENCE_PERIOD;
        let skipped = self.subscriptions.skipped;
        if skipped == self.reported || self.last_warning.is_some_and(is_recent) {
            return Ok(());
        }
        (self.reported, self.last_warning) = (skipped, Some(Instant::now()));
        let sentence = format!(
            "{skipped} messages were skipped so far: this connection is slower than the run."
        );
        self.send_status(WARNING, "skipped", &sentence).await
    }

    async fn send_status(
        &mut self,
        level: u8,
        name: &str,
        sentence: &str,
    ) -> Result<(), Disconnected> {
        let status = json!({"op": "status", "level": level, "id": name, "message": sentence});
        self.send_json(&status).await
    }

    async fn send_json(&mut self, message: &Value) -> Result<(), Disconnected> {
        self.send(Message::Text(message.to_string().into())).await
    }

    async fn send(&mut self, message: Message) -> Result<(), Disconnected> {
        let sent = time::timeout(MAX_SEND, self.socket.send(message)).await;
        sent.map_err(|_| Disconnected)?.map_err(|_| Disconnected)
    }
}

fn server_info() -> Value {
    json!({
        "op": "serverInfo",
        "name": concat!("gyre ", env!("CARGO_PKG_VERSION")),
        // The viewer's clock is the sensor's.
        "capabilities": ["time"],
        "metadata": {},
        // New after a restart: the viewer drops the subscriptions of the last session.
        "sessionId": format!("{}-{}", std::process::id(), clock::now_ns()),
    })
}
