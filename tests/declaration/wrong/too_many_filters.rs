// says: `c` on bus 1: with it the motors of the bus need 24 receive filters of 16: have it send fewer kinds of frames, or plug it in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Own = Entry::new(Bus(1), own(1, 8, 0x1FFF_FFFF)),
    B: Own = Entry::new(Bus(1), own(2, 8, 0x1FFF_FFFF)),
    C: Own = Entry::new(Bus(1), own(3, 8, 0x1FFF_FFFF)),
}

const fn own(raw: u16, patterns: u32, mask: u32) -> OtherDevice {
    let mut ids = CanIds::new();
    let mut number = 0;
    while number < patterns {
        let id = IdPattern::extended((raw as u32) << 12 | number << 8).under(mask);
        ids = ids.receives(Frames::new(id, 8, Rate::Rare));
        number += 1;
    }
    OtherDevice { name: MotorName { model: "own", id: raw }, ids, direction: Direction::Forward }
}

fn main() {}
