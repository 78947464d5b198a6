// says: `a` on bus 1: own id 1 declares more than 8 received, 8 transmitted or 2 listened-to patterns
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Own = Entry::new(Bus(1), own(1, 9, 0x1FFF_FFFF)),
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
