use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    A: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1).with_feedback_rate(dji::FeedbackRate::Hz500)),
    B: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 2).with_feedback_rate(dji::FeedbackRate::Hz500)),
    C: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 3).with_feedback_rate(dji::FeedbackRate::Hz500)),
    D: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 4).with_feedback_rate(dji::FeedbackRate::Hz500)),
    E: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 5).with_feedback_rate(dji::FeedbackRate::Hz500)),
    F: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 6).with_feedback_rate(dji::FeedbackRate::Hz500)),
    G: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 7).with_feedback_rate(dji::FeedbackRate::Hz500)),
    H: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 8).with_feedback_rate(dji::FeedbackRate::Hz500)),
    I: Own = Entry::new(Bus(2), own(1, 8, 0x1FFF_FFFF)),
    J: Own = Entry::new(Bus(2), own(2, 8, 0x1FFF_FFFF)),
    L0: GoM8010 = Entry::new(Line(1), LineConfig::new(0)).with_label("leg 0"),
    L1: GoM8010 = Entry::new(Line(1), LineConfig::new(1)).with_label("leg 1"),
    L2: GoM8010 = Entry::new(Line(1), LineConfig::new(2)).with_label("leg 2"),
    L3: GoM8010 = Entry::new(Line(1), LineConfig::new(3)).with_label("leg 3"),
    L4: GoM8010 = Entry::new(Line(1), LineConfig::new(4)).with_label("leg 4"),
    L5: GoM8010 = Entry::new(Line(1), LineConfig::new(5)).with_label("leg 5"),
    L6: GoM8010 = Entry::new(Line(1), LineConfig::new(6)).with_label("leg 6"),
    L7: GoM8010 = Entry::new(Line(1), LineConfig::new(7)).with_label("leg 7"),
    L8: GoM8010 = Entry::new(Line(1), LineConfig::new(8)).with_label("leg 8"),
    L9: GoM8010 = Entry::new(Line(1), LineConfig::new(9)).with_label("leg 9"),
    L10: GoM8010 = Entry::new(Line(1), LineConfig::new(10)).with_label("leg 10"),
    L11: GoM8010 = Entry::new(Line(1), LineConfig::new(11)).with_label("leg 11"),
    L12: GoM8010 = Entry::new(Line(1), LineConfig::new(12)).with_label("leg 12"),
    L13: GoM8010 = Entry::new(Line(1), LineConfig::new(13)).with_label("leg 13"),
    L14: GoM8010 = Entry::new(Line(1), LineConfig::new(14)).with_label("leg 14"),
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
