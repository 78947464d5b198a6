// says: `m 6` on bus 1: its feedback can be of any age in a command, more than its 9000 us: set some to send feedback less often, or plug some in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    M1: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)),
    M2: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 2)),
    M3: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 3)),
    M4: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 4)),
    M5: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 5)),
    M6: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 6)).with_most_age(Micros::new(9000)),
}

fn main() {}
