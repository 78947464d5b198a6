// says: `a` on bus 1: its feedback can be 5990 us old in a command, more than its 5000 us: set some to send feedback less often, or plug some in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Vesc = Entry::new(Bus(1), vesc(1)).with_most_age(Micros::new(5000)),
}

fn main() {}
