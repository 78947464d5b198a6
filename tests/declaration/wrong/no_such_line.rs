// says: `knee` on line 2: the robot has no such line
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: GoM8010 = Entry::new("knee", Line(2), LineConfig::new(0)),
}

fn main() {}
