//! The following board: its wheel turns as the leading one says.

use rc10::io::{Read, Write};
use rc10::prelude::*;
use rc10::tasks::boards::{Peer, Role};

use crate::{BAUD, BOARDS, Gaps, STATE, WISH};

rc10::robot! {
    board Follower;
    own Own;
    serial leader: uart_10 at BAUD, speak;
    motors {
        Wheel: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
    }
}

rc10::live! {
    /// What the tasks share.
    pub struct Own {
        fields {
            /// The other board.
            peer: Peer;
        }
    }
}

async fn speak(shared: &Shared<'_>, reception: &Reception, port: impl Read + Write) -> ! {
    shared.own.peer.run_over(shared, &BOARDS, Role::Follows, reception, port).await
}

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        let (mut every, mut ticks, mut gaps) = (Every::millis(1), 0_u32, Gaps::default());
        let (mut count, mut wrong) = (0.0, 0.0);
        loop {
            let now = every.next().await.now;
            let wish = shared.own.peer.newer_than(&WISH, Micros::from_millis(50), now);
            if let Some([speed, number, sum]) = wish {
                wrong += f32::from(u8::from(sum != speed + number));
                gaps.see(number);
                // Without a wish it is not commanded: 50 ms later it is safe.
                shared.command(Name::Wheel, Target::Speed(Rpm::new(speed)));
            }
            ticks += 1;
            if ticks.is_multiple_of(5) {
                count += 1.0;
                let lost = shared.own.peer.lost(&WISH) as f32;
                let _ = shared.own.peer.tell(&STATE, &[count, 2.0 * count, wrong, gaps.gaps, lost]);
            }
        }
    }
}
