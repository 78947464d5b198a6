// says: `flywheel` on bus 1: VESC id 255: `id` is 255, but must be 0 to 254 (255 is every VESC)
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Vesc = Entry::new(Bus(1), vesc(255)).with_label("flywheel"),
}

fn main() {}
