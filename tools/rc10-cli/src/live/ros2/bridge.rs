//! The bridge between the link of a robot and a node of ROS 2.

use std::collections::BTreeMap;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use hiroz::Builder;
use hiroz::context::ZContext;
use hiroz::node::ZNode;
use hiroz_msgs::diagnostic_msgs::{DiagnosticStatus, KeyValue};
use rc10_link::Declaration;
use zenoh::Wait as _;

use super::args::NodeArgs;
use super::given::{Given, refresh};
use super::node::{Outbox, context, sound};
use super::told::{INFO, Told, WARNING};
use crate::live::line::RobotConnection;
use crate::live::plan::{SLOW, plan, watch_at};
use crate::live::session::Session;
use crate::robot::description::PoseSignals;
use crate::run::running::Running;
use crate::terminal::tell;

/// Period of what is watched often, ms: the newest time of the robot is in it, by which commands are judged.
const OFTEN: u16 = 10;
/// Period of the diagnostics, and of the same line of the log.
const SECOND: Duration = Duration::from_secs(1);

/// A robot, and the node that it is.
pub struct Bridge<'r> {
    session: Session<'r>,
    context: Option<ZContext>,
    opening: Option<JoinHandle<Result<ZContext>>>,
    outbox: Outbox,
    args: NodeArgs,
    estimate: Option<PoseSignals>,
    yaw: Option<&'static str>,
    node: Option<Node>,
    is_up: bool,
    has_router: bool,
    published: Instant,
    state_told: Instant,
    told: BTreeMap<String, u64>,
}

/// The node of one robot.
struct Node {
    declaration: Declaration,
    told: Told,
    given: Given,
    changes: Option<u32>,
    node: ZNode,
}

impl<'r> Bridge<'r> {
    /// Begins between a robot's line and a router, each of which may come later. `estimate` and `yaw` are signals of the
    /// robot's [`Description`](crate::Description). Fails without a thread; an
    /// invalid router's address is told by a [`step`](Self::step).
    pub fn new(
        connection: RobotConnection<'r>,
        args: &NodeArgs,
        estimate: Option<PoseSignals>,
        yaw: Option<&'static str>,
    ) -> Result<Self> {
        // zenoh waits for others for up to 500 ms: meanwhile the robot describes itself.
        let of = args.clone();
        let opening = Some(thread::Builder::new().spawn(move || context(&of))?);
        let (session, outbox) = (Session::new(connection), Outbox::new()?);
        tell(format_args!(
            "{} as a node of ROS 2, by the router at {}",
            session.name(),
            args.router
        ));
        let (published, state_told) = (Instant::now(), Instant::now());
        let args =
            NodeArgs { namespace: args.namespace.trim_matches('/').to_owned(), ..args.clone() };
        Ok(Self {
            session,
            context: None,
            opening,
            outbox,
            args,
            estimate,
            yaw,
            node: None,
            is_up: false,
            has_router: true,
            published,
            state_told,
            told: BTreeMap::new(),
        })
    }

    /// The world of a robot that is simulated here.
    pub fn world(&mut self) -> Option<&mut dyn Running> {
        self.session.world()
    }

    /// Why commands were refused so far, and how often; and how many were handed to the robot.
    pub fn commands(&self) -> (BTreeMap<String, u64>, u64) {
        self.node.as_ref().map(|it| (it.given.refused.clone(), it.given.passed)).unwrap_or_default()
    }

    /// Goes on, for a few milliseconds. Fails if the line has ended for good, or if zenoh has.
    pub fn step(&mut self) -> Result<()> {
        self.session.step()?;
        let now = self.session.now();
        let is_up = self.session.client.is_up(now);
        if is_up != self.is_up {
            self.is_up = is_up;
            self.say(
                if is_up { INFO } else { WARNING },
                if is_up { "the robot is there" } else { "the robot is gone" },
            );
        }
        self.meet()?;
        let samples = self.session.client.take_samples();
        let Some(node) = &mut self.node else { return Ok(()) };
        node.given.step(&mut self.session.client, &self.outbox, is_up, now);
        if !is_up {
            node.told.forget();
        }
        samples.iter().for_each(|it| node.told.take(it));
        let events = if samples.is_empty() { Vec::new() } else { node.told.events() };
        if self.session.client.is_described() && node.changes != self.session.client.changes() {
            node.changes = self.session.client.changes();
            refresh(&self.session.client, &node.node);
        }
        if self.published.elapsed() >= SECOND / self.args.rate.max(1) && !samples.is_empty() {
            self.published = Instant::now();
            node.told.publish();
        }
        events.iter().for_each(|(level, text)| self.say(*level, text));
        if self.state_told.elapsed() >= SECOND {
            self.state_told = Instant::now();
            self.tell_state();
        }
        Ok(())
    }

    /// Becomes the node of a robot that has described itself.
    fn meet(&mut self) -> Result<()> {
        if let Some(opening) = self.opening.take_if(|it| it.is_finished()) {
            let opened = opening.join().map_err(|_| anyhow!("zenoh has ended"))?;
            self.context = Some(opened?);
        }
        let Some(context) = &self.context else { return Ok(()) };
        let client = &mut self.session.client;
        let declaration = client.declaration();
        if !client.is_described()
            || self.node.as_ref().is_some_and(|it| it.declaration == declaration)
        {
            return Ok(());
        }
        let (topics, left) = plan(client);
        watch_at(client, &topics, [OFTEN, SLOW]);
        // The one before leaves first: its names may be those of the new one.
        self.node = None;
        let builder = context.create_node("rc10").with_namespace(&self.args.namespace);
        let node = sound(builder.build())?;
        let given = Given::new(client, &node)?;
        let place = (&node, &self.outbox, self.args.namespace.as_str());
        let told = Told::new(client, place, self.estimate, self.yaw)?;
        let changes = client.changes();
        let takes = if given.takes_commands() {
            "takes commands"
        } else {
            "takes no commands: it has no `auto`"
        };
        self.node = Some(Node { declaration, told, given, changes, node });
        if !left.is_empty() {
            tell(format_args!("{} signals have no room on the line", left.len()));
        }
        self.say(INFO, &format!("the robot has described itself; it {takes}"));
        Ok(())
    }

    /// Tells the state of the bridge, and what was refused since.
    fn tell_state(&mut self) {
        let has_router = self.context_has_router();
        if has_router != self.has_router {
            self.has_router = has_router;
            let router = &self.args.router;
            match has_router {
                true => tell(format_args!("the router at {router} is there")),
                false => tell(format_args!(
                    "no router at {router}: begin zenohd, or ros2 run rmw_zenoh_cpp rmw_zenohd; it is tried on and on"
                )),
            }
        }
        let (trouble, losses) = (self.session.trouble(), self.session.client.losses());
        let Some(node) = &mut self.node else { return };
        let mut values = vec![
            ("commands passed".to_owned(), node.given.passed),
            ("messages without room".to_owned(), node.told.lost),
            ("samples lost".to_owned(), losses.samples),
            ("samples skipped".to_owned(), losses.skipped),
            ("frames damaged".to_owned(), losses.damaged),
        ];
        let refused = node.given.refused.clone();
        values.extend(refused.iter().map(|(why, count)| (format!("refused: {why}"), *count)));
        let values =
            values.into_iter().map(|(key, value)| KeyValue { key, value: value.to_string() });
        node.told.publish_state(DiagnosticStatus {
            level: u8::from(trouble.is_some()),
            name: "rc10 ros2".into(),
            message: trouble.unwrap_or_else(|| "the robot is there".into()),
            values: values.collect(),
            ..DiagnosticStatus::default()
        });
        for (why, count) in refused {
            let before = self.told.insert(why.clone(), count).unwrap_or(0);
            if count > before {
                self.say(WARNING, &format!("{} commands refused: {why}", count - before));
            }
        }
    }

    fn context_has_router(&self) -> bool {
        let Some(node) = &self.node else { return true };
        node.node.session().info().routers_zid().wait().next().is_some()
    }

    /// Says something on the terminal, and on rosout.
    fn say(&mut self, level: u8, text: &str) {
        tell(text);
        if let Some(node) = &mut self.node {
            node.told.log(level, text);
        }
    }
}
