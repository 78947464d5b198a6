//! Reads MCAP files that may be damaged: one record after the other, in a bounded memory. No length
//! in a file is believed before its bytes are there.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, ensure};
use mcap::MAGIC;
use mcap::records::op;

/// Longest record that is read, bytes: a chunk of ours has a megabyte.
const MOST: u64 = 64 << 20;
/// Bytes before the body of a record: kind and length.
const HEAD: u64 = 9;
/// Place of the first record.
const BEGIN: u64 = MAGIC.len() as u64;
const EARLY: &str = "it ends too early";

pub(crate) struct Channel {
    pub(crate) topic: String,
    pub(crate) map: BTreeMap<String, String>,
    /// Names of the numbers in its messages; `None` for other messages.
    pub(crate) columns: Option<Vec<String>>,
    /// What its schema says of each of them.
    pub(crate) notes: Vec<String>,
}

/// Names of numbers, and what a schema says of each.
type Columns = (Vec<String>, Vec<String>);

pub(crate) enum Item<'a> {
    Channel(u16, Channel),
    /// A message: its channel, the time in nanoseconds, and its bytes.
    Message(u16, u64, &'a [u8]),
    Metadata(String, BTreeMap<String, String>),
}

/// Passes the items of a file to `take`, in order; an error of `take` ends it. Returns why the rest
/// of the file cannot be read, if it cannot. Fails if it is no MCAP file, or `take` does.
pub(crate) fn walk(
    file: &mut (impl Read + Seek),
    mut take: impl FnMut(Item<'_>) -> Result<()>,
) -> Result<Option<String>> {
    let (mut at, mut refused) = (0, None);
    let read = read(file, &mut at, |item| {
        take(item).map_err(|error| anyhow!("{}", refused.insert(error)))
    });
    match (read, refused) {
        (Ok(()), _) => Ok(None),
        (_, Some(error)) => Err(error.context(format!("at byte {at}"))),
        (Err(error), None) if at <= BEGIN => Err(error.context("it is no MCAP file")),
        (Err(error), None) => Ok(Some(format!("at byte {at}: {error:#}"))),
    }
}

/// Reads a file to its end. `at` is the place of the current record, or of its chunk.
fn read(
    file: &mut (impl Read + Seek),
    at: &mut u64,
    mut take: impl FnMut(Item<'_>) -> Result<()>,
) -> Result<()> {
    file.seek(SeekFrom::Start(0))?;
    let mut file = BufReader::with_capacity(1 << 16, file);
    let (mut body, mut schemas) = (Vec::new(), BTreeMap::new());
    ends_or_begins(&mut file)?;
    *at = BEGIN;
    loop {
        let (kind, length) = next(&mut file, &mut body)?;
        match kind {
            op::FOOTER => return ends_or_begins(&mut file),
            op::CHUNK => {
                let mut records = chunk(&body)?;
                while !records.0.is_empty() {
                    let (kind, body) = records.record()?;
                    item(kind, body, &mut schemas, &mut take)?;
                }
            }
            _ => item(kind, &body, &mut schemas, &mut take)?,
        }
        *at = at.saturating_add(HEAD + length);
    }
}

/// Reads the mark that is both at the begin and at the end of a file.
fn ends_or_begins(file: &mut impl Read) -> Result<()> {
    let mut magic = [0; MAGIC.len()];
    file.read_exact(&mut magic).context(EARLY)?;
    ensure!(magic == *MAGIC, "the bytes of an MCAP file are missing");
    Ok(())
}

/// Reads the next record: its kind and length, and the body if its kind is of use.
fn next(file: &mut impl Read, body: &mut Vec<u8>) -> Result<(u8, u64)> {
    body.clear();
    let mut head = [0; HEAD as usize];
    file.read_exact(&mut head).context(EARLY)?;
    let [kind, length @ ..] = head;
    let length = u64::from_le_bytes(length);
    let mut rest = file.take(length);
    let read = match kind {
        op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK | op::METADATA => {
            ensure!(length <= MOST, "a record of {length} bytes");
            rest.read_to_end(body)? as u64
        }
        _ => io::copy(&mut rest, &mut io::sink())?,
    };
    ensure!(read == length, EARLY);
    Ok((kind, length))
}

fn item(
    kind: u8,
    body: &[u8],
    schemas: &mut BTreeMap<u16, Option<Columns>>,
    take: &mut impl FnMut(Item<'_>) -> Result<()>,
) -> Result<()> {
    let mut rest = Rest(body);
    match kind {
        op::SCHEMA => {
            let (id, _, encoding) = (rest.number(2)? as u16, rest.text()?, rest.text()?);
            let length = rest.number(4)?;
            let columns = columns(rest.take(length)?).filter(|_| encoding == "ros2msg");
            schemas.insert(id, columns);
            Ok(())
        }
        op::CHANNEL => {
            let (id, schema) = (rest.number(2)? as u16, rest.number(2)? as u16);
            let (topic, encoding, map) = (rest.text()?, rest.text()?, rest.map()?);
            let columns = schemas.get(&schema).cloned().flatten();
            let columns = columns.filter(|_| encoding == "cdr");
            let (columns, notes) =
                columns.map_or((None, Vec::new()), |(names, notes)| (Some(names), notes));
            take(Item::Channel(id, Channel { topic, map, columns, notes }))
        }
        op::MESSAGE => {
            let (id, _, time) = (rest.number(2)? as u16, rest.number(4)?, rest.number(8)?);
            rest.take(8)?;
            take(Item::Message(id, time, rest.0))
        }
        op::METADATA => take(Item::Metadata(rest.text()?, rest.map()?)),
        _ => Ok(()),
    }
}

/// The records of a chunk without compression.
fn chunk(body: &[u8]) -> Result<Rest<'_>> {
    let mut rest = Rest(body);
    rest.take(24)?;
    let (crc, packed, length) = (rest.number(4)? as u32, rest.text()?, rest.number(8)?);
    ensure!(packed.is_empty(), "a chunk is packed with {packed}; mcap decompress unpacks it");
    let records = rest.take(length)?;
    // Zero from a writer that has no time for it.
    ensure!(crc == 0 || crc == crc32fast::hash(records), "the CRC of a chunk is wrong");
    Ok(Rest(records))
}

struct Rest<'a>(&'a [u8]);

impl<'a> Rest<'a> {
    fn take(&mut self, count: u64) -> Result<&'a [u8]> {
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        let (taken, rest) = self.0.split_at_checked(count).context("a record is too short")?;
        self.0 = rest;
        Ok(taken)
    }

    fn number(&mut self, bytes: u64) -> Result<u64> {
        Ok(self.take(bytes)?.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }

    fn text(&mut self) -> Result<String> {
        let length = self.number(4)?;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    fn map(&mut self) -> Result<BTreeMap<String, String>> {
        let length = self.number(4)?;
        let (mut rest, mut map) = (Rest(self.take(length)?), BTreeMap::new());
        while !rest.0.is_empty() {
            map.insert(rest.text()?, rest.text()?);
        }
        Ok(map)
    }

    fn record(&mut self) -> Result<(u8, &'a [u8])> {
        let (kind, length) = (self.number(1)? as u8, self.number(8)?);
        Ok((kind, self.take(length)?))
    }
}

/// The names of a schema's numbers, and what it says of them; `None` if it has other types than eight-byte numbers.
fn columns(schema: &[u8]) -> Option<Columns> {
    let text = std::str::from_utf8(schema).ok()?;
    let lines = text.lines().map(|line| line.split_once('#').unwrap_or((line, "")));
    lines
        .filter(|line| !line.0.trim().is_empty())
        .map(|(line, note)| {
            let name = line.trim().strip_prefix("float64 ")?;
            Some((name.trim().to_owned(), note.trim().to_owned()))
        })
        .collect()
}

/// The records of a folder that have no end.
pub(crate) fn leftovers(folder: &Path) -> Vec<PathBuf> {
    let has_no_end = |path: &PathBuf| {
        let mut end = [0; MAGIC.len()];
        let read = File::open(path).and_then(|mut file| {
            file.seek(SeekFrom::End(-(MAGIC.len() as i64)))?;
            file.read_exact(&mut end)
        });
        path.is_file()
            && path.extension().is_some_and(|word| word == "mcap")
            && (read.is_err() || end != *MAGIC)
    };
    let files = fs::read_dir(folder).into_iter().flatten().flatten().map(|file| file.path());
    let mut found: Vec<_> = files.filter(has_no_end).collect();
    found.sort();
    found
}

/// The text of a message that is one string; else empty.
pub(crate) fn label(bytes: &[u8]) -> String {
    let text = bytes.get(8..bytes.len().saturating_sub(1)).unwrap_or_default();
    String::from_utf8_lossy(text).into_owned()
}
