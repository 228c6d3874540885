//! A `gyre watch` process: a server that shows a run.

use std::{
    io::{Read, Write},
    net::TcpStream,
};

use rustix::process::Signal;

use super::{Pid, Run, gyre, spawned::Spawned};

/// Asks a port of this machine for a path with these headers.
pub fn asked(port: &str, path: &str, headers: &[&str]) -> TcpStream {
    let mut connection = TcpStream::connect(("127.0.0.1", port.parse().unwrap())).unwrap();
    let headers = headers.iter().map(|header| format!("{header}\r\n"));
    let request = format!("GET {path} HTTP/1.1\r\n{}\r\n", headers.collect::<String>());
    connection.write_all(request.as_bytes()).unwrap();
    connection
}

pub struct Server {
    process: Spawned,
    pub address: String,
}

impl Server {
    /// Starts one at a free port of an address, and waits until it serves.
    pub fn start(run: &Run, ip: &str, options: &[&str]) -> Self {
        let mut command = gyre();
        command.arg("watch").arg(run.out()).args(options);
        command.args(["--listen", &format!("{ip}:0")]);
        let mut server = Self {
            process: Spawned::new(command, run.folder().join("server.txt")),
            address: String::new(),
        };
        server.address = server.line(" is shown at ");
        server
    }

    pub fn pid(&self) -> Pid {
        self.process.pid()
    }

    /// The address that Foxglove connects to.
    pub fn foxglove(&self) -> String {
        self.line(" connect to ")
    }

    /// Waits for a line with these words, and returns the text after them.
    pub fn line(&self, words: &str) -> String {
        self.process.until(|said| {
            let (whole, _) = said.rsplit_once('\n')?;
            let (_, rest) = whole.lines().find_map(|line| line.split_once(words))?;
            Some(rest.to_owned())
        })
    }

    pub fn token(&self) -> Option<&str> {
        self.address.split_once("?token=").map(|(_, token)| token)
    }

    /// Asks for a path as a browser on this machine does, with other headers, and returns the whole
    /// answer.
    pub fn get(&self, path: &str, headers: &[&str]) -> String {
        let host = self.address.split('/').nth(2).unwrap();
        let (_, port) = host.rsplit_once(':').unwrap();
        let host = format!("Host: 127.0.0.1:{port}");
        let has_host = headers.iter().any(|header| header.starts_with("Host:"));
        let mut all = vec!["Connection: close"];
        all.extend((!has_host).then_some(host.as_str()));
        all.extend(headers);
        let mut answer = String::new();
        let mut connection = asked(port, path, &all);
        connection.read_to_string(&mut answer).unwrap();
        answer
    }

    /// Ends it as Ctrl-C does, and asserts that it ends well.
    pub fn interrupt(mut self) {
        self.process.signal(Signal::INT);
        let status = self.process.wait();
        assert!(status.success(), "{status}: {}", self.process.said());
    }
}
