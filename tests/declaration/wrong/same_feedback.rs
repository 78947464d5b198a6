// says: `turret` on bus 1: GM6020 (current mode) id 1 cannot share a bus with M3508 id 5 (`wheel`): both send feedback with identifier 0x205; set another on one, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: Dji = Entry::new("wheel", Bus(1), dji::Config::new(&dji::M3508, 5)),
    B: Dji = Entry::new("turret", Bus(1), dji::Config::new(&dji::GM6020_CURRENT, 1)),
}

fn main() {}
