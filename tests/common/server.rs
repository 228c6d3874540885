//! A `gyre watch` process: a server that shows a run.

use std::{
    fs::{self, File},
    io::{Read, Write},
    net::TcpStream,
    path::PathBuf,
    process::{Child, Stdio},
    thread,
    time::{Duration, Instant},
};

use rustix::process::Signal;

use super::{Pid, Run, gyre, send};

const LIMIT: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(5);

/// A running server. Dropped, it is killed.
pub struct Server {
    child: Child,
    said: PathBuf,
    /// The address that it has printed.
    pub address: String,
}

impl Server {
    /// Starts one at a free port of an address, and waits until it serves.
    pub fn start(run: &Run, ip: &str, options: &[&str]) -> Self {
        let said = run.folder().join("server.txt");
        let mut command = gyre();
        let command = command.arg("watch").arg(run.out()).args(options);
        command.args(["--listen", &format!("{ip}:0")]);
        command.stdin(Stdio::null()).stdout(Stdio::null());
        let child = command.stderr(File::create(&said).unwrap()).spawn();
        let mut server = Self {
            child: child.unwrap(),
            said,
            address: String::new(),
        };
        server.address = server.line(" is shown at ");
        server
    }

    fn said(&self) -> String {
        fs::read_to_string(&self.said).unwrap()
    }

    /// Returns its process.
    pub fn pid(&self) -> Pid {
        self.child.id()
    }

    /// The address that Foxglove connects to.
    pub fn foxglove(&self) -> String {
        self.line(" connect to ")
    }

    /// Waits for a line with these words, and returns the text after them.
    pub fn line(&self, words: &str) -> String {
        let since = Instant::now();
        loop {
            let said = self.said();
            let whole = said.rsplit_once('\n').map_or("", |(whole, _)| whole);
            let mut found = whole.lines().filter_map(|line| line.split_once(words));
            if let Some((_, rest)) = found.next() {
                return rest.to_owned();
            }
            assert!(since.elapsed() < LIMIT, "{said}");
            thread::sleep(LOOK);
        }
    }

    /// The token in its address.
    pub fn token(&self) -> Option<&str> {
        self.address.split_once("?token=").map(|(_, token)| token)
    }

    /// Asks for a path as a browser on this machine does, with other headers, and returns the whole
    /// answer.
    pub fn get(&self, path: &str, headers: &[&str]) -> String {
        let port = self
            .address
            .split('/')
            .nth(2)
            .and_then(|host| host.rsplit_once(':'));
        let port: u16 = port.unwrap().1.parse().unwrap();
        let mut connection = TcpStream::connect(("127.0.0.1", port)).unwrap();
        let has_host = headers.iter().any(|header| header.starts_with("Host:"));
        let host = if has_host {
            String::new()
        } else {
            format!("Host: 127.0.0.1:{port}\r\n")
        };
        let headers: String = headers
            .iter()
            .map(|header| format!("{header}\r\n"))
            .collect();
        let request = format!("GET {path} HTTP/1.1\r\n{host}{headers}Connection: close\r\n\r\n");
        connection.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        connection.read_to_string(&mut answer).unwrap();
        answer
    }

    /// Ends it as Ctrl-C does, and asserts that it ends well.
    pub fn interrupt(mut self) {
        send(self.child.id(), Signal::INT);
        let since = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                assert!(status.success(), "{status}: {}", self.said());
                return;
            }
            assert!(since.elapsed() < LIMIT, "it does not end: {}", self.said());
            thread::sleep(LOOK);
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
