//! Two wheels, driven by a remote control.

use rc10::prelude::*;

rc10::robot! {
    motors {
        Left: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
        Right: Dji = Entry::new(Bus(1), Config::new(&M3508, 2).with_direction(Direction::Reversed)),
    }
}

const FULL: f32 = 200.0; // rpm of a wheel, with a stick at its end

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        let (mut arming, mut every) = (Arming::of::<Self>(), Every::millis(10));
        loop {
            every.next().await;
            // Without a remote nothing is commanded: 50 ms later both motors coast.
            let Some(remote) = shared.obey(&mut arming) else { continue };
            let (ahead, turn) = (remote.left.y, remote.right.x);
            shared.command(Name::Left, Target::Speed(Rpm::new(FULL * (ahead + turn))));
            shared.command(Name::Right, Target::Speed(Rpm::new(FULL * (ahead - turn))));
        }
    }
}

fn main() -> std::process::ExitCode {
    rc10::sim::main_of::<Robot>()
}

// So far the READMEs. In simulation it also needs a load on each shaft, and hands at the remote.
mod simulation {
    use rc10::sim::prelude::*;

    impl Simulated for super::Robot {
        fn description() -> Description {
            Description {
                remote: Some(RemoteControl::of::<Self>(&HANDS, None)),
                // A robot of 10 kg on wheels of 76 mm radius: 0.029 kg m² for each.
                ..Description::of_program::<Self>(|_| Plant::inertia(0.029))
            }
        }
    }

    const HANDS: [ScriptLine; 5] = [
        ScriptLine::new(0, "switches down", Controls { right_switch: Switch::Down, ..STILL }),
        ScriptLine::new(100, "arm", STILL),
        ScriptLine::new(200, "forward", Controls { left: Stick { x: 0.0, y: 0.5 }, ..STILL }),
        ScriptLine::new(1000, "turn right", Controls { right: Stick { x: 0.5, y: 0.0 }, ..STILL }),
        ScriptLine::new(1800, "stand", STILL),
    ];

    /// Sticks let go.
    const STILL: Controls = Controls::REST;
}
