use rc10_time::Micros;

/// Why a scenario ended early.
pub(crate) enum Halt {
    /// The rule is broken.
    Broken(Option<Micros>, String),
    /// A number that it tells or sends is wrong: what else is broken follows from that.
    Wrong(Micros, String),
    /// The motor does not do what the scenario starts from: another rule says so.
    Stuck,
}

pub(crate) type Outcome = Result<(), Halt>;

pub(crate) fn broken<T>(at: impl Into<Option<Micros>>, what: impl Into<String>) -> Result<T, Halt> {
    Err(Halt::Broken(at.into(), what.into()))
}

/// The rule is broken if it is not so.
pub(crate) fn must(
    at: impl Into<Option<Micros>>,
    is_so: bool,
    what: impl FnOnce() -> String,
) -> Outcome {
    if is_so { Ok(()) } else { broken(at, what()) }
}

/// What one rule found. A fault that shows in every tick is told a few times only.
#[derive(Default)]
pub(crate) struct Findings {
    /// Findings from which others follow.
    pub(crate) causes: Vec<(Option<Micros>, String)>,
    pub(crate) found: Vec<(Option<Micros>, String)>,
    pub(crate) is_stuck: bool,
}

const MOST_FINDINGS: usize = 4;

impl Findings {
    pub(crate) fn add(&mut self, at: Option<Micros>, what: String) {
        if self.found.len() < MOST_FINDINGS {
            self.found.push((at, what));
        }
    }

    pub(crate) fn add_cause(&mut self, at: Option<Micros>, what: String) {
        if self.causes.len() < MOST_FINDINGS {
            self.causes.push((at, what));
        }
    }

    pub(crate) fn note(&mut self, outcome: Outcome) {
        match outcome {
            Ok(()) => (),
            Err(Halt::Broken(at, what)) => self.add(at, what),
            Err(Halt::Wrong(at, what)) => self.add_cause(Some(at), what),
            Err(Halt::Stuck) => self.is_stuck = true,
        }
    }
}
