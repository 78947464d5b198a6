//! Faults of wires and devices, caused when their time has come.

use std::convert::Infallible;

use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;

use crate::fault::{Defect, Fault, Kind, NoFault, Others, Wire, is_called};
use crate::{Bus, Contact, Encoder, Esc, Line, Nanos, Serial, TraceEntry, UartFault};

/// Time from one filling of a bus to the next.
const STEP: Nanos = Nanos::new(1_000_000);
/// Frames that a filled bus has waiting: more than a step's worth.
const FILLER: usize = 12;
/// While a bus is filled, one step in this many is not: so that "99 %" is not "100 %".
const FILLER_PAUSE: u64 = 100;

/// The faults of a run. Begins and ends those of wires and devices, and hands out the others.
///
/// Let time pass up to [`next`](Self::next), tell it what was [`heard`](Self::heard) on the buses,
/// and let it [`act`](Self::act).
pub struct Faults<O = Infallible> {
    buses: Vec<Filled>,
    lines: Vec<Line>,
    parts: Parts,
    /// Beginnings (`true`) and ends, the next one last.
    timeline: Vec<(Nanos, bool, Kind<O>)>,
}

/// Things with labels that can have defects.
#[derive(Default)]
pub struct Parts {
    /// Parts on UARTs.
    pub serials: Vec<(String, Serial)>,
    /// Contacts, by the labels of their motors.
    pub contacts: Vec<(String, Contact)>,
    /// Motors.
    pub motors: Vec<(String, Esc)>,
}

/// A bus, and what fills it while a fault does.
struct Filled {
    bus: Bus,
    on: bool,
    /// Whether it is filled with the most urgent frames instead, without a pause.
    babbles: bool,
    /// The newest of its least urgent feedback.
    filler: Option<CanFrame>,
}

impl<O: Others> Faults<O> {
    /// The faults of a run on these buses and lines. Fails as [`check`](Self::check) does.
    pub fn new(buses: &[Bus], lines: &[Line], faults: &[Fault<O>]) -> Result<Self, NoFault> {
        Self::check(faults, buses.len(), lines.len())?;
        let mut timeline = Vec::new();
        for Fault { kind, from, until } in faults {
            timeline.push((*from, true, kind.clone()));
            timeline.extend(until.map(|until| (until, false, kind.clone())));
        }
        // Stable: what begins and ends at one moment does so as it was written.
        timeline.sort_by_key(|entry| entry.0);
        timeline.reverse();
        let filled =
            |bus: &Bus| Filled { bus: bus.clone(), on: false, babbles: false, filler: None };
        let buses = buses.iter().map(filled).collect();
        Ok(Self { buses, lines: lines.into(), parts: Parts::default(), timeline })
    }

    /// Adds the things with labels.
    pub fn set_parts(&mut self, parts: Parts) {
        self.parts = parts;
    }

    /// Begins one more fault at a time, or ends one.
    pub fn plan(&mut self, at: Nanos, begins: bool, kind: Kind<O>) {
        let place = self.timeline.partition_point(|entry| entry.0 > at);
        self.timeline.insert(place, (at, begins, kind));
    }

    /// Whether a robot with this number of buses and lines can have such faults. Fails if one is on
    /// a bus or a line that is not there.
    pub fn check(faults: &[Fault<O>], buses: usize, lines: usize) -> Result<(), NoFault> {
        for Fault { kind, .. } in faults {
            let (index, count, noun) = match kind.wire() {
                Some(Wire::Bus(bus)) => (bus, buses, "bus"),
                Some(Wire::Line(line)) => (line, lines, "line"),
                None => continue,
            };
            if index >= count {
                let rest = match count {
                    0 => format!("it has no {noun}"),
                    last => format!("the last is {last}"),
                };
                return Err(NoFault(format!("{kind}: there is no such {noun}; {rest}")));
            }
        }
        Ok(())
    }

    /// Time of the next action, later than now.
    pub fn next(&self, now: Nanos) -> Option<Nanos> {
        let entry = self.timeline.last().map(|entry| entry.0);
        let step = Nanos::new((now.get() / STEP.get() + 1) * STEP.get());
        entry
            .into_iter()
            .chain(self.buses.iter().any(|bus| bus.on || bus.babbles).then_some(step))
            .min()
    }

    /// Takes the traffic of a bus, 0 for the first, since the last time: its least urgent feedback
    /// fills it.
    pub fn heard(&mut self, bus: usize, entries: &[TraceEntry]) {
        let Some(Filled { filler, .. }) = self.buses.get_mut(bus) else { return };
        for entry in entries.iter().filter(|entry| !entry.from_controller) {
            if filler.is_none_or(|filler| entry.frame.id() >= filler.id()) {
                *filler = Some(entry.frame);
            }
        }
    }

    /// Begins and ends the faults that are due by now. Those that are not of a wire come back: whether
    /// one begins, and which.
    #[must_use]
    pub fn act(&mut self, now: Nanos) -> Vec<(bool, Kind<O>)> {
        let mut others = Vec::new();
        while let Some((_, begins, kind)) = self.timeline.pop_if(|entry| entry.0 <= now) {
            if !self.act_on_wire(begins, &kind) {
                others.push((begins, kind));
            }
        }
        if now.get().is_multiple_of(STEP.get()) {
            self.fill(now.get() / STEP.get());
        }
        others
    }

    /// Whether it is a fault of a wire or a part.
    fn act_on_wire(&mut self, begins: bool, kind: &Kind<O>) -> bool {
        let bus = |index: usize| &self.buses[index].bus;
        match kind {
            Kind::Load(bus) => self.buses[*bus].on = begins,
            Kind::Babble(bus) => self.buses[*bus].babbles = begins,
            Kind::Cut(Wire::Bus(index)) => bus(*index).set_cut(begins),
            Kind::Noise(Wire::Bus(index)) => bus(*index).damage(1),
            Kind::Power(Wire::Bus(index)) => bus(*index).set_power(!begins),
            Kind::Short(index) => bus(*index).set_shorted(begins),
            Kind::Dominant(index) => bus(*index).set_held_dominant(begins),
            Kind::Cut(Wire::Line(index)) => self.lines[*index].set_cut(begins),
            Kind::Noise(Wire::Line(index)) => self.lines[*index].damage_answers(1),
            Kind::Power(Wire::Line(index)) => self.lines[*index].set_power(!begins),
            Kind::Part(defect, name) => self.act_on_part(begins, *defect, name),
            Kind::RemoteLost | Kind::Other(_) => return false,
        }
        true
    }

    fn act_on_part(&self, begins: bool, defect: Defect, name: &str) {
        for (_, serial) in self.parts.serials.iter().filter(|(label, _)| is_called(label, name)) {
            match defect {
                Defect::Cut => serial.set_cut(begins),
                Defect::Noise => serial.inject(UartFault::Framing),
                Defect::Power => serial.set_power(!begins),
                _ => {}
            }
        }
        for (_, contact) in self.parts.contacts.iter().filter(|(label, _)| is_called(label, name)) {
            contact.set_defect(begins.then_some(defect));
        }
        for (_, motor) in self.parts.motors.iter().filter(|(label, _)| is_called(label, name)) {
            match defect {
                Defect::Cut => motor.set_cut(begins),
                Defect::Power => motor.set_power(!begins),
                Defect::Mute => motor.set_feedback(!begins),
                Defect::Frozen => motor.set_encoder(begins.then_some(Encoder::Frozen)),
                Defect::Flipped => motor.set_encoder(begins.then_some(Encoder::Flipped)),
                _ => {}
            }
        }
    }

    fn fill(&self, step: u64) {
        for Filled { bus, .. } in self.buses.iter().filter(|bus| bus.babbles) {
            let frame = CanFrame::eight_bytes(StandardId::ZERO, [0; 8]);
            (bus.foreign_waiting()..FILLER).for_each(|_| bus.inject(&frame));
        }
        if (step + 1).is_multiple_of(FILLER_PAUSE) {
            return;
        }
        for Filled { bus, filler, .. } in self.buses.iter().filter(|bus| bus.on) {
            if let Some(frame) = filler {
                for _ in bus.foreign_waiting()..FILLER {
                    bus.inject(frame);
                }
            }
        }
    }
}
