// says: `right` on bus 1: M3508 id 1 cannot share a bus with M3508 id 1 (`left`): both send feedback with identifier 0x201; set another on one, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: Dji = Entry::new("left", Bus(1), dji::Config::new(&dji::M3508, 1)),
    B: Dji = Entry::new("right", Bus(1), dji::Config::new(&dji::M3508, 1)),
}

fn main() {}
