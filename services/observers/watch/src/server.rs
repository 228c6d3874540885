//! The server: it listens, asks who may read, and ends with a signal.

use std::{
    io,
    net::{SocketAddr, TcpListener},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use axum::{
    Router,
    extract::{Request, State, WebSocketUpgrade, ws::rejection::WebSocketUpgradeRejection},
    http::{StatusCode, header},
    middleware::{self, Next},
    response::{IntoResponse, Redirect, Response},
    routing::get,
};
use gyre_stage::{StageError, wake::Signals};
use thiserror::Error;
use tokio::{runtime, sync::watch, time};

use crate::{
    access::{Access, Token, Verdict},
    connections::{self, Limits},
    foxglove::{self, Hub},
    metrics,
    observing::{self, Followed},
    page,
    run_view::RunView,
    stream,
};

/// The most browsers at once, and the most viewers.
const MAX_READERS: usize = 16;
/// The longest message of a browser, bytes.
const MAX_RECEIVED: usize = 1024;
/// The longest request of a viewer, bytes.
const MAX_REQUESTED: usize = 64 << 10;
/// Time between two checks whether the server has failed.
const POLL_INTERVAL: Duration = Duration::from_secs(1);
/// Time for the connections to end with the program.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);

/// A failure of the server.
#[derive(Debug, Error)]
pub enum WatchError {
    /// The address cannot be listened at.
    #[error("cannot serve at {address}: {source}; choose another address")]
    Listen {
        address: SocketAddr,
        /// The reason.
        source: io::Error,
    },
    /// The server fails.
    #[error("cannot serve: {0}")]
    Serve(#[from] io::Error),
    /// Signals cannot be received.
    #[error(transparent)]
    Stage(#[from] StageError),
}

/// An address that is listened at, and the token of its readers.
pub struct Endpoint {
    listener: TcpListener,
    address: SocketAddr,
    token: Option<Token>,
}

/// The server of a page, and on request of Foxglove.
pub struct Server {
    page: Endpoint,
    foxglove: Option<Endpoint>,
}

#[derive(Clone)]
struct Shared {
    view: Arc<RunView>,
    hub: Arc<Hub>,
    access: Arc<Access>,
    readers: Arc<AtomicUsize>,
}

impl Shared {
    fn judge(&self, request: &Request) -> Verdict {
        self.access.judge(request.uri(), request.headers())
    }
}

/// One of the places for readers. Dropped, it is free again.
struct ReaderSlot(Arc<AtomicUsize>);

impl Endpoint {
    /// Listens at an address. Without a token only this machine is answered.
    pub fn listen(address: SocketAddr, token: Option<Token>) -> Result<Self, WatchError> {
        let failed = |source| WatchError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        Ok(Self {
            listener,
            address,
            token,
        })
    }

    /// Returns the address for a browser. One of all interfaces is reached by the machine's name.
    pub fn url(&self, scheme: &str) -> String {
        let host = match self.address.ip().is_unspecified() {
            true => {
                let system = rustix::system::uname();
                let name = system.nodename().to_string_lossy();
                format!("{name}:{}", self.address.port())
            }
            false => self.address.to_string(),
        };
        let token = self.token.as_ref().map(Token::as_str);
        let query = token.map_or(String::new(), |token| format!("?token={token}"));
        format!("{scheme}://{host}/{query}")
    }

    /// Serves until the program stops.
    async fn serve(self, router: Router, stop: watch::Receiver<bool>) -> io::Result<()> {
        self.listener.set_nonblocking(true)?;
        let listener = tokio::net::TcpListener::from_std(self.listener)?;
        connections::serve(listener, router, Limits::default(), stop).await;
        Ok(())
    }
}

impl Server {
    /// Creates a server of the page and the metrics.
    pub fn new(page: Endpoint) -> Self {
        Self {
            page,
            foxglove: None,
        }
    }

    /// Serves Foxglove too.
    pub fn with_foxglove(self, foxglove: Option<Endpoint>) -> Self {
        Self { foxglove, ..self }
    }

    /// Shows the runs that write to `out`, one after the other, until a signal arrives.
    /// `is_complete` returns whether a run that has ended there has reached the end of its
    /// recording.
    pub fn show(
        self,
        out: PathBuf,
        is_complete: fn(&Path) -> bool,
        signals: &Signals,
    ) -> Result<(), WatchError> {
        let view = Arc::new(RunView::new(&out.display().to_string()));
        let hub = Arc::new(Hub::default());
        let followed = Arc::new(Followed {
            out,
            is_complete,
            view: Arc::clone(&view),
        });
        let mut threads = observing::start(&followed)?;
        if self.foxglove.is_some() {
            threads.extend(foxglove::start(&followed, &hub)?);
        }
        let serving = Arc::clone(&view);
        let server = thread::Builder::new().name("serve".to_owned());
        let server = server.spawn(move || {
            let served = self.serve(&serving, hub);
            // Without a server nothing is left to do.
            serving.stop();
            served
        })?;
        while !view.is_stopping() && !signals.sleep(POLL_INTERVAL)? {}
        view.stop();
        for thread in threads {
            let _ = thread.join();
        }
        let died = || io::Error::other("its thread has died");
        Ok(server.join().unwrap_or_else(|_| Err(died()))?)
    }

    fn serve(self, view: &Arc<RunView>, hub: Arc<Hub>) -> io::Result<()> {
        let shared = |access: Access| Shared {
            view: Arc::clone(view),
            hub: Arc::clone(&hub),
            access: Arc::new(access),
            readers: Arc::default(),
        };
        let stop = || view.updates.stop.subscribe();
        let access = Access::new(self.page.address, self.page.token.clone());
        let page = self.page.serve(router(shared(access)), stop());
        let foxglove = async {
            let Some(endpoint) = self.foxglove else {
                return Ok(());
            };
            let access = Access::new(endpoint.address, endpoint.token.clone());
            let router = foxglove_router(shared(access.of_viewers()));
            endpoint.serve(router, stop()).await
        };
        let runtime = runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let mut stopped = stop();
        runtime.block_on(async {
            tokio::select! {
                served = async { tokio::try_join!(page, foxglove) } => served.map(drop),
                () = async {
                    let _ = stopped.wait_for(|stop| *stop).await;
                    time::sleep(STOP_TIMEOUT).await;
                } => Ok(()),
            }
        })
    }
}

fn router(shared: Shared) -> Router {
    let files = page::FILES.into_iter();
    let router = files.fold(Router::new(), |router, (path, kind, content)| {
        router.route(path, get(move || async move { page::file(kind, content) }))
    });
    router
        .route("/stream", get(stream))
        .route("/metrics", get(scrape))
        .layer(middleware::from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
}

fn foxglove_router(shared: Shared) -> Router {
    Router::new()
        .fallback(view)
        .layer(middleware::from_fn_with_state(
            shared.clone(),
            guard_viewers,
        ))
        .with_state(shared)
}

/// Answers only viewers that may read.
async fn guard_viewers(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    match shared.judge(&request) {
        Verdict::Granted | Verdict::GrantedByAddress => next.run(request).await,
        Verdict::NoToken => page::refusal(
            StatusCode::UNAUTHORIZED,
            "This needs the token: open the whole address that `gyre watch` has printed.",
        ),
        Verdict::ForeignHost => page::refusal(
            StatusCode::FORBIDDEN,
            "This is for this machine alone: open it as ws://localhost, or start `gyre watch` with --foxglove and an address.",
        ),
        Verdict::ForeignOrigin => page::refusal(
            StatusCode::FORBIDDEN,
            "A page of another site asked for this: start `gyre watch` with --token-file, and give the token in the address.",
        ),
    }
}

async fn view(
    State(shared): State<Shared>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let upgrade = upgrade.map(|upgrade| upgrade.protocols(foxglove::PROTOCOLS));
    let Some(upgrade) = upgrade.ok().filter(|it| it.selected_protocol().is_some()) else {
        let other = "This is for Foxglove and Lichtblick: open a connection of the kind Foxglove WebSocket to this address.";
        return page::refusal(StatusCode::BAD_REQUEST, other);
    };
    let Some(place) = ReaderSlot::take(&shared.readers) else {
        let full = "As many viewers as there is room for are connected: close one.";
        return page::refusal(StatusCode::SERVICE_UNAVAILABLE, full);
    };
    let upgrade = bounded(upgrade, MAX_REQUESTED);
    upgrade.on_upgrade(move |socket| async move {
        foxglove::serve(socket, shared.hub, shared.view).await;
        drop(place);
    })
}

/// Answers only requests that may read, whatever the path.
async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let mut response = match shared.judge(&request) {
        Verdict::Granted => next.run(request).await,
        Verdict::GrantedByAddress if request.uri().path() == "/" => {
            // The token does not stay in the address, where others may see it.
            let cookie = shared.access.cookie().unwrap_or_default();
            ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response()
        }
        Verdict::GrantedByAddress => next.run(request).await,
        Verdict::NoToken => page::refusal(
            StatusCode::UNAUTHORIZED,
            "This page needs the token: open the whole address that `gyre watch` has printed.",
        ),
        Verdict::ForeignHost => page::refusal(
            StatusCode::FORBIDDEN,
            "This page is for this machine alone: open it as http://localhost, or start `gyre watch` with --listen.",
        ),
        Verdict::ForeignOrigin => page::refusal(
            StatusCode::FORBIDDEN,
            "A page of another site asked for this.",
        ),
    };
    page::protect(response.headers_mut());
    response
}

async fn stream(State(shared): State<Shared>, upgrade: WebSocketUpgrade) -> Response {
    let Some(place) = ReaderSlot::take(&shared.readers) else {
        let full = "As many browsers as there is room for are connected: close one.";
        return page::refusal(StatusCode::SERVICE_UNAVAILABLE, full);
    };
    let upgrade = bounded(upgrade, MAX_RECEIVED);
    upgrade.on_upgrade(move |socket| async move {
        stream::serve(socket, shared.view).await;
        drop(place);
    })
}

/// Bounds the bytes of a received message and of a frame.
fn bounded(upgrade: WebSocketUpgrade, bytes: usize) -> WebSocketUpgrade {
    upgrade.max_message_size(bytes).max_frame_size(bytes)
}

async fn scrape(State(shared): State<Shared>) -> Response {
    let text = metrics::scrape(&shared.view);
    ([(header::CONTENT_TYPE, metrics::OPEN_METRICS)], text).into_response()
}

impl ReaderSlot {
    fn take(readers: &Arc<AtomicUsize>) -> Option<Self> {
        let place = Self(Arc::clone(readers));
        let taken = readers.fetch_add(1, Ordering::Relaxed);
        (taken < MAX_READERS).then_some(place)
    }
}

impl Drop for ReaderSlot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
