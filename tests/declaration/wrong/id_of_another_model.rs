// says: `yaw` on bus 2: GM6020 (voltage mode) id 8: `id` is 8, but must be 1 to 7
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(2), dji::Config::new(&dji::GM6020_VOLTAGE, 8)).with_label("yaw"),
}

fn main() {}
