//! What our codec reads in the data of a module's frames, by the names of the signals.

use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id};
use rc10_motor::unitree::wire::RotorScale;
use rc10_motor::unitree::wire::module::{Content, Reply};

/// The named values of a frame of this message. Commands have no decoder of ours; their data are
/// laid out like those of the answers, so they are read as an answer.
pub fn values(message: &str, frame: &CanFrame) -> Vec<(&'static str, f64)> {
    let content = match message {
        "UNITREE_GO_CONTROL" | "UNITREE_GO_CONTROL_UNANSWERED" => 1,
        "UNITREE_GO_SET_GAINS" => 2,
        _ => return Vec::new(),
    };
    let id = ExtendedId::new(1 << 26 | content << 24).unwrap();
    let data = *frame.all_eight().unwrap();
    let reply = Reply::unpack(&CanFrame::eight_bytes(Id::Extended(id), data)).unwrap();
    match reply.content {
        Content::State { motion, .. } => {
            let motion = RotorScale::OUTPUT.motion(motion);
            vec![
                // Microdegrees are exact; degrees as an f32 are not.
                ("Angle", motion.angle.microdegrees() as f64 * 1e-6),
                ("Speed", motion.speed.get().into()),
                ("Torque", motion.torque.get().into()),
            ]
        }
        Content::Impedance(raw) => {
            let impedance = RotorScale::OUTPUT.impedance(raw);
            vec![("Damping", impedance.damping.into()), ("Stiffness", impedance.stiffness.into())]
        }
        Content::Fault { .. } => Vec::new(),
    }
}
