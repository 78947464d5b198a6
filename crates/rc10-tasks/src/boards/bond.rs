//! The arm states of two boards: the leading one's is followed, a stop of one stops both.

use rc10_motor::{ArmState, ArmSwitch};
use rc10_time::Micros;

use super::{BEAT_LEN, Role};

/// Time from one arm state that is told to the next, while it does not change.
pub const BEAT: Micros = Micros::from_millis(5);
/// Without a word of the other board for this time a follower is suspended: three that were due.
pub const SILENCE: Micros = Micros::from_millis(15);
/// After this time it is disarmed, and must see the other board disarmed before it is armed again.
pub const LOST: Micros = Micros::from_millis(1000);
/// Words behind the first of the other board that say that this one has just started.
const NEW: u8 = 4;
/// A number that is farther ahead is one from before: 160 s at one every 5 ms.
const AHEAD: u16 = 0x7FFF;

/// Whether the other board is heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Link {
    /// It was heard within 15 ms.
    Online,
    /// It is silent for less than a second.
    Interrupted,
    /// It was not heard yet, or is silent for a second.
    Lost,
    /// It was compiled with other topics: nothing of it is taken, and a follower is not armed.
    Different,
}

/// What a board says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Beat {
    pub(super) state: ArmState,
    /// It has just started: its stops count anew.
    is_new: bool,
    /// Stops that began there, modulo 256.
    stops: u8,
    /// The other board's that it has carried out; `None` before it has heard one.
    carried: Option<u8>,
}

impl Beat {
    const NEW: u8 = 1 << 4;
    const HAS_HEARD: u8 = 1 << 5;

    fn bytes(self, number: u16, declaration: u16) -> [u8; BEAT_LEN] {
        let state = match self.state {
            ArmState::Disarmed => 0,
            ArmState::Armed => 1,
            ArmState::Suspended => 2,
            ArmState::EStopped => 3,
        };
        let mut flags = state;
        flags |= if self.is_new { Self::NEW } else { 0 };
        flags |= if self.carried.is_some() { Self::HAS_HEARD } else { 0 };
        let [[a, b], [c, d]] = [number, declaration].map(u16::to_le_bytes);
        [a, b, flags, self.stops, self.carried.unwrap_or_default(), c, d]
    }

    /// The number, the declaration and what is said; `None` for what no board says.
    fn of(bytes: &[u8]) -> Option<(u16, u16, Self)> {
        let &[a, b, flags, stops, carried, c, d] = bytes else { return None };
        let state = match flags & 0x0F {
            0 => ArmState::Disarmed,
            1 => ArmState::Armed,
            2 => ArmState::Suspended,
            3 => ArmState::EStopped,
            _ => return None,
        };
        let is_new = flags & Self::NEW != 0;
        let carried = (flags & Self::HAS_HEARD != 0).then_some(carried);
        let [number, declaration] = [[a, b], [c, d]].map(u16::from_le_bytes);
        Some((number, declaration, Self { state, is_new, stops, carried }))
    }
}

/// A board's side of it.
pub(super) struct Bond {
    pub(super) role: Role,
    pub(super) declaration: u16,
    /// Number of what was told last, what that was, and when.
    number: u16,
    told: Option<(Beat, Micros)>,
    /// How many were told since the other board was heard.
    beats: u8,
    /// What was heard last, its number, and when something new was heard.
    pub(super) heard: Option<(Beat, u16, Micros)>,
    is_same: bool,
    /// Stops of the switch that are known; those of them that began here.
    seen: u32,
    own: u8,
    /// The other board's stops that were carried out.
    carried: Option<u8>,
    /// It has just started; it is stopped.
    is_other_new: bool,
    is_other_stopped: bool,
    /// The leading board was disarmed since the last stop, or since it was lost.
    may_arm: bool,
}

impl Bond {
    pub(super) fn new(role: Role, declaration: u16, switch: &ArmSwitch) -> Self {
        Self {
            role,
            declaration,
            number: 0,
            told: None,
            beats: 0,
            heard: None,
            is_same: false,
            seen: switch.stops(),
            own: 0,
            carried: None,
            is_other_new: false,
            is_other_stopped: false,
            may_arm: false,
        }
    }

    pub(super) fn other(&self) -> Option<Beat> {
        self.heard.map(|(beat, ..)| beat)
    }

    /// Takes an arm state, unless its number is not ahead of the last one: it comes twice, or from a board that is stuck.
    /// If it is heard anew, whether it may have started since.
    pub(super) fn hear(&mut self, from: u8, bytes: &[u8], at: Micros) -> Option<bool> {
        let (number, declaration, beat) = Beat::of(bytes)?;
        let starts = beat.is_new && self.heard.is_none_or(|(before, ..)| !before.is_new);
        let may_be_new = starts || self.heard.is_none_or(|(.., since)| at.since(since) > LOST);
        let is_ahead = |(_, last, _)| (1..=AHEAD).contains(&number.wrapping_sub(last));
        if from != 1 - self.role as u8 || !(may_be_new || self.heard.is_some_and(is_ahead)) {
            return None;
        }
        let is_anew = starts || !self.is_heard(at);
        self.is_same = declaration == self.declaration;
        self.heard = Some((beat, number, at));
        is_anew.then_some(may_be_new)
    }

    /// Whether the other board's values are taken: it has the same declaration, and is heard.
    pub(super) fn is_heard(&self, now: Micros) -> bool {
        self.is_same && self.heard.is_some_and(|(.., at)| now.since(at) <= SILENCE)
    }

    /// Decides, at least every millisecond: how the other board is heard, and what is to be told now, if anything is.
    pub(super) fn step(
        &mut self,
        switch: &ArmSwitch,
        now: Micros,
    ) -> (Link, Option<[u8; BEAT_LEN]>) {
        let stops = switch.stops();
        self.count(stops, 0);
        let link = match self.heard {
            None => Link::Lost,
            Some((.., at)) if now.since(at) > LOST => Link::Lost,
            Some(_) if !self.is_same => Link::Different,
            Some((.., at)) if now.since(at) > SILENCE => Link::Interrupted,
            Some(_) => Link::Online,
        };
        if let (Some((beat, ..)), Link::Online | Link::Different) = (self.heard, link) {
            self.carry(beat, switch);
        }
        if self.role == Role::Follows {
            self.follow(link, switch);
        }
        (link, self.tell(switch, now))
    }

    /// Stops that the switch has had since, all but some of which began here.
    fn count(&mut self, stops: u32, of_other: u32) {
        let news = stops.wrapping_sub(self.seen).wrapping_sub(of_other);
        self.own = self.own.wrapping_add(news as u8);
        self.seen = stops;
    }

    /// Carries out the other board's stop.
    fn carry(&mut self, beat: Beat, switch: &ArmSwitch) {
        let was_new = core::mem::replace(&mut self.is_other_new, beat.is_new);
        if beat.is_new && !was_new {
            (self.carried, self.is_other_stopped) = (None, false);
        }
        let is_stopped = beat.state == ArmState::EStopped;
        let was_stopped = core::mem::replace(&mut self.is_other_stopped, is_stopped);
        let is_stop = is_stopped && !was_stopped || self.carried.is_some_and(|it| it != beat.stops);
        if is_stop {
            self.stop(switch);
        }
        // A board that is unfit does not stay stopped: it never says that it has carried one out.
        if !is_stop || switch.unfit().is_none() {
            self.carried = Some(beat.stops);
        }
    }

    fn stop(&mut self, switch: &ArmSwitch) {
        let before = switch.stops();
        switch.emergency_stop();
        let after = switch.stops();
        // Another one may have come in between.
        self.count(after, u32::from(after != before));
        self.may_arm = false;
    }

    fn follow(&mut self, link: Link, switch: &ArmSwitch) {
        match (link, self.heard) {
            (Link::Online, Some((beat, ..))) => match beat.state {
                ArmState::EStopped => {
                    if switch.state() != ArmState::EStopped {
                        self.stop(switch);
                    }
                    self.may_arm = false;
                }
                ArmState::Disarmed => {
                    switch.disarm();
                    // A hand has ended the stop there; one that began here it must have known. What it says of stops before
                    // this board has said that it is new is of those before its start.
                    if self.beats >= NEW && beat.carried == Some(self.own) {
                        switch.reset_after(self.seen);
                    }
                    self.may_arm = switch.state() == ArmState::Disarmed;
                }
                ArmState::Suspended => switch.suspend(),
                ArmState::Armed => {
                    switch.resume();
                    if core::mem::take(&mut self.may_arm) {
                        // Refused while it is unfit: the status says so.
                        let _ = switch.arm();
                    }
                }
            },
            (Link::Interrupted, _) => switch.suspend(),
            _ => {
                switch.disarm();
                self.may_arm = false;
            }
        }
    }

    /// What is to be told: each change at once, the same every 5 ms.
    fn tell(&mut self, switch: &ArmSwitch, now: Micros) -> Option<[u8; BEAT_LEN]> {
        let (state, stops, carried) = (switch.state(), self.own, self.carried);
        let beat = Beat { state, is_new: self.beats < NEW, stops, carried };
        let is_due = self.told.is_none_or(|(told, at)| {
            let since = now.since(at);
            since >= BEAT || told != beat && since >= Micros::from_millis(1)
        });
        if !is_due {
            return None;
        }
        self.told = Some((beat, now));
        self.beats = self.beats.saturating_add(self.heard.is_some().into());
        self.number = self.number.wrapping_add(1);
        Some(beat.bytes(self.number, self.declaration))
    }
}
