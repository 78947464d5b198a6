//! The leading board.
#![no_std]
#![no_main]

rc10_board::program!(two_boards_uart::leader::Leader);
