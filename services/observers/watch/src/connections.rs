//! Connections: a bounded number of them, none of which keeps its permit by silence, or by not
//! reading its answer. If there is no permit for another one, a connection gives way that has not
//! shown that it may read.

mod permits;
mod stream;
#[cfg(test)]
mod tests;

use std::{
    net::IpAddr,
    pin::pin,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    service::TowerToHyperService,
};
use tokio::{
    net::{TcpListener, TcpStream},
    sync::watch,
    time,
};

use permits::Permits;
use stream::Timed;

/// The limits of connections.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// The most connections with requests at once. Streams have permits of their own.
    pub connections: usize,
    /// Time for the head of a request, from the connection or from the answer before.
    pub request: Duration,
    /// Time for the client to take an answer.
    pub answer: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 64,
            request: Duration::from_secs(10),
            answer: Duration::from_secs(10),
        }
    }
}

/// A connection, as the requests on it know it.
#[derive(Clone, Debug, Default)]
pub struct Peer(Arc<AtomicBool>);

impl Peer {
    /// It has shown that it may read: it keeps its permit when others come.
    pub fn keep_place(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    fn keeps_place(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Time until the next try where the system refuses a connection, as for want of descriptors.
const RETRY: Duration = Duration::from_millis(100);

/// Serves until `stop` holds; requests that are being answered then have their answers. Each
/// request has its [`Peer`] as an extension.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    limits: Limits,
    mut stop: watch::Receiver<bool>,
) {
    let permits = Arc::new(Permits::new(limits.connections));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(limits.request);
    loop {
        let next = async {
            permits.wait_for_room().await;
            accept(&listener).await
        };
        let (stream, address) = tokio::select! {
            next = next => next,
            () = stopped(&mut stop) => break,
        };
        let (permit, peer) = permits.take(address);
        let number = permit.number();
        let service = TowerToHyperService::new(router.clone().layer(Extension(peer)));
        let io = TokioIo::new(Timed::new(stream, limits.answer));
        let connection = http.serve_connection(io, service).with_upgrades();
        let mut stop = stop.clone();
        let task = tokio::spawn(async move {
            let mut connection = pin!(connection);
            // A reader may disconnect at any time.
            tokio::select! {
                _ = connection.as_mut() => {}
                () = stopped(&mut stop) => {
                    connection.as_mut().graceful_shutdown();
                    let _ = connection.await;
                }
            }
            drop(permit);
        });
        permits.let_end(number, task.abort_handle());
    }
    permits.wait_for_end().await;
}

async fn stopped(stop: &mut watch::Receiver<bool>) {
    let _ = stop.wait_for(|stop| *stop).await;
}

async fn accept(listener: &TcpListener) -> (TcpStream, IpAddr) {
    loop {
        match listener.accept().await {
            Ok((stream, address)) => return (stream, address.ip()),
            Err(_) => time::sleep(RETRY).await,
        }
    }
}
