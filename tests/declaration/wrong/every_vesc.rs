// says: `flywheel` on bus 1: VESC id 255: `id` is 255, but must be 0 to 254 (255 is every VESC)
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: Vesc = Entry::new("flywheel", Bus(1), vesc(255)),
}

fn main() {}
