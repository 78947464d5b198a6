//! The page of `rc10 live` whose other end is in the same browser: a robot without sockets, threads and processes.

use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use anyhow::Result;
use rc10_time::Micros;

use super::connection::Reply;
use super::page::{LiveArgs, LivePage};
use super::request::Request;
use super::server::{Answered, Pages, page};
use crate::record::replay::Kit;
use crate::world::robot::Robot;

/// A robot in the simulator or on the emulated chip, and the pages that show it.
pub struct Web {
    live: LivePage<'static, 'static>,
    /// Answers that the robot owes: the page's number for each, and since when.
    owed: Vec<(u32, Instant, Answered)>,
}

impl Web {
    /// Begins a robot in the simulator or on the emulated chip; `report` makes the report of a record.
    /// Fails if the robot cannot begin.
    pub fn new(
        args: &LiveArgs,
        robot: Robot<'static>,
        report: impl Fn(&Path) -> Result<Vec<u8>> + 'static,
    ) -> Result<Self> {
        let kit = Box::leak(Box::new(Kit::of(&robot)));
        let connection = args.at.source().open(robot, None)?;
        let report_of = move |path: PathBuf| {
            let (made, making) = channel();
            // The page that asked may have gone.
            let _ = made.send(report(&path));
            making
        };
        let live = LivePage::new(args, connection, kit, Pages::unserved(), Box::new(report_of))?;
        Ok(Self { live, owed: Vec::new() })
    }

    /// The page.
    pub fn page() -> String {
        page()
    }

    /// Lets the robot go on for some milliseconds; its time then. Fails if it cannot go on.
    pub fn step(&mut self) -> Result<Micros> {
        self.live.step()?;
        Ok(self.live.now())
    }

    /// The mistakes with which the robot is to begin anew, when a page has asked for it.
    pub fn take_anew(&mut self) -> Option<Vec<String>> {
        if self.live.is_anew() { self.live.anew.take().map(|(_, mistakes)| mistakes) } else { None }
    }

    /// Answers a request of the page with this number; `None` if the robot's answer comes by [`owed`](Self::owed).
    pub fn ask(&mut self, number: u32, is_post: bool, target: &str, body: &[u8]) -> Option<Reply> {
        let (target, body) = (target.to_owned(), body.to_vec());
        let request = Request { is_post, target, body, is_last: false, len: 0 };
        match self.live.pages.ask(&request).poll(Duration::ZERO) {
            Ok(reply) => Some(reply),
            Err(later) => {
                self.owed.push((number, Instant::now(), later));
                None
            }
        }
    }

    /// The next answer that was owed and is there, with its number.
    pub fn owed(&mut self) -> Option<(u32, Reply)> {
        for at in 0..self.owed.len() {
            let (number, since, answer) = self.owed.remove(at);
            match answer.poll(since.elapsed()) {
                Ok(reply) => return Some((number, reply)),
                Err(later) => self.owed.insert(at, (number, since, later)),
            }
        }
        None
    }
}
