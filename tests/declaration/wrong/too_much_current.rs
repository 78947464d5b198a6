// says: `left` on bus 1: M3508 id 1: `speed.output_limit` is 25, but must be at most the model's largest current, in A
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1).with_cascade(GAINS)).with_label("left"),
}

const GAINS: Cascade = {
    let mut gains = dji::M3508.cascade;
    gains.speed.output_limit = 25.0;
    gains
};

fn main() {}
