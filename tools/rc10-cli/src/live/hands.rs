//! Hands of pages at the remote of a robot that is simulated here.
//!
//! A page that takes the remote gets a number, and drives with it until another page takes it. It says where
//! sticks and switches are some fifty times a second. Without its word the transmitter goes off, and the robot does what
//! it does without its remote. The robot's thread looks here in each step, so that no number of messages delays a stop.

use std::hash::{BuildHasher as _, RandomState};

use rc10_sim::remote::{Controls, Stick, Switch};
use rc10_time::Micros;
use serde_json::{Value, json};

use crate::robot::operator::{Operator, at_rest};
use crate::robot::remote::{Receiver, RemoteControl};
use crate::run::running::Running;

/// Time without a word of the page after which the transmitter goes off while a stick is moved.
pub const MOVED: Micros = Micros::from_millis(250);
/// The same with sticks at rest: a browser lets a page in the background speak once a second.
pub const AT_REST: Micros = Micros::from_millis(2500);

/// Whose hands hold a remote.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Holder {
    /// It lies there.
    #[default]
    Table,
    Script,
    Page(u32),
}

/// Hands at the remote, as pages move them.
#[derive(Debug, Default)]
pub struct Hands {
    /// Whether there is a remote: never that of a real robot.
    is_there: bool,
    /// Number of its switches.
    switches: usize,
    holder: Holder,
    /// Number of the newest page, and of its newest message.
    number: u32,
    message: u64,
    controls: Controls,
    /// Whether the robot's thread has not seen it yet.
    is_new: bool,
}

impl Hands {
    /// Puts the remote there, if there is one: in the script's hands, or on the table.
    pub fn begin(&mut self, world: &mut dyn Running, script: bool) {
        let Some(RemoteControl { receiver, channels, .. }) = &world.description().remote else {
            return;
        };
        let has_two = matches!(receiver, Receiver::Dr16 | Receiver::Vt03);
        let more = channels.more_switches.iter().flatten().count();
        let switches = if has_two { 2 } else { 2 + more };
        let Some(operator) = world.operator() else { return };
        // By chance, so that a page of an earlier program has no number of this one.
        let number = RandomState::new().hash_one(0) as u32 / 2;
        let holder = if script { Holder::Script } else { Holder::Table };
        *self = Self { is_there: true, holder, number, switches, ..Self::default() };
        if !script {
            operator.lay_down();
        }
    }

    /// Does what a page wants: `"take"`, `"script"`, or `[number]` to let go, and `[number, message, positions ..]`.
    /// Fails with the reason for the page: there is no remote here, it is in other hands, or this is no position.
    pub fn ask(&mut self, wish: &Value) -> Result<Value, String> {
        if !self.is_there {
            return Err("no remote is simulated here: a real robot is driven by its own".into());
        }
        let mut answer = Value::Null;
        match (wish.as_str(), wish.as_array().map(Vec::as_slice)) {
            (Some("take"), _) => {
                (self.number, self.message) = (self.number.wrapping_add(1), 0);
                self.controls = at_rest(self.controls);
                self.holder = Holder::Page(self.number);
                answer = json!({ "number": self.number, "at": positions(&self.controls) });
            }
            (Some("script"), _) => self.holder = Holder::Script,
            (_, Some([number, rest @ ..])) => {
                let is_holder =
                    matches!(self.holder, Holder::Page(it) if number.as_u64() == Some(it.into()));
                if !is_holder {
                    return Err("the remote is in other hands".into());
                }
                match rest {
                    [] => self.holder = Holder::Table,
                    [message, at @ ..] => {
                        let message = message.as_u64().filter(|it| *it > self.message);
                        self.message = message.ok_or("this message is late")?;
                        self.controls = controls(at).ok_or(
                            "positions are nine numbers from -1 to 1, those of switches whole",
                        )?;
                    }
                }
            }
            _ => return Err(format!("not understood: {wish}")),
        }
        self.is_new = true;
        Ok(answer)
    }

    /// Moves the remote as the hands do; for the robot's thread.
    pub fn act(&mut self, operator: &mut Operator, now: Micros) {
        if std::mem::take(&mut self.is_new) {
            let patience = if self.controls == at_rest(self.controls) { AT_REST } else { MOVED };
            match self.holder {
                Holder::Table => operator.leave(),
                Holder::Script => operator.follow(now),
                Holder::Page(_) => operator.hold(self.controls, Some(now + patience)),
            }
        }
        self.controls = operator.remote().controls();
    }

    /// The remote for pages.
    pub fn state(&self, operator: &Operator) -> Value {
        let holder = match self.holder {
            Holder::Table => json!("table"),
            Holder::Script => json!("script"),
            Holder::Page(number) => json!(number),
        };
        json!({
            "holder": holder, "on": operator.is_on(), "script": operator.follows(),
            "at": positions(&operator.remote().controls()), "switches": self.switches,
            "safe": positions(&operator.safe()),
        })
    }
}

/// Positions of sticks, dial and switches: the left stick's x and y, the right one's, the dial, the switches.
fn positions(controls: &Controls) -> [f64; 9] {
    let Controls { left, right, dial, left_switch, right_switch, more_switches, .. } = controls;
    let [third, fourth] = more_switches;
    let switches = [left_switch, right_switch, third, fourth].map(|switch| match switch {
        Switch::Up => 1.0,
        Switch::Middle => 0.0,
        Switch::Down => -1.0,
    });
    let [left_switch, right_switch, third, fourth] = switches;
    [left.x, left.y, right.x, right.y, *dial, left_switch, right_switch, third, fourth]
}

fn controls(at: &[Value]) -> Option<Controls> {
    let [left_x, left_y, right_x, right_y, dial, switches @ ..] = at else { return None };
    let axis = |value: &Value| value.as_f64().filter(|it| (-1.0..=1.0).contains(it));
    let stick = |x, y| Some(Stick { x: axis(x)?, y: axis(y)? });
    let switch = |value: &Value| match value.as_i64() {
        Some(1) => Some(Switch::Up),
        Some(0) => Some(Switch::Middle),
        Some(-1) => Some(Switch::Down),
        _ => None,
    };
    let [left_switch, right_switch, third, fourth] = switches else { return None };
    Some(Controls {
        left: stick(left_x, left_y)?,
        right: stick(right_x, right_y)?,
        left_switch: switch(left_switch)?,
        right_switch: switch(right_switch)?,
        more_switches: [switch(third)?, switch(fourth)?],
        dial: axis(dial)?,
        keys: 0,
    })
}
