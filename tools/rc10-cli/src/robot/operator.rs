//! The operator of a remote control, who follows a script until other hands take it.

use rc10_sim::remote::{Controls, Remote, Stick};
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
    /// Label of the script's newest line; empty while other hands hold the remote.
    label: &'static str,
    /// The time at which the word of other hands ends.
    until: Option<Micros>,
    /// Why the transmitter is off: it is lost, and no hands hold it.
    off: [bool; 2],
    /// The remote as it lies there: disarmed.
    safe: Controls,
    /// The times at which the transmitter goes off (`false`) or on (`true`), the next first.
    switching: Vec<(Micros, bool)>,
}

impl Operator {
    /// Creates an operator of this remote, before power-on.
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
            label: "",
            until: None,
            off: [false; 2],
            safe: control.safe(),
            switching: control.lost.iter().flat_map(off_and_on).collect(),
        }
    }

    /// The remote.
    pub const fn remote(&self) -> &Remote {
        &self.remote
    }

    /// The remote as it lies there: disarmed.
    pub const fn safe(&self) -> Controls {
        self.safe
    }

    /// Whether its transmitter is on.
    pub fn is_on(&self) -> bool {
        self.off == [false; 2]
    }

    /// Label of the script's newest line; `None` while it is not followed.
    pub fn follows(&self) -> Option<&'static str> {
        (self.line < self.script.len() || !self.label.is_empty()).then_some(self.label)
    }

    /// Puts the remote down, switched on and disarmed, and follows no script.
    pub fn lay_down(&mut self) {
        self.hold(self.safe, None);
    }

    /// Holds the remote so. Its transmitter goes off at a time, if there is one.
    pub fn hold(&mut self, controls: Controls, until: Option<Micros>) {
        (self.line, self.label, self.until) = (self.script.len(), "", until);
        self.remote.set(controls);
        self.switch(1, true);
    }

    /// Switches the transmitter off, with the sticks let go.
    pub fn leave(&mut self) {
        self.hold(at_rest(self.remote.controls()), None);
        self.switch(1, false);
    }

    /// Follows the script from its first line on.
    pub fn follow(&mut self, now: Micros) {
        (self.line, self.round, self.until) = (0, now, None);
        self.switch(1, true);
    }

    /// Loses the radio link, or gets it back.
    pub fn lose(&mut self, is_lost: bool) {
        self.switch(0, !is_lost);
    }

    fn switch(&mut self, why: usize, on: bool) {
        self.off[why] = !on;
        self.remote.set_transmitter(self.is_on());
    }

    /// The time of the next action, if there is one.
    pub fn next(&self) -> Option<Micros> {
        let line = self.script.get(self.line).map(|line| self.round + line.at);
        let switched = self.switching.first().map(|(at, _)| *at);
        line.into_iter().chain(switched).chain(self.until).min()
    }

    /// Does the actions that are due.
    pub fn act(&mut self, now: Micros) {
        while let Some(line) = self.script.get(self.line).filter(|line| self.round + line.at <= now)
        {
            self.remote.set(line.controls);
            self.label = line.label;
            self.line += 1;
            if let (true, Some(period)) = (self.line == self.script.len(), self.repeats_after) {
                self.line = 0;
                self.round += period;
            }
        }
        while let Some((_, on)) = self.switching.first().copied().filter(|(at, _)| *at <= now) {
            self.switch(0, on);
            self.switching.remove(0);
        }
        if self.until.is_some_and(|until| until <= now) {
            self.leave();
        }
    }
}

/// The same switches, and sticks and dial in the middle.
pub const fn at_rest(controls: Controls) -> Controls {
    Controls { left: Stick::MIDDLE, right: Stick::MIDDLE, dial: 0.0, keys: 0, ..controls }
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
