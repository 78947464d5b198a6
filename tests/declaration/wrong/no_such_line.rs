// says: `knee` on line 3: the robot has no such line
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: GoM8010 = Entry::new(Line(3), LineConfig::new(0)).with_label("knee"),
}

fn main() {}
