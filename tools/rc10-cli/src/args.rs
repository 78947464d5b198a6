//! Arguments that several commands have: what goes wrong on purpose, times, seeds.

use std::net::{SocketAddr, ToSocketAddrs as _};

use anyhow::{Context as _, Result, bail};
use clap::Args;
use rc10_emu::fault::Fault;
use rc10_time::Micros;

use crate::robot::mistake::{self, Mistake};

/// Help text of `--fault`.
const FAULTS: &str = "\
Something goes wrong, KIND@TIME or KIND@TIME..TIME: cut:2@0.3s..0.5s short:2@.. dominant:2@.. \
noise:2@0.3s power:2@.. load:2@.. babble:2@.. remote-lost@0.5s..0.7s; cut:L1, noise:L1 and power:L1 for an RS-485 \
line, and cut:IMU and so on for a part on a UART; cut:NAME, power:NAME, mute:NAME, frozen:NAME and flipped:NAME for a motor; stuck:NAME, torn:NAME and bounces:NAME for the contact \
of a motor, with - for spaces; of the chip, in rc10 emu only: hang@0.3s..320ms mask@0.3s..305ms panic@0.3s hardfault@0.3s \
crystal-dead crystal-stops@0.3s cut-power@0.3s..0.4s; repeat for more";

/// The faults and mistakes that a run is to have.
#[derive(Args, Clone, Debug, Default)]
pub struct Injected {
    #[arg(long = "fault", value_name = "FAULT", help = FAULTS)]
    pub(crate) faults: Vec<Fault>,
    #[arg(long = "mistake", value_name = "MISTAKE", help = mistake::HELP)]
    pub(crate) mistakes: Vec<Mistake>,
}

/// A number of seconds with up to six decimals, exactly.
pub(crate) fn seconds(text: &str) -> Result<Micros, String> {
    const WANTED: &str = "must be a number of seconds from 0.001 to 3600";
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let is_number = (1..=4).contains(&whole.len())
        && fraction.len() <= 6
        && [whole, fraction].concat().bytes().all(|byte| byte.is_ascii_digit());
    let micros = format!("{whole}{fraction:0<6}").parse().ok();
    let micros = micros.filter(|micros| is_number && (1000..=3_600_000_000).contains(micros));
    micros.map(Micros::new).ok_or_else(|| WANTED.into())
}

/// An address of `HOST:PORT`.
pub(crate) fn address(text: &str) -> Result<SocketAddr> {
    let mut found = text.to_socket_addrs().with_context(|| format!("{text}: not HOST:PORT"))?;
    found.next().with_context(|| format!("{text}: there is no such host"))
}

/// A share of the clock's pace.
pub(crate) fn pace(text: &str) -> Result<f64, &'static str> {
    let pace = text.parse().ok().filter(|it| (0.01..=1.0).contains(it));
    pace.ok_or("must be a number from 0.01 to 1")
}

pub(crate) fn seed(text: &str) -> Result<u64, &'static str> {
    text.parse().map_err(|_| "must be a whole number from 0 to 18446744073709551615")
}

/// Fails if a fault would begin after the end of the run.
pub(crate) fn check_end(faults: &[Fault], end: Micros) -> Result<()> {
    if let Some(Fault { kind, from, .. }) = faults.iter().find(|fault| fault.from >= end.into()) {
        let [from, end] = [from.micros(), end].map(|time| time.get() as f64 * 1e-6);
        bail!("{kind} would begin at {from} s, after the end at {end} s: see --seconds")
    }
    Ok(())
}
