// says: `left` on bus 1: M3508 id 0: `id` is 0, but must be 1 to 8
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 0)).with_label("left"),
}

fn main() {}
