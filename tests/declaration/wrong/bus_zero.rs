// says: `left` on bus 0: the robot has no such bus
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: Dji = Entry::new("left", Bus(0), dji::Config::new(&dji::M3508, 1)),
}

fn main() {}
