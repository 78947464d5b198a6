//! What goes wrong with a simulated robot while it runs: by the words of `--fault` and `--mistake`, without a time.

use anyhow::{Result, anyhow, ensure};
use rc10_emu::fault::Fault;
use rc10_sim::Plant;

use crate::robot::description::Description;
use crate::robot::mistake::Mistake;
use crate::run::running::Running;
use crate::world::built::Built;

/// A thing that is wrong.
#[derive(Clone, Debug, PartialEq)]
enum Wrong {
    Fault(Fault),
    Mistake(Mistake),
}

/// All that was let go wrong here, with its words, and the motors' own plants.
#[derive(Default)]
pub struct Broken {
    all: Vec<(String, Wrong)>,
    plants: Vec<Plant>,
}

fn read(words: &str) -> Result<Wrong> {
    let text = format!("{words}@0s");
    let why = match (words.parse::<Mistake>(), text.parse::<Fault>()) {
        (Ok(mistake), _) => return Ok(Wrong::Mistake(mistake)),
        (_, Ok(fault)) => return Ok(Wrong::Fault(fault)),
        (Err(mistake), Err(fault)) if mistake.to_string().contains("no such mistake") => {
            anyhow!(fault)
        }
        (Err(mistake), _) => mistake,
    };
    Err(why)
}

impl Broken {
    /// The words of all that is wrong now.
    pub fn words(&self) -> impl Iterator<Item = &str> {
        self.all.iter().map(|(words, _)| words.as_str())
    }

    /// The mistakes that a robot began with.
    pub fn of(description: &Description) -> Self {
        let of = |it: &Mistake| (it.to_string(), Wrong::Mistake(it.clone()));
        Self { all: description.mistakes.iter().map(of).collect(), plants: Vec::new() }
    }

    /// Lets something go wrong, or takes it back. Gives the mistakes of a robot that must begin anew for that.
    /// Fails if these are no such words, or the robot cannot have it.
    pub fn change(
        &mut self,
        world: &mut dyn Running,
        words: &str,
        begins: bool,
    ) -> Result<Option<Vec<String>>> {
        let known = self.all.iter().position(|(known, _)| known == words);
        let wrong = read(words)?;
        ensure!(begins || known.is_some(), "{words} was not let go wrong here");
        ensure!(!begins || known.is_none(), "{words} is so already");
        if let Wrong::Fault(fault) = &wrong {
            world.description().check(std::slice::from_ref(fault))?;
            world.inject(begins, &fault.kind)?;
        }
        let mut all = self.all.clone();
        match known {
            Some(at) => drop(all.remove(at)),
            None => all.push((words.to_owned(), wrong.clone())),
        }
        if matches!(wrong, Wrong::Mistake(_)) && !self.build(world, &all)? {
            let mistakes = all.into_iter().filter(|(_, it)| matches!(it, Wrong::Mistake(_)));
            return Ok(Some(mistakes.map(|(words, _)| words).collect()));
        }
        // A sudden one is over.
        let is_sudden = begins && format!("{words}@0s..1s").parse::<Fault>().is_err();
        if !(is_sudden && matches!(wrong, Wrong::Fault(_))) {
            self.all = all;
        }
        Ok(None)
    }

    /// Changes the motors of a robot that runs as its mistakes say, if that can be.
    fn build(&mut self, world: &dyn Running, all: &[(String, Wrong)]) -> Result<bool> {
        let with = |all: &[(String, Wrong)]| {
            let mut description = world.description().clone();
            description.mistakes.clear();
            for (_, wrong) in all {
                if let Wrong::Mistake(mistake) = wrong {
                    description.mistakes.push(mistake.clone());
                }
            }
            Built::new(&description)
        };
        let (before, built) = (with(&self.all)?, with(all)?);
        let mut pairs = built.motors.iter().zip(&before.motors);
        let masses = |built: &Built| -> Vec<f64> {
            built.arms.iter().flat_map(|arm| &arm.links).map(|(_, link)| link.mass).collect()
        };
        let is_fixed = pairs.all(|(now, was)| (now.on, now.direction) == (was.on, was.direction));
        if !is_fixed || built.chassis != before.chassis || masses(&built) != masses(&before) {
            return Ok(false);
        }
        if self.plants.is_empty() {
            self.plants = world.twins().iter().map(rc10_sim::Esc::plant).collect();
        }
        for (at, (twin, plant)) in world.twins().iter().zip(&self.plants).enumerate() {
            if !built.differs(&before, at) {
                continue;
            }
            let (motor, mut plant) = (&built.motors[at], *plant);
            plant.nonlinear.gravity_torque = motor.sign() * motor.plant.nonlinear.gravity_torque;
            twin.set_plant(plant);
            twin.set_load(motor.sign() * motor.plant.load);
            let id = built.id(at);
            let is_set = id == before.id(at) || u8::try_from(id).is_ok_and(|id| twin.set_id(id));
            ensure!(
                is_set,
                "a simulated {} cannot be set to the identifier {id}",
                motor.name().model
            );
            built.finish(at, twin)?;
        }
        Ok(true)
    }
}
