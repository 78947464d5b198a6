// says: `arm` on bus 1: DM-J4310 id 17: `speed.output_limit` is 11, but must be at most the model's largest torque, in N m
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 0x11, 0x31, damiao::Control::Mit(GAINS))).with_label("arm"),
}

const GAINS: Cascade = {
    let mut gains = dji::M3508.cascade;
    gains.speed.output_limit = 11.0;
    gains.angle.output_limit = 100.0;
    gains
};

fn main() {}
