use std::net::SocketAddr;

use axum::{
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
    routing::get,
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    runtime,
    time::Instant,
};

use super::*;

const GRANTED: &str = "GET / HTTP/1.1\r\nHost: a\r\nAuthorization: yes\r\n";
const REFUSED: &str = "GET / HTTP/1.1\r\nHost: a\r\n";

/// A megabyte for those that may read, and a refusal for the others.
async fn page(headers: HeaderMap) -> Response {
    match headers.contains_key(header::AUTHORIZATION) {
        true => vec![b'x'; 1 << 20].into_response(),
        false => crate::page::refusal(StatusCode::UNAUTHORIZED, "no"),
    }
}

/// Runs a server of four permits beside a test.
fn with_server(limits: Limits, test: impl AsyncFnOnce(SocketAddr)) {
    let runtime = runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let router = Router::new().route("/", get(page));
        let (stop, stopped) = watch::channel(false);
        let server = tokio::spawn(serve(listener, router, limits, stopped));
        test(address).await;
        stop.send(true).unwrap();
        server.await.unwrap();
    });
}

fn limits(request: Duration, answers: Duration) -> Limits {
    Limits {
        connections: 4,
        request,
        answers,
    }
}

const LONG: Duration = Duration::from_secs(60);
const SHORT: Duration = Duration::from_secs(1);

async fn answer(address: SocketAddr) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!("{GRANTED}Connection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await.unwrap();
    answer
}

/// Returns a client that sends many requests at once and reads no answer.
async fn pipelining(address: SocketAddr, request: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let requests = format!("{request}\r\n").repeat(100);
    // It may have been refused by now.
    let _ = stream.write_all(requests.as_bytes()).await;
    stream
}

#[test]
fn silent_connections_end_and_a_request_after_them_is_answered() {
    with_server(limits(SHORT, LONG), async |address| {
        let mut silent = Vec::new();
        for _ in 0..12 {
            silent.push(TcpStream::connect(address).await.unwrap());
        }
        // The head of a request that never ends.
        let _ = silent[0].write_all(b"GET / HTTP/1.1\r\nX: ").await;
        assert!(answer(address).await.ends_with(b"x"));
    });
}

#[test]
fn a_refusal_is_the_only_answer_on_its_connection() {
    with_server(limits(LONG, LONG), async |address| {
        let mut refused = TcpStream::connect(address).await.unwrap();
        let request = format!("{REFUSED}\r\n");
        refused.write_all(request.as_bytes()).await.unwrap();
        let mut answer = String::new();
        refused.read_to_string(&mut answer).await.unwrap();
        assert!(answer.starts_with("HTTP/1.1 401 "), "{answer}");
        assert!(answer.ends_with("no\n"), "{answer}");
    });
}

#[test]
fn an_answer_that_is_not_read_is_given_up() {
    with_server(limits(LONG, SHORT), async |address| {
        let mut others = Vec::new();
        for _ in 0..4 {
            others.push(pipelining(address, GRANTED).await);
        }
        let since = Instant::now();
        assert!(answer(address).await.len() > 1 << 20);
        assert!(since.elapsed() < LONG / 10, "{:?}", since.elapsed());
    });
}
