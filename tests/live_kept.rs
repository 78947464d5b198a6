//! Parameters that are kept over a power-off: through the store, the link and the tool, with the chip's own code.
#![expect(clippy::float_cmp, reason = "it compares what was kept")]

#[path = "../crates/rc10-module/tests/store/flash.rs"]
mod flash;

use std::cell::RefCell;
use std::pin::pin;
use std::rc::Rc;

use embassy_time::Instant;
use rc10_cli::live::{Action, Answer, Client, frame};
use rc10_cli::world::environment::Environment;
use rc10_link::frame::FromRobot;
use rc10_link::{Ask, Change, Declaration, Outcome, Tell};
use rc10_module::Stream;
use rc10_module::store::{Cells, Store, WORD, Word};
use rc10_motor::embassy::{BusPort, PortsOf, Rs485Port};
use rc10_motor::{ArmError, ArmState, Device, Entry, Names, Slot, Unfit};
use rc10_sim::{Random, Tasks, UartFault, World};
use rc10_tasks::embedded_io_async::{ErrorType, Read, Write};
use rc10_tasks::live::{Commanded, Kept, Link, Live, Parameter, RobotView, Signal};
use rc10_tasks::{Common, status};
use rc10_time::Micros;
use team::table::Name;
use team::{Motors, Ports, Shared};

use crate::common::browser::{Browser, has_browser};
use crate::common::scratch::Scratch;
use crate::common::served::live;
use flash::{Cell, Flash};

/// The names of a robot without motors.
#[derive(Clone, Copy, Debug)]
enum NoMotor {}

impl Names for NoMotor {
    const ALL: &'static [Self] = &[];
    const ENTRIES: &'static [Entry<Device>] = &[];
    const SLOTS: &'static [Slot] = &[];
    const BUSES: &'static [f32] = &[];
    const LINES: u8 = 0;

    fn index(self) -> usize {
        match self {}
    }
}

/// The parameters of a program.
#[derive(Default)]
struct Own(Vec<Parameter>);

impl Live for Own {
    fn auto(&self) -> impl Commanded {}
    fn signals<'l>(&'l self, _: &mut dyn FnMut(&'l Signal)) {}
    fn parameters<'l>(&'l self, see: &mut dyn FnMut(&'l Parameter)) {
        self.0.iter().for_each(see);
    }
}

/// A flash that a robot leaves behind.
#[derive(Clone)]
struct Handle(Rc<RefCell<Flash>>);

impl Cells for Handle {
    fn words(&self) -> u32 {
        self.0.borrow().words()
    }
    fn read(&mut self, sector: u32, word: u32) -> Word {
        self.0.borrow_mut().read(sector, word)
    }
    fn program(&mut self, sector: u32, word: u32, bytes: &Word) {
        self.0.borrow_mut().program(sector, word, bytes);
    }
    fn erase(&mut self, sector: u32) {
        self.0.borrow_mut().erase(sector);
    }
}

/// A PC's bytes, and then silence.
struct Said(Vec<u8>);

impl ErrorType for Said {
    type Error = UartFault;
}

impl Read for Said {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, UartFault> {
        if self.0.is_empty() {
            std::future::pending::<()>().await;
        }
        let count = buffer.len().min(self.0.len());
        for (place, byte) in buffer.iter_mut().zip(self.0.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }
}

#[derive(Clone, Default)]
struct Heard(Rc<RefCell<Vec<u8>>>);

impl ErrorType for Heard {
    type Error = UartFault;
}

impl Write for Heard {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, UartFault> {
        self.0.borrow_mut().extend(bytes);
        Ok(bytes.len())
    }
    async fn flush(&mut self) -> Result<(), UartFault> {
        Ok(())
    }
}

/// What is seen of a robot that was switched on.
#[derive(Debug, PartialEq)]
struct Seen {
    values: Vec<f32>,
    status: String,
    /// Text, value, parameter and whether it is used, of each kept value.
    kept: Vec<(String, f32, Option<u16>, bool)>,
    refused: Option<String>,
    arm: Result<(), ArmError>,
}

const NOTHING: &[&str] = &[];

/// Switches a robot on, sets parameters, has this done, and looks at it.
fn boot(
    flash: &Handle,
    own: Vec<Parameter>,
    must_have: &'static [&'static str],
    set: &[(u16, f32)],
    action: Option<Action>,
) -> Seen {
    let (buses, lines): ([BusPort; 0], [Rs485Port; 0]) = ([], []);
    let mut shared = Common::<NoMotor, Own>::new(PortsOf::new(&buses, &lines));
    shared.own = Own(own);
    let cells: &'static mut dyn Cells = Box::leak(Box::new(flash.clone()));
    let kept = Kept::new(Store::start(cells), must_have, &shared.switch);
    let view = RobotView::new(&shared).with_kept(&kept);
    let mut world = World::new(1);
    assert!(world.run(pin!(kept.apply(&view)), Micros::from_millis(1)).is_ready());
    let status = status::now(&shared).to_string();
    let arm = shared.switch.arm();
    shared.switch.disarm();
    let values = shared.own.0.iter().map(Parameter::get).collect();
    let mut seen = Seen { values, status, kept: Vec::new(), refused: None, arm };
    if action.is_none() && set.is_empty() {
        return seen;
    }
    let mut declaration = Declaration::default().with(&[0]).with(&[0]);
    shared.own.parameters(&mut |it| declaration = declaration.with(it.label.as_bytes()));
    let changes = set.iter().map(|&(parameter, value)| Change { parameter, value }).collect();
    let ask = [
        Some(Ask::Hello { version: rc10_link::VERSION }),
        (!set.is_empty()).then_some(Ask::Set { id: 1, changes, declaration }),
        action.map(|action| Ask::Act { id: 2, declaration, heard: 0, action }),
    ];
    let speak = |ask: &[Option<Ask>], world: &mut World| {
        let heard = Heard::default();
        let link = Link::new(heard.clone());
        let said = Said(ask.iter().flatten().flat_map(frame).collect());
        let until = world.now() + Micros::from_millis(60);
        let _ = world.run(pin!(link.serve(&view, said, Instant::from_ticks(0), ())), until);
        let mut bodies = Vec::new();
        Stream::new(FromRobot).receive(&heard.0.borrow(), until, |body| bodies.push(body));
        bodies
    };
    for body in speak(&ask, &mut world) {
        if let Ok((Tell::Answer { outcome: Outcome::Refused { why, .. }, .. }, _)) =
            postcard::take_from_bytes(&body)
        {
            seen.refused = Some(why.to_owned());
        }
    }
    if flash.0.borrow().left < u64::MAX / 2 {
        // What it believes to be kept without power is of no account.
        return seen;
    }
    let ask = [Some(Ask::Hello { version: rc10_link::VERSION }), Some(Ask::Kept { first: 0 })];
    for body in speak(&ask, &mut world) {
        if let Ok((Tell::Kept { of, text, value, parameter, is_used, .. }, _)) =
            postcard::take_from_bytes(&body)
            && of > 0
        {
            seen.kept.push((text.to_owned(), value, parameter, is_used));
        }
    }
    seen
}

fn new_flash(words: usize) -> Handle {
    Handle(Rc::new(RefCell::new(Flash::new(words, 1))))
}

fn feeder(range: [f32; 2]) -> Parameter {
    Parameter::new("feeder speed", "rpm", 300.0, range)
}

fn lift(label: &'static str, unit: &'static str) -> Parameter {
    Parameter::new(label, unit, 1.0, [0.0, 10.0])
}

const SPEEDS: [f32; 2] = [0.0, 450.0];

/// Two parameters, both saved.
fn saved() -> Handle {
    let flash = new_flash(64);
    let all = vec![feeder(SPEEDS), lift("lift height", "m")];
    let seen = boot(&flash, all, NOTHING, &[(0, 120.0), (1, 2.5)], Some(Action::Save));
    assert_eq!((seen.refused, seen.kept.len()), (None, 2));
    flash
}

#[test]
fn what_is_saved_is_there_at_the_next_start_and_said_in_the_first_status() {
    let flash = saved();
    let same = || vec![feeder(SPEEDS), lift("lift height", "m")];
    let seen = boot(&flash, same(), NOTHING, &[], None);
    assert_eq!(seen.values, [120.0, 2.5]);
    assert!(seen.status.contains("2 parameters differ from the table"), "{}", seen.status);
    assert_eq!(seen.arm, Ok(()));
    // A table without what it had is a table of its own.
    let plain = boot(&new_flash(64), same(), NOTHING, &[], None);
    assert!(!plain.status.contains("parameter") && plain.arm == Ok(()), "{}", plain.status);
    // Set back to the table and saved: it is no longer kept.
    let seen = boot(&flash, same(), NOTHING, &[(0, 300.0)], Some(Action::Save));
    assert_eq!(seen.kept, [("lift height".to_owned(), 2.5, Some(1), true)]);
}

/// Other programs on the same flash.
#[test]
fn a_program_with_other_parameters_uses_those_that_are_the_same_and_tells_the_others() {
    let whole =
        |text: &str, value, parameter, is_used| (text.to_owned(), value, parameter, is_used);
    // Added and removed: what is the same is used; what is not known stays.
    let flash = saved();
    let other = || vec![lift("arm length", "m"), feeder(SPEEDS)];
    let seen = boot(&flash, other(), NOTHING, &[(0, 7.0)], Some(Action::Save));
    assert_eq!(seen.values, [1.0, 120.0]);
    assert_eq!(
        seen.kept,
        [
            whole("arm length", 7.0, Some(0), true),
            whole("feeder speed", 120.0, Some(1), true),
            whole("lift height", 2.5, None, false)
        ]
    );
    let seen = boot(&flash, vec![lift("lift height", "m")], NOTHING, &[], None);
    assert_eq!(seen.values, [2.5], "the program that knows it");
    // Renamed: it is another one.
    let flash = saved();
    let seen = boot(
        &flash,
        vec![feeder(SPEEDS), lift("lift way", "m")],
        NOTHING,
        &[],
        Some(Action::Forget(0)),
    );
    assert_eq!(seen.values, [120.0, 1.0]);
    assert_eq!(seen.kept[1], whole("lift height", 2.5, None, false));
    // Of another unit, of another range: not used, and said.
    let ranges = [[0.0, 451.0], [1.0, 450.0]];
    let ranges = ranges.map(|range| (vec![feeder(range), lift("lift height", "m")], [300.0, 2.5]));
    let unit = (vec![feeder(SPEEDS), lift("lift height", "mm")], [120.0, 1.0]);
    for (own, values) in ranges.into_iter().chain([unit]) {
        let flash = saved();
        let seen = boot(&flash, own, NOTHING, &[], Some(Action::Forget(0)));
        assert_eq!(seen.values, values);
        let told = "1 parameter differs from the table, 1 kept parameter is not used";
        assert!(seen.status.contains(told), "{}", seen.status);
        assert_eq!(seen.kept.iter().filter(|it| it.2.is_some() && !it.3).count(), 1);
        assert_eq!(seen.arm, Ok(()));
    }
    // A save by a program that has it otherwise replaces it.
    let flash = saved();
    let otherwise = vec![feeder([0.0, 400.0]), lift("lift height", "m")];
    let seen = boot(&flash, otherwise, NOTHING, &[(0, 50.0)], Some(Action::Save));
    assert_eq!(seen.kept[0], whole("feeder speed", 50.0, Some(0), true));
    assert_eq!(seen.kept.len(), 2);
}

#[test]
fn what_is_forgotten_is_as_in_the_table_at_the_next_start() {
    let own = || vec![feeder(SPEEDS), lift("lift height", "m")];
    let flash = saved();
    let id = Declaration::default().with(b"parameters").with(b"feeder speed").with(b"value").0;
    let seen = boot(&flash, own(), NOTHING, &[], Some(Action::Forget(id)));
    assert_eq!((seen.values, seen.kept.len()), (vec![120.0, 2.5], 1));
    let seen = boot(&flash, own(), NOTHING, &[], Some(Action::ForgetAll));
    assert_eq!((seen.values, seen.kept.len()), (vec![300.0, 2.5], 0));
    let seen = boot(&flash, own(), NOTHING, &[], None);
    assert_eq!(seen.values, [300.0, 1.0]);
}

#[test]
fn without_what_it_must_have_a_robot_is_not_armed_until_it_is_saved() {
    const MUST: &[&str] = &["arm zero"];
    let own = || vec![Parameter::new("arm zero", "deg", 0.0, [-180.0, 180.0])];
    let unfit = Err(ArmError::Unfit(Unfit::Parameters));
    let flash = new_flash(64);
    let seen = boot(&flash, own(), MUST, &[], None);
    assert!(
        seen.arm == unfit && seen.status.contains("a parameter that it must have is not kept"),
        "{seen:?}"
    );
    // Zero is a value like others here: it is kept though it is that of the table.
    let seen = boot(&flash, own(), MUST, &[], Some(Action::Save));
    assert_eq!((seen.arm, seen.kept.len()), (unfit, 1));
    assert_eq!(boot(&flash, own(), MUST, &[], None).arm, Ok(()));
    // One of another unit is none.
    let other = vec![Parameter::new("arm zero", "rad", 0.0, [-180.0, 180.0])];
    assert_eq!(boot(&flash, other, MUST, &[], None).arm, unfit);
}

#[test]
fn a_robot_runs_with_any_flash_and_says_what_is_wrong() {
    let own = || vec![feeder(SPEEDS), lift("lift height", "m")];
    let mut random = Random::new(9);
    for kind in 0..4 {
        let flash = new_flash(64);
        for cell in flash.0.borrow_mut().sectors.iter_mut().flatten() {
            *cell = match kind {
                0 => Cell::Whole([0; WORD]),
                1 => Cell::Whole([0xFF; WORD]),
                2 => Cell::Torn,
                _ => Cell::Whole(std::array::from_fn(|_| random.bits().to_le_bytes()[0])),
            };
        }
        let seen = boot(&flash, own(), NOTHING, &[(0, 111.0)], Some(Action::Save));
        assert_eq!(
            (seen.values, seen.arm, seen.kept.len()),
            (vec![300.0, 1.0], Ok(()), 1),
            "{kind}"
        );
        assert_eq!(boot(&flash, own(), NOTHING, &[], None).values, [111.0, 1.0], "{kind}");
    }
    // Worn: one sector, and both. The values that are there are used.
    let flash = saved();
    // So much that the other sector is to be erased.
    (0..8).for_each(|_| drop(boot(&flash, own(), NOTHING, &[], Some(Action::Save))));
    flash.0.borrow_mut().worn = [false, true];
    flash.0.borrow_mut().sectors[1].fill(Cell::Torn);
    let seen = boot(&flash, own(), NOTHING, &[(0, 99.0)], Some(Action::Save));
    assert!(
        seen.status.contains("half of the flash of the parameters is worn out"),
        "{}",
        seen.status
    );
    assert_eq!((seen.values, seen.refused, seen.arm), (vec![120.0, 2.5], None, Ok(())));
    let flash = new_flash(64);
    flash.0.borrow_mut().worn = [true; 2];
    flash.0.borrow_mut().sectors.iter_mut().for_each(|sector| sector.fill(Cell::Torn));
    let seen = boot(&flash, own(), NOTHING, &[(0, 99.0)], Some(Action::Save));
    assert!(seen.status.contains("is worn out: nothing can be saved"), "{}", seen.status);
    assert_eq!(seen.refused.as_deref(), Some("the flash of the parameters is worn out"));
    assert_eq!((seen.values, seen.arm), (vec![300.0, 1.0], Ok(())));
    // Damaged: the set before is used, and that is said.
    let flash = saved();
    boot(&flash, own(), NOTHING, &[(0, 99.0)], Some(Action::Save));
    let place =
        |cell: &Cell| matches!(cell, Cell::Whole(word) if word[..4] == 99.0_f32.to_le_bytes());
    for sector in &mut flash.0.borrow_mut().sectors {
        sector.iter_mut().filter(|cell| place(cell)).for_each(|cell| *cell = Cell::Torn);
    }
    let seen = boot(&flash, own(), NOTHING, &[], None);
    assert_eq!(seen.values, [120.0, 2.5]);
    assert!(seen.status.contains("the newest kept parameters are damaged"), "{}", seen.status);
}

/// A cut at every word of every save and every step of every erase at a start: the old set or the new one, whole.
#[test]
fn a_cut_leaves_the_old_set_or_the_new_one() {
    let own = || {
        ["one", "two", "three"]
            .map(|label| Parameter::new(label, "", 0.0, [0.0, 1e6]))
            .into_iter()
            .collect()
    };
    let mut random = Random::new(3);
    let flash = new_flash(32);
    let mut old = vec![0.0; 3];
    let (mut cuts, mut lost) = (0_u32, 0_u32);
    let mut round = 0_u16;
    while cuts < 100_000 {
        round += 1;
        // All three at once, so that a mixture shows.
        let new: Vec<f32> = (0..3).map(|at| f32::from(round) * 3.0 + at as f32).collect();
        let set: Vec<_> = (0..).zip(new.iter().copied()).collect();
        let whole = Handle(Rc::new(RefCell::new(flash.0.borrow().clone())));
        whole.0.borrow_mut().done = 0;
        let seen = boot(&whole, own(), NOTHING, &set, Some(Action::Save));
        assert_eq!((seen.refused, &seen.values), (None, &old));
        let steps = whole.0.borrow().done;
        for at in 1..=steps {
            let cut = Handle(Rc::new(RefCell::new(flash.0.borrow().clone())));
            cut.0.borrow_mut().left = at;
            cut.0.borrow_mut().random = Random::new(random.bits());
            boot(&cut, own(), NOTHING, &set, Some(Action::Save));
            cut.0.borrow_mut().left = u64::MAX;
            let seen = boot(&cut, own(), NOTHING, &[], None);
            assert!(
                seen.values == old || seen.values == new,
                "round {round}, cut at {at}: {seen:?}"
            );
            assert!(
                !seen.status.contains("not used") && !seen.status.contains("damaged"),
                "{}",
                seen.status
            );
            assert_eq!(seen.arm, Ok(()));
            cuts += 1;
            lost += u32::from(seen.values == old);
        }
        *flash.0.borrow_mut() = whole.0.borrow().clone();
        old = new;
    }
    println!("{round} saves, {cuts} cuts, {lost} of them left the old set");
    assert!(lost > cuts / 10 && cuts - lost > 1_000);
}

const BAUD: u32 = 921_600;

/// The team's robot with a PC, which keeps its parameters in a file.
struct Scene<'r> {
    around: Environment,
    tasks: Tasks<'r>,
    client: Client,
}

impl Scene<'_> {
    fn run(&mut self, millis: u64) {
        for _ in 0..millis {
            let now = self.around.world.now();
            self.client.step(now);
            let line = self.around.console.clone().unwrap();
            line.send(&self.client.take_out());
            self.around.run(&mut self.tasks, now + Micros::from_millis(1));
            self.client.hear(&line.take(), self.around.world.now());
        }
    }

    fn ask(&mut self, id: u16) -> Answer {
        for _ in 0..300 {
            if let Some(answer) = self.client.answer(id) {
                return answer;
            }
            self.run(1);
        }
        panic!("no answer");
    }

    /// A parameter, and half of what it is in the table.
    fn half(&self, label: &str, name: &str) -> (u16, f32) {
        let mut all = self.client.parameters();
        let it = all.find(|it| it.label == label && it.name == name).unwrap();
        (it.index, it.initial / 2.0)
    }
}

fn switch_on(file: &std::path::Path, remote: bool, test: impl FnOnce(&mut Scene<'_>, &Shared<'_>)) {
    let ports = Ports::new();
    let shared = Shared::new(&ports);
    let mut motors = Motors::new();
    let mut robot = rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    robot.keep_in(file).unwrap();
    if !remote {
        robot.set_faults(&["remote-lost@1us".parse().unwrap()]).unwrap();
    }
    let around = Environment::new(robot.description(), 1).unwrap().with_console(BAUD);
    let tasks = robot.tasks(&around).unwrap();
    let mut scene = Scene { around, tasks, client: Client::new() };
    scene.run(900);
    assert!(scene.client.is_described());
    test(&mut scene, &shared);
}

#[test]
fn gains_and_own_values_of_a_simulated_robot_outlast_its_run() {
    let folder = Scratch::new("kept");
    let file = folder.join("kept.bin");
    switch_on(&file, false, |scene, shared| {
        assert_eq!(scene.client.kept().unwrap().count(), 0);
        let all = [
            scene.half("wheel front left", "speed_kp"),
            scene.half("wheel front left", "limit"),
            scene.half("lift front left", "angle_kp"),
            scene.half("feeder speed", "value"),
        ];
        let id = scene.client.set(&all).unwrap();
        assert_eq!(scene.ask(id), Answer::Done);
        let id = scene.client.act(Action::Save);
        assert_eq!(scene.ask(id), Answer::Done);
        scene.run(400);
        assert_eq!(scene.client.kept().unwrap().count(), 4);
        // Not saved.
        let id = scene.client.set(&[(all[3].0, 9.0)]).unwrap();
        assert_eq!(scene.ask(id), Answer::Done);
        assert_eq!(shared.own.feeder.get(), 9.0);
    });
    switch_on(&file, false, |scene, shared| {
        assert_eq!(shared.own.feeder.get(), 150.0);
        let tuning = |name: Name| shared.motor(name).tuning().unwrap();
        let [table, wheel] = tuning(Name::ALL[0]);
        assert_eq!([wheel.speed.kp, wheel.limit], [table.speed.kp / 2.0, table.limit / 2.0]);
        let lift = Name::ALL.iter().find(|name| name.label() == "lift front left").unwrap();
        let [table, lift] = tuning(*lift);
        assert_eq!(lift.angle.kp, table.angle.kp / 2.0);
        assert!(status::now(shared).to_string().contains("4 parameters differ from the table"));
        assert!(scene.client.kept().unwrap().all(|it| it.is_used && it.parameter.is_some()));
        let told: Vec<_> = scene.client.kept().unwrap().map(|it| it.text.clone()).collect();
        assert_eq!(told[0], "l front left speed_kp", "the end of the name, for people");
        assert!(
            rc10_cli::live::full_name(scene.client.parameters().next().unwrap())
                .starts_with("wheel")
        );
    });
    // A file of something else is not touched.
    let other = folder.join("notes.txt");
    std::fs::write(&other, "notes").unwrap();
    let mut robot = rc10_cli::Robot::new(rc10_cli::Description::default());
    let error = robot.keep_in(&other).unwrap_err().to_string();
    assert!(error.contains("notes.txt is no file of kept parameters"), "{error}");
    assert_eq!(std::fs::read_to_string(&other).unwrap(), "notes");
}

#[test]
fn an_armed_robot_and_one_that_rolls_save_nothing_and_say_why() {
    let folder = Scratch::new("kept-armed");
    switch_on(&folder.join("kept.bin"), true, |scene, shared| {
        assert_eq!(shared.switch.state(), ArmState::Armed);
        let refused = |scene: &mut Scene<'_>, action, wanted: &str| {
            let id = scene.client.act(action);
            let Answer::Refused(why) = scene.ask(id) else { panic!("not refused") };
            assert_eq!(why, wanted);
        };
        scene.run(600);
        for action in [Action::Save, Action::Forget(1), Action::ForgetAll] {
            refused(scene, action, "only while the robot is disarmed");
        }
        shared.switch.emergency_stop();
        refused(scene, Action::Save, "only while the robot is disarmed");
        shared.switch.reset();
        shared.switch.disarm();
        refused(scene, Action::Save, "only while the robot is at rest: a motor turns");
        scene.run(100);
        assert_eq!(scene.client.kept().unwrap().count(), 0);
    });
}

/// Another shell's command to the robot of a page.
fn shell(port: u16, arguments: &[&str]) -> String {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_rc10"));
    command.env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR")).args(arguments);
    let output = command.arg(format!("--port=sim:{port}")).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    String::from_utf8(text).unwrap()
}

#[test]
fn the_page_and_other_shells_save_and_a_second_run_has_it() {
    let folder = Scratch::new("kept-page");
    let begin = || {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_rc10"));
        command.args(["live", "--sim", "--page", "0", "--fault", "remote-lost@1us", "--kept"]);
        live(command.arg(folder.join("robot.kept")).arg("--out").arg(&*folder))
    };
    let (running, port) = begin();
    assert!(shell(port, &["set", "feeder_speed=222"]).contains("feeder_speed = 222"));
    let told = shell(port, &["params", "--kept"]);
    assert_eq!(told, "nothing is kept\nfeeder_speed = 222  (NOT SAVED, 300 in the table)\n");
    if has_browser() {
        let page = Browser::open(&format!("http://127.0.0.1:{port}/"));
        let save = "document.querySelector('#save')";
        page.until(&format!(
            "return {save}.textContent === 'Save (1 unsaved)' && {save}.title === 'feeder_speed'"
        ));
        page.look(&format!("{save}.click()"));
        page.until(&format!("return {save}.textContent === 'Saved' && {save}.disabled"));
    } else {
        assert!(shell(port, &["save"]).contains("1 parameter is kept"));
    }
    assert_eq!(shell(port, &["params", "--kept"]), "feeder_speed = 222  (300 in the table)\n");
    shell(port, &["set", "feeder_speed=1"]);
    let told = shell(port, &["params", "--kept"]);
    assert_eq!(told, "feeder_speed = 222  (1 now, 300 in the table)\n");
    drop(running);
    let (running, port) = begin();
    assert_eq!(shell(port, &["get", "feeder_speed"]), "222\n");
    let told = shell(port, &["forget", "feeder"]);
    assert!(told.contains("no value `feeder` is kept: rc10 params --kept lists them"), "{told}");
    let told = shell(port, &["forget", "feeder_speed"]);
    assert!(told.starts_with("forgotten: feeder_speed."), "{told}");
    drop(running);
    let (_running, port) = begin();
    assert_eq!(shell(port, &["get", "feeder_speed"]), "300\n");
}
