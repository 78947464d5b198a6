// says: `arm` on bus 1: DM-J4310 id 17: `MST_ID` is 273, but must be at most 0x7FE, its low byte not that of CAN_ID
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 0x11, 0x111, damiao::Control::Velocity)).with_label("arm"),
}

fn main() {}
