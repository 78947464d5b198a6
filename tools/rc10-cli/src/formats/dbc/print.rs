//! The form of the file. Source: the DBC format as `cantools` and `SavvyCAN` read it.

use std::fmt::{self, Display, Formatter};

use rc10_motor::signals::{ByteOrder, Kind, Presence};

use crate::formats::dbc::model::{Dbc, Frame, NamedSignal, number};
use crate::formats::dbc::names::Name;

impl Dbc {
    /// The file as bytes; characters that Windows-1252 does not have become question marks.
    pub fn to_bytes(&self) -> Vec<u8> {
        let text = self.to_string().replace('π', "pi");
        text.chars().map(|character| u8::try_from(character).unwrap_or(b'?')).collect()
    }

    fn node(&self, place: usize) -> &str {
        &self.nodes[place].0.short
    }

    fn list(&self, places: &[usize], between: &str) -> String {
        places.iter().map(|&place| self.node(place)).collect::<Vec<_>>().join(between)
    }

    fn signals(&self) -> impl Iterator<Item = (u32, &NamedSignal)> {
        self.frames.iter().flat_map(|frame| frame.signals.iter().map(|it| (number(frame.id), it)))
    }

    fn frame(&self, f: &mut Formatter<'_>, frame: &Frame) -> fmt::Result {
        let sender = frame.senders.first().map_or("Vector__XXX", |&place| self.node(place));
        let (id, name, len) = (number(frame.id), &frame.name.short, frame.len);
        writeln!(f, "\nBO_ {id} {name}: {len} {sender}")?;
        for NamedSignal { name, signal, receivers } in &frame.signals {
            write!(f, " SG_ {}", name.short)?;
            match signal.presence {
                Presence::Always => (),
                Presence::Switch => write!(f, " M")?,
                Presence::If(value) => write!(f, " m{value}")?,
            }
            let order = u8::from(signal.order == ByteOrder::Little);
            let sign = if signal.kind == Kind::Unsigned { '+' } else { '-' };
            let (start, bits) = (signal.start, signal.bits);
            let (factor, offset) = (signal.factor, signal.offset);
            write!(f, " : {start}|{bits}@{order}{sign} ({factor},{offset}) [0|0]")?;
            writeln!(f, " {} {}", Text(signal.unit), self.list(receivers, ","))?;
        }
        Ok(())
    }

    fn comments(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut about = format!("{}, made by rc10 dbc.", self.bus);
        if !self.left_out.is_empty() {
            about += " Not in this file:";
            self.left_out.iter().for_each(|line| about += &format!("\n* {line}"));
        }
        writeln!(f, "CM_ {};", Text(&about))?;
        for (name, comment) in &self.nodes {
            writeln!(f, "CM_ BU_ {} {};", name.short, Text(comment))?;
        }
        Ok(())
    }

    /// The whole names of those that were cut.
    fn long_names(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let cut = |Name { short, long }: &Name, whose: String| {
            (short != long).then(|| format!("{whose} \"{long}\""))
        };
        let nodes = self.nodes.iter().filter_map(|(name, _)| cut(name, name.short.clone()));
        let frames = self.frames.iter();
        let frames = frames.filter_map(|frame| cut(&frame.name, number(frame.id).to_string()));
        let signals = self
            .signals()
            .filter_map(|(id, NamedSignal { name, .. })| cut(name, format!("{id} {}", name.short)));
        let all: [(&str, &str, Vec<String>); 3] = [
            ("BU_", "SystemNodeLongSymbol", nodes.collect()),
            ("BO_", "SystemMessageLongSymbol", frames.collect()),
            ("SG_", "SystemSignalLongSymbol", signals.collect()),
        ];
        for (object, attribute, _) in all.iter().filter(|(.., names)| !names.is_empty()) {
            writeln!(f, "BA_DEF_ {object}  \"{attribute}\" STRING ;")?;
            writeln!(f, "BA_DEF_DEF_  \"{attribute}\" \"\";")?;
        }
        for (object, attribute, names) in &all {
            names.iter().try_for_each(|it| writeln!(f, "BA_ \"{attribute}\" {object} {it};"))?;
        }
        Ok(())
    }
}

impl Display for Dbc {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "VERSION \"\"\n\nNS_ :\n\nBS_:\n")?;
        write!(f, "BU_:")?;
        self.nodes.iter().try_for_each(|(name, _)| write!(f, " {}", name.short))?;
        writeln!(f)?;
        self.frames.iter().try_for_each(|frame| self.frame(f, frame))?;
        writeln!(f)?;
        for frame in self.frames.iter().filter(|frame| frame.senders.len() > 1) {
            let senders = self.list(&frame.senders, ",");
            writeln!(f, "BO_TX_BU_ {} : {senders};", number(frame.id))?;
        }
        self.comments(f)?;
        self.long_names(f)?;
        for (id, signal) in
            self.signals().filter(|(_, signal)| signal.signal.values().next().is_some())
        {
            write!(f, "VAL_ {id} {}", signal.name.short)?;
            for (raw, meaning) in signal.signal.values() {
                write!(f, " {raw} {}", Text(meaning))?;
            }
            writeln!(f, " ;")?;
        }
        for (id, signal) in self.signals().filter(|(_, signal)| signal.signal.kind == Kind::Float) {
            writeln!(f, "SIG_VALTYPE_ {id} {} : 1;", signal.name.short)?;
        }
        Ok(())
    }
}

/// A quoted text; the format has no quotation mark in it that all tools read.
struct Text<'t>(&'t str);

impl Display for Text<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "\"{}\"", self.0.replace('"', "'").replace('\\', "/"))
    }
}
