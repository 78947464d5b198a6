//! The gimbal's board.
#![no_std]
#![no_main]

rc10_board::program!(two_boards::gimbal::Gimbal);
