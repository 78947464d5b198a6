//! What reached the ticks of a robot, as words of [`rc10_motor::record`]: read from a record.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use anyhow::{Context, Result, ensure};

use rc10_motor::record::ring::MAGIC;

use crate::record::CDR;
use crate::record::file::{Channel, Item, walk};
use crate::record::replay::{is_of, numbers};
use crate::record::{END, INPUTS, LAYOUT, topic};
use crate::world::black_box::{self, BlackBox};
use crate::world::robot::Robot;

/// What a file says of the ticks.
#[derive(Default)]
pub struct Inputs {
    /// Words of [`rc10_motor::record`].
    pub words: Vec<u32>,
    /// Program and table that wrote it, where it says so.
    pub(crate) revision: String,
    /// The memory of a chip that it is.
    pub(crate) black_box: Option<BlackBox>,
    /// Why it ends early, if it does.
    pub(crate) cut: Option<String>,
    /// Topics, with what they say of a motor.
    topics: BTreeMap<String, BTreeMap<String, String>>,
    /// Efforts of the motors by their topics: time and value.
    efforts: BTreeMap<String, Vec<(f64, f32)>>,
}

impl Inputs {
    /// Reads a record, a chip's memory, or a match of its board's flash.
    ///
    /// # Errors
    /// It is neither, or has no inputs.
    pub fn read(file: &mut (impl Read + Seek)) -> Result<Self> {
        let mut memory = Vec::new();
        file.by_ref().take(black_box::BYTES as u64).read_to_end(&mut memory)?;
        if black_box::pages(&memory[..memory.len().min(black_box::PAGE_BYTES)]).next().is_some() {
            file.read_to_end(&mut memory)?;
            let (black_box, words) = BlackBox::of_pages(&memory).unwrap_or_default();
            return Ok(Self { words, black_box: Some(black_box), ..Self::default() });
        }
        if let Some(mut black_box) = BlackBox::of(&memory) {
            let words = black_box.news();
            return Ok(Self { words, black_box: Some(black_box), ..Self::default() });
        }
        ensure!(
            !memory.starts_with(&MAGIC.to_le_bytes()),
            "it is the memory of a black box, and it is empty, cut off or damaged"
        );
        let mut inputs = Self::default();
        let (mut channel, mut ends) = (None, false);
        let mut motors: BTreeMap<u16, (String, usize)> = BTreeMap::new();
        let cut = walk(file, |item| {
            match item {
                Item::Channel(id, Channel { topic, .. }) if topic == INPUTS => channel = Some(id),
                Item::Channel(id, Channel { topic, columns, map, .. }) => {
                    inputs.topics.insert(topic.clone(), map);
                    let column = columns.iter().flatten().position(|it| it == "effort");
                    motors.extend(column.map(|column| (id, (topic, column))));
                }
                Item::Message(id, _, bytes) if Some(id) == channel => {
                    let body = bytes.strip_prefix(&CDR).context("its inputs are no CDR")?;
                    let (words, _) = body.get(4..).unwrap_or_default().as_chunks::<4>();
                    inputs.words.extend(words.iter().map(|word| u32::from_le_bytes(*word)));
                }
                Item::Message(id, time, bytes) => {
                    if let Some((topic, column)) = motors.get(&id)
                        && let Some(value) = numbers(bytes)?.nth(*column)
                    {
                        let all = inputs.efforts.entry(topic.clone()).or_default();
                        all.push((time as f64 * 1e-9, value as f32));
                    }
                }
                Item::Metadata(name, map) if name == LAYOUT => {
                    inputs.revision = map.get("revision").cloned().unwrap_or_default();
                }
                Item::Metadata(name, _) => ends |= name == END,
            }
            Ok(())
        })?;
        ensure!(
            !inputs.words.is_empty(),
            "it has no inputs to replay: `rc10 run --record` and `rc10 emu --record` write them, a \
             robot's black box has them, `rc10 record` and `rc10 live` do not"
        );
        inputs.cut = cut.or_else(|| (!ends).then(|| "its end is missing".to_owned()));
        Ok(inputs)
    }

    /// Fails if they are of another robot, as far as that is known: of a chip's memory it is not.
    pub(crate) fn check(&self, robot: &Robot<'_>) -> Result<()> {
        if self.topics.is_empty() { Ok(()) } else { is_of(robot, &self.topics) }
    }

    /// The efforts of a motor with this label, as the record has them.
    pub(crate) fn efforts(&self, label: &str) -> &[(f64, f32)] {
        self.efforts.get(&topic("motors", label)).map_or(&[], Vec::as_slice)
    }
}
