// says: `left` on bus 4: the robot has no such bus
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(4), dji::Config::new(&dji::M3508, 1)).with_label("left"),
}

fn main() {}
