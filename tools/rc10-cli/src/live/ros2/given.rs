//! What nodes give to the robot: commands, services, parameters.

use std::collections::BTreeMap;
use std::hash::{BuildHasher as _, RandomState};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Result;
use hiroz::Builder;
use hiroz::attachment::Attachment;
use hiroz::msg::ZMessage;
use hiroz::node::ZNode;
use hiroz::parameter::{
    FloatingPointRange, Parameter, ParameterDescriptor, ParameterType, ParameterValue,
    SetParametersResult,
};
use hiroz::prelude::{ServiceRequest, ZServer, ZSub};
use hiroz_msgs::geometry_msgs::Twist;
use hiroz_msgs::sensor_msgs::JointState;
use hiroz_msgs::std_srvs::TriggerResponse;
use hiroz_msgs::std_srvs::srv::Trigger;
use rc10_link::commands::{COMMAND_AGE, Head};
use rc10_link::{Action, Urgent};
use rc10_time::Micros;
use zenoh::query::Query;
use zenoh::sample::Sample;

use super::node::{Outbox, ros_name, sound, unix_nanos};
use crate::live::client::{Answer, Client};
use crate::live::session::full_name;

/// Time limit of an answer to a service, and to a change of parameters.
const PATIENCE: Duration = Duration::from_secs(2);

type Subscription<T> = ZSub<T, Sample, <T as ZMessage>::Serdes>;

/// What a service does.
#[derive(Clone, Copy)]
enum Deed {
    Urge(Urgent),
    Act(Action),
}

/// A result, or why it is missing.
type Told<T> = std::result::Result<T, String>;

/// A change of parameters that a node wants, and where its answer goes.
type Wish = (Vec<(String, f32)>, SyncSender<Told<()>>);

/// All that nodes give to a robot.
pub struct Given {
    cmd_vel: Option<(u8, Subscription<Twist>)>,
    joints: Option<Subscription<JointState>>,
    /// Name, unit and number of each channel.
    channels: Vec<(String, String, u8)>,
    services: Vec<(ZServer<Trigger, Query>, Deed)>,
    waiting: Vec<(u16, Instant, ServiceRequest<Trigger>)>,
    wishes: Receiver<Wish>,
    wished: Vec<(u16, Instant, SyncSender<Told<()>>)>,
    /// Differs after a restart of this program.
    salt: RandomState,
    /// Commands that were refused, by the reason.
    pub refused: BTreeMap<String, u64>,
    /// Commands that were handed to the robot.
    pub passed: u64,
}

impl Given {
    /// Begins to hear nodes for a robot that has described itself.
    pub fn new(client: &Client, node: &ZNode) -> Result<Self> {
        let channels =
            client.signals().filter(|(_, it)| it.folder == "signals" && it.unit != "commands");
        let channels =
            channels.filter_map(|(_, it)| Some((it.label.strip_prefix("auto ")?, &it.unit)));
        let channels: Vec<_> = (0..)
            .zip(channels)
            .map(|(at, (label, unit))| (ros_name(label), unit.clone(), at))
            .collect();
        let is_twist =
            |at: &[(String, String, u8)]| at.iter().map(|it| it.0.as_str()).eq(["vx", "vy", "wz"]);
        let twist = channels.windows(3).position(is_twist).and_then(|at| u8::try_from(at).ok());
        let cmd_vel = match twist {
            Some(at) => Some((at, sound(node.create_sub::<Twist>("cmd_vel").build())?)),
            None => None,
        };
        let has_joints = channels.len() > if twist.is_some() { 3 } else { 0 };
        let joints = match has_joints {
            true => Some(sound(node.create_sub::<JointState>("joint_commands").build())?),
            false => None,
        };
        let mut deeds = vec![
            ("stop".to_owned(), Deed::Urge(Urgent::Stop)),
            ("disarm".to_owned(), Deed::Urge(Urgent::Disarm)),
        ];
        let mut labels: Vec<_> = client
            .signals()
            .filter(|(_, it)| it.folder == "motors")
            .map(|(_, it)| &it.label)
            .collect();
        labels.dedup();
        for (number, label) in (0..).zip(labels) {
            let name = ros_name(label);
            deeds.push((format!("clear_fault/{name}"), Deed::Act(Action::ClearFault(number))));
            deeds.push((format!("set_zero/{name}"), Deed::Act(Action::Zero(number))));
        }
        let services = deeds
            .into_iter()
            .map(|(name, deed)| Ok((sound(node.create_service::<Trigger>(&name).build())?, deed)));
        Ok(Self {
            cmd_vel,
            joints,
            channels,
            services: services.collect::<Result<_>>()?,
            waiting: Vec::new(),
            wishes: parameters(client, node),
            wished: Vec::new(),
            salt: RandomState::new(),
            refused: BTreeMap::new(),
            passed: 0,
        })
    }

    /// Whether the robot takes commands.
    pub fn takes_commands(&self) -> bool {
        !self.channels.is_empty()
    }

    /// Hands on what has come; answers what is done.
    pub fn step(&mut self, client: &mut Client, outbox: &Outbox, is_up: bool, now: Micros) {
        self.command(client, is_up);
        for (server, deed) in &mut self.services {
            while let Ok(Some(request)) = server.try_take_request() {
                let id = match deed {
                    // It is sent until it is answered.
                    Deed::Urge(what) => client.urge(*what, now),
                    Deed::Act(action) => client.act(*action),
                };
                self.waiting.push((id, Instant::now(), request));
            }
        }
        let mut at = 0;
        while let Some((id, since, _)) = self.waiting.get(at) {
            let Some(told) = answer(client, *id, *since) else {
                at += 1;
                continue;
            };
            let (_, _, request) = self.waiting.swap_remove(at);
            let response = TriggerResponse {
                success: told.is_ok(),
                message: told.err().unwrap_or_else(|| "done".into()),
            };
            outbox.put(move || drop(request.reply_blocking(&response)));
        }
        while let Ok((changes, to)) = self.wishes.try_recv() {
            let number = |name: &str| {
                client.parameters().find(|it| full_name(it) == name).map(|it| it.index)
            };
            let changes: Option<Vec<_>> =
                changes.iter().map(|(name, value)| Some((number(name)?, *value))).collect();
            match changes.and_then(|changes| client.set(&changes)) {
                Some(id) => self.wished.push((id, Instant::now(), to)),
                None => drop(to.try_send(Err(format!("at most {} at once", rc10_link::CHANGES)))),
            }
        }
        self.wished.retain(|(id, since, to)| match answer(client, *id, *since) {
            Some(told) => {
                // Who asked may have given up.
                let _ = to.try_send(told);
                false
            }
            None => true,
        });
    }

    fn command(&mut self, client: &mut Client, is_up: bool) {
        let mut sent = Vec::new();
        let mut refused = Vec::new();
        if let Some((first, of)) = &self.cmd_vel {
            while let Some(sample) = of.queue.as_ref().and_then(|it| it.try_recv()) {
                match self.head(&sample).and_then(|head| Ok((head, decoded::<Twist>(&sample)?))) {
                    Ok((head, Twist { linear, angular })) => {
                        let values = [linear.x, linear.y, angular.z].map(|it| it as f32);
                        sent.push((Head { first: *first, ..head }, values.to_vec()));
                    }
                    Err(why) => refused.push(why),
                }
            }
        }
        if let Some(of) = &self.joints {
            while let Some(sample) = of.queue.as_ref().and_then(|it| it.try_recv()) {
                let told = self.head(&sample).and_then(|head| Ok((head, decoded(&sample)?)));
                match told.and_then(|(head, joints)| self.channels_of(head, &joints)) {
                    Ok(all) => sent.extend(all),
                    Err(why) => refused.push(why),
                }
            }
        }
        for (head, values) in sent {
            if is_up {
                client.command(head, &values);
                self.passed += 1;
            } else {
                refused.push("the robot is not there".into());
            }
        }
        refused.extend(client.take_refusals());
        for why in refused {
            *self.refused.entry(why).or_default() += 1;
        }
    }

    /// Who commands, which one it is, and how old.
    fn head(&self, sample: &Sample) -> Told<Head> {
        let attachment = sample.attachment().and_then(|it| Attachment::try_from(it).ok());
        let attachment =
            attachment.ok_or("it says not who sent it, and when (rmw_zenoh's attachment)")?;
        let age = unix_nanos().saturating_sub(attachment.source_timestamp) / 1000;
        let limit = COMMAND_AGE as i64;
        if !(-limit..limit).contains(&age) {
            return Err(match age < 0 {
                true => "the clock of its sender is ahead of this PC's by more than 50 ms".into(),
                false => "it is older than 50 ms by the clock of its sender".into(),
            });
        }
        let who = self.salt.hash_one(attachment.source_gid) as u32;
        let age = (age.max(0) as u64).div_ceil(1000) as u16;
        Ok(Head { who, count: attachment.sequence_number as u32, age, ..Head::default() })
    }

    /// The channels that joints are, each with its value.
    fn channels_of(&self, head: Head, joints: &JointState) -> Told<Vec<(Head, Vec<f32>)>> {
        let one = |(at, name): (usize, &String)| {
            let channel = self.channels.iter().find(|it| it.0 == *name);
            let (_, unit, first) =
                channel.ok_or_else(|| format!("no joint `{name}` may be commanded"))?;
            let (from, scale) = match unit.as_str() {
                "rpm" => (&joints.velocity, 60.0 / std::f64::consts::TAU),
                "rad/s" | "m/s" => (&joints.velocity, 1.0),
                _ => (&joints.effort, 1.0),
            };
            let value = from.get(at).ok_or_else(|| {
                let field =
                    if std::ptr::eq(from, &joints.velocity) { "velocity" } else { "effort" };
                format!("joint `{name}` is commanded by its {field}, which is not there")
            })?;
            Ok((Head { first: *first, ..head }, vec![(value * scale) as f32]))
        };
        joints.name.iter().enumerate().map(one).collect()
    }
}

fn decoded<T: ZMessage>(sample: &Sample) -> Told<T>
where
    T::Serdes: for<'a> hiroz::msg::ZDeserializer<Output = T, Input<'a> = &'a [u8]>,
{
    T::deserialize(&sample.payload().to_bytes())
        .map_err(|_| "its bytes are no message of its type".into())
}

/// The answer of the robot to a request; `None` as long as it may come.
fn answer(client: &mut Client, id: u16, since: Instant) -> Option<Told<()>> {
    match client.answer(id) {
        Some(Answer::Refused(why)) => Some(Err(why)),
        Some(_) => Some(Ok(())),
        None if since.elapsed() > PATIENCE => Some(Err("the robot does not answer".into())),
        None => None,
    }
}

/// Declares the robot's parameters, and hands on their changes.
fn parameters(client: &Client, node: &ZNode) -> Receiver<Wish> {
    let (wish, wishes) = sync_channel::<Wish>(16);
    for parameter in client.parameters() {
        let [from_value, to_value] = parameter.range.map(f64::from);
        let name = full_name(parameter);
        let descriptor = ParameterDescriptor {
            description: parameter.unit.clone(),
            floating_point_range: Some(FloatingPointRange { from_value, to_value, step: 0.0 }),
            ..ParameterDescriptor::new(&name, ParameterType::Double)
        };
        // Two parameters of a name are one.
        let _ = node.declare_parameter(
            &name,
            ParameterValue::Double(parameter.value.into()),
            descriptor,
        );
    }
    let own = thread::current().id();
    node.on_set_parameters(move |changes| {
        // What the robot has told.
        if thread::current().id() == own {
            return SetParametersResult::success();
        }
        let value = |it: &Parameter| match it.value {
            ParameterValue::Double(value) => Some((it.name.clone(), value as f32)),
            _ => None,
        };
        let Some(changes) = changes.iter().map(value).collect::<Option<Vec<_>>>() else {
            return SetParametersResult::failure("the robot's parameters are doubles");
        };
        let (to, from) = sync_channel(1);
        if wish.try_send((changes, to)).is_err() {
            return SetParametersResult::failure("too many changes at once");
        }
        match from.recv_timeout(PATIENCE) {
            Ok(Ok(())) => SetParametersResult::success(),
            Ok(Err(why)) => SetParametersResult::failure(why),
            Err(_) => SetParametersResult::failure("the robot does not answer"),
        }
    });
    wishes
}

/// Tells nodes what was changed elsewhere.
pub fn refresh(client: &Client, node: &ZNode) {
    for parameter in client.parameters() {
        let name = full_name(parameter);
        let known = node.get_parameter(&name);
        let is_same = |it: &ParameterValue| match it {
            ParameterValue::Double(value) => (*value as f32).to_bits() == parameter.value.to_bits(),
            _ => false,
        };
        if known.is_some_and(|it| !is_same(&it)) {
            let value = ParameterValue::Double(parameter.value.into());
            let _ = node.set_parameter(Parameter::new(name, value));
        }
    }
}
