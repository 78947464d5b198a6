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

const fn rule(name: &'static str, check: fn(&Case<'_>, &mut Findings), text: &'static str) -> Rule {
    Rule { name, text, check }
}

/// All rules, in the order in which they are tried.
#[rustfmt::skip] // A table: name and function in a line, then the text.
pub const RULES: &[Rule] = &[
    rule("every-target-is-tried", declared::every_target_is_tried,
        "The declaration tries every kind of target that the motor takes, and no other; what the \
         motor cannot do has a reason."),
    rule("ids-are-valid", can_ids::ids_are_valid,
        "Its identifiers include feedback that comes regularly and a command; no frame is longer \
         than 8 bytes, and owned bytes and guards lie within their frames."),
    rule("ids-are-constant", can_ids::ids_are_constant,
        "Its name and its identifiers are the same whatever happened to the motor."),
    rule("frames-are-declared", can_ids::frames_are_declared,
        "Every frame it sends is declared: identifier, length, its own bytes or guard."),
    rule("streams-are-own", can_ids::streams_are_own,
        "The stream that a frame names is one of the motor's own identifiers."),
    rule("few-frames-a-tick", can_ids::few_frames_a_tick,
        "It sends at most two frames in a tick."),
    rule("load-is-as-declared", can_ids::load_is_as_declared,
        "While it runs, frames come and go as often as declared, and none comes that is not \
         declared."),
    rule("supports-is-constant", targets::supports_is_constant,
        "Which kinds of target it takes never changes, and coasting is one."),
    rule("refuses-targets", targets::refuses_targets,
        "A target that it does not support, or that is not finite, is refused for that reason, and \
         the old one stays."),
    rule("feedback-is-true", targets::feedback_is_true,
        "Speed and angle in the feedback are those of the shaft, driven or turned by hand; the \
         angle lies in 0 ..< 360."),
    rule("gets-going", targets::gets_going,
        "Armed and commanded it turns against its load, and says that it is ready."),
    rule("follows", targets::follows,
        "It reaches every target of the declaration, as closely and as fast as declared."),
    rule("follows-motions", targets::follows_motions,
        "A motion that is commanded every 10 ms is followed evenly and without a lag."),
    rule("strange-steps", targets::strange_steps,
        "A time step of zero, of seconds, backwards or NaN makes it neither panic nor leap."),
    rule("deterministic", targets::deterministic,
        "The same things happening to it give the same frames, to the bit."),
    rule("foreign-frames", frames::foreign_frames,
        "Frames with identifiers of others, and remote requests, are `NotMine` and change nothing; \
         nor do frames whose guard says that they are another's."),
    rule("wrong-lengths", frames::wrong_lengths,
        "A frame of its own with a wrong length is an error and changes nothing."),
    rule("any-content", frames::any_content,
        "Any content of a frame of its own leaves its feedback finite and its angles in agreement, \
         and a refused frame changes nothing."),
    rule("feedback-at", frames::feedback_at,
        "`Feedback::at` is when the frame arrived."),
    rule("silent-before-feedback", stopping::silent_before_feedback,
        "Before its first feedback it drives nothing, for any target."),
    rule("off-until-armed", stopping::off_until_armed,
        "Commanded while the robot was never armed, it drives and enables nothing."),
    rule("disarm", stopping::disarm,
        "Disarmed it has no torque any more and its device is disabled; armed again it runs."),
    rule("emergency-stop", stopping::emergency_stop,
        "The emergency stop takes it to its safe state with the next tick, and coasting it has no \
         torque."),
    rule("expiry", stopping::expiry,
        "When commands stop coming it goes to its safe state, and coasting it has no torque."),
    rule("lost", stopping::lost,
        "When its feedback stops coming it coasts, for any target."),
    rule("link-timeout", link::link_timeout,
        "Silent for less than its time-out it runs on as before; for longer it is lost, coasts, \
         and comes back softly."),
    rule("coast-frames-are-fixed", stopping::coast_frames_are_fixed,
        "The frames for a panic handler are always the same, also before any feedback."),
    rule("coast-frames-stop", stopping::coast_frames_stop,
        "These frames, sent once, leave the device without torque in any state."),
    rule("brakes", stopping::brakes,
        "Braking, it slows down, also against a load that drives it."),
    rule("holds", stopping::holds,
        "Holding, it keeps its angle against a load."),
    rule("back-on-the-wire", returning::back_on_the_wire,
        "After a cut it follows again, softly."),
    rule("restart", returning::restart,
        "A device that was restarted is enabled again and follows, softly; also if it was away for \
         so short a time that its link was never lost. Turns that it may have missed are told."),
    rule("set-zero", requests::set_zero,
        "After `SetZero` its angles are zero and nothing moves; before any feedback it is \
         refused."),
    rule("zero-while-driven", zero::zero_while_driven,
        "Driven, it has no new zero unless a task means it; and then no number given before counts \
         on the new scale."),
    rule("zero-moves-nothing", zero::zero_moves_nothing,
        "A new zero moves nothing while it turns, seeks, holds, brakes or obeys an impedance; the \
         same number commanded again lies elsewhere, and coasting is coasting."),
    rule("target-on-new-scale", zero::target_is_on_the_new_scale,
        "After a new zero its target is the same place or law, on the new scale."),
    rule("impedance-law", impedance::obeys_the_law,
        "An impedance gives the torque of its law: stiffness, damping, speed and torque, each with \
         its unit and sign."),
    rule("soft-impedance", impedance::starts_softly,
        "From rest an impedance grows to its law in 20 ms, by one factor for all of it: its \
         equilibrium stays."),
    rule("limits-bound-efforts", limits::limits_bound_efforts,
        "A lowered limit bounds every torque and current that is asked for, braking too; without \
         one none is above its largest torque."),
    rule("requests-are-checked", requests::requests_are_checked,
        "Limits and gains that are negative or not finite are refused."),
    rule("set-up-while-disarmed", requests::set_up_while_disarmed,
        "While the robot is armed, nothing is stored or written in the device."),
    rule("pending-is-answered", requests::pending_is_answered,
        "A request that is pending keeps others off, and is answered once; by a time-out when the \
         device is silent."),
    rule("clear-fault-moves-nothing", requests::clear_fault_moves_nothing,
        "`ClearFault` without a fault neither drives a motor that is off nor stops one that runs."),
    rule("fault-is-told", faults::fault_is_told,
        "A fault of the device is told in words, and takes the motor to its safe state without \
         torque."),
    rule("fault-waits", faults::fault_waits,
        "After a fault its device stays disabled until `ClearFault`, also if it is restarted; then \
         it runs again."),
    rule("same-id-is-refused", sharing::same_id_is_refused,
        "Two of the same identifier are refused on one bus."),
    rule("two-share-a-bus", sharing::two_share_a_bus,
        "Two of different identifiers share a bus, and each obeys and reports for itself."),
];
