// says: `shin` on line 1: GO-M8010-6 id 3 cannot share a bus with GO-M8010-6 id 3 (`knee`): both have address 3; set another on one, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: GoM8010 = Entry::new(Line(1), LineConfig::new(3)).with_label("knee"),
    B: GoM8010 = Entry::new(Line(1), LineConfig::new(3)).with_label("shin"),
}

fn main() {}
