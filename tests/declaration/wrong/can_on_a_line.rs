// says: `left` on line 1: M3508 id 1 has CAN only: plug it into a bus
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Line(1), dji::Config::new(&dji::M3508, 1)).with_label("left"),
}

fn main() {}
