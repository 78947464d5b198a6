// says: `knee` on line 2: the robot has no such line
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: GoM8010 = Entry::new(Line(2), LineConfig::new(0)).with_label("knee"),
}

fn main() {}
