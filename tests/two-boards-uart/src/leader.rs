//! The leading board: right switch arms, left switch down stops, left stick turns the wheel of the other board.

use rc10::io::{Read, Write};
use rc10::join::join;
use rc10::prelude::*;
use rc10::tasks::boards::{Peer, Role};

use crate::noise::{Noise, Noisy};
use crate::{BAUD, BOARDS, Gaps, STATE, WISH};

rc10::robot! {
    board Leader;
    own Own;
    serial follower: uart_7 at BAUD, speak;
    motors {
        Yaw: Dji = Entry::new(Bus(1), Config::new(&GM6020_CURRENT, 1)),
    }
}

rc10::live! {
    /// What the tasks share.
    pub struct Own {
        signals {
            wrong: "wrong states", "";
            gaps: "states not heard", "";
        }
        fields {
            /// The other board.
            peer: Peer;
            /// On the line.
            noise: Noise;
        }
    }
}

async fn speak(shared: &Shared<'_>, reception: &Reception, port: impl Read + Write) -> ! {
    let port = Noisy::new(port, &shared.own.noise);
    shared.own.peer.run_over(shared, &BOARDS, Role::Leads, reception, port).await
}

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        join(drive(shared), check(shared)).await.0
    }
}

async fn drive(shared: &Shared<'_>) -> ! {
    let (mut arming, mut every, mut count) = (Arming::of::<Robot>(), Every::millis(10), 0.0);
    loop {
        every.next().await;
        let remote = shared.obey(&mut arming);
        let speed = remote.map_or(0.0, |remote| 100.0 * remote.left.y);
        if remote.is_some() {
            shared.command(Name::Yaw, Target::Speed(Rpm::new(speed)));
        }
        count += 1.0;
        let _ = shared.own.peer.tell(&WISH, &[speed, count, speed + count]);
    }
}

async fn check(shared: &Shared<'_>) -> ! {
    let (mut every, mut gaps, mut wrong) = (Every::millis(1), Gaps::default(), 0.0);
    loop {
        every.next().await;
        let Some(state) = shared.own.peer.read(&STATE) else { continue };
        let [count, twice, ..] = state.value;
        wrong += f32::from(u8::from(twice != 2.0 * count));
        gaps.see(count);
        shared.own.wrong.set(wrong);
        shared.own.gaps.set(gaps.gaps);
    }
}
