// says: `i` on bus 1: M3508 id 1 finds no room: the bus holds 8 motors
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    buses: [200.0];
    A: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 17, 49, damiao::Control::Velocity)),
    B: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 18, 50, damiao::Control::Velocity)),
    C: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 19, 51, damiao::Control::Velocity)),
    D: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 20, 52, damiao::Control::Velocity)),
    E: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 21, 53, damiao::Control::Velocity)),
    F: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 22, 54, damiao::Control::Velocity)),
    G: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 23, 55, damiao::Control::Velocity)),
    H: Damiao = Entry::new(Bus(1), damiao::Config::new(damiao::models::J4310, 24, 56, damiao::Control::Velocity)),
    I: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1)),
}

fn main() {}
