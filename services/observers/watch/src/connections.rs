//! Connections: a bounded number of them, none of which stays without a request.

use std::{pin::pin, sync::Arc, time::Duration};

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    service::TowerToHyperService,
};
use tokio::{
    net::{TcpListener, TcpStream},
    sync::{Semaphore, watch},
    time,
};

/// The limits of connections.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// The most connections with requests at once; further ones wait for a place. Streams have
    /// places of their own.
    pub connections: usize,
    /// Time for the head of a request, from the connection or from the answer before: nobody keeps
    /// a place by silence.
    pub request: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 64,
            request: Duration::from_secs(10),
        }
    }
}

/// Time until the next try where the system refuses a connection, as for want of descriptors.
const RETRY: Duration = Duration::from_millis(100);

/// Serves until `stop` holds; requests that are being answered then have their answers.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    limits: Limits,
    mut stop: watch::Receiver<bool>,
) {
    let places = Arc::new(Semaphore::new(limits.connections));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(limits.request);
    loop {
        let next = async {
            let place = Arc::clone(&places).acquire_owned().await;
            (accept(&listener).await, place)
        };
        let (stream, place) = tokio::select! {
            next = next => next,
            () = stopped(&mut stop) => break,
        };
        let service = TowerToHyperService::new(router.clone());
        let connection = http.serve_connection(TokioIo::new(stream), service);
        let (connection, mut stop) = (connection.with_upgrades(), stop.clone());
        tokio::spawn(async move {
            let mut connection = pin!(connection);
            // A reader may disconnect at any time.
            tokio::select! {
                _ = connection.as_mut() => {}
                () = stopped(&mut stop) => {
                    connection.as_mut().graceful_shutdown();
                    let _ = connection.await;
                }
            }
            drop(place);
        });
    }
    let _ = places.acquire_many(limits.connections as u32).await;
}

async fn stopped(stop: &mut watch::Receiver<bool>) {
    let _ = stop.wait_for(|stop| *stop).await;
}

async fn accept(listener: &TcpListener) -> TcpStream {
    loop {
        match listener.accept().await {
            Ok((stream, _)) => return stream,
            Err(_) => time::sleep(RETRY).await,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use axum::routing::get;
    use tokio::{
        io::{AsyncReadExt, AsyncWriteExt},
        runtime,
    };

    use super::*;

    async fn answer(mut stream: TcpStream) -> String {
        let request = b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
        stream.write_all(request).await.unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.unwrap();
        answer
    }

    #[test]
    fn silent_connections_give_way_to_one_that_asks() {
        let runtime = runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        runtime.block_on(async {
            let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
            let address = listener.local_addr().unwrap();
            let router = Router::new().route("/", get(async || "here"));
            let (stop, stopped) = watch::channel(false);
            let limits = Limits {
                connections: 4,
                request: Duration::from_millis(200),
            };
            let server = tokio::spawn(serve(listener, router, limits, stopped));
            let mut silent = Vec::new();
            for _ in 0..12 {
                silent.push(TcpStream::connect(address).await.unwrap());
            }
            // The head of a request that never ends.
            silent[0].write_all(b"GET / HTTP/1.1\r\nX: ").await.unwrap();
            let asking = TcpStream::connect(address).await.unwrap();
            assert!(answer(asking).await.ends_with("here"));
            stop.send(true).unwrap();
            server.await.unwrap();
        });
    }
}
