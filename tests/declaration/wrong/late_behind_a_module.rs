// says: `last` on bus 1: its command can take 1580 us to arrive, more than the 1000 us to its next one: set some to send feedback less often, or plug some in elsewhere, or say by `with_most_age` what it may be
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    V1: Vesc = Entry::new(Bus(1), vesc(1)),
    V2: Vesc = Entry::new(Bus(1), vesc(2)),
    Last: GoModule = Entry::new(Bus(1), ModuleConfig::new(3, 0)),
}

fn main() {}
