// says: `turret` on bus 1: GM6020 (current mode) id 1 cannot share a bus with M3508 id 5 (`wheel`): both send feedback with identifier 0x205; set another on one, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 5)).with_label("wheel"),
    B: Dji = Entry::new(Bus(1), dji::Config::new(&dji::GM6020_CURRENT, 1)).with_label("turret"),
}

fn main() {}
