// says: `m 4` on bus 1: its feedback can be 2055 us old in a command, more than its 2000 us: set some to send feedback less often, or plug some in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    M1: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)),
    M2: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 2)),
    M3: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 3)),
    M4: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 4)).with_most_age(Micros::new(2000)),
}

fn main() {}
