// says: `a` on bus 1: its command can take 1140 us to arrive, more than the 1000 us to its next one: set some to send feedback less often, or plug some in elsewhere, or say by `with_most_age` what it may be
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Own = Entry::new(Bus(1), own()),
}

/// Seven frames of 500 Hz that go before its command: the bus is not full, and yet it comes too late.
const fn own() -> OtherDevice {
    let mut ids = CanIds::new();
    let mut number = 1;
    while number <= 7 {
        ids = ids.receives(Frames::new(IdPattern::standard(number), 8, Rate::Hz(500)));
        number += 1;
    }
    ids = ids.transmits(Frames::new(IdPattern::standard(0x700), 8, Rate::EveryTick));
    OtherDevice { name: MotorName { model: "own", id: 1 }, ids, direction: Direction::Forward }
}

fn main() {}
