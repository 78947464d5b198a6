use core::fmt;
use core::sync::atomic::{AtomicU8, Ordering};

/// Whether the motors of a robot may move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ArmState {
    /// Nothing is driven: the state after power-on.
    #[default]
    Disarmed,
    /// Motors follow their commands.
    Armed,
    /// Armed, but whoever drives is not heard: every motor is in its safe state, until
    /// [`ArmSwitch::resume`].
    Suspended,
    /// Every motor is in its safe state, until [`ArmSwitch::reset`].
    EStopped,
}

impl fmt::Display for ArmState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Disarmed => "disarmed",
            Self::Armed => "armed",
            Self::Suspended => "suspended",
            Self::EStopped => "emergency stop",
        })
    }
}

/// The one switch that arms and stops a robot. All its buses look at it in every tick; anything
/// may hold a reference to it and stop the robot, from any task or interrupt.
///
/// An emergency stop latches: [`arm`](Self::arm) fails until somebody calls
/// [`reset`](Self::reset), and then the robot is disarmed, not armed.
///
/// ```
/// use rc10_motor::{ArmState, ArmSwitch};
/// let switch = ArmSwitch::new();
/// switch.arm()?;
/// switch.emergency_stop();
/// assert!(switch.arm().is_err());
/// switch.reset();
/// assert_eq!(switch.state(), ArmState::Disarmed);
/// # Ok::<(), rc10_motor::EStopped>(())
/// ```
#[derive(Debug, Default)]
pub struct ArmSwitch(AtomicU8);

const DISARMED: u8 = 0;
const ARMED: u8 = 1;
const STOPPED: u8 = 2;
/// Stopped, and without torque: it was not armed, or has been disarmed since.
const STOPPED_OFF: u8 = 3;
const SUSPENDED: u8 = 4;

/// The robot is stopped; it must be reset before it can be armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EStopped;

impl fmt::Display for EStopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the emergency stop is latched: reset it before arming")
    }
}

impl core::error::Error for EStopped {}

impl ArmSwitch {
    /// A switch in state [`ArmState::Disarmed`].
    #[must_use]
    pub const fn new() -> Self {
        Self(AtomicU8::new(DISARMED))
    }

    /// The state now.
    #[inline]
    #[must_use]
    pub fn state(&self) -> ArmState {
        match self.0.load(Ordering::Acquire) {
            ARMED => ArmState::Armed,
            DISARMED => ArmState::Disarmed,
            SUSPENDED => ArmState::Suspended,
            _ => ArmState::EStopped,
        }
    }

    /// Lets the motors follow their commands. Arming an armed robot changes nothing, nor does
    /// arming a suspended one.
    ///
    /// # Errors
    /// [`EStopped`] while an emergency stop is latched.
    pub fn arm(&self) -> Result<(), EStopped> {
        self.change(DISARMED, ARMED);
        if self.state() == ArmState::EStopped { Err(EStopped) } else { Ok(()) }
    }

    /// Stops driving: every motor coasts, also one that holds during an emergency stop. The stop
    /// stays latched.
    pub fn disarm(&self) {
        self.always(
            |state| if matches!(state, STOPPED | STOPPED_OFF) { STOPPED_OFF } else { DISARMED },
        );
    }

    /// Sends every motor of an armed robot to its safe state in the next tick of its bus, until
    /// [`resume`](Self::resume): for a link that is lost and may come back. Changes nothing if the
    /// robot is not armed.
    pub fn suspend(&self) {
        self.change(ARMED, SUSPENDED);
    }

    /// Lets the motors of a suspended robot follow their commands again, each with its soft start.
    /// Changes nothing if the robot is not suspended: it never arms one.
    pub fn resume(&self) {
        self.change(SUSPENDED, ARMED);
    }

    /// Sends every motor to its safe state in the next tick of its bus, until
    /// [`reset`](Self::reset). Motors of a robot that is not armed stay without torque.
    pub fn emergency_stop(&self) {
        self.always(|state| {
            if matches!(state, ARMED | STOPPED | SUSPENDED) { STOPPED } else { STOPPED_OFF }
        });
    }

    /// Ends an emergency stop; the robot is disarmed then. Changes nothing if there is none.
    pub fn reset(&self) {
        self.always(|state| if matches!(state, STOPPED | STOPPED_OFF) { DISARMED } else { state });
    }

    /// What the motors have to know: disarmed also while stopped without torque, stopped also while
    /// suspended.
    #[inline]
    pub(crate) fn for_motors(&self) -> ArmState {
        let state = self.0.load(Ordering::Acquire);
        if state == ARMED { ArmState::Armed } else { for_idle_motors(state) }
    }

    /// One step from whatever state there is, in one piece: nobody's step comes in between.
    fn always(&self, step: impl Fn(u8) -> u8) {
        // It always has an answer, so this always takes effect.
        let _ = self.0.fetch_update(Ordering::AcqRel, Ordering::Acquire, |state| Some(step(state)));
    }

    /// One step of the state machine; an emergency stop in between wins.
    fn change(&self, from: u8, to: u8) {
        let _ = self.0.compare_exchange(from, to, Ordering::AcqRel, Ordering::Acquire);
    }
}

/// Out of line: the ticks of an armed robot are counted by the instruction.
#[cold]
#[inline(never)]
const fn for_idle_motors(state: u8) -> ArmState {
    if matches!(state, STOPPED | SUSPENDED) { ArmState::EStopped } else { ArmState::Disarmed }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use core::sync::atomic::AtomicBool;

    use super::*;

    /// Whatever another task does at the same time: who has disarmed has disarmed.
    #[test]
    fn a_driver_that_suspends_and_resumes_undoes_no_disarming() {
        let (switch, done) = (ArmSwitch::new(), AtomicBool::new(false));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    switch.suspend();
                    switch.resume();
                }
            });
            let undone = (0..300_000).filter(|_| {
                switch.arm().unwrap();
                switch.disarm();
                switch.state() != ArmState::Disarmed
            });
            let undone = undone.count();
            done.store(true, Ordering::Relaxed);
            assert_eq!(undone, 0);
        });
    }

    #[test]
    fn only_a_reset_ends_a_stop_and_it_disarms() {
        let switch = ArmSwitch::new();
        switch.reset();
        assert_eq!(switch.state(), ArmState::Disarmed);
        switch.arm().unwrap();
        switch.arm().unwrap();
        switch.reset();
        assert_eq!(switch.state(), ArmState::Armed);
        switch.emergency_stop();
        switch.disarm();
        assert_eq!(switch.arm(), Err(EStopped));
        assert_eq!(switch.state(), ArmState::EStopped);
        // Disarmed on top: no torque either.
        assert_eq!(switch.for_motors(), ArmState::Disarmed);
        switch.reset();
        assert_eq!(switch.state(), ArmState::Disarmed);
        // Stopping a disarmed robot gives no motor torque.
        switch.emergency_stop();
        assert_eq!((switch.state(), switch.for_motors()), (ArmState::EStopped, ArmState::Disarmed));
        switch.reset();
        switch.arm().unwrap();
        switch.emergency_stop();
        assert_eq!(switch.for_motors(), ArmState::EStopped);
    }

    #[test]
    fn only_an_armed_robot_is_suspended_and_only_that_one_resumes() {
        let switch = ArmSwitch::new();
        switch.suspend();
        assert_eq!(switch.state(), ArmState::Disarmed);
        switch.resume();
        assert_eq!(switch.state(), ArmState::Disarmed);
        switch.arm().unwrap();
        switch.suspend();
        let both = (switch.state(), switch.for_motors());
        assert_eq!(both, (ArmState::Suspended, ArmState::EStopped));
        switch.arm().unwrap();
        switch.reset();
        assert_eq!(switch.state(), ArmState::Suspended);
        switch.resume();
        assert_eq!(switch.for_motors(), ArmState::Armed);
        // A stop of a suspended robot latches, and it holds.
        switch.suspend();
        switch.emergency_stop();
        switch.resume();
        assert_eq!((switch.state(), switch.for_motors()), (ArmState::EStopped, ArmState::EStopped));
        switch.reset();
        switch.arm().unwrap();
        switch.suspend();
        switch.disarm();
        switch.resume();
        assert_eq!(switch.state(), ArmState::Disarmed);
    }
}
