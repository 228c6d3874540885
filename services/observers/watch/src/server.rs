//! The server: it listens, asks who may read, and ends with a signal.

use std::{
    io,
    net::{SocketAddr, TcpListener},
    path::{Path, PathBuf},
    sync::Arc,
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
use gyre_client::Signals;
use tokio::{
    runtime,
    sync::{Semaphore, watch},
    time,
};

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
const POLL_INTERVAL: Duration = Duration::from_secs(1);
/// Time for the connections to end with the program.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);

pub struct Endpoint {
    listener: TcpListener,
    address: SocketAddr,
    token: Option<Token>,
}

pub struct Server {
    pub page: Endpoint,
    pub foxglove: Option<Endpoint>,
}

#[derive(Clone)]
struct Shared {
    view: Arc<RunView>,
    hub: Arc<Hub>,
    access: Arc<Access>,
    places: Arc<Semaphore>,
}

impl Endpoint {
    /// Listens at an address. Without a token only this machine is answered.
    pub fn listen(address: SocketAddr, token: Option<Token>) -> io::Result<Self> {
        let failed = |error: io::Error| {
            io::Error::other(format!(
                "cannot serve at {address}: {error}; choose another address"
            ))
        };
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

    async fn serve(self, router: Router, stop: watch::Receiver<bool>) -> io::Result<()> {
        self.listener.set_nonblocking(true)?;
        let listener = tokio::net::TcpListener::from_std(self.listener)?;
        connections::serve(listener, router, Limits::default(), stop).await;
        Ok(())
    }
}

impl Server {
    /// Shows the runs that write to `out`, one after the other, until a signal arrives.
    /// `is_complete` returns whether a run that has ended there has reached the end of its
    /// recording.
    pub fn show(
        self,
        out: PathBuf,
        is_complete: fn(&Path) -> bool,
        signals: &Signals,
    ) -> io::Result<()> {
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
        while !view.is_stopping() && !signals.sleep(POLL_INTERVAL).map_err(io::Error::other)? {}
        view.stop();
        for thread in threads {
            let _ = thread.join();
        }
        let died = || io::Error::other("its thread has died");
        server.join().unwrap_or_else(|_| Err(died()))
    }

    fn serve(self, view: &Arc<RunView>, hub: Arc<Hub>) -> io::Result<()> {
        let shared = |endpoint: &Endpoint, of_viewers| {
            let (address, token) = (endpoint.address, endpoint.token.clone());
            Shared {
                view: Arc::clone(view),
                hub: Arc::clone(&hub),
                access: Arc::new(Access::new(address, token, of_viewers)),
                places: Arc::new(Semaphore::new(MAX_READERS)),
            }
        };
        let stop = || view.updates.stop.subscribe();
        let of_page = router(shared(&self.page, false));
        let page = self.page.serve(of_page, stop());
        let foxglove = async {
            let Some(endpoint) = self.foxglove else {
                return Ok(());
            };
            let router = foxglove_router(shared(&endpoint, true));
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
        let file = ([(header::CONTENT_TYPE, kind)], content);
        router.route(path, get(move || async move { file }))
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
        .layer(middleware::from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
}

/// The sentences to readers without permission, on the page and on viewers' connections:
/// without the token, by the name of another host, and from a page of another site.
const REFUSALS: [[&str; 3]; 2] = [
    [
        "This page needs the token: open the whole address that `gyre watch` has printed.",
        "This page is for this machine alone: open it as http://localhost, or start `gyre watch` with --listen.",
        "A page of another site asked for this.",
    ],
    [
        "This needs the token: open the whole address that `gyre watch` has printed.",
        "This is for this machine alone: open it as ws://localhost, or start `gyre watch` with --foxglove and an address.",
        "A page of another site asked for this: start `gyre watch` with --token-file, and give the token in the address.",
    ],
];

async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let access = &shared.access;
    let [no_token, foreign_host, foreign_origin] = REFUSALS[usize::from(access.of_viewers)];
    let mut response = match access.judge(request.uri(), request.headers()) {
        Verdict::GrantedByAddress if !access.of_viewers && request.uri().path() == "/" => {
            // The token does not stay in the address, where others may see it.
            let cookie = access.cookie().unwrap_or_default();
            ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response()
        }
        Verdict::Granted | Verdict::GrantedByAddress => next.run(request).await,
        Verdict::NoToken => page::refusal(StatusCode::UNAUTHORIZED, no_token),
        Verdict::ForeignHost => page::refusal(StatusCode::FORBIDDEN, foreign_host),
        Verdict::ForeignOrigin => page::refusal(StatusCode::FORBIDDEN, foreign_origin),
    };
    if !access.of_viewers {
        page::protect(response.headers_mut());
    }
    response
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
    let Ok(place) = Arc::clone(&shared.places).try_acquire_owned() else {
        let full = "As many viewers as there is room for are connected: close one.";
        return page::refusal(StatusCode::SERVICE_UNAVAILABLE, full);
    };
    bounded(upgrade, MAX_REQUESTED).on_upgrade(move |socket| async move {
        foxglove::serve(socket, shared.hub, shared.view).await;
        drop(place);
    })
}

async fn stream(State(shared): State<Shared>, upgrade: WebSocketUpgrade) -> Response {
    let Ok(place) = Arc::clone(&shared.places).try_acquire_owned() else {
        let full = "As many browsers as there is room for are connected: close one.";
        return page::refusal(StatusCode::SERVICE_UNAVAILABLE, full);
    };
    bounded(upgrade, MAX_RECEIVED).on_upgrade(move |socket| async move {
        stream::serve(socket, shared.view).await;
        drop(place);
    })
}

fn bounded(upgrade: WebSocketUpgrade, bytes: usize) -> WebSocketUpgrade {
    upgrade.max_message_size(bytes).max_frame_size(bytes)
}

async fn scrape(State(shared): State<Shared>) -> Response {
    let text = metrics::scrape(&shared.view);
    ([(header::CONTENT_TYPE, metrics::OPEN_METRICS)], text).into_response()
}
