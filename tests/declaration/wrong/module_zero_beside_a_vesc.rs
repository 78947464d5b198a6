// says: `hip` on bus 1: GO-M8010-6 behind module 0, id 0 cannot share a bus with VESC id 1 (`flywheel`): one takes the other's frame 0x00001001 for a command; set another on one, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Vesc = Entry::new(Bus(1), vesc(1)).with_label("flywheel"),
    B: GoModule = Entry::new(Bus(1), ModuleConfig::new(0, 0)).with_label("hip"),
}

fn main() {}
