// says: `left` on line 1: M3508 id 1 has CAN only: plug it into a bus
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: Dji = Entry::new("left", Line(1), dji::Config::new(&dji::M3508, 1)),
}

fn main() {}
