// says: `hip` on bus 1: GO-M8010-6 behind module 0, id 0 cannot share a bus with VESC id 1 (`flywheel`): one takes the other's frame 0x00001001 for a command; set another on one, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: Vesc = Entry::new("flywheel", Bus(1), vesc(1)),
    B: GoModule = Entry::new("hip", Bus(1), ModuleConfig::new(0, 0)),
}

fn main() {}
