//! Requests of pages, read from bytes: without sockets, so that it can be fuzzed.

use std::hash::{BuildHasher as _, RandomState};
use std::net::SocketAddr;

use rc10_time::Micros;

/// Limit of bytes before the body.
const HEAD: usize = 8 * 1024;
/// Limit of bytes of the body.
const BODY: usize = 64 * 1024;
/// Limit of signals in one answer.
const SIGNALS: usize = 64;

/// Where a server is reached: by this PC alone, or by others that know a key.
#[derive(Clone, Debug)]
pub struct Door {
    /// What a browser may call it: names with the port.
    hosts: Vec<String>,
    /// What each path begins with.
    key: String,
}

impl Door {
    /// For this PC alone, at a port.
    pub fn here(port: u16) -> Self {
        let hosts = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}"));
        Self { hosts: hosts.into(), key: String::new() }
    }

    /// For other devices in the network, at an address of this PC; with the address to give them.
    pub fn lan(address: SocketAddr) -> (Self, String) {
        let key = format!("/{}", by_chance());
        let url = format!("http://{address}{key}/");
        (Self { hosts: vec![address.to_string()], key }, url)
    }

    /// Whether it is for guests: they watch, and stop.
    pub const fn is_for_guests(&self) -> bool {
        !self.key.is_empty()
    }
}

/// 128 bits that other programs do not know, in hexadecimal.
pub fn by_chance() -> String {
    let half = |half| RandomState::new().hash_one(half);
    format!("{:016x}{:016x}", half(0), half(1))
}

/// A whole request that is allowed.
#[derive(Debug, PartialEq, Eq)]
pub struct Request {
    /// Whether it is a `POST`, with JSON; else it is a `GET`.
    pub is_post: bool,
    /// Path and query.
    pub target: String,
    /// Content behind the head.
    pub body: Vec<u8>,
    /// Whether the connection ends after it.
    pub is_last: bool,
    /// Length in bytes; other requests may follow.
    pub len: usize,
}

/// A refusal: the HTTP status and the reason.
pub type Refusal = (u16, &'static str);

type Headers<'h> = [httparse::Header<'h>];

/// Reads the first request in `bytes`, for the server behind this door; `None` if it is not whole yet.
/// Origin, key and length are checked as soon as the head is there. Fails if the request is not
/// allowed; the connection is to be closed.
pub fn read(bytes: &[u8], door: &Door) -> Result<Option<Request>, Refusal> {
    let mut headers = [httparse::EMPTY_HEADER; 64];
    let mut head = httparse::Request::new(&mut headers);
    let start = &bytes[..bytes.len().min(HEAD)];
    let begin = match head.parse(start) {
        Ok(httparse::Status::Complete(begin)) => begin,
        Ok(httparse::Status::Partial) if start.len() < HEAD => return Ok(None),
        Ok(_) | Err(httparse::Error::TooManyHeaders) => return Err((431, "the head is too long")),
        Err(_) => return Err((400, "this is not HTTP")),
    };
    let method = head.method.unwrap_or_default();
    let is_post = method == "POST";
    admit(head.headers, is_post, door)?;
    let target = head.path.unwrap_or_default().strip_prefix(&door.key);
    let target = target.filter(|it| it.starts_with('/'));
    let target = target.ok_or((403, "the key is missing: take the whole address"))?;
    if !is_post && method != "GET" {
        return Err((501, "only GET and POST"));
    }
    let len = begin + length(head.headers, is_post)?;
    let Some(body) = bytes.get(begin..len) else { return Ok(None) };
    let connection = only(head.headers, "Connection")?.unwrap_or_default();
    let closes = connection.split(',').any(|word| word.trim().eq_ignore_ascii_case("close"));
    Ok(Some(Request {
        is_post,
        target: target.to_owned(),
        body: body.to_vec(),
        is_last: closes || head.version != Some(1),
        len,
    }))
}

/// The value of a header that may occur once.
fn only<'h>(headers: &Headers<'h>, name: &str) -> Result<Option<&'h str>, Refusal> {
    let mut found = headers.iter().filter(|header| header.name.eq_ignore_ascii_case(name));
    let value = found.next().map(|header| str::from_utf8(header.value)).transpose();
    let value = value.map_err(|_| (400, "a header is not UTF-8"))?;
    if found.next().is_some() { Err((400, "a header is there twice")) } else { Ok(value) }
}

/// A page of another site in the same browser must not drive the robot, nor keep this PC busy:
/// neither by its own name for this PC, nor by a form or an image.
fn admit(headers: &Headers<'_>, is_post: bool, door: &Door) -> Result<(), Refusal> {
    let is_ours = |host: &str| door.hosts.iter().any(|it| it == host);
    let is_our_page = |origin: &str| origin.strip_prefix("http://").is_some_and(is_ours);
    if !only(headers, "Host")?.is_some_and(is_ours) {
        return Err((403, "not under this name"));
    }
    // The header has `none` for a typed address or a bookmark.
    let site = only(headers, "Sec-Fetch-Site")?.unwrap_or("none");
    if !only(headers, "Origin")?.is_none_or(is_our_page) || !["same-origin", "none"].contains(&site)
    {
        return Err((403, "not from another site: type the address"));
    }
    let is_json = |kind: &str| kind.starts_with("application/json");
    if is_post && !only(headers, "Content-Type")?.is_some_and(is_json) {
        return Err((403, "only JSON"));
    }
    Ok(())
}

/// The announced length of the body.
fn length(headers: &Headers<'_>, is_post: bool) -> Result<usize, Refusal> {
    if only(headers, "Expect")?.is_some() {
        return Err((417, "the body is to be sent at once"));
    }
    if only(headers, "Transfer-Encoding")?.is_some() {
        return Err((411, "the body needs a Content-Length, and no other"));
    }
    match only(headers, "Content-Length")? {
        None if is_post => Err((411, "the body needs a Content-Length")),
        None => Ok(0),
        Some(text) if text.is_empty() || !text.bytes().all(|digit| digit.is_ascii_digit()) => {
            Err((400, "the Content-Length is no number"))
        }
        Some(text) => {
            let length = text.parse().ok().filter(|length| *length <= BODY);
            length.ok_or((413, "the body is too long"))
        }
    }
}

/// A request for plots.
#[derive(Debug, PartialEq, Eq)]
pub struct Plots {
    /// Numbers of the signals, each once.
    pub signals: Vec<u16>,
    /// Begin and end.
    pub span: [Micros; 2],
    /// Width in pixels.
    pub columns: u32,
    /// Shortest time from one value to the next, µs; 0: all of them.
    pub every: u64,
}

impl Plots {
    /// The form of a query that [`Self::parse`] reads.
    pub const FORM: &str = "signals=1,2&from=US&to=US&columns=N[&every=MS]: at most 64 signals, each once, and from <= to";

    /// Reads the query of a request; `None` if it does not have its [`Self::FORM`].
    pub fn parse(query: &str) -> Option<Self> {
        let value = |name: &str| {
            query.split('&').find_map(|pair| pair.split_once('=').filter(|pair| pair.0 == name))
        };
        let number = |name: &str| value(name)?.1.parse::<u64>().ok();
        let span = [Micros::new(number("from")?), Micros::new(number("to")?)];
        let columns = u32::try_from(number("columns")?).ok()?.clamp(1, 10_000);
        let every = number("every").unwrap_or_default().min(1000) * 1000;
        let mut signals = Vec::new();
        for signal in value("signals")?.1.split(',').filter(|it| !it.is_empty()) {
            let signal = signal.parse().ok()?;
            if signals.len() == SIGNALS || signals.contains(&signal) {
                return None;
            }
            signals.push(signal);
        }
        (span[0] <= span[1]).then_some(Self { signals, span, columns, every })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: &str = "Host: 127.0.0.1:8010\r\n";

    fn read_all(text: &str) -> Result<Option<Request>, Refusal> {
        // In pieces it is the same, but for what is not there yet.
        let whole = read(text.as_bytes(), &Door::here(8010));
        for end in 0..text.len() {
            let part = read(&text.as_bytes()[..end], &Door::here(8010));
            assert!(part == Ok(None) || part == whole, "{text}: {part:?}, then {whole:?}");
        }
        whole
    }

    fn status(text: &str) -> u16 {
        match read_all(text) {
            Ok(Some(_)) => 200,
            Ok(None) => 0,
            Err((status, _)) => status,
        }
    }

    fn post(headers: &str, body: &str) -> String {
        format!(
            "POST /wish HTTP/1.1\r\n{OURS}Content-Type: application/json\r\n{headers}\r\n{body}"
        )
    }

    #[test]
    fn a_whole_request_is_read_and_no_more() {
        let text = post("Content-Length: 2\r\n", "{}GET / HTTP/1.1\r\n");
        let request = read_all(&text).unwrap().unwrap();
        assert_eq!((request.target.as_str(), request.body.as_slice()), ("/wish", &b"{}"[..]));
        assert!(request.is_post && !request.is_last);
        assert_eq!(&text[request.len..], "GET / HTTP/1.1\r\n");
        assert_eq!(status(&post("Content-Length: 3\r\n", "{}")), 0);
        for last in ["GET / HTTP/1.0\r\n", "GET / HTTP/1.1\r\nConnection: TE, Close\r\n"] {
            assert!(read_all(&format!("{last}{OURS}\r\n")).unwrap().unwrap().is_last, "{last}");
        }
        for (more, expected) in [(63, 200), (64, 431)] {
            let more: String = (0..more).map(|at| format!("X-{at}: 1\r\n")).collect();
            assert_eq!(status(&format!("GET / HTTP/1.1\r\n{OURS}{more}\r\n")), expected);
        }
    }

    #[test]
    fn others_are_refused_by_the_head_alone() {
        let giant = "Content-Length: 18446744073709551615\r\n";
        let get = |headers: &str| format!("GET / HTTP/1.1\r\n{headers}\r\n");
        for (wanted, text) in [
            (200, get(OURS)),
            (200, get("Host: localhost:8010\r\nOrigin: http://127.0.0.1:8010\r\n")),
            (200, get(&format!("{OURS}Sec-Fetch-Site: none\r\n"))),
            (200, get(&format!("{OURS}Sec-Fetch-Site: same-origin\r\nUpgrade: websocket\r\n"))),
            (403, get("")),
            (403, get("Host: example.org\r\n")),
            (403, get("Host: 127.0.0.1\r\n")),
            (403, get("Host: 127.0.0.1:80108010\r\n")),
            (403, get("Host: 127.0.0.1.example.org:8010\r\n")),
            (403, get(&format!("{OURS}Origin: null\r\n"))),
            (403, get(&format!("{OURS}Origin: https://127.0.0.1:8010\r\n"))),
            (403, get(&format!("{OURS}Origin: http://127.0.0.1:8011\r\n"))),
            (403, get(&format!("{OURS}Sec-Fetch-Site: cross-site\r\n"))),
            (403, get(&format!("{OURS}Sec-Fetch-Site: same-site\r\n"))),
            (403, post(&format!("Origin: http://example.org\r\n{giant}"), "")),
            (403, format!("POST /wish HTTP/1.1\r\n{OURS}Content-Type: text/plain\r\n{giant}\r\n")),
            (400, get(&format!("{OURS}{OURS}"))),
            (400, get(&format!("{OURS}Origin: http://localhost:8010\r\nOrigin: null\r\n"))),
            (501, format!("PUT / HTTP/1.1\r\n{OURS}\r\n")),
        ] {
            assert_eq!(status(&text), wanted, "{text}");
        }
    }

    #[test]
    fn a_guest_says_the_key() {
        let (door, url) = Door::lan("192.168.1.5:8010".parse().unwrap());
        let path = url.strip_prefix("http://192.168.1.5:8010").unwrap();
        assert!(door.is_for_guests() && path.len() == 34, "{path}");
        let get = |host: &str, path: &str| {
            let text = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n");
            read(text.as_bytes(), &door).map(|it| it.unwrap().target).map_err(|it| it.0)
        };
        let ours = "192.168.1.5:8010";
        assert_eq!(get(ours, path), Ok("/".to_owned()));
        assert_eq!(get(ours, &format!("{path}state")), Ok("/state".to_owned()));
        let key = path.trim_end_matches('/');
        for wrong in ["/", "/state", "//", &format!("{key}0/"), key, &path.replace(&key[3..5], "")]
        {
            assert_eq!(get(ours, wrong), Err(403), "{wrong}");
        }
        for host in ["127.0.0.1:8010", "example.org", "192.168.1.5", "192.168.1.5:8011"] {
            assert_eq!(get(host, path), Err(403), "{host}");
        }
        assert_ne!(Door::lan("192.168.1.5:8010".parse().unwrap()).1, url);
    }

    #[test]
    fn a_body_has_one_length_that_is_short() {
        for (wanted, headers) in [
            (413, "Content-Length: 18446744073709551615\r\n"),
            (413, "Content-Length: 99999999999999999999999999\r\n"),
            (413, "Content-Length: 65537\r\n"),
            (0, "Content-Length: 65536\r\n"),
            (400, "Content-Length: +2\r\n"),
            (400, "Content-Length: -2\r\n"),
            (400, "Content-Length:\r\n"),
            (400, "Content-Length: 2\r\nContent-Length: 2\r\n"),
            (411, "Content-Length: 2\r\nTransfer-Encoding: chunked\r\n"),
            (411, "Transfer-Encoding: chunked\r\n"),
            (417, "Content-Length: 2\r\nExpect: 100-continue\r\n"),
            (411, ""),
        ] {
            assert_eq!(status(&post(headers, "")), wanted, "{headers}");
        }
    }

    #[test]
    fn a_head_has_an_end_and_is_http() {
        let long = format!("GET / HTTP/1.1\r\nX: {}", "x".repeat(HEAD));
        assert_eq!(read(long.as_bytes(), &Door::here(8010)), Err((431, "the head is too long")));
        assert_eq!(status(&format!("GET / HTTP/1.1\r\n{}\r\n", "X: x\r\n".repeat(65))), 431);
        assert_eq!(status("\u{16}\u{3}\u{1}"), 400);
        assert_eq!(status("GET / HTTP/2.0\r\n\r\n"), 400);
    }

    #[test]
    fn plots_have_few_signals_each_once() {
        let parse =
            |signals: &str| Plots::parse(&format!("signals={signals}&from=1&to=9&columns=20000"));
        let plots = parse("3,1").unwrap();
        assert_eq!((plots.signals, plots.columns), (vec![3, 1], 10_000));
        let numbers =
            |count: u16| (0..count).map(|it| it.to_string()).collect::<Vec<_>>().join(",");
        assert!(parse("").is_some() && parse(&numbers(64)).is_some());
        assert!(parse(&numbers(65)).is_none() && parse("1,2,1").is_none() && parse("-1").is_none());
        assert!(Plots::parse("signals=1&from=9&to=1&columns=9").is_none(), "backwards");
        assert!(Plots::parse("signals=1").is_none());
    }
}
