// says: `knee` on bus 1: GO-M8010-6 id 3 has RS-485 only: plug it into a line
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: GoM8010 = Entry::new(Bus(1), LineConfig::new(3)).with_label("knee"),
}

fn main() {}
