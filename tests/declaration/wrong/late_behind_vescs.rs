// says: `last` on bus 1: its command can take 2130 us to arrive, more than the 1000 us to its next one: set some to send feedback less often, or plug some in elsewhere, or say by `with_most_age` what it may be
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    V1: Vesc = Entry::new(Bus(1), vesc(1)),
    V2: Vesc = Entry::new(Bus(1), vesc(2)),
    V3: Vesc = Entry::new(Bus(1), vesc(3)),
    Last: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)),
}

fn main() {}
