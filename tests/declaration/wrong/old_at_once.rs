// says: `a` on bus 1: its feedback can be 1650 us old in a command, more than its 0 us: set some to send feedback less often, or plug some in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)).with_most_age(Micros::new(0)),
}

fn main() {}
