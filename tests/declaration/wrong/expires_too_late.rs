// says: `left` on bus 1: M3508 id 1: a command must expire after 1 to 1000000 us, not 2000000
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)).with_label("left")
        .with_safety(Safety { command_expiry: Micros::from_millis(2000), ..Safety::COAST }),
}

fn main() {}
