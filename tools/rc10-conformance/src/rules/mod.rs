//! The rules, one function each. What a rule needs a motor to do first is another rule's business:
//! where the motor does not, the rule says that it could not be tried. What others follow from comes
//! before them.

mod can_ids;
mod declared;
mod faults;
mod frames;
mod impedance;
mod limits;
mod link;
mod requests;
mod returning;
mod sharing;
mod stopping;
mod targets;
mod zero;

use crate::case::Case;
use crate::outcome::Findings;

/// A rule that every motor keeps.
pub struct Rule {
    /// Name in a report.
    pub name: &'static str,
    /// Text of the rule.
    pub text: &'static str,
    /// Tries it; nothing, if it is about frames and the motor has none.
    pub(crate) check: fn(&Case<'_>, &mut Findings),
}

const fn rule(name: &'static str, text: &'static str, check: fn(&Case<'_>, &mut Findings)) -> Rule {
    Rule { name, text, check }
}

/// All rules, in the order in which they are tried.
pub const RULES: &[Rule] = &[
    rule(
        "every-target-is-tried",
        "The declaration tries every kind of target that the motor takes, and no other; \
         what the motor cannot do has a reason.",
        declared::every_target_is_tried,
    ),
    rule(
        "ids-are-valid",
        "Its identifiers include feedback that comes regularly and a command; no frame is longer \
         than 8 bytes, and owned bytes and guards lie within their frames.",
        can_ids::ids_are_valid,
    ),
    rule(
        "ids-are-constant",
        "Its name and its identifiers are the same whatever happened to the motor.",
        can_ids::ids_are_constant,
    ),
    rule(
        "frames-are-declared",
        "Every frame it sends is declared: identifier, length, its own bytes or guard.",
        can_ids::frames_are_declared,
    ),
    rule(
        "streams-are-own",
        "The stream that a frame names is one of the motor's own identifiers.",
        can_ids::streams_are_own,
    ),
    rule("few-frames-a-tick", "It sends at most two frames in a tick.", can_ids::few_frames_a_tick),
    rule(
        "load-is-as-declared",
        "While it runs, frames come and go as often as declared, and none comes that is not \
         declared.",
        can_ids::load_is_as_declared,
    ),
    rule(
        "supports-is-constant",
        "Which kinds of target it takes never changes, and coasting is one.",
        targets::supports_is_constant,
    ),
    rule(
        "refuses-targets",
        "A target that it does not support, or that is not finite, is refused for that reason, \
         and the old one stays.",
        targets::refuses_targets,
    ),
    rule(
        "feedback-is-true",
        "Speed and angle in the feedback are those of the shaft, driven or turned by hand; the angle \
         lies in 0 ..< 360.",
        targets::feedback_is_true,
    ),
    rule(
        "gets-going",
        "Armed and commanded it turns against its load, and says that it is ready.",
        targets::gets_going,
    ),
    rule(
        "follows",
        "It reaches every target of the declaration, as closely and as fast as declared.",
        targets::follows,
    ),
    rule(
        "follows-motions",
        "A motion that is commanded every 10 ms is followed evenly and without a lag.",
        targets::follows_motions,
    ),
    rule(
        "strange-steps",
        "A time step of zero, of seconds, backwards or NaN makes it neither panic nor leap.",
        targets::strange_steps,
    ),
    rule(
        "deterministic",
        "The same things happening to it give the same frames, to the bit.",
        targets::deterministic,
    ),
    rule(
        "foreign-frames",
        "Frames with identifiers of others, and remote requests, are `NotMine` and change nothing; \
         nor do frames whose guard says that they are another's.",
        frames::foreign_frames,
    ),
    rule(
        "wrong-lengths",
        "A frame of its own with a wrong length is an error and changes nothing.",
        frames::wrong_lengths,
    ),
    rule(
        "any-content",
        "Any content of a frame of its own leaves its feedback finite and its angles in agreement, \
         and a refused frame changes nothing.",
        frames::any_content,
    ),
    rule("feedback-at", "`Feedback::at` is when the frame arrived.", frames::feedback_at),
    rule(
        "silent-before-feedback",
        "Before its first feedback it drives nothing, for any target.",
        stopping::silent_before_feedback,
    ),
    rule(
        "off-until-armed",
        "Commanded while the robot was never armed, it drives and enables nothing.",
        stopping::off_until_armed,
    ),
    rule(
        "disarm",
        "Disarmed it has no torque any more and its device is disabled; armed again it runs.",
        stopping::disarm,
    ),
    rule(
        "emergency-stop",
        "The emergency stop takes it to its safe state with the next tick, and coasting it has no \
         torque.",
        stopping::emergency_stop,
    ),
    rule(
        "expiry",
        "When commands stop coming it goes to its safe state, and coasting it has no torque.",
        stopping::expiry,
    ),
    rule("lost", "When its feedback stops coming it coasts, for any target.", stopping::lost),
    rule(
        "link-timeout",
        "Silent for less than its time-out it runs on as before; for longer it is lost, coasts, and \
         comes back softly.",
        link::link_timeout,
    ),
    rule(
        "coast-frames-are-fixed",
        "The frames for a panic handler are always the same, also before any feedback.",
        stopping::coast_frames_are_fixed,
    ),
    rule(
        "coast-frames-stop",
        "These frames, sent once, leave the device without torque in any state.",
        stopping::coast_frames_stop,
    ),
    rule("brakes", "Braking, it slows down, also against a load that drives it.", stopping::brakes),
    rule("holds", "Holding, it keeps its angle against a load.", stopping::holds),
    rule("back-on-the-wire", "After a cut it follows again, softly.", returning::back_on_the_wire),
    rule(
        "restart",
        "A device that was restarted is enabled again and follows, softly; also if it was away \
         for so short a time that its link was never lost. Turns that it may have missed are told.",
        returning::restart,
    ),
    rule(
        "set-zero",
        "After `SetZero` its angles are zero and nothing moves; before any feedback it is refused.",
        requests::set_zero,
    ),
    rule(
        "zero-while-driven",
        "Driven, it has no new zero unless a task means it; and then no number given before counts on \
         the new scale.",
        zero::zero_while_driven,
    ),
    rule(
        "zero-moves-nothing",
        "A new zero moves nothing while it turns, seeks, holds, brakes or obeys an impedance; the \
         same number commanded again lies elsewhere, and coasting is coasting.",
        zero::zero_moves_nothing,
    ),
    rule(
        "target-on-new-scale",
        "After a new zero its target is the same place or law, on the new scale.",
        zero::target_is_on_the_new_scale,
    ),
    rule(
        "impedance-law",
        "An impedance gives the torque of its law: stiffness, damping, speed and torque, each with \
         its unit and sign.",
        impedance::obeys_the_law,
    ),
    rule(
        "soft-impedance",
        "From rest an impedance grows to its law in 20 ms, by one factor for all of it: its \
         equilibrium stays.",
        impedance::starts_softly,
    ),
    rule(
        "limits-bound-efforts",
        "A lowered limit bounds every torque and current that is asked for, braking too; without one \
         none is above its largest torque.",
        limits::limits_bound_efforts,
    ),
    rule(
        "requests-are-checked",
        "Limits and gains that are negative or not finite are refused.",
        requests::requests_are_checked,
    ),
    rule(
        "set-up-while-disarmed",
        "While the robot is armed, nothing is stored or written in the device.",
        requests::set_up_while_disarmed,
    ),
    rule(
        "pending-is-answered",
        "A request that is pending keeps others off, and is answered once; by a time-out when the \
         device is silent.",
        requests::pending_is_answered,
    ),
    rule(
        "clear-fault-moves-nothing",
        "`ClearFault` without a fault neither drives a motor that is off nor stops one that runs.",
        requests::clear_fault_moves_nothing,
    ),
    rule(
        "fault-is-told",
        "A fault of the device is told in words, and takes the motor to its safe state without \
         torque.",
        faults::fault_is_told,
    ),
    rule(
        "fault-waits",
        "After a fault its device stays disabled until `ClearFault`, also if it is restarted; then it \
         runs again.",
        faults::fault_waits,
    ),
    rule(
        "same-id-is-refused",
        "Two of the same identifier are refused on one bus.",
        sharing::same_id_is_refused,
    ),
    rule(
        "two-share-a-bus",
        "Two of different identifiers share a bus, and each obeys and reports for itself.",
        sharing::two_share_a_bus,
    ),
];
