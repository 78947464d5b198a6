//! Faults: text, safe state, and nothing but clearing them lets it move again.

use rc10_motor::{Fault, Safety};
use rc10_sim::EscFault;

use super::with_cybergear;

/// The fault frame is not taken: the bits of the feedback have their own text.
#[test]
fn feedback_alone_tells_a_fault() {
    with_cybergear(Safety::COAST, |mut pair| {
        pair.esc.set_feedback(false);
        pair.esc.inject(EscFault::OverCurrent);
        pair.bench.wait(5);
        pair.esc.set_feedback(true);
        pair.bench.wait(5);
        let status = pair.status();
        assert_eq!(status.fault, Some(Fault::new(1 << 1, "over-current")));
    });
}
