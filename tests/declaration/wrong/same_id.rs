// says: `right` on bus 1: M3508 id 1 cannot share a bus with M3508 id 1 (`left`): both send feedback with identifier 0x201; set another on one, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)).with_label("left"),
    B: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)).with_label("right"),
}

fn main() {}
