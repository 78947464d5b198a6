// says: `left` on bus 1: M3508 id 1: `speed.kp` is NaN, but must be finite and not negative
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1).with_cascade(GAINS)).with_label("left"),
}

const GAINS: Cascade = {
    let mut gains = dji::M3508.cascade;
    gains.speed.kp = f32::NAN;
    gains
};

fn main() {}
