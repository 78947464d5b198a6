//! The board of an emulated chip, and whether a program is made for it.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use rc10_emu::{Board, Image, MadeFor};

use crate::files::unreadable;
use crate::robot::build::Wanted;
use crate::robot::description::Description;

/// The board with this name on the command line.
pub(crate) fn named(name: &str) -> Result<Board, String> {
    Board::named(name).ok_or_else(|| {
        let names = Board::ALL.map(|board| board.name);
        format!("there is no such board: {}", names.join(", "))
    })
}

/// A crystal in MHz as hertz: 4 to 50, the chip's range.
pub(crate) fn crystal(megahertz: &str) -> Result<u64, String> {
    let hz = megahertz.parse::<f64>().ok().map(|megahertz| (megahertz * 1e6).round());
    match hz {
        Some(hz) if (4e6..=50e6).contains(&hz) => Ok(hz as u64),
        _ => Err("a crystal has 4 to 50 MHz".into()),
    }
}

/// The board to run a program on: the given one, else the program's, else the team's.
pub(crate) fn of(program: &[u8], asked: Option<Board>, crystal: Option<u64>) -> Result<Board> {
    let board = match (asked, Image::parse(program)?.made_for) {
        (Some(board), _) => board,
        (None, None) => Board::default(),
        (None, Some(MadeFor { board, chip, crystal_hz })) => {
            // An unknown board is like ours with the same chip.
            let alike = Board::ALL.into_iter().find(|known| known.chip == chip);
            let alike = alike.unwrap_or_default();
            Board::named(&board).unwrap_or(Board { crystal_hz, ..alike })
        }
    };
    let crystal_hz = crystal.unwrap_or(board.crystal_hz);
    Ok(Board { crystal_hz, ..board })
}

/// The program of the robot's other board, if it has one, built first.
pub(crate) fn partner(robot: &Description, wanted: Wanted) -> Result<Option<Vec<u8>>> {
    let other = robot.partner.map(|it| program(None, &(it.description)(), wanted)).transpose();
    Ok(other.context("the other board")?.map(|(_, program)| program))
}

/// The program to run, and where it is: an ELF file, or a robot's own firmware, which is built first. Fails if there is
/// none, or it cannot be read.
pub(crate) fn program(
    elf: Option<&Path>,
    robot: &Description,
    wanted: Wanted,
) -> Result<(PathBuf, Vec<u8>)> {
    let path = match (elf, robot.firmware) {
        (Some(path), _) => path.into(),
        (None, Some(build)) => build(wanted)?,
        (None, None) => bail!("this robot does not say how to build a firmware: name an ELF file"),
    };
    let program = fs::read(&path).with_context(|| unreadable(&path))?;
    Ok((path, program))
}

/// Why a program does not fit a board, in one sentence.
pub(crate) fn mismatch(made_for: Option<&MadeFor>, board: &Board) -> Option<String> {
    let MadeFor { board: name, chip, crystal_hz } = made_for?;
    let mut found = Vec::new();
    if name != board.name {
        let Board { name: ours, chip: our_chip, .. } = board;
        found.push(format!("the program is for {name} ({chip}), the board is {ours} ({our_chip})"));
    }
    if *crystal_hz != board.crystal_hz {
        let [wanted, is] = [*crystal_hz, board.crystal_hz].map(|hz| hz as f64 / 1e6);
        let rate = (10_000.0 * is / wanted).round() / 10.0;
        found.push(format!(
            "the program is for a crystal of {wanted} MHz, the board's has {is}: buses at 1000 kbit/s \
             would run at {rate} kbit/s"
        ));
    }
    (!found.is_empty()).then(|| found.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_crystal_or_board_is_reported() {
        let of = |board: &Board| MadeFor {
            board: board.name.into(),
            chip: board.chip.into(),
            crystal_hz: board.crystal_hz,
        };
        let ours = of(&Board::H723ZG);
        assert_eq!(mismatch(Some(&ours), &Board::H723ZG), None);
        assert_eq!(mismatch(None, &Board::H723ZG), None);
        let soldered = Board { crystal_hz: 24_000_000, ..Board::H723ZG };
        let told = mismatch(Some(&ours), &soldered);
        let expected = "the program is for a crystal of 25 MHz, the board's has 24: buses at 1000 kbit/s would run at \
                        960 kbit/s";
        assert_eq!(told.as_deref(), Some(expected));
        let told = mismatch(Some(&of(&Board::DM_MC02)), &Board::H723ZG);
        let expected = "the program is for dm-mc02 (STM32H723VG), the board is h723zg (STM32H723ZG); the program is for a \
                        crystal of 24 MHz, the board's has 25: buses at 1000 kbit/s would run at 1041.7 kbit/s";
        assert_eq!(told.as_deref(), Some(expected));
    }

    #[test]
    fn boards_and_crystals_are_what_there_is() {
        assert_eq!(named("dm-mc02"), Ok(Board::DM_MC02));
        assert_eq!(named("DM-MC02"), Err("there is no such board: h723zg, dm-mc02".into()));
        assert_eq!(crystal("24"), Ok(24_000_000));
        assert_eq!(crystal("19.2"), Ok(19_200_000));
        for wrong in ["3.9", "51", "NaN", "inf", "-24", "24MHz", ""] {
            assert_eq!(crystal(wrong), Err("a crystal has 4 to 50 MHz".into()), "{wrong}");
        }
    }
}
