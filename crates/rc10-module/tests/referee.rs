//! What a simulated referee says is heard, in both versions of 2026 and in one that appends; silence is silence.

use std::cell::RefCell;
use std::pin::pin;

use rc10_message::Latest;
use rc10_module::referee::{Power, Referee, Robot, SILENCE, Said, Tally};
use rc10_module::{Reception, listen};
use rc10_sim::referee::{Referee as Simulated, Season};
use rc10_sim::{Serial, World};
use rc10_time::Micros;

/// What a robot's task knows.
#[derive(Default)]
struct Known {
    robot: Latest<Robot, 1>,
    power: Latest<Power, 1>,
    tally: RefCell<Tally>,
    reception: Reception,
}

/// A task listens to a referee; `look` is called each 10 ms until a time.
fn with(season: Season, millis: u64, mut look: impl FnMut(&Known, &Serial, Micros)) {
    let (mut world, known) = (World::new(1), Known::default());
    let link = world.add_serial(Simulated::SERIAL, Simulated::new(60, season));
    let mut task = pin!(listen(link.port(), Referee, &known.reception, |packet, at| {
        match known.tally.borrow_mut().hear(&packet) {
            Said::Robot(robot) => known.robot.set(robot, at),
            Said::Power(power) => known.power.set(power, at),
            _ => {}
        }
    }));
    for at in (0..=millis).step_by(10) {
        let _ = world.run(task.as_mut(), Micros::from_millis(at));
        look(&known, &link, world.now());
    }
    assert_eq!((known.tally.borrow().short, known.tally.borrow().missing), (0, 0));
    assert_eq!(known.reception.read().skipped, 0);
}

#[test]
fn every_season_says_limit_and_buffer() {
    for season in [Season::Spring2026, Season::June2026, Season::Later(1), Season::Later(80)] {
        let mut least = u16::MAX;
        with(season, 3000, |known, link, now| {
            // 100 W of 60: 4 J less in 100 ms.
            let _ = link.with(|it: &mut Simulated| {
                it.power = if now < Micros::from_millis(1000) { 100.0 } else { 50.0 }
            });
            let Some(power) = known.power.newer_than(SILENCE, now) else { return };
            least = least.min(power.buffer);
            let robot = known.robot.newer_than(SILENCE, now).unwrap();
            assert_eq!((robot.id, robot.power_limit, robot.supplied), (3, 60, [true; 3]));
            assert_eq!(robot.speed_limit.is_some(), season != Season::Spring2026, "{season:?}");
        });
        assert_eq!(least, 60 - 10 * 4, "{season:?}");
    }
}

#[test]
fn three_missing_frames_are_silence_and_the_next_one_ends_it() {
    let mut unknown = 0;
    with(Season::June2026, 2000, |known, link, now| {
        let is_silent = (Micros::from_millis(500)..Micros::from_millis(1000)).contains(&now);
        let _ = link.with(|it: &mut Simulated| it.silent = is_silent);
        let is_known = known.power.newer_than(SILENCE, now).is_some();
        if now > Micros::from_millis(150) && !is_known {
            unknown += 1;
            assert!(
                (Micros::from_millis(790)..Micros::from_millis(1120)).contains(&now),
                "{now:?}"
            );
        }
    });
    assert!((20..=32).contains(&unknown), "{unknown}");
}

#[test]
fn an_empty_buffer_costs_health() {
    let mut health = 200;
    with(Season::Spring2026, 2000, |known, link, now| {
        let _ = link.with(|it: &mut Simulated| it.power = 260.0);
        health = known.robot.newer_than(SILENCE, now).map_or(health, |it| it.health[0]);
    });
    // Three times 20 J are there.
    assert_eq!(health, 0);
}
