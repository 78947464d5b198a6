//! Findings about a run, as data: console, JSON, report and exit code say the same.

use rc10_time::Micros;
use serde_json::{Value, json};
use std::fmt;

/// The severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Something to mend: `--strict` ends with exit code 3.
    Problem,
    /// Good to know.
    Information,
}

/// The subject of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum About {
    /// The robot as a whole.
    Robot,
    /// The motor with this label.
    Motor(&'static str),
    /// A bus; the first is 1.
    Bus(u8),
    /// An RS-485 line; the first is 1.
    Line(u8),
    /// The remote control.
    Remote,
    /// The part on a UART with this label.
    Part(&'static str),
    /// The emulated chip and its program.
    Chip,
}

impl fmt::Display for About {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Robot => f.write_str("robot"),
            Self::Motor(label) | Self::Part(label) => f.write_str(label),
            Self::Bus(number) => write!(f, "bus {number}"),
            Self::Line(number) => write!(f, "line {number}"),
            Self::Remote => f.write_str("remote"),
            Self::Chip => f.write_str("chip"),
        }
    }
}

/// The cause of each kind in at most five words, and the signals of its culprit that show it.
const CAUSES: [(&str, &str, &[&str]); 61] = [
    ("heats", "becomes too hot", &["temperature", "current"]),
    ("sags", "its supply sags", &["supply", "current"]),
    ("remote-lost", "was lost while it drove", &["arm"]),
    ("power-gone", "the motors' power is gone", &[]),
    ("bus-shorted", "shorted, or another bit rate", &["bus_offs"]),
    ("bus-alone", "nothing answers, unplugged or unpowered", &["transmit_errors"]),
    ("bus-silent", "none of its motors speaks", &["received"]),
    ("bus-loose", "a loose cable or supply", &["received"]),
    ("never-armed", "was never armed", &["arm"]),
    ("no-heading", "armed without a heading", &["arm"]),
    ("task-ended", "a task has ended", &[]),
    ("unread-parameter", "no task reads it", &[]),
    ("gave-up", "gave up", &["value"]),
    ("never-began", "never began", &["value"]),
    ("not-told", "not known", &[]),
    ("never-heard", "never heard", &["link", "received"]),
    ("lost", "lost at the end", &["link", "received"]),
    ("was-lost", "lost during the run", &["link", "lost"]),
    ("never-commanded", "never got a target", &["drive", "target"]),
    ("refused", "targets refused", &["target"]),
    ("device-fault", "reports a fault", &["fault"]),
    ("condition", "does not follow or report", &["condition"]),
    ("malformed", "malformed frames", &["malformed"]),
    ("overwritten", "feedback overwritten, bus busy", &["received"]),
    ("expired", "its commands expired", &["expired"]),
    ("oscillation", "shakes, gains too high", &["effort", "measured"]),
    ("gain-margin", "gains are too high", &["effort", "measured"]),
    ("no-inertia", "its load is not described", &[]),
    ("feed-forward", "feed-forward is wrong", &["effort", "target", "measured"]),
    ("saturation", "effort stands at its limit", &["effort", "target", "measured"]),
    ("runaway", "runs away, direction reversed", &["target", "measured", "effort"]),
    ("answers-twice", "two devices, one identifier", &["received"]),
    ("other-identifier", "a motor has another identifier", &["unclaimed"]),
    ("base", "wheels and IMU disagree", &["target", "measured", "effort"]),
    ("not-overdetermined", "wheels do not check themselves", &[]),
    ("wheel-radius", "wheel radius not checked", &[]),
    ("not-checked", "direction and gear not checked", &[]),
    ("tight", "load is tight", &["planned_typical"]),
    ("does-not-fit", "too many frames", &["planned_typical"]),
    ("replaced", "commands replaced before sending", &["replaced"]),
    ("overrun", "ticks overrun", &["overruns"]),
    ("rx-lost", "received frames lost", &["receive_lost"]),
    ("frame-refused", "frames refused", &["refused"]),
    ("bus-off", "was bus-off", &["bus_offs"]),
    ("unclaimed", "frames of no motor", &["unclaimed"]),
    ("timeout", "commands without an answer", &["timeouts"]),
    ("crc", "answers with wrong CRC", &["crc_errors"]),
    ("unexpected", "answers not asked for", &["unexpected"]),
    ("port-error", "port errors", &["port_errors"]),
    ("damaged", "damaged frames", &["damaged"]),
    ("late-to-coast", "lost, motors coasted late", &["arm"]),
    ("not-coasting", "lost, motors did not coast", &["arm"]),
    ("fault-without-effect", "heard in spite of fault", &["link"]),
    ("not-back", "not back after fault", &["link"]),
    ("warning", "its program warns", &[]),
    ("wrong-board", "program for another board", &[]),
    ("silent", "says nothing", &[]),
    ("bad-access", "accesses what is not there", &[]),
    ("restart", "has restarted", &[]),
    ("not-read", "never read by the chip", &[]),
    ("garbled", "another baud rate or format", &[]),
];

/// What tells a finding from others, and what to do: a line each, by its kind, or by its cause where that says more. What
/// stands further up explains more of what stands below.
const REMEDIES: &str = include_str!("remedies.tsv");

/// Length of a text in bytes up to which it is its own headline.
const SHORT: usize = 60;

/// Kinds that say what no run of this robot can show: the same after every run.
const STANDING: [&str; 4] = ["not-overdetermined", "wheel-radius", "not-checked", "no-inertia"];

/// One finding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Severity of the finding.
    pub severity: Severity,
    /// Subject of the finding.
    pub about: About,
    /// Identifier for programs: small letters with hyphens.
    pub kind: &'static str,
    /// Text for people: a sentence without its subject.
    pub text: String,
    /// The cause in a few words.
    pub cause: &'static str,
    /// Labels of the motors that cause it, where those are not its subject.
    pub culprits: Vec<&'static str>,
    /// Its begin and its end, where it has a time.
    pub span: Option<(Micros, Micros)>,
}

impl Problem {
    /// Creates a problem: something to mend.
    #[must_use]
    pub fn new(about: About, kind: &'static str, text: String) -> Self {
        let known = CAUSES.iter().find(|(known, ..)| *known == kind);
        let cause = known.map_or(kind, |(_, cause, _)| *cause);
        let (severity, culprits, span) = (Severity::Problem, Vec::new(), None);
        Self { severity, about, kind, text, cause, culprits, span }
    }

    /// Creates information: something good to know.
    #[must_use]
    pub fn information(about: About, kind: &'static str, text: String) -> Self {
        Self { severity: Severity::Information, ..Self::new(about, kind, text) }
    }

    /// The same, of this time.
    #[must_use]
    pub fn in_time(self, begin: Micros, length: Micros) -> Self {
        Self { span: Some((begin, begin + length)), ..self }
    }

    /// The same with a cause of its own.
    #[must_use]
    pub fn because(self, cause: &'static str) -> Self {
        Self { cause, ..self }
    }

    /// Culprit and cause in at most eight words.
    #[must_use]
    pub fn headline(&self) -> String {
        match self.culprits.as_slice() {
            [] => format!("{}: {}", self.about, self.cause),
            labels => format!("{}: {}", labels.join(", "), self.cause),
        }
    }

    /// Whether its text needs a headline above it.
    #[must_use]
    pub fn is_long(&self) -> bool {
        self.text.len() > SHORT
    }

    /// The finding for a terminal: a line, or its headline and its text.
    #[must_use]
    pub fn lines(&self) -> String {
        if self.is_long() {
            format!("  {}\n    {self}\n", self.headline())
        } else {
            format!("  {self}\n")
        }
    }

    /// Labels of its culprits, as the robot's tables and signals have them.
    #[must_use]
    pub fn labels(&self) -> Vec<String> {
        match self.about {
            About::Motor(label) | About::Part(label) => vec![label.to_owned()],
            About::Bus(number) | About::Line(number) => vec![number.to_string()],
            _ => self.culprits.iter().map(|label| (*label).to_owned()).collect(),
        }
    }

    /// Whether it is the same after every run of this robot: what no sensor of it knows.
    #[must_use]
    pub fn is_standing(&self) -> bool {
        STANDING.contains(&self.kind)
    }

    /// Full names of the signals that show it: label and name, or a name of the robot's own.
    #[must_use]
    pub fn signals(&self) -> Vec<String> {
        let known = CAUSES.iter().find(|(known, ..)| *known == self.kind);
        let names = known.map_or(&[][..], |(.., names)| names);
        let of = |label: &String| -> Vec<_> {
            names.iter().map(|name| format!("{label} {name}")).collect()
        };
        match self.labels().as_slice() {
            // Of the robot, the others of the table are motors'.
            [] => names.iter().filter(|it| **it == "arm").map(ToString::to_string).collect(),
            labels => labels.iter().flat_map(of).collect(),
        }
    }

    /// Its place among those that explain others, what tells it from others, and what to do; empty if nothing is known.
    #[must_use]
    pub fn remedy(&self) -> (usize, [&'static str; 2]) {
        let of = |wanted: &str| {
            let mut lines = REMEDIES.lines().map(|line| line.split('\t')).enumerate();
            lines.find_map(|(place, mut words)| {
                let is_it = words.next() == Some(wanted);
                is_it.then(|| (place, [words.next(), words.next()].map(Option::unwrap_or_default)))
            })
        };
        of(self.cause).or_else(|| of(self.kind)).unwrap_or((usize::MAX, [""; 2]))
    }

    /// The finding as JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let seconds = |at: Micros| at.get() as f64 / 1e6;
        let [check, mend] = self.remedy().1;
        json!({
            "check": check,
            "do": mend,
            "severity": match self.severity {
                Severity::Problem => "problem",
                Severity::Information => "information",
            },
            "about": self.about.to_string(),
            "kind": self.kind,
            "text": self.text,
            "headline": self.headline(),
            "culprits": self.labels(),
            "signals": self.signals(),
            "at": self.span.map(|(begin, _)| seconds(begin)),
            "until": self.span.map(|(_, end)| seconds(end)),
        })
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.about, self.text)
    }
}

/// A problem for each count that is not zero; each has its kind, and what is counted.
pub(crate) fn counted<'t>(
    about: About,
    counts: impl IntoIterator<Item = (u64, &'static str, &'t str)>,
) -> impl Iterator<Item = Problem> {
    let counts = counts.into_iter().filter(|(count, ..)| *count > 0);
    counts.map(move |(count, kind, what)| Problem::new(about, kind, format!("{count} {what}")))
}

/// Whether there is something to mend.
#[must_use]
pub fn any(problems: &[Problem]) -> bool {
    problems.iter().any(|problem| problem.severity == Severity::Problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_headline_has_culprit_and_cause_and_a_label_of_three_words_leaves_room() {
        for (kind, cause, _) in CAUSES {
            let problem = Problem::new(About::Motor("wheel front left"), kind, String::new());
            let headline = problem.headline();
            assert_eq!(headline, format!("wheel front left: {cause}"));
            assert!(headline.split_whitespace().count() <= 8, "{headline}");
        }
        let unknown = Problem::new(About::Bus(2), "no-such-kind", String::new());
        assert_eq!(unknown.headline(), "bus 2: no-such-kind");
    }

    #[test]
    fn a_problem_is_told_with_its_time_its_culprits_and_their_signals() {
        let problem = Problem::new(About::Robot, "base", "text".to_owned()).because("swapped");
        let problem = problem.in_time(Micros::from_millis(1500), Micros::from_millis(100));
        let swapped = Problem { culprits: vec!["a left", "a right"], ..problem.clone() };
        let json = swapped.to_json();
        assert_eq!(json["headline"], "a left, a right: swapped");
        assert_eq!((&json["at"], &json["until"]), (&json!(1.5), &json!(1.6)));
        assert_eq!(json["culprits"], json!(["a left", "a right"]));
        let signals = ["target", "measured", "effort"];
        let of = |label: &str| signals.map(|name| format!("{label} {name}"));
        assert_eq!(json["signals"], json!([of("a left"), of("a right")].concat()));
        assert_eq!(problem.to_json()["signals"], json!([]));
        let lost = Problem::new(About::Bus(3), "bus-off", String::new()).to_json();
        assert_eq!((&lost["signals"], &lost["at"]), (&json!(["3 bus_offs"]), &Value::Null));
    }
}
