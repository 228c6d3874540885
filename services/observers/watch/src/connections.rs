//! Connections: a bounded number of them. A connection loses its permit by silence, and by not
//! reading its answer.

#[cfg(test)]
mod tests;

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

#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// The most connections with requests at once. Streams have permits of their own.
    pub connections: u32,
    /// Time for the head of a request, from the connection or from the answer before.
    pub request: Duration,
    /// Time for requests and answers, after which a connection takes no more requests; and time
    /// again for the answer that it is at. Streams have limits of their own.
    pub answers: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 64,
            request: Duration::from_secs(10),
            answers: Duration::from_secs(10),
        }
    }
}

/// Time until the next try where the system refuses a connection, as for want of descriptors.
const RETRY: Duration = Duration::from_millis(100);

pub async fn serve(
    listener: TcpListener,
    router: Router,
    limits: Limits,
    mut stop: watch::Receiver<bool>,
) {
    let permits = Arc::new(Semaphore::new(limits.connections as usize));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(limits.request);
    loop {
        let next = async {
            let permit = Arc::clone(&permits).acquire_owned().await;
            (accept(&listener).await, permit)
        };
        let (stream, permit) = tokio::select! {
            next = next => next,
            () = stopped(&mut stop) => break,
        };
        let service = TowerToHyperService::new(router.clone());
        let connection = http.serve_connection(TokioIo::new(stream), service);
        let connection = connection.with_upgrades();
        let mut stop = stop.clone();
        tokio::spawn(async move {
            let mut connection = pin!(connection);
            // A reader may disconnect at any time.
            tokio::select! {
                _ = connection.as_mut() => {}
                _ = time::timeout(limits.answers, stopped(&mut stop)) => {
                    connection.as_mut().graceful_shutdown();
                    let _ = time::timeout(limits.answers, connection).await;
                }
            }
            drop(permit);
        });
    }
    // All connections have ended.
    let _ = permits.acquire_many(limits.connections).await;
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
