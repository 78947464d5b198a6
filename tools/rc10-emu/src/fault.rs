//! Faults of a chip, as a user writes them among those of its wires and devices.

use std::fmt;

use rc10_sim::fault::{self, Others, alone};

/// A fault of a run, of the chip or of the simulated world.
pub type Fault = rc10_sim::Fault<ChipFault>;

/// Kinds of fault, of the chip or of the simulated world.
pub type Kind = fault::Kind<ChipFault>;

/// Faults of a chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ChipFault {
    /// `panic`: the program panics, in file `injected.rs`, line 2300. Has no end.
    Panic,
    /// `hardfault`: the program executes an undefined instruction, which is a `HardFault` unless
    /// usage faults have a handler. Has no end.
    HardFault,
    /// `hang[:HANDLER]`: an interrupt handler hangs when it is called next, before its first
    /// instruction; without a name `CONTROL_EXECUTOR`.
    Hang(String),
    /// `mask`: a critical section, with all interrupts masked, takes this long. If the program masks
    /// them itself, that begins when it no longer does.
    Mask,
    /// `crystal-dead`: the board's crystal never swings. Has no time: from power-on on.
    CrystalDead,
    /// `crystal-stops`: the board's crystal stops swinging.
    CrystalStops,
    /// `cut-power`: the chip has no power. The flash is kept, but for what it was programming or erasing.
    CutPower,
}

/// The handler that runs the buses of RC10's firmware.
const CONTROL_EXECUTOR: &str = "UART9";

/// Names of the faults without an argument.
const NAMES: [(&str, ChipFault); 6] = [
    ("panic", ChipFault::Panic),
    ("hardfault", ChipFault::HardFault),
    ("mask", ChipFault::Mask),
    ("crystal-dead", ChipFault::CrystalDead),
    ("crystal-stops", ChipFault::CrystalStops),
    ("cut-power", ChipFault::CutPower),
];

impl fmt::Display for ChipFault {
    /// The text, as a user writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Self::Hang(handler) = self {
            f.write_str("hang")?;
            let is_named = handler != CONTROL_EXECUTOR;
            return if is_named { write!(f, ":{handler}") } else { Ok(()) };
        }
        let mut names = NAMES.iter().filter(|(_, fault)| fault == self);
        names.try_for_each(|(name, _)| f.write_str(name))
    }
}

impl Others for ChipFault {
    const NAMES: &str = " panic hardfault hang[:HANDLER] mask crystal-dead crystal-stops cut-power";

    fn read(name: &str, argument: Option<&str>) -> Option<Result<Self, String>> {
        if name == "hang" {
            return Some(match argument.unwrap_or(CONTROL_EXECUTOR) {
                "" => Err("name a handler: hang:TIM2; or none: hang".into()),
                handler => Ok(Self::Hang(handler.into())),
            });
        }
        let (_, fault) = NAMES.into_iter().find(|(other, _)| *other == name)?;
        Some(alone(name, argument).map(|()| fault))
    }

    fn is_sudden(&self) -> bool {
        matches!(self, Self::Panic | Self::HardFault)
    }

    fn untimed(&self) -> Option<&'static str> {
        (*self == Self::CrystalDead)
            .then_some("it is dead from power-on, write it without a time; or crystal-stops@TIME")
    }
}

#[cfg(test)]
mod tests {
    use rc10_sim::Nanos;
    use rc10_sim::fault::Wire;

    use super::*;

    #[test]
    fn faults_are_written_as_the_help_says() {
        for (text, other, from, until) in [
            ("hang@1.000001s", ChipFault::Hang("UART9".into()), 1_000_001_000, None),
            (
                "hang:TIM2@1s..2s",
                ChipFault::Hang("TIM2".into()),
                1_000_000_000,
                Some(2_000_000_000),
            ),
            ("mask@20us..25us", ChipFault::Mask, 20_000, Some(25_000)),
            ("panic@1ms", ChipFault::Panic, 1_000_000, None),
            ("hardfault@1ms", ChipFault::HardFault, 1_000_000, None),
            ("crystal-dead", ChipFault::CrystalDead, 0, None),
            ("crystal-stops@1s", ChipFault::CrystalStops, 1_000_000_000, None),
            ("cut-power@1s..2s", ChipFault::CutPower, 1_000_000_000, Some(2_000_000_000)),
        ] {
            let (from, until) = (Nanos::new(from), until.map(Nanos::new));
            let fault: Fault = text.parse().unwrap();
            assert_eq!(fault, Fault { kind: Kind::Other(other), from, until });
            assert_eq!(fault.to_string().parse(), Ok(fault));
        }
        let fault: Fault = "cut:2@1s".parse().unwrap();
        assert_eq!(fault.kind, Kind::Cut(Wire::Bus(1)));
    }

    #[test]
    fn what_cannot_be_a_fault_is_told_why() {
        for (text, why) in [
            ("panic:1@1s", "panic@0.5s"),
            ("crystal-dead@1s", "without a time"),
            ("crystal-stops", "KIND@TIME"),
            ("crystal-stops:1@1s", "crystal-stops@0.5s"),
            ("panic@1s..2s", "no end"),
            ("hang:@1s", "name a handler"),
            ("flood@1s", "remote-lost panic hardfault"),
        ] {
            let error = text.parse::<Fault>().unwrap_err().to_string();
            assert!(error.contains(why) && error.contains(text), "{error}");
        }
    }
}
