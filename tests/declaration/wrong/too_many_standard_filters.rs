// says: `e` on bus 1: with it the motors of the bus need 40 receive filters of 32: have it send fewer kinds of frames, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Own = Entry::new(Bus(1), own(1, 8)),
    B: Own = Entry::new(Bus(1), own(2, 8)),
    C: Own = Entry::new(Bus(1), own(3, 8)),
    D: Own = Entry::new(Bus(1), own(4, 8)),
    E: Own = Entry::new(Bus(1), own(5, 8)),
}

const fn own(raw: u16, patterns: u16) -> OtherDevice {
    let mut ids = CanIds::new();
    let mut number = 0;
    while number < patterns {
        let id = IdPattern::standard(raw << 4 | number);
        ids = ids.receives(Frames::new(id, 8, Rate::Rare));
        number += 1;
    }
    OtherDevice { name: MotorName { model: "own", id: raw }, ids, direction: Direction::Forward }
}

fn main() {}
