// says: `g` on bus 1: with it the motors of the bus need 106 % of it typically, more than 100 %: set some to send feedback less often, or plug some in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0, 100.0];
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)),
    B: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 2)),
    C: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 3)),
    D: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 4)),
    E: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 5)),
    F: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 6)),
    G: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 7)),
    H: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 8)),
}

fn main() {}
