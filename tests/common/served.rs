//! A program that serves HTTP, and requests to it.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A program that ends with the test.
pub struct Started(pub Child);

impl Drop for Started {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts a program, and reads its output up to a line that has this in it.
pub fn start(command: &mut Command, awaited: &str) -> (Started, String) {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let line = lines.find_map(|line| line.ok().filter(|line| line.contains(awaited)));
    // What it says later must not fill the pipe.
    std::thread::spawn(move || lines.for_each(drop));
    let line = line.unwrap_or_else(|| panic!("no {awaited}"));
    (Started(child), line)
}

/// Waits until something is so, also on a machine that is very slow.
pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < Duration::from_secs(600), "never: {what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// One request, and the body of its answer with its status.
pub fn http(port: u16, method: &str, path: &str, headers: &str, body: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(600))).unwrap();
    let length = body.len();
    // At once: a server has little patience with a request that comes in pieces.
    let request = format!(
        "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: {length}\r\n\
         Connection: close\r\n{headers}\r\n{body}"
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut reader = BufReader::new(stream);
    let (mut head, mut line) = (String::new(), String::new());
    while reader.read_line(&mut line).unwrap() > 2 {
        head += &std::mem::take(&mut line).to_lowercase();
    }
    // The driver does not always hang up.
    let length = head.lines().find_map(|line| line.strip_prefix("content-length:"));
    let mut body = vec![0; length.expect("a length").trim().parse().unwrap()];
    reader.read_exact(&mut body).unwrap();
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    (status, String::from_utf8(body).unwrap())
}

pub const JSON: &str = "Content-Type: application/json\r\n";

/// Starts `rc10 live`, and gives its page's port. It is not among the robots of this user.
pub fn live(command: &mut Command) -> (Started, u16) {
    let (live, line) =
        start(command.env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR")), "http://");
    (live, page_of(&line))
}

/// The port in the line of `rc10 live` with its address.
pub fn page_of(line: &str) -> u16 {
    let url = line.split_whitespace().last().unwrap().trim_end_matches('/');
    url.rsplit(':').next().unwrap().parse().unwrap()
}
