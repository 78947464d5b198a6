//! A PC at the console of the flashed firmware.

use rc10_can::Micros;
use rc10_cli::emulate::{Emulation, Setup};
use rc10_cli::live::{Action, Answer, Client, Sample};
use rc10_emu::Figures;
use rc10_motor::Names;
use rc10_robot::table::Name;
use rc10_sim::Nanos;

use super::{is_clean, keeps_its_period, log, run, setup};

/// The console's.
const BAUD: u32 = 2_000_000;

/// The firmware with a PC.
struct Watched<'e, 'r> {
    emulation: &'e mut Emulation<'r>,
    client: Client,
    samples: Vec<Sample>,
}

impl Watched<'_, '_> {
    fn now(&self) -> Micros {
        self.emulation.rig.machine.now().micros()
    }

    /// Lets time pass, and the PC speak every millisecond.
    fn run(&mut self, millis: u64) {
        let line = self.emulation.console.clone().unwrap();
        for _ in 0..millis {
            let now = self.now();
            self.client.step(now);
            line.send(&self.client.take_out());
            let next: Nanos = (now + Micros::from_millis(1)).into();
            self.emulation.run(next).unwrap();
            self.client.hear(&line.take(), next.micros());
            self.samples.extend(self.client.take_samples());
        }
    }

    fn ask(&mut self, id: u16) -> Answer {
        for _ in 0..200 {
            if let Some(answer) = self.client.answer(id) {
                return answer;
            }
            self.run(1);
        }
        panic!("no answer");
    }

    fn signals(&self, names: &[&str]) -> Vec<u16> {
        let all = self.client.signals();
        let all = all.filter(|(_, it)| it.folder == "motors" && names.contains(&it.name.as_str()));
        all.map(|(index, _)| index).collect()
    }
}

fn watched(baud: u32, scenario: impl FnOnce(&mut Watched<'_, '_>)) {
    let setup = Setup { console: Some(baud), ..setup(&[]) };
    run(&setup, |emulation| {
        let mut watched = Watched { emulation, client: Client::new(), samples: Vec::new() };
        scenario(&mut watched);
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn it_is_watched_at_full_rate_and_keeps_its_period() {
    let mut unheard = 0;
    let mut costs: Vec<std::collections::BTreeMap<String, u64>> = Vec::new();
    for heard in [false, true] {
        watched(BAUD, |pc| {
            pc.run(600);
            assert!(pc.client.is_described(), "{}", log(pc.emulation));
            let names = ["target", "measured", "speed", "total_angle", "current", "temperature"];
            let signals = pc.signals(&names);
            assert_eq!(signals.len(), 6 * Name::ALL.len());
            if heard {
                pc.client.watch(0, 2, signals.iter().copied());
            }
            pc.run(100);
            pc.emulation.rig.machine.restart_profile();
            let before = 0;
            pc.samples.clear();
            pc.run(1000);
            let after = Figures::of(&pc.emulation.rig).instructions;
            let instructions = after - before;
            println!("{} samples, {instructions} instructions", pc.samples.len());
            let losses = pc.client.losses();
            println!("{losses:?}");
            if heard {
                let samples = 66 * pc.samples.len() as u64;
                println!("{} instructions a sample", (instructions - unheard) / samples);
            }
            unheard = instructions;
            let image = rc10_emu::Image::parse(super::firmware()).unwrap();
            let by = pc.emulation.rig.machine.profile().by_function(&image);
            costs.push(by.into_iter().map(|(n, c)| (n.to_owned(), c)).collect());
            is_clean(&pc.emulation.rig, &Figures::of(&pc.emulation.rig));
            keeps_its_period(&Figures::of(&pc.emulation.rig));
        });
    }
    let mut diff: Vec<_> = costs[1]
        .iter()
        .map(|(n, c)| (*c as i64 - costs[0].get(n).copied().unwrap_or(0) as i64, n))
        .collect();
    diff.sort();
    for (d, n) in diff.iter().rev().take(30) {
        println!("{d} {n}");
    }
}
