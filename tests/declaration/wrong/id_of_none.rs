// says: `left` on bus 1: M3508 id 0: `id` is 0, but must be 1 to 8
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: Dji = Entry::new("left", Bus(1), dji::Config::new(&dji::M3508, 0)),
}

fn main() {}
