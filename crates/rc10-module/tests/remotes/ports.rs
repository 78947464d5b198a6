//! Ports that make it hard for the driver loop.

use std::cell::Cell;
use std::rc::Rc;

use embassy_time::Instant;
use embedded_io_async::{ErrorKind, ErrorType, Read};
use rc10_module::Reception;
use rc10_module::remote::{Receiver, Remote, listen};
use rc10_time::Micros;

use crate::clock::{Line, run_until};

/// Always ready, with nothing but this; after very many reads it has mercy, so that the test ends.
struct Broken {
    says: Result<usize, ErrorKind>,
    reads: Rc<Cell<u32>>,
}

const VERY_MANY: u32 = 50_000;

impl ErrorType for Broken {
    type Error = ErrorKind;
}

impl Read for Broken {
    async fn read(&mut self, _: &mut [u8]) -> Result<usize, ErrorKind> {
        self.reads.set(self.reads.get() + 1);
        if self.reads.get() > VERY_MANY {
            std::future::pending::<()>().await;
        }
        self.says
    }
}

#[test]
fn a_port_that_fails_at_once_and_always_leaves_time_for_others() {
    for says in [Err(ErrorKind::Other), Ok(0)] {
        let (start, reads) = (Instant::now().as_micros(), Rc::new(Cell::new(0)));
        let port = Broken { says, reads: Rc::clone(&reads) };
        let reception = Reception::new();
        let silent = |_: Remote, _: Micros| panic!("heard something");
        let task = listen(Receiver::Dr16, Receiver::Dr16.channels(), port, &reception, silent);
        assert_eq!(run_until(start + 1_000_000, task), None);
        // And it is tried again soon.
        assert!((200..=251).contains(&reads.get()), "{says:?}: {} reads", reads.get());
        assert!(reception.read().port_errors + 1 >= reads.get());
    }
}

/// A port that loses the next bytes if a waiting read of it is dropped.
struct Careless {
    line: Line,
    dropped: Rc<Cell<u32>>,
}

struct Waiting(Option<Rc<Cell<u32>>>);

impl Drop for Waiting {
    fn drop(&mut self) {
        if let Some(dropped) = self.0.take() {
            dropped.set(dropped.get() + 1);
        }
    }
}

impl ErrorType for Careless {
    type Error = ErrorKind;
}

impl Read for Careless {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        let mut waiting = Waiting(Some(Rc::clone(&self.dropped)));
        let result = self.line.read(buffer).await;
        waiting.0 = None;
        result
    }
}

/// DBUS is believed after a pause: the read that hears it is the one that goes on.
#[test]
fn no_read_is_dropped_to_hear_a_pause() {
    let start = Instant::now().as_micros();
    let centred = [0x00, 0x04, 0x20, 0x00, 0x01, 0xF8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x00, 0x04];
    let mut line = Line { now: start, ..Line::default() };
    for _ in 0..10 {
        line.send(&centred, 110_000);
        line.now += 12_000;
    }
    let (end, dropped) = (line.now, Rc::new(Cell::new(0)));
    let port = Careless { line, dropped: Rc::clone(&dropped) };
    let (heard, reception) = (Cell::new(0), Reception::new());
    let task = listen(Receiver::Dr16, Receiver::Dr16.channels(), port, &reception, |_, _| {
        heard.set(heard.get() + 1);
    });
    assert_eq!(run_until(end, task), None);
    // The last one, with the task.
    assert_eq!((heard.get(), dropped.get()), (10, 1));
}
