//! What is chosen at a high rate is whole, and as many signals are had as was said.

use super::*;
use rc10_cli::live::{Line, watch_at};

/// Watches as many signals of motors as the line carries every `period` ms, for some seconds: how many, and the
/// longest gaps of all groups, in ms.
fn gaps(baud: u32, period: u16, more: usize) -> (usize, [u64; 4], rc10_cli::live::Losses) {
    let mut outcome = None;
    with_scene(baud, |scene, _| {
        scene.run(1500);
        assert!(scene.client.is_described());
        let (topics, left) = plan(&scene.client);
        assert!(left.is_empty());
        let line = Line::new(baud, &topics);
        let most = line.most(period) + more;
        let paces = line.beside(most - more, period).unwrap();
        let of_motors = scene.client.signals().filter(|(_, it)| it.folder == "motors");
        let of_motors =
            of_motors.filter(|(_, it)| ["target", "speed", "current"].contains(&it.name.as_str()));
        let chosen: Vec<u16> = of_motors.map(|(index, _)| index).take(most).collect();
        scene.client.set_line(line.bytes);
        scene.client.watch(0, period, chosen.iter().copied());
        watch_at(&mut scene.client, &topics, paces);
        scene.run(500);
        let _ = scene.client.take_samples();
        let before = scene.client.losses();
        scene.run(4000);
        let samples = scene.client.take_samples();
        let gaps = [0, 1, 2, 3].map(|group| {
            let times: Vec<u64> =
                samples.iter().filter(|it| it.group == group).map(|it| it.at.get()).collect();
            times.windows(2).map(|two| (two[1] - two[0] + 500) / 1000).max().unwrap_or(u64::MAX)
        });
        let count = samples.iter().filter(|it| it.group == 0).count();
        println!(
            "{baud} baud: {} signals every {period} ms: {count} samples in 4 s, all else every {paces:?} ms; longest gaps {gaps:?} ms",
            chosen.len()
        );
        let now = scene.client.losses();
        let losses = rc10_cli::live::Losses {
            skipped: now.skipped - before.skipped,
            samples: now.samples - before.samples,
            ..now
        };
        outcome = Some((chosen.len(), gaps, losses));
    });
    outcome.unwrap()
}

#[test]
fn what_is_chosen_is_whole_beside_all_else() {
    for (baud, period, least) in
        [(921_600, 1, 12), (921_600, 2, 20), (921_600, 5, 20), (2_000_000, 1, 30)]
    {
        let (count, [first, rest @ ..], losses) = gaps(baud, period, 0);
        assert!(count >= least, "{count}");
        assert_eq!(first, u64::from(period));
        assert!(rest.iter().all(|gap| *gap <= 450), "{rest:?}");
        assert_eq!(losses, <_>::default());
    }
}
