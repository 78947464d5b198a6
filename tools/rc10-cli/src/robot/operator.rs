//! The operator of a remote control, who follows a script.

use rc10_sim::remote::Remote;
use rc10_time::Micros;

use crate::robot::remote::{Lost, RemoteControl, ScriptLine};

/// The operator of a remote, who follows a script to the microsecond.
#[derive(Clone, Debug)]
pub struct Operator {
    remote: Remote,
    script: Vec<ScriptLine>,
    repeats_after: Option<Micros>,
    /// The next line of the script, and the begin of its round.
    line: usize,
    round: Micros,
    /// The times at which the transmitter goes off (`false`) or on (`true`), the next first.
    switching: Vec<(Micros, bool)>,
}

impl Operator {
    /// Creates an operator of this remote, before power-on.
    #[must_use]
    pub fn new(remote: &Remote, control: &RemoteControl) -> Self {
        let off_and_on = |lost: &Lost| {
            std::iter::once((lost.from, false)).chain(lost.until.map(|until| (until, true)))
        };
        Self {
            remote: remote.clone(),
            script: control.script.clone(),
            repeats_after: control.repeats_after.filter(|period| *period > Micros::ZERO),
            line: 0,
            round: Micros::ZERO,
            switching: control.lost.iter().flat_map(off_and_on).collect(),
        }
    }

    /// The time of the next action, if there is one.
    #[must_use]
    pub fn next(&self) -> Option<Micros> {
        let line = self.script.get(self.line).map(|line| self.round + line.at);
        let switched = self.switching.first().map(|(at, _)| *at);
        line.into_iter().chain(switched).min()
    }

    /// Does the actions that are due.
    pub fn act(&mut self, now: Micros) {
        while let Some(line) = self.script.get(self.line).filter(|line| self.round + line.at <= now)
        {
            self.remote.set(line.controls);
            self.line += 1;
            if let (true, Some(period)) = (self.line == self.script.len(), self.repeats_after) {
                self.line = 0;
                self.round += period;
            }
        }
        while let Some((_, on)) = self.switching.first().copied().filter(|(at, _)| *at <= now) {
            self.remote.set_transmitter(on);
            self.switching.remove(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use rc10_sim::remote::Switch;

    use super::*;
    use crate::robot::remote::tests::{control, faults};

    #[test]
    fn an_operator_does_what_is_due_and_begins_again() {
        let mut control = control();
        control.lose(&faults(&["remote-lost@1.5s", "cut:1@1s", "remote-lost@50ms..60ms"])).unwrap();
        let remote = Remote::new();
        let mut operator = Operator::new(&remote, &control);
        let mut seen = Vec::new();
        for _ in 0..8 {
            let at = operator.next().unwrap();
            operator.act(at);
            seen.push((at.get() / 1000, remote.controls().right_switch));
        }
        use Switch::{Down, Up};
        let expected =
            [(0, Down), (50, Down), (60, Down), (100, Up), (1000, Down), (1100, Up), (1500, Up)];
        assert_eq!(seen[..7], expected);
        assert_eq!(seen[7], (2000, Down));
    }
}
