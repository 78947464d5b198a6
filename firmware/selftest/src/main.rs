#![no_std]
#![no_main]
use defmt_rtt as _;
rc10_bsp::crash_handlers!();
#[embassy_executor::main]
async fn main(_s: embassy_executor::Spawner) {}
