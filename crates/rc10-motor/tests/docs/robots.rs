// Two robots for the examples in the docs.

pub mod ours {
    use rc10_motor::dji::{Config, Dji, M3508};
    rc10_motor::motors! {
        pub enum Name;
        pub struct Motors;
        Wheel: Dji = rc10_motor::Entry::new(rc10_motor::Place::Bus(1), Config::new(&M3508, 1)),
    }
}

pub mod theirs {
    use rc10_motor::dji::{Config, Dji, M3508};
    rc10_motor::motors! {
        pub enum Name;
        pub struct Motors;
        Lift: Dji = rc10_motor::Entry::new(rc10_motor::Place::Bus(1), Config::new(&M3508, 1)),
    }
}
