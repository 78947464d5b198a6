//! Kept parameters: what a PC has changed and saved is there again after power-off.
//!
//! A snapshot of the [`store`](rc10_module::store) has a word for each parameter that is not as in the robot's table:
//!
//! | bytes | content |
//! |---|---|
//! | 0 .. 4 | the value, an `f32`, little endian |
//! | 4 .. 8 | FNV-1a of folder, label and name |
//! | 8 .. 11 | the low 24 bits of FNV-1a of unit and range |
//! | 11 .. 32 | the end of label and name, for people: of a parameter that this program does not know |
//!
//! **Another program**: what has the same name, unit and range keeps its value. What has another unit or range is not
//! used, and told. What has a name that is not known here stays, for the program that knows it. So a save writes all
//! that differs from this program's table, and then the unknown ones of the snapshot before.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_time::{Duration, Instant, Timer};
use heapless::Vec;
use rc10_link::{Change, Declaration, Tell};
use rc10_module::store::{Cells, Found, Store, StoreError, WORD, Word};
use rc10_motor::{ArmState, ArmSwitch, Link, TargetSet, Unfit};

use super::RobotView;
use super::parameters::{Refusal, parameter, parameters, set};

/// The part of a word that tells a parameter by its name, and that of its unit and range.
const NAME: core::ops::Range<usize> = 4..8;
const KIND: core::ops::Range<usize> = 8..11;
const TEXT: core::ops::RangeFrom<usize> = 11..;

/// A robot whose motors turn no faster is at rest, rpm: more than what a sensor of speed says of one that stands.
const AT_REST: f32 = 10.0;

/// How long before the middle between two ticks a word begins: it takes 100 to 200 µs, and may take twice that.
const EARLY: Duration = Duration::from_micros(250);

/// What is to be told of kept parameters in the status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KeptState {
    /// Those that are not used: their unit or range is another, or the motor refused them.
    pub unused: u16,
    /// What is wrong with their flash.
    pub trouble: Option<&'static str>,
}

/// The kept parameters of a robot.
pub struct Kept {
    store: Mutex<NoopRawMutex, Store<&'static mut dyn Cells>>,
    trouble: Option<&'static str>,
    /// Names of the parameters without which the robot cannot be armed.
    must_have: &'static [&'static str],
    is_applied: AtomicBool,
}

/// What a PC wants to be kept no longer.
#[derive(Clone, Copy)]
pub(super) enum Order {
    Save,
    Forget(u32),
    ForgetAll,
}

impl Kept {
    /// Those in a flash, as its store was found. Until [`apply`](Self::apply) the robot cannot be armed, if there are
    /// any or it must have some.
    pub fn new(
        (store, found): (Store<&'static mut dyn Cells>, Found),
        must_have: &'static [&'static str],
        switch: &ArmSwitch,
    ) -> Self {
        if !store.is_empty() || !must_have.is_empty() {
            switch.forbid(Unfit::Parameters);
        }
        let trouble = match found {
            Found { worn: 2, .. } => {
                Some("the flash of the parameters is worn out: nothing can be saved")
            }
            Found { worn: 1, .. } => Some("half of the flash of the parameters is worn out"),
            Found { is_damaged: true, .. } => {
                Some("the newest kept parameters are damaged: those before them are used")
            }
            _ => None,
        };
        Self { store: Mutex::new(store), trouble, must_have, is_applied: AtomicBool::new(false) }
    }

    /// The number of kept parameters; `None` while they are written.
    pub(super) fn count(&self) -> Option<u16> {
        let count = self.store.try_lock().ok()?.len();
        Some(u16::try_from(count).unwrap_or(u16::MAX))
    }

    fn word(&self, at: u16) -> Option<Word> {
        self.store.try_lock().ok()?.word(at.into())
    }

    /// Gives the parameters their kept values, as soon as the buses run: [`Link::serve`](super::Link::serve) does so first.
    pub async fn apply(&self, robot: &RobotView<'_>) {
        if self.is_applied.load(Ordering::Relaxed) {
            return;
        }
        let is_up = || robot.motors.iter().all(|motor| motor.supports() != TargetSet::NONE);
        for _ in 0..BUSES_RUN {
            if is_up() {
                break;
            }
            Timer::after_millis(1).await;
        }
        let (mut unused, mut changes) = (0, Vec::<Change, { rc10_link::CHANGES }>::new());
        for at in 0.. {
            let word = self.word(at);
            let found = word.and_then(|word| find(&word, robot).map(|found| (word, found)));
            match found {
                Some((word, (index, true))) => {
                    let _ = changes.push(Change { parameter: index, value: value_of(&word) });
                }
                Some((_, (index, false))) => {
                    unused += 1;
                    log(index, robot, "its unit or range is another");
                }
                None => {}
            }
            if changes.is_full() || word.is_none() {
                unused += use_all(&changes, robot).await;
                changes.clear();
            }
            if word.is_none() {
                break;
            }
        }
        robot.kept_state.set(KeptState { unused, trouble: self.trouble }, rc10_message::now());
        self.is_applied.store(true, Ordering::Relaxed);
        self.allow(robot);
    }

    /// Lets the robot be armed if all is kept that it must have.
    fn allow(&self, robot: &RobotView<'_>) {
        let count = self.count().unwrap_or(0);
        let is_there = |name: &&str| {
            (0..count)
                .filter_map(|at| find(&self.word(at)?, robot))
                .any(|(index, is_used)| is_used && is_called(index, name, robot))
        };
        let mut missing = self.must_have.iter().filter(|name| !is_there(name)).peekable();
        if missing.peek().is_none() {
            robot.switch.allow();
        }
        for name in missing {
            #[cfg(feature = "defmt")]
            defmt::error!("{=str} must be kept, and is not: the robot cannot be armed", name);
            #[cfg(not(feature = "defmt"))]
            let _ = name;
        }
    }

    /// Keeps all parameters as they are now, or fewer. The robot is disarmed and at rest, and stays so: else the
    /// parameters that were kept before are. `grid`: half way between two ticks of the buses.
    pub(super) async fn carry_out(
        &self,
        order: Order,
        robot: &RobotView<'_>,
        grid: Instant,
    ) -> Result<(), Refusal> {
        let refused = |why| Err(Refusal::because(None, why));
        may_write(robot)?;
        if !self.is_applied.load(Ordering::Relaxed) {
            return Err(Refusal::BUSY);
        }
        let _turn = robot.changes.turn.lock().await;
        let mut store = self.store.lock().await;
        let count = parameters(robot);
        let mut next = (0_u16, 0_u32);
        let words = |store: &mut Store<_>, at: u32| {
            if at == 0 {
                next = if matches!(order, Order::Save) { (0, 0) } else { (count, 0) };
            }
            while next.0 < count {
                let word = self.worth(next.0, robot);
                next.0 += 1;
                if word.is_some() {
                    return word;
                }
            }
            loop {
                let word = store.word(next.1)?;
                next.1 += 1;
                let stays = match order {
                    Order::Save => find(&word, robot).is_none(),
                    Order::Forget(id) => id_of(&word) != id,
                    Order::ForgetAll => false,
                };
                if stays {
                    return Some(word);
                }
            }
        };
        let moment = async || {
            let since = (Instant::now() + EARLY).saturating_duration_since(grid).as_micros();
            Timer::after_micros(1000 - since % 1000).await;
            may_write(robot).is_ok()
        };
        let outcome = store.save(words, moment).await;
        drop(store);
        // Also after a failure: a PC is to look again.
        robot.changes.add();
        match outcome {
            Ok(()) => {
                self.allow(robot);
                let unused = |at| find(&self.word(at)?, robot).filter(|(_, is_used)| !is_used);
                let unused = (0..self.count().unwrap_or(0)).filter_map(unused).count();
                let unused = u16::try_from(unused).unwrap_or(u16::MAX);
                let state = KeptState { unused, trouble: self.trouble };
                robot.kept_state.set(state, rc10_message::now());
                Ok(())
            }
            Err(StoreError::GivenUp) => may_write(robot).and_then(|()| refused("given up")),
            Err(StoreError::Worn) => refused("the flash of the parameters is worn out"),
            Err(StoreError::TooLong) => refused("these are more parameters than the flash holds"),
            Err(StoreError::Full) => {
                refused("the flash is full until the next start: switch off and on")
            }
        }
    }

    /// The word of a parameter that is worth keeping: it is not as in the table, or the robot must have it.
    fn worth(&self, index: u16, robot: &RobotView<'_>) -> Option<Word> {
        let tell = parameter(index, robot)?;
        let Tell::Parameter { value, initial, .. } = tell else { return None };
        let is_needed = || self.must_have.iter().any(|name| is_called(index, name, robot));
        let is_worth = value.to_bits() != initial.to_bits() || is_needed();
        word_of(&tell).filter(|_| is_worth)
    }
}

/// Has a kept value told, by its number: without any there is a message of none.
pub(super) fn tell(index: u16, robot: &RobotView<'_>, mut to: impl FnMut(&Tell<'_>)) {
    let of = robot.kept.and_then(Kept::count).unwrap_or(0);
    let word = robot.kept.and_then(|kept| kept.word(index)).unwrap_or_default();
    let found = find(&word, robot);
    let text = word[TEXT].split(|byte| *byte == 0).next().unwrap_or_default();
    to(&Tell::Kept {
        index,
        of,
        id: id_of(&word),
        text: core::str::from_utf8(text).unwrap_or("?"),
        value: value_of(&word),
        parameter: found.map(|(index, _)| index),
        is_used: found.is_some_and(|(_, is_used)| is_used),
    });
}

/// Milliseconds in which the buses begin to run.
const BUSES_RUN: u32 = 100;

/// Uses these values: together, or those that can be. Returns how many cannot.
async fn use_all(changes: &[Change], robot: &RobotView<'_>) -> u16 {
    let (mut unused, mut at, mut length) = (0, 0, changes.len());
    while let Some(some) = changes.get(at..at + length).filter(|some| !some.is_empty()) {
        let some = Vec::from_slice(some).unwrap_or_default();
        match set(&some, robot).await {
            Ok(()) => at += length,
            Err(_) if length > 1 => length = 1,
            Err(why) => {
                unused += 1;
                log(some.first().map_or(0, |it| it.parameter), robot, why.why);
                at += 1;
            }
        }
    }
    unused
}

/// Whether parameters may be written now.
#[inline(never)]
fn may_write(robot: &RobotView<'_>) -> Result<(), Refusal> {
    let refused = |why| Err(Refusal::because(None, why));
    if robot.switch.state() != ArmState::Disarmed {
        return refused("only while the robot is disarmed");
    }
    let turns = robot.motors.iter().any(|motor| {
        motor.look(|status| {
            status.link == Link::Online && status.feedback.speed.get().abs() > AT_REST
        })
    });
    if turns { refused("only while the robot is at rest: a motor turns") } else { Ok(()) }
}

/// The parameter of a word, and whether its unit and range are those of the word.
#[inline(never)]
fn find(word: &Word, robot: &RobotView<'_>) -> Option<(u16, bool)> {
    (0..parameters(robot)).find_map(|index| {
        let own = word_of(&parameter(index, robot)?)?;
        let is_it = own[NAME] == word[NAME] && own[TEXT] == word[TEXT];
        is_it.then(|| (index, own[KIND] == word[KIND]))
    })
}

fn id_of(word: &Word) -> u32 {
    word[NAME].first_chunk().copied().map_or(0, u32::from_le_bytes)
}

fn value_of(word: &Word) -> f32 {
    word.first_chunk().copied().map_or(0.0, f32::from_le_bytes)
}

/// The word of a parameter as it is now; `None` if there is none with that number.
#[inline(never)]
fn word_of(tell: &Tell<'_>) -> Option<Word> {
    let Tell::Parameter { topic, name, unit, range: [least, most], value, .. } = tell else {
        return None;
    };
    if name.is_empty() {
        return None;
    }
    let all = Declaration::default();
    let named =
        all.with(topic.folder.as_bytes()).with(topic.label.as_bytes()).with(name.as_bytes());
    let kind = all.with(unit.as_bytes()).with(&least.to_le_bytes()).with(&most.to_le_bytes());
    let mut word = [0; WORD];
    word[..4].copy_from_slice(&value.to_le_bytes());
    word[NAME].copy_from_slice(&named.0.to_le_bytes());
    word[KIND].copy_from_slice(&kind.0.to_le_bytes()[..3]);
    // As many of the last characters as there is room for.
    let (own, between) = if topic.folder == "parameters" { ("", "") } else { (*name, " ") };
    let mut rest = &mut word[TEXT];
    for part in [own, between, topic.label] {
        let from = part.len().saturating_sub(rest.len());
        let from = (from..=part.len()).find(|at| part.is_char_boundary(*at)).unwrap_or(part.len());
        let bytes = &part.as_bytes()[from..];
        let (before, place) = rest.split_at_mut(rest.len() - bytes.len());
        place.copy_from_slice(bytes);
        rest = before;
    }
    let free = rest.len();
    word[TEXT].rotate_left(free);
    Some(word)
}

/// Whether this is the name of a parameter: `label` of the robot's own, `label name` of a motor's.
#[inline(never)]
fn is_called(index: u16, wanted: &str, robot: &RobotView<'_>) -> bool {
    let Some(Tell::Parameter { topic, name, .. }) = parameter(index, robot) else { return false };
    match wanted.strip_prefix(topic.label) {
        Some("") => topic.folder == "parameters",
        Some(rest) => rest.strip_prefix(' ') == Some(name),
        None => false,
    }
}

/// Tells the log that a kept parameter is not used.
#[inline(never)]
fn log(index: u16, robot: &RobotView<'_>, why: &str) {
    #[cfg(feature = "defmt")]
    if let Some(Tell::Parameter { topic, name, .. }) = parameter(index, robot) {
        defmt::warn!("the kept value of {=str} {=str} is not used: {=str}", topic.label, name, why);
    }
    #[cfg(not(feature = "defmt"))]
    let _ = (index, robot, why);
}
