//! A client and its connection: the start of every command that talks to a robot.

use std::hash::{BuildHasher as _, RandomState};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result, bail, ensure};
use rc10_link::{Action, VERSION};
use rc10_time::Micros;
#[cfg(unix)]
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::client::{Answer, Client, KeptValue, Parameter};
use crate::live::line::RobotConnection;
use crate::run::running::Running;

/// A client, and its connection to a robot.
pub struct Session<'r> {
    connection: RobotConnection<'r>,
    /// The client.
    pub client: Client,
    now: Micros,
    heard: u64,
}

/// Time limit for an answer of the robot.
const PATIENCE: Micros = Micros::from_millis(5000);

impl<'r> Session<'r> {
    /// Creates a session on an open connection.
    pub fn new(connection: RobotConnection<'r>) -> Self {
        // Another program may use a real line, too, and must not take our answers for its own.
        let first = if connection.is_real { RandomState::new().hash_one(0) as u16 } else { 0 };
        Self { connection, client: Client::with_first_id(first), now: Micros::ZERO, heard: 0 }
    }

    /// Name of the connection.
    pub fn name(&self) -> &str {
        &self.connection.name
    }

    /// Bit rate of the line.
    pub const fn baud(&self) -> u32 {
        self.connection.baud
    }

    /// The time on the line.
    pub const fn now(&self) -> Micros {
        self.now
    }

    /// The world of a robot that is simulated here.
    pub fn world(&mut self) -> Option<&mut dyn Running> {
        self.connection.source.world()
    }

    /// Sends and receives, for a few milliseconds; fails if the line has ended.
    pub fn step(&mut self) -> Result<()> {
        self.client.step(self.now);
        let (bytes, now) = self.connection.source.exchange(&self.client.take_out())?;
        self.heard += bytes.len() as u64;
        self.now = now;
        self.client.hear(&bytes, now);
        Ok(())
    }

    /// Why the robot is not heard; `None` if it is.
    pub fn trouble(&self) -> Option<String> {
        if let Some(trouble) = self.connection.source.trouble() {
            return Some(trouble.to_owned());
        }
        if self.client.is_up(self.now) {
            return match self.client.version() {
                VERSION => None,
                newer if newer > VERSION => Some(format!(
                    "the robot's messages have version {newer}, this program knows {VERSION}: some of \
                     what it says may be missing here"
                )),
                older => Some(format!(
                    "the robot's messages have version {older}, this program {VERSION}: flash it anew"
                )),
            };
        }
        Some(if self.client.is_described() {
            "nothing is heard any more: is the robot on, and its cable plugged in?".into()
        } else if self.heard == 0 {
            "nothing is heard: is the robot on, and is this its port?".into()
        } else {
            "something is heard, but no robot: is the bit rate right (--baud), and is this its port?"
                .into()
        })
    }

    /// A session with a robot that has described itself; fails if it does not.
    pub fn meet(connection: RobotConnection<'r>) -> Result<Self> {
        let mut session = Self::new(connection);
        let met = session.until(|client| client.is_described().then_some(()));
        met.with_context(|| format!("{}: no robot", session.name()))?;
        Ok(session)
    }

    fn until<T>(&mut self, mut look: impl FnMut(&mut Client) -> Option<T>) -> Result<T> {
        let (mut begin, mut known) = (self.now, 0);
        loop {
            self.step()?;
            if let Some(found) = look(&mut self.client) {
                return Ok(found);
            }
            // An emulated chip may take long to describe itself.
            let told = self.client.signals().count() + self.client.parameters().count();
            if told > known {
                (begin, known) = (self.now, told);
            }
            if self.now.since(begin) > PATIENCE {
                bail!("{}", self.trouble().unwrap_or_else(|| "it does not answer".into()));
            }
        }
    }

    /// Asks for changes of parameters by their full names, all or none; returns the number of the answer.
    /// Fails unless there are such parameters, and for too many.
    pub fn ask(&mut self, wanted: &[(String, f32)]) -> Result<u16> {
        let number = |(name, value): &(String, f32)| Ok((self.parameter(name)?.index, *value));
        let changes: Vec<_> = wanted.iter().map(number).collect::<Result<_>>()?;
        let id = self.client.set(&changes);
        id.with_context(|| format!("at most {} changes at once", rc10_link::CHANGES))
    }

    /// Changes parameters, all or none; fails if the robot refuses or does not answer.
    pub fn set(&mut self, wanted: &[(String, f32)]) -> Result<()> {
        let id = self.ask(wanted)?;
        self.answer(id).map(drop)
    }

    /// Has an action carried out; fails if the robot refuses or does not answer.
    pub fn carry_out(&mut self, action: Action) -> Result<Answer> {
        let id = self.client.act(action);
        self.answer(id)
    }

    fn answer(&mut self, id: u16) -> Result<Answer> {
        match self.until(|client| client.answer(id))? {
            Answer::Refused(why) => bail!("refused: {why}"),
            answer => Ok(answer),
        }
    }

    /// The values that the robot keeps, with the full name of each; fails of a robot that keeps none by its messages.
    pub fn kept(&mut self) -> Result<Vec<(String, KeptValue)>> {
        if let (Some(why), true) = (self.trouble(), self.client.version() < VERSION) {
            bail!(why);
        }
        let kept = self.until(|client| Some(client.kept()?.cloned().collect::<Vec<_>>()))?;
        Ok(kept.into_iter().map(|it| (self.name_of(&it), it)).collect())
    }

    /// The full name of a kept value, or as much of it as is known.
    pub fn name_of(&self, kept: &KeptValue) -> String {
        let mut known = self.client.parameters();
        let known = kept.parameter.and_then(|index| known.find(|it| it.index == index));
        known.map_or_else(|| kept.text.replace(' ', "_"), full_name)
    }

    /// The parameter of a full name: `motor.name` or the robot's own `name`, `_` for spaces. Fails
    /// unless there is one.
    pub fn parameter(&self, name: &str) -> Result<Parameter> {
        let all: Vec<_> = self.client.parameters().collect();
        let found: Vec<_> = all.iter().filter(|it| full_name(it) == name).collect();
        if let [one] = found.as_slice() {
            return Ok((**one).clone());
        }
        let near: Vec<_> =
            all.iter().map(|it| full_name(it)).filter(|it| it.contains(name)).collect();
        ensure!(!near.is_empty(), "there is no parameter `{name}`: rc10 params lists them");
        let more = match near.len().saturating_sub(NEAR) {
            0 => String::new(),
            more => format!(" and {more} more: rc10 params lists them"),
        };
        let near = near.get(..NEAR).unwrap_or(&near).join(", ");
        bail!("there is no parameter `{name}`; there are {near}{more}")
    }
}

/// Limit of names that a wrong one is answered with.
const NEAR: usize = 10;

/// A parameter's name on a command line.
pub fn full_name(parameter: &Parameter) -> String {
    let label = parameter.label.replace(' ', "_");
    if parameter.folder == "parameters" { label } else { format!("{label}.{}", parameter.name) }
}

/// A flag that Ctrl-C sets, or the end of the terminal.
pub(crate) fn stop() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    #[cfg(unix)]
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    #[cfg(windows)]
    {
        let stop = Arc::clone(&stop);
        ctrlc::set_handler(move || stop.store(true, std::sync::atomic::Ordering::Relaxed))?;
    }
    Ok(stop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::line::Source;
    use crate::live::source::SourceArgs;

    struct Nowhere;

    impl Source for Nowhere {
        fn exchange(&mut self, _: &[u8]) -> Result<(Vec<u8>, Micros)> {
            Ok((Vec::new(), Micros::ZERO))
        }
    }

    /// The simulated robot has one program, and one run of it is as the other.
    #[test]
    fn questions_are_counted_from_a_number_by_chance_where_others_may_speak() {
        let first = |connection| Session::new(connection).client.act(Action::Zero(0));
        let of = |is_real| {
            let (source, name) = (Box::new(Nowhere), String::new());
            first(RobotConnection { source, name, baud: 0, is_real })
        };
        assert_ne!([of(true), of(true), of(true), of(true)], [1; 4]);
        assert_eq!([of(false), of(false)], [1; 2]);
        let ports = team::Ports::new();
        let (shared, mut motors) = (team::Shared::new(&ports), team::Motors::new());
        let robot = crate::tests::robot(&shared, motors.start(&shared.switch).unwrap().buses);
        let simulated = SourceArgs { sim: true, ..SourceArgs::default() };
        assert_eq!(first(simulated.open(robot, None).unwrap()), 1);
    }
}
