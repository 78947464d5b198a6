// says: `b` on bus 3: its feedback can be 1650 us old in a command, more than its 1500 us: set some to send feedback less often, or plug some in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)),
    B: Dji = Entry::new(Bus(3), dji::Config::new(&dji::M3508, 1)).with_most_age(Micros::new(1500)),
}

fn main() {}
