// says: `g` on bus 1: with it the motors of the bus need 106 % of it typically, more than 100 %: set some to send feedback less often, or plug some in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0, 100.0];
    lines: 1;
    A: Dji = Entry::new("a", Bus(1), dji::Config::new(&dji::M3508, 1)),
    B: Dji = Entry::new("b", Bus(1), dji::Config::new(&dji::M3508, 2)),
    C: Dji = Entry::new("c", Bus(1), dji::Config::new(&dji::M3508, 3)),
    D: Dji = Entry::new("d", Bus(1), dji::Config::new(&dji::M3508, 4)),
    E: Dji = Entry::new("e", Bus(1), dji::Config::new(&dji::M3508, 5)),
    F: Dji = Entry::new("f", Bus(1), dji::Config::new(&dji::M3508, 6)),
    G: Dji = Entry::new("g", Bus(1), dji::Config::new(&dji::M3508, 7)),
    H: Dji = Entry::new("h", Bus(1), dji::Config::new(&dji::M3508, 8)),
}

fn main() {}
