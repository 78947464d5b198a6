// The panel of a motor: gains, margins, steps.
