// says: `arm` on bus 1: DM-J4310 id 1 cannot share a bus with M3508 id 1 (`left`): one takes the other's frame 0x201 for a command; set another on one, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)).with_label("left"),
    B: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 0x01, 0x31, damiao::Control::Velocity)).with_label("arm"),
}

fn main() {}
