//! Connections of browsers: few, and with short timeouts, so that a new one always gets in.

use crate::live::request::read;
use std::io::Read as _;
use std::io::Write as _;
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::{Arc, Mutex, Weak};
use std::sync::{MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use std::{io, thread};

use super::request::{Door, Request};

const MOST: usize = 32;
/// Time limit from the first byte of a request to its last.
const WHOLE: Duration = Duration::from_secs(2);
/// Time limit of silence, and for taking an answer.
const IDLE: Duration = Duration::from_secs(10);
/// Pause after an error of the listener: other connections may close their files meanwhile.
const PAUSE: Duration = Duration::from_millis(2);

/// An answer to a browser.
pub struct Reply {
    /// HTTP status.
    pub status: u16,
    /// MIME type of the content.
    pub kind: &'static str,
    /// Content.
    pub body: Vec<u8>,
}

/// The phase of a connection; if there are too many, the oldest in the lowest phase is closed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Reading,
    Idle,
    Answering,
}

struct Connection {
    stream: TcpStream,
    phase: Mutex<(Phase, Instant)>,
}

/// Answers all requests, for ever.
pub fn serve<A>(listener: &TcpListener, door: &Door, answer: A)
where
    A: Fn(&Request) -> Reply + Clone + Send + 'static,
{
    let mut open = Vec::new();
    loop {
        let Ok((stream, _)) = listener.accept() else {
            // The likely cause is too many open files.
            shut_one(&mut open);
            thread::sleep(PAUSE);
            continue;
        };
        open.retain(|it: &Weak<_>| it.strong_count() > 0);
        if open.len() >= MOST {
            shut_one(&mut open);
        }
        let phase = Mutex::new((Phase::Reading, Instant::now()));
        let connection = Arc::new(Connection { stream, phase });
        open.push(Arc::downgrade(&connection));
        let (door, answer) = (door.clone(), answer.clone());
        // Without a thread the connection is closed; an error ends it alone.
        let _ = thread::Builder::new().spawn(move || connection.serve(&door, answer));
    }
}

/// Shuts down the one that has been longest in the first phase.
fn shut_one(open: &mut Vec<Weak<Connection>>) {
    let alive = open.iter().enumerate().filter_map(|(at, it)| Some((at, it.upgrade()?)));
    if let Some((at, connection)) = alive.min_by_key(|(_, it)| *look(&it.phase)) {
        open.swap_remove(at);
        let _ = connection.stream.shutdown(Shutdown::Both);
    }
}

impl Connection {
    fn serve(&self, door: &Door, answer: impl Fn(&Request) -> Reply) -> io::Result<()> {
        self.stream.set_nodelay(true)?;
        self.stream.set_write_timeout(Some(IDLE))?;
        let mut bytes = Vec::new();
        loop {
            let request = self.receive(&mut bytes, door)?;
            self.enter(Phase::Answering);
            match &request {
                Ok(request) => self.send(&answer(request), request.is_last)?,
                Err(refused) => self.send(refused, true)?,
            }
            let Ok(Request { is_last: false, len, .. }) = request else { return self.end() };
            bytes.drain(..len);
            self.enter(if bytes.is_empty() { Phase::Idle } else { Phase::Reading });
        }
    }

    fn enter(&self, phase: Phase) {
        *look(&self.phase) = (phase, Instant::now());
    }

    /// Waits for a request, or for a refusal.
    fn receive(&self, bytes: &mut Vec<u8>, door: &Door) -> io::Result<Result<Request, Reply>> {
        let mut until = Instant::now() + if bytes.is_empty() { IDLE } else { WHOLE };
        loop {
            match read(bytes, door) {
                Ok(None) => {}
                Ok(Some(request)) => return Ok(Ok(request)),
                Err((status, why)) => return Ok(Err(Reply::text(status, why))),
            }
            let mut piece = [0; 4096];
            let count = self.read(&mut piece, until)?;
            if bytes.is_empty() {
                until = Instant::now() + WHOLE;
                self.enter(Phase::Reading);
            }
            bytes.extend(&piece[..count]);
        }
    }

    fn read(&self, piece: &mut [u8], until: Instant) -> io::Result<usize> {
        // A timeout of zero is an error here.
        self.stream.set_read_timeout(Some(until.saturating_duration_since(Instant::now())))?;
        match (&self.stream).read(piece)? {
            0 => Err(io::ErrorKind::UnexpectedEof.into()),
            count => Ok(count),
        }
    }

    fn send(&self, reply: &Reply, is_last: bool) -> io::Result<()> {
        let Reply { status, kind, body } = reply;
        let connection = if is_last { "close" } else { "keep-alive" };
        let head = format!(
            "HTTP/1.1 {status} \r\nContent-Type: {kind}\r\nContent-Length: {}\r\n\
             Connection: {connection}\r\nCache-Control: no-store\r\n\
             X-Content-Type-Options: nosniff\r\nContent-Security-Policy: \
             default-src 'self' 'unsafe-inline'; frame-ancestors 'none'\r\n\r\n",
            body.len()
        );
        (&self.stream).write_all(&[head.as_bytes(), body].concat())
    }

    /// Closes the connection. Some more bytes are read and dropped, or closing would discard the
    /// answer.
    fn end(&self) -> io::Result<()> {
        self.enter(Phase::Reading);
        self.stream.shutdown(Shutdown::Write)?;
        let until = Instant::now() + WHOLE;
        (0..256).try_for_each(|_| self.read(&mut [0; 4096], until).map(drop))
    }
}

impl Reply {
    /// A reply of plain text.
    pub fn text(status: u16, text: &str) -> Self {
        Self { status, kind: "text/plain", body: text.into() }
    }
}

/// Locks a value; a thread that panicked left it whole.
pub fn look<T>(behind: &Mutex<T>) -> MutexGuard<'_, T> {
    behind.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    /// Its connection is older than all silent ones, of which some are closed.
    #[test]
    fn a_connection_with_an_answer_stays_when_there_are_too_many() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let ((tell, begun), (go_on, wait)) = (channel(), channel());
        let wait = Arc::new(Mutex::new(wait));
        let answer = move |request: &Request| {
            if request.target == "/slow" {
                tell.send(()).unwrap();
                look(&wait).recv().unwrap();
            }
            Reply::text(200, "")
        };
        thread::spawn(move || serve(&listener, &Door::here(port), answer));
        let send = |text: &str| {
            let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
            // It may be one of those that are closed.
            let _ = stream.write_all(text.as_bytes());
            stream
        };
        let get = |path| send(&format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n"));
        let is_answered = |mut stream: TcpStream| {
            let mut status = [0; 12];
            stream.read_exact(&mut status).is_ok() && &status == b"HTTP/1.1 200"
        };
        let slow = get("/slow");
        begun.recv().unwrap();
        let _silent: Vec<_> = (0..MOST + 8).map(|_| send("GET")).collect();
        assert!(is_answered(get("/")), "behind them all");
        go_on.send(()).unwrap();
        assert!(is_answered(slow));
    }
}
