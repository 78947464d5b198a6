// says: `yaw` on bus 2: GM6020 (voltage mode) id 8: `id` is 8, but must be 1 to 7
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [100.0; 2];
    lines: 1;
    A: Dji = Entry::new("yaw", Bus(2), dji::Config::new(&dji::GM6020_VOLTAGE, 8)),
}

fn main() {}
