//! The right to read: by the token, or by being on this machine.

use std::{
    fs::{self, OpenOptions},
    io::{self, ErrorKind, Write},
    net::{IpAddr, SocketAddr},
    os::unix::fs::OpenOptionsExt,
    path::Path,
};

use axum::http::{HeaderMap, Uri, header};
use subtle::ConstantTimeEq;

const TOKEN_BYTES: usize = 16;
const MIN_TOKEN: usize = 16;

/// The origins of viewers' pages: Foxglove's site, and the files of an application, which no site
/// can name as its origin.
const VIEWERS: [&str; 2] = ["https://app.foxglove.dev", "file://"];

#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

pub struct Access {
    token: Option<Token>,
    /// The cookie's name: cookies are shared by all ports of a host.
    cookie: String,
    /// True if the pages of viewers, which are served elsewhere, may read: with the token of any
    /// site; without it of Foxglove's own site, an application and this machine.
    pub of_viewers: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Granted,
    /// It may read, and gave the token in its address: a cookie replaces it from here on.
    GrantedByAddress,
    NoToken,
    /// It names a host that is not this machine: another site's name may have been pointed here
    /// (DNS rebinding).
    ForeignHost,
    ForeignOrigin,
}

impl Token {
    pub fn random() -> io::Result<Self> {
        let mut bytes = [0_u8; TOKEN_BYTES];
        getrandom::fill(&mut bytes).map_err(io::Error::other)?;
        let digits = bytes.iter().map(|byte| format!("{byte:02x}"));
        Ok(Self(digits.collect()))
    }

    /// Reads the token of a file, or writes a random one there if there is no such file.
    pub fn of_file(path: &Path) -> io::Result<Self> {
        match fs::read_to_string(path) {
            Ok(text) => Self::parse(text.trim()),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let token = Self::random()?;
                let mut options = OpenOptions::new();
                let options = options.write(true).create_new(true).mode(0o600);
                let mut file = options.open(path)?;
                writeln!(file, "{}", token.0)?;
                Ok(token)
            }
            Err(error) => Err(error),
        }
    }

    fn parse(text: &str) -> io::Result<Self> {
        let plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
        match text.len() >= MIN_TOKEN && text.bytes().all(plain) {
            true => Ok(Self(text.to_owned())),
            false => Err(io::Error::other(format!(
                "a token has at least {MIN_TOKEN} letters, digits, `-` or `_`"
            ))),
        }
    }

    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Compares in a time that does not depend on where the texts differ.
    fn is(&self, given: &str) -> bool {
        self.0.as_bytes().ct_eq(given.as_bytes()).into()
    }
}

impl Access {
    /// Creates the access to a server: without a token it is for this machine alone.
    pub fn new(address: SocketAddr, token: Option<Token>, of_viewers: bool) -> Self {
        Self {
            token,
            cookie: format!("gyre_watch_{}", address.port()),
            of_viewers,
        }
    }

    pub fn judge(&self, uri: &Uri, headers: &HeaderMap) -> Verdict {
        let host = text(headers, header::HOST).unwrap_or_default();
        let origin = text(headers, header::ORIGIN);
        if origin.is_some_and(|origin| !is_of(origin, host) && !self.is_viewer(origin)) {
            return Verdict::ForeignOrigin;
        }
        let Some(token) = &self.token else {
            return match is_this_machine(host) {
                true => Verdict::Granted,
                false => Verdict::ForeignHost,
            };
        };
        if in_address(uri).is_some_and(|given| token.is(given)) {
            return Verdict::GrantedByAddress;
        }
        let bearer = text(headers, header::AUTHORIZATION).and_then(|h| h.strip_prefix("Bearer "));
        let given = bearer.or_else(|| self.in_cookie(headers));
        match given.is_some_and(|given| token.is(given)) {
            true => Verdict::Granted,
            false => Verdict::NoToken,
        }
    }

    /// Returns the header `Set-Cookie` that replaces the token in the address.
    pub fn cookie(&self) -> Option<String> {
        let token = self.token.as_ref()?.as_str();
        let name = &self.cookie;
        Some(format!(
            "{name}={token}; HttpOnly; SameSite=Lax; Path=/; Max-Age=2592000"
        ))
    }

    fn is_viewer(&self, origin: &str) -> bool {
        let host = origin.split_once("://").map(|(_, host)| host);
        let is_known = VIEWERS.contains(&origin) || host.is_some_and(is_this_machine);
        self.of_viewers && (self.token.is_some() || is_known)
    }

    fn in_cookie<'a>(&self, headers: &'a HeaderMap) -> Option<&'a str> {
        let all = headers.get_all(header::COOKIE).into_iter();
        let all = all.filter_map(|cookies| cookies.to_str().ok());
        let mut cookies = all.flat_map(|cookies| cookies.split("; "));
        cookies.find_map(|cookie| cookie.strip_prefix(self.cookie.as_str())?.strip_prefix('='))
    }
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

fn in_address(uri: &Uri) -> Option<&str> {
    let mut pairs = uri.query()?.split('&');
    pairs.find_map(|pair| pair.strip_prefix("token="))
}

fn is_of(origin: &str, host: &str) -> bool {
    let authority = origin.split_once("://").map(|(_, authority)| authority);
    !host.is_empty() && authority == Some(host)
}

/// Returns whether a `Host` names this machine. The port may differ, as through `ssh -L`.
fn is_this_machine(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let address = name.trim_start_matches('[').trim_end_matches(']').parse();
    name.eq_ignore_ascii_case("localhost") || address.is_ok_and(|ip: IpAddr| ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECRET: &str = "0123456789abcdef";

    fn access(token: Option<&str>, of_viewers: bool) -> Access {
        let token = token.map(|text| Token::parse(text).unwrap());
        Access::new("127.0.0.1:8080".parse().unwrap(), token, of_viewers)
    }

    fn judged(access: &Access, uri: &str, headers: &[(header::HeaderName, &str)]) -> Verdict {
        let headers = headers.iter();
        let headers = headers.map(|(name, value)| (name.clone(), value.parse().unwrap()));
        access.judge(&uri.parse().unwrap(), &headers.collect())
    }

    #[test]
    fn without_a_token_only_names_of_this_machine_are_answered() {
        let access = access(None, false);
        let own = "127.0.0.1:8080 127.0.0.1 LocalHost localhost:9000 [::1]:8080 [::1] 127.1.2.3:1";
        let foreign = "evil.example:8080 localhost.evil.example 127.0.0.1.evil.example:8080 192.168.0.1:8080 [2001:db8::1]:8080";
        for (hosts, verdict) in [(own, Verdict::Granted), (foreign, Verdict::ForeignHost)] {
            for host in hosts.split(' ') {
                let found = judged(&access, "/", &[(header::HOST, host)]);
                assert_eq!(found, verdict, "{host}");
            }
        }
        let nameless = judged(&access, "/", &[(header::HOST, "")]);
        assert_eq!(nameless, Verdict::ForeignHost);
    }

    #[test]
    fn pages_of_other_sites_are_refused_but_for_those_of_viewers() {
        let origin = |access: &Access, uri: &str, origin: &str| {
            let headers = [(header::HOST, "localhost:8080"), (header::ORIGIN, origin)];
            judged(access, uri, &headers)
        };
        let (page, open) = (access(None, false), access(None, true));
        let foreign = "null http://evil.example https://app.foxglove.dev.evil.example http://localhost.evil.example";
        for foreign in foreign.split(' ') {
            for access in [&page, &open] {
                let found = origin(access, "/", foreign);
                assert_eq!(found, Verdict::ForeignOrigin, "{foreign}");
            }
        }
        let own = origin(&page, "/", "http://localhost:8080");
        assert_eq!(own, Verdict::Granted);
        for known in "https://app.foxglove.dev file:// http://localhost:3000".split(' ') {
            assert_eq!(origin(&page, "/", known), Verdict::ForeignOrigin, "{known}");
            assert_eq!(origin(&open, "/", known), Verdict::Granted, "{known}");
        }
        let (closed, lichtblick) = (access(Some(SECRET), true), "http://lichtblick.lan");
        assert_eq!(origin(&closed, "/", lichtblick), Verdict::NoToken);
        let verdict = origin(&closed, &format!("/?token={SECRET}"), lichtblick);
        assert_eq!(verdict, Verdict::GrantedByAddress);
    }

    #[test]
    fn the_token_is_taken_from_the_address_a_header_or_the_cookie_and_nothing_else() {
        let access = access(Some(SECRET), false);
        let bearer = format!("Bearer {SECRET}");
        let cookie = format!("other=1; gyre_watch_8080={SECRET}");
        let of_another = format!("gyre_watch_8081={SECRET}");
        let by_address = format!("/?token={SECRET}");
        let longer = format!("/?token={SECRET}0");
        let other = (header::ACCEPT, "any");
        for (uri, header, verdict) in [
            (&*by_address, other.clone(), Verdict::GrantedByAddress),
            ("/", (header::AUTHORIZATION, &*bearer), Verdict::Granted),
            ("/", (header::COOKIE, &*cookie), Verdict::Granted),
            ("/?token=", other.clone(), Verdict::NoToken),
            ("/?token=0123456789abcdeX", other.clone(), Verdict::NoToken),
            (&*longer, other.clone(), Verdict::NoToken),
            ("/", (header::AUTHORIZATION, SECRET), Verdict::NoToken),
            ("/", (header::COOKIE, &*of_another), Verdict::NoToken),
            ("/", (header::COOKIE, "gyre_watch_8080="), Verdict::NoToken),
            ("/", other, Verdict::NoToken),
        ] {
            let headers = [(header::HOST, "robot.local:8080"), header];
            assert_eq!(judged(&access, uri, &headers), verdict, "{uri} {headers:?}");
        }
    }

    #[test]
    fn tokens_are_random_and_a_file_keeps_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        let written = Token::of_file(&path).unwrap();
        assert!(Token::of_file(&path).unwrap() == written);
        assert!(Token::random().unwrap() != written);
        assert_eq!(written.as_str().len(), 2 * TOKEN_BYTES);
        fs::write(&path, "short\n").unwrap();
        assert!(Token::of_file(&path).is_err());
    }
}
