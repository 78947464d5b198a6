// says: `left` on bus 2: another motor has this label: give it its own
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: Dji = Entry::new("left", Bus(1), dji::Config::new(&dji::M3508, 1)),
    B: Dji = Entry::new("left", Bus(2), dji::Config::new(&dji::M3508, 1)),
}

fn main() {}
