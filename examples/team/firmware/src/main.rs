//! The team's robot on the chip.
#![no_std]
#![no_main]

// On a DM-MC02 the switched 5 V stay off: nothing is there.
rc10_board::program!(team, outputs: [First, Second]);
