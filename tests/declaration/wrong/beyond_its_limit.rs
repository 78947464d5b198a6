// says: `c` on bus 1: with it the motors of the bus need 47 % of it typically, more than 40 %: set some to send feedback less often, or plug some in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [40.0];
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)),
    B: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 2)),
    C: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 3)),
}

fn main() {}
