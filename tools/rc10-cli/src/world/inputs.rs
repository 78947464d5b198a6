//! What reaches the ticks of a simulated robot, written for a record.

use std::sync::{Mutex, PoisonError};

use rc10_motor::record::Sink;

/// A simulated robot's sink: what its buses have written and was not taken yet.
#[derive(Default)]
pub(crate) struct Written(Mutex<Vec<u32>>);

impl Written {
    /// One that stays for the life of the program: a few bytes a run that is recorded.
    pub(crate) fn new() -> &'static Self {
        Box::leak(Box::default())
    }

    pub(crate) fn take(&self) -> Vec<u32> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Sink for Written {
    fn put(&self, entry: &[u32]) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend(entry);
    }

    fn is_proof(&self) -> bool {
        true
    }
}
