// says: `b` on bus 1: own id 2 finds no room in the bus's receive table
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Own = Entry::new(Bus(1), own(1, 5, 0x1FFF_FF00)),
    B: Own = Entry::new(Bus(1), own(2, 5, 0x1FFF_FF00)),
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
