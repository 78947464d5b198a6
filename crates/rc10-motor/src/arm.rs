use core::fmt;
use core::sync::atomic::{AtomicU32, Ordering};

/// Whether the motors of a robot may move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ArmState {
    /// Nothing is driven: the state after power-on.
    #[default]
    Disarmed,
    /// Motors follow their commands.
    Armed,
    /// Armed, but the operator is not heard: safe states until [`ArmSwitch::resume`].
    Suspended,
    /// Every motor is in its safe state, until [`ArmSwitch::reset`].
    EStopped,
}

rc10_app::states!(ArmState: Disarmed, Armed, Suspended, EStopped);

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
/// An emergency stop latches: [`arm`](Self::arm) fails until a call of
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
/// # Ok::<(), rc10_motor::ArmError>(())
/// ```
#[derive(Debug, Default)]
pub struct ArmSwitch(AtomicU32);

/// The switch's low byte is its state, the rest counts stops: no stop between two looks is missed.
const STATE: u32 = 0xFF;
const ONE_STOP: u32 = 0x100;

const DISARMED: u8 = 0;
const ARMED: u8 = 1;
const STOPPED: u8 = 2;
/// Stopped, and without torque: it was not armed, or has been disarmed since.
const STOPPED_OFF: u8 = 3;
const SUSPENDED: u8 = 4;
/// Disarmed until the next start: [`Unfit::Overload`], [`Unfit::Clock`], [`Unfit::Chip`].
const OVERLOAD: u8 = 5;
const CLOCK: u8 = 6;
const CHIP: u8 = 7;
/// Disarmed until [`ArmSwitch::allow`]: [`Unfit::Parameters`].
const PARAMETERS: u8 = 8;

/// Why a robot cannot be armed until it is started again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Unfit {
    /// The motors of a bus need more than the bus has: frames would be lost.
    #[error("the motors of a bus do not fit on it")]
    Overload,
    /// The crystal does not work, or is not the one that the program is for: bit rates and times are not exact.
    #[error("the crystal does not work or is another")]
    Clock,
    /// The program is for another chip.
    #[error("the program is for another chip")]
    Chip,
    /// The kept parameters have not been taken over yet, or one that the robot must have is not kept.
    #[error("a parameter that it must have is not kept")]
    Parameters,
}

/// Why [`ArmSwitch::arm`] was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ArmError {
    /// The robot is stopped; it must be reset before it can be armed.
    #[error("the emergency stop is latched: reset it before arming")]
    EStopped,
    /// The robot cannot be armed until it is started again.
    #[error("cannot be armed: {0}")]
    Unfit(Unfit),
}

impl ArmSwitch {
    /// A switch in state [`ArmState::Disarmed`].
    pub const fn new() -> Self {
        Self(AtomicU32::new(DISARMED as u32))
    }

    #[inline]
    fn load(&self) -> u8 {
        state_of(self.0.load(Ordering::Acquire))
    }

    /// The state now.
    #[inline]
    pub fn state(&self) -> ArmState {
        self.seen().state()
    }

    /// The state now, for all of a tick: a stop in between changes the next one.
    #[inline]
    pub(crate) fn seen(&self) -> Seen {
        Seen(self.load())
    }

    /// Sets the state that a record says a tick has [seen](crate::record::TICK).
    #[cfg(all(feature = "record", not(target_os = "none")))]
    pub fn replay(&self, seen: u8) {
        self.0.store(u32::from(seen), Ordering::Release);
    }

    /// Lets the motors follow their commands; an armed or suspended robot stays as it is.
    ///
    /// # Errors
    /// [`ArmError`] while an emergency stop is latched, and after [`forbid`](Self::forbid).
    pub fn arm(&self) -> Result<(), ArmError> {
        self.change(DISARMED, ARMED);
        match (self.state(), self.unfit()) {
            (_, Some(why)) => Err(ArmError::Unfit(why)),
            (ArmState::EStopped, None) => Err(ArmError::EStopped),
            _ => Ok(()),
        }
    }

    /// Disarms the robot until it is started again, because it is unsafe. The first reason stays, but
    /// [`Unfit::Parameters`], which [`allow`](Self::allow) ends.
    pub fn forbid(&self, why: Unfit) {
        let unfit = match why {
            Unfit::Overload => OVERLOAD,
            Unfit::Clock => CLOCK,
            Unfit::Chip => CHIP,
            Unfit::Parameters => PARAMETERS,
        };
        self.update(&|word| {
            let state = state_of(word);
            (state < OVERLOAD || state == PARAMETERS).then(|| with(word, unfit))
        });
    }

    /// Ends [`Unfit::Parameters`]: the robot is disarmed, or stopped if it was ever stopped.
    pub fn allow(&self) {
        self.update(&|word| {
            let free = if word < ONE_STOP { DISARMED } else { STOPPED_OFF };
            (state_of(word) == PARAMETERS).then(|| with(word, free))
        });
    }

    /// Why the robot cannot be armed, if it cannot.
    pub fn unfit(&self) -> Option<Unfit> {
        match self.load() {
            OVERLOAD => Some(Unfit::Overload),
            CLOCK => Some(Unfit::Clock),
            CHIP => Some(Unfit::Chip),
            PARAMETERS => Some(Unfit::Parameters),
            _ => None,
        }
    }

    /// Lets every motor coast, also one that holds during an emergency stop, which stays latched.
    pub fn disarm(&self) {
        self.always(
            |state| if matches!(state, STOPPED | STOPPED_OFF) { STOPPED_OFF } else { DISARMED },
        );
    }

    /// Sends all motors of an armed robot to their safe states until [`resume`](Self::resume).
    pub fn suspend(&self) {
        self.change(ARMED, SUSPENDED);
    }

    /// Lets a suspended robot's motors follow their commands again, softly. It never arms one.
    pub fn resume(&self) {
        self.change(SUSPENDED, ARMED);
    }

    /// Sends all motors to their safe states until [`reset`](Self::reset); disarmed ones stay free.
    pub fn emergency_stop(&self) {
        self.update(&|word| {
            let stopped = match state_of(word) {
                ARMED | STOPPED | SUSPENDED => STOPPED,
                // It stays unfit. The count tells `allow`, and another board.
                unfit @ OVERLOAD.. => unfit,
                _ => STOPPED_OFF,
            };
            Some(with(word.wrapping_add(ONE_STOP), stopped))
        });
    }

    /// Ends an emergency stop; the robot is disarmed then. Changes nothing without one.
    pub fn reset(&self) {
        self.reset_after(self.stops());
    }

    /// The emergency stops so far, modulo 2^24: for [`reset_after`](Self::reset_after).
    pub fn stops(&self) -> u32 {
        self.0.load(Ordering::Acquire) / ONE_STOP
    }

    /// Ends an emergency stop, unless another one came since [`stops`](Self::stops) said this.
    pub fn reset_after(&self, stops: u32) {
        self.update(&|word| {
            let is_known = word / ONE_STOP == stops;
            let is_stopped = matches!(state_of(word), STOPPED | STOPPED_OFF);
            (is_known && is_stopped).then(|| with(word, DISARMED))
        });
    }

    /// One step from the present state, in one piece. An unfit robot stays what it is.
    fn always(&self, step: impl Fn(u8) -> u8) {
        self.update(&|word| {
            let state = state_of(word);
            (state < OVERLOAD).then(|| with(word, step(state)))
        });
    }

    /// One step of the state machine; an emergency stop in between wins.
    fn change(&self, from: u8, to: u8) {
        self.update(&|word| (state_of(word) == from).then(|| with(word, to)));
    }

    #[inline(never)] // Once in flash: nothing calls it in every tick.
    fn update(&self, step: &dyn Fn(u32) -> Option<u32>) {
        // `Err`: there is nothing to do.
        let _ = self.0.fetch_update(Ordering::AcqRel, Ordering::Acquire, step);
    }
}

/// What a tick has seen of the switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Seen(pub(crate) u8);

impl Seen {
    #[inline]
    pub(crate) const fn state(self) -> ArmState {
        match self.0 {
            ARMED => ArmState::Armed,
            DISARMED | OVERLOAD | CLOCK | CHIP | PARAMETERS => ArmState::Disarmed,
            SUSPENDED => ArmState::Suspended,
            _ => ArmState::EStopped,
        }
    }

    /// The state as motors see it: disarmed also while stopped without torque.
    #[inline]
    pub(crate) const fn for_motors(self) -> ArmState {
        if self.0 == ARMED { ArmState::Armed } else { for_idle_motors(self.0) }
    }
}

#[inline]
const fn state_of(word: u32) -> u8 {
    (word & STATE) as u8
}

const fn with(word: u32, state: u8) -> u32 {
    word & !STATE | state as u32
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
        assert_eq!(switch.arm(), Err(ArmError::EStopped));
        assert_eq!(switch.state(), ArmState::EStopped);
        // Disarmed on top: no torque either.
        assert_eq!(switch.seen().for_motors(), ArmState::Disarmed);
        switch.reset();
        assert_eq!(switch.state(), ArmState::Disarmed);
        // Stopping a disarmed robot gives no motor torque.
        switch.emergency_stop();
        assert_eq!(
            (switch.state(), switch.seen().for_motors()),
            (ArmState::EStopped, ArmState::Disarmed)
        );
        switch.reset();
        switch.arm().unwrap();
        switch.emergency_stop();
        assert_eq!(switch.seen().for_motors(), ArmState::EStopped);
    }

    /// A robot that was disarmed while stopped, or before, gets no torque by another stop.
    #[test]
    fn a_second_stop_gives_a_disarmed_robot_no_torque() {
        for disarms_first in [false, true] {
            let switch = ArmSwitch::new();
            switch.arm().unwrap();
            if !disarms_first {
                switch.emergency_stop();
            }
            switch.disarm();
            switch.emergency_stop();
            switch.emergency_stop();
            let both = (switch.state(), switch.seen().for_motors());
            assert_eq!(both, (ArmState::EStopped, ArmState::Disarmed));
        }
    }

    /// A stop between the look at the switches and the reset that follows from it.
    #[test]
    fn a_reset_ends_no_stop_that_it_does_not_know() {
        let switch = ArmSwitch::new();
        switch.emergency_stop();
        let stops = switch.stops();
        switch.emergency_stop();
        switch.reset_after(stops);
        assert_eq!(switch.state(), ArmState::EStopped);
        switch.reset_after(switch.stops());
        assert_eq!(switch.state(), ArmState::Disarmed);
        // It counts on, whatever else is done, and no count leaks into the state.
        for count in 0..1000 {
            assert_eq!(switch.stops(), 2 + count);
            switch.arm().unwrap();
            switch.emergency_stop();
            switch.disarm();
            switch.reset();
            assert_eq!(switch.state(), ArmState::Disarmed);
        }
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
        let both = (switch.state(), switch.seen().for_motors());
        assert_eq!(both, (ArmState::Suspended, ArmState::EStopped));
        switch.arm().unwrap();
        switch.reset();
        assert_eq!(switch.state(), ArmState::Suspended);
        switch.resume();
        assert_eq!(switch.seen().for_motors(), ArmState::Armed);
        // A stop of a suspended robot latches, and it holds.
        switch.suspend();
        switch.emergency_stop();
        switch.resume();
        assert_eq!(
            (switch.state(), switch.seen().for_motors()),
            (ArmState::EStopped, ArmState::EStopped)
        );
        switch.reset();
        switch.arm().unwrap();
        switch.suspend();
        switch.disarm();
        switch.resume();
        assert_eq!(switch.state(), ArmState::Disarmed);
    }

    /// Parameters are taken over in the first milliseconds: what forbids arming besides stays, and so does a stop.
    #[test]
    fn a_robot_that_waits_for_its_parameters_is_allowed_later() {
        let switch = ArmSwitch::new();
        switch.allow();
        switch.forbid(Unfit::Parameters);
        for step in [ArmSwitch::disarm, ArmSwitch::suspend, ArmSwitch::resume, ArmSwitch::reset] {
            step(&switch);
            assert_eq!(switch.arm(), Err(ArmError::Unfit(Unfit::Parameters)));
            assert_eq!(switch.seen().for_motors(), ArmState::Disarmed);
        }
        switch.allow();
        assert_eq!((switch.arm(), switch.state()), (Ok(()), ArmState::Armed));
        let switch = ArmSwitch::new();
        switch.forbid(Unfit::Parameters);
        switch.emergency_stop();
        switch.allow();
        assert_eq!((switch.state(), switch.arm()), (ArmState::EStopped, Err(ArmError::EStopped)));
        let switch = ArmSwitch::new();
        switch.forbid(Unfit::Parameters);
        switch.forbid(Unfit::Clock);
        switch.forbid(Unfit::Parameters);
        switch.allow();
        assert_eq!(switch.arm(), Err(ArmError::Unfit(Unfit::Clock)));
    }

    #[test]
    fn an_unfit_robot_stays_disarmed_whatever_is_done() {
        for (why, later) in [(Unfit::Overload, Unfit::Clock), (Unfit::Clock, Unfit::Overload)] {
            let switch = ArmSwitch::new();
            switch.arm().unwrap();
            switch.forbid(why);
            let steps: [&dyn Fn(); 6] = [
                &|| switch.disarm(),
                &|| switch.emergency_stop(),
                &|| switch.reset(),
                &|| switch.suspend(),
                &|| switch.resume(),
                &|| switch.forbid(later),
            ];
            for step in steps {
                step();
                assert_eq!(switch.arm(), Err(ArmError::Unfit(why)));
                assert_eq!((switch.state(), switch.unfit()), (ArmState::Disarmed, Some(why)));
                assert_eq!(switch.seen().for_motors(), ArmState::Disarmed);
            }
        }
    }
}
