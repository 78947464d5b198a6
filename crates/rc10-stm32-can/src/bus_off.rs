/// Tells from bxCAN's registers whether it is off the bus.
///
/// `BOFF` stays set until the end of the way back: `ERRI`, with `BOFIE` as its only cause, tells
/// that the controller went off again.
#[derive(Clone, Copy, Debug, Default)]
pub struct BusOff {
    /// Whether it was restarted, and was not seen off the way back since.
    returning: bool,
}

impl BusOff {
    /// The state of a controller that was just reset.
    #[must_use]
    pub const fn new() -> Self {
        Self { returning: false }
    }

    /// The way back was begun.
    pub const fn restarted(&mut self) {
        self.returning = true;
    }

    /// Whether it is off, and not on its way back; `off` is `BOFF`, `fell` is `ERRI`, read once.
    pub const fn is_off(&mut self, off: bool, fell: bool) -> bool {
        self.returning &= off && !fell;
        off && !self.returning
    }
}
