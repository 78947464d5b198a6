// says: `left` on bus 2: another motor has this label: give it its own
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)).with_label("left"),
    B: Dji = Entry::new(Bus(2), dji::Config::new(&dji::M3508, 1)).with_label("left"),
}

fn main() {}
