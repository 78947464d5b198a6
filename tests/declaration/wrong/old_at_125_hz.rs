// says: `slow` on bus 1: its feedback can be 8650 us old in a command, more than its 8000 us: set some to send feedback less often, or plug some in elsewhere
use wrong_robots::*;

declare! {
    enum Name;
    struct Motors;
    Slow: Dji = Entry::new(Bus(1), dji::Config::new(&dji::M3508, 1).with_feedback_rate(dji::FeedbackRate::Hz125)).with_most_age(Micros::new(8000)),
}

fn main() {}
