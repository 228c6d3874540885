//! A `gyre watch` process: a server that shows a run.

use std::{
    io::{Read, Write},
    net::TcpStream,
};

use rustix::process::Signal;

use super::{Pid, Run, gyre, spawned::Spawned};

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
        self.process.signal(Signal::INT);
        let status = self.process.wait();
        assert!(status.success(), "{status}: {}", self.process.said());
    }
}
