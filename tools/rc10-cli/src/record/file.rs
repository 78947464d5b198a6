//! Reads MCAP files that may be damaged: one record after the other, in a bounded memory. No length
//! in a file is believed before its bytes are there.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};
use mcap::records::{self, Record, op};
use mcap::{MAGIC, parse_record};

/// Longest record that is read, bytes: a chunk of ours has a megabyte.
const MOST: u64 = 64 << 20;
/// Bytes before the body of a record: kind and length.
const HEAD: u64 = 9;
/// Place of the first record.
const BEGIN: u64 = MAGIC.len() as u64;
const EARLY: &str = "it ends too early";
const DAMAGED: &str = "a record is damaged";

pub(crate) struct Channel {
    pub(crate) topic: String,
    pub(crate) map: BTreeMap<String, String>,
    /// Names of the numbers in its messages; `None` for other messages.
    pub(crate) columns: Option<Vec<String>>,
}

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
                while !records.is_empty() {
                    let (kind, body, others) = split(records).context(DAMAGED)?;
                    item(kind, body, &mut schemas, &mut take)?;
                    records = others;
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
    schemas: &mut BTreeMap<u16, Option<Vec<String>>>,
    take: &mut impl FnMut(Item<'_>) -> Result<()>,
) -> Result<()> {
    match kind {
        op::MESSAGE => return take(message(body).context(DAMAGED)?),
        op::SCHEMA | op::CHANNEL | op::METADATA => {}
        _ => return Ok(()),
    }
    match parse_record(kind, body).ok().context(DAMAGED)? {
        Record::Schema { header, data } => {
            let columns = columns(&data).filter(|_| header.encoding == "ros2msg");
            schemas.insert(header.id, columns);
            Ok(())
        }
        Record::Channel(records::Channel { id, schema_id, topic, message_encoding, metadata }) => {
            let columns = schemas.get(&schema_id).cloned().flatten();
            let columns = columns.filter(|_| message_encoding == "cdr");
            take(Item::Channel(id, Channel { topic, map: metadata, columns }))
        }
        Record::Metadata(it) => take(Item::Metadata(it.name, it.metadata)),
        _ => Ok(()),
    }
}

/// A message. They are nearly all of a file, and read faster by hand.
fn message(body: &[u8]) -> Option<Item<'_>> {
    let (id, rest) = body.split_first_chunk()?;
    let (_sequence, rest) = rest.split_first_chunk::<4>()?;
    let (time, rest) = rest.split_first_chunk()?;
    let (_published, bytes) = rest.split_first_chunk::<8>()?;
    Some(Item::Message(u16::from_le_bytes(*id), u64::from_le_bytes(*time), bytes))
}

/// The records of a chunk without compression.
fn chunk(body: &[u8]) -> Result<&[u8]> {
    let Ok(Record::Chunk { header, data: Cow::Borrowed(records) }) = parse_record(op::CHUNK, body)
    else {
        bail!(DAMAGED);
    };
    let packed = header.compression;
    ensure!(packed.is_empty(), "a chunk is packed with {packed}; mcap decompress unpacks it");
    let crc = header.uncompressed_crc;
    // Zero from a writer that has no time for it.
    ensure!(crc == 0 || crc == crc32fast::hash(records), "the CRC of a chunk is wrong");
    Ok(records)
}

/// Kind and body of the first record of a chunk, and the others.
fn split(records: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let ([kind, length @ ..], rest) = records.split_first_chunk::<{ HEAD as usize }>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let (body, others) = rest.split_at_checked(length)?;
    Some((*kind, body, others))
}

/// The names of a schema's numbers; `None` if it has other types than eight-byte numbers.
fn columns(schema: &[u8]) -> Option<Vec<String>> {
    let text = std::str::from_utf8(schema).ok()?;
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    lines
        .filter(|line| !line.is_empty())
        .map(|line| line.strip_prefix("float64 ").map(|name| name.trim().to_owned()))
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
