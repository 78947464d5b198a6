//! A program's ELF file: its bytes, its functions, its room on the chip.

use std::collections::BTreeMap;
use std::ops::Range;

use anyhow::{Context, Result, ensure};
use object::elf::{
    FileHeader32, PT_LOAD, SHF_ALLOC, SHF_WRITE, SHT_NOBITS, SHT_SYMTAB, STT_FUNC, STT_OBJECT,
};
use object::read::elf::{FileHeader, ProgramHeader, SectionHeader, Sym};
use object::{Endianness, elf};

/// A static variable or constant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Static {
    /// Demangled name, with its path.
    pub name: String,
    /// Address.
    pub address: u32,
    /// Length in bytes.
    pub bytes: u32,
}

/// A program.
pub struct Image {
    /// Physical address and bytes of everything to be stored.
    pub segments: Vec<(u32, Vec<u8>)>,
    /// Every function: its address, without the Thumb bit, and its demangled name.
    pub functions: BTreeMap<u32, String>,
    /// Every symbol's address as it is in the file (functions with the Thumb bit), by its mangled
    /// name.
    pub symbols: BTreeMap<String, u32>,
    /// Every static that has a place and a length.
    pub statics: Vec<Static>,
    /// Address range of each section that the chip holds, by its name.
    pub sections: BTreeMap<String, Range<u32>>,
    /// Bytes of flash: code, constants, the initial values of statics.
    pub flash: u32,
    /// Bytes of static RAM: initialised, zeroed, and what a reset keeps.
    pub ram: u32,
    /// The compiler and its version, if the file says: `rustc version 1.95.0 (..)`.
    pub compiler: Option<String>,
    /// The board that it is for, if the file says.
    pub made_for: Option<MadeFor>,
}

/// The board that a program is for: section `.rc10.board` of its file, as `rc10-board` writes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MadeFor {
    /// Name of the board.
    pub board: String,
    /// Name of its chip.
    pub chip: String,
    /// Crystal, hertz.
    pub crystal_hz: u64,
}

impl MadeFor {
    /// A note of 36 bytes: two texts of 16 that end in zeros, and a number, the low byte first.
    /// Fails if there are more or fewer bytes, or a text is not UTF-8.
    fn parse(bytes: &[u8]) -> Result<Self> {
        let note: &[u8; 36] = bytes
            .try_into()
            .with_context(|| format!("it has {} bytes, and not 36", bytes.len()))?;
        let (board, rest) = note.split_at(16);
        let (chip, hz) = rest.split_at(16);
        let text = |bytes: &[u8]| {
            let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
            std::str::from_utf8(&bytes[..end]).map(str::to_owned)
        };
        let crystal_hz = u32::from_le_bytes(hz.try_into()?).into();
        let board = text(board).context("the board's name is not UTF-8")?;
        let chip = text(chip).context("the chip's name is not UTF-8")?;
        Ok(Self { board, chip, crystal_hz })
    }
}

impl Image {
    /// Reads an ELF file for a 32-bit Arm. Fails if the file is invalid, cut short, or says
    /// nonsense about its board.
    pub fn parse(file: &[u8]) -> Result<Self> {
        let header = FileHeader32::<Endianness>::parse(file).context("no 32-bit ELF file")?;
        let endian = header.endian()?;
        ensure!(header.e_machine(endian) == elf::EM_ARM, "not a program for an Arm processor");
        let mut segments = Vec::new();
        for segment in header.program_headers(endian, file)? {
            if segment.p_type(endian) == PT_LOAD {
                let bytes = segment.data(endian, file).ok().context("a segment is cut short")?;
                if !bytes.is_empty() {
                    segments.push((segment.p_paddr(endian), bytes.to_vec()));
                }
            }
        }
        ensure!(!segments.is_empty(), "nothing in it is to be loaded");
        let table = header.sections(endian, file)?;
        let (mut flash, mut ram) = (0, 0);
        let (mut compiler, mut made_for) = (None, None);
        let mut sections = BTreeMap::new();
        for section in table.iter() {
            let name = table.section_name(endian, section)?;
            if name == b".comment" {
                let comments = String::from_utf8_lossy(section.data(endian, file)?);
                let mut comments = comments.split('\0');
                compiler = comments.find(|text| text.starts_with("rustc")).map(str::to_owned);
            }
            if name == b".rc10.board" {
                let note = MadeFor::parse(section.data(endian, file)?);
                made_for = Some(note.context(".rc10.board makes no sense")?);
            }
            let bytes = section.sh_size(endian);
            if section.sh_flags(endian) & SHF_ALLOC == 0 {
                continue;
            }
            let start = section.sh_addr(endian);
            let name = String::from_utf8_lossy(name).into_owned();
            sections.insert(name, start..start.saturating_add(bytes));
            if section.sh_type(endian) != SHT_NOBITS {
                flash += bytes;
            }
            // Writable: `.data` is in both, once as itself and once as its initial values.
            if section.sh_flags(endian) & SHF_WRITE != 0 {
                ram += bytes;
            }
        }
        let table = table.symbols(endian, file, SHT_SYMTAB)?;
        let (mut functions, mut symbols) = (BTreeMap::new(), BTreeMap::new());
        let mut statics = Vec::new();
        for symbol in table.iter() {
            let name = std::str::from_utf8(symbol.name(endian, table.strings())?)?;
            let address = symbol.st_value(endian);
            let demangled = || format!("{:#}", rustc_demangle::demangle(name));
            if symbol.st_type() == STT_FUNC {
                functions.insert(address & !1, demangled());
            }
            let bytes = symbol.st_size(endian);
            if symbol.st_type() == STT_OBJECT && bytes != 0 {
                statics.push(Static { name: demangled(), address, bytes });
            }
            symbols.insert(name.to_owned(), address);
        }
        Ok(Self { segments, functions, symbols, statics, sections, flash, ram, compiler, made_for })
    }

    /// The value of a symbol. Fails if the program has none of this name.
    pub fn symbol(&self, name: &str) -> Result<u32> {
        self.symbols.get(name).copied().with_context(|| format!("the program has no {name}"))
    }

    /// Whether the file says what stands at an address.
    pub(crate) fn holds(&self, address: u32) -> bool {
        self.segments.iter().any(|(start, bytes)| {
            address.checked_sub(*start).is_some_and(|offset| (offset as usize) < bytes.len())
        })
    }

    /// The function that an address lies in.
    pub fn function_at(&self, address: u32) -> Option<(u32, &str)> {
        let (&start, name) = self.functions.range(..=address).next_back()?;
        Some((start, name))
    }

    /// The addresses of the stack: `_stack_end .. _stack_start`. Fails if the program does not say.
    pub fn stack(&self) -> Result<Range<u32>> {
        Ok(self.symbol("_stack_end")?..self.symbol("_stack_start")?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(board: &[u8], chip: &[u8], crystal_hz: u32) -> Vec<u8> {
        let mut note = vec![0; 36];
        note[..board.len()].copy_from_slice(board);
        note[16..16 + chip.len()].copy_from_slice(chip);
        note[32..].copy_from_slice(&crystal_hz.to_le_bytes());
        note
    }

    /// An ELF file for Arm with one byte to be loaded and a section `.rc10.board`.
    fn file_with(note: &[u8]) -> Vec<u8> {
        let names = b"\0.rc10.board\0.names\0";
        let (header, segment, section) = (52, 32, 40);
        let at_note = header + segment;
        let at_names = at_note + note.len();
        let at_sections = (at_names + names.len()).next_multiple_of(4);
        let word = |value: usize| u32::try_from(value).unwrap_or(0).to_le_bytes();
        let half = |value: usize| u16::try_from(value).unwrap_or(0).to_le_bytes();
        let mut file = b"\x7FELF\x01\x01\x01".to_vec();
        file.resize(16, 0);
        // Executable, Arm.
        file.extend([half(2), half(40)].concat());
        file.extend([word(1), word(0), word(header), word(at_sections), word(0)].concat());
        let counts = [header, segment, 1, section, 3, 2];
        file.extend(counts.iter().flat_map(|&count| half(count)));
        let load = [1, 0, 0x0800_0000, 0x0800_0000, 1, 1, 5, 1];
        file.extend(load.iter().flat_map(|&value| word(value)));
        file.extend(note);
        file.extend(names);
        file.resize(at_sections + section, 0);
        // PROGBITS, STRTAB.
        for [name, kind, place, length] in
            [[1, 1, at_note, note.len()], [13, 3, at_names, names.len()]]
        {
            let fields = [name, kind, 0, 0, place, length, 0, 0, 1, 0];
            file.extend(fields.iter().flat_map(|&value| word(value)));
        }
        file
    }

    #[test]
    fn a_program_says_which_board_it_is_for() {
        let expected =
            MadeFor { board: "dm-mc02".into(), chip: "STM32H723VG".into(), crystal_hz: 24_000_000 };
        let file = file_with(&note(b"dm-mc02", b"STM32H723VG", 24_000_000));
        assert_eq!(Image::parse(&file).map(|image| image.made_for).ok(), Some(Some(expected)));
        // All sixteen bytes of a name may be used.
        let full = MadeFor::parse(&note(&[b'x'; 16], &[b'y'; 16], 1));
        assert_eq!(full.map(|full| (full.board.len(), full.chip.len())).ok(), Some((16, 16)));
    }

    #[test]
    fn a_note_that_makes_no_sense_is_an_error() {
        let good = note(b"dm-mc02", b"STM32H723VG", 24_000_000);
        for (note, why) in [
            (good[..35].to_vec(), "it has 35 bytes, and not 36"),
            ([&good[..], &good].concat(), "it has 72 bytes, and not 36"),
            (vec![], "it has 0 bytes, and not 36"),
            (note(b"\xFF", b"", 1), "the board's name is not UTF-8"),
            (note(b"", b"\xFF", 1), "the chip's name is not UTF-8"),
        ] {
            let error = Image::parse(&file_with(&note)).err().map(|error| format!("{error:#}"));
            let error = error.unwrap_or_default();
            assert!(
                error.starts_with(".rc10.board makes no sense") && error.contains(why),
                "{error}"
            );
        }
    }
}
