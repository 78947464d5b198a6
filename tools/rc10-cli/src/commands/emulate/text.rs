//! The text that the chip's UARTs sent.

use std::fmt::Write as _;

use rc10_emu::peripherals::SentByte;

pub(super) struct UartText {
    pub file_name: String,
    /// The lines of the text, each behind its time in seconds.
    pub lines: String,
}

/// The UARTs that send text: at most one byte in a hundred is not part of a text.
pub(super) fn of(sent: &[SentByte]) -> Vec<UartText> {
    let texts = (1..=10).map(|uart| {
        let bytes = sent.iter().filter(move |byte| byte.uart == uart);
        let mut text = UartText { file_name: format!("uart{uart}.txt"), lines: String::new() };
        let (mut all, mut strange, mut begins) = (0_u32, 0_u32, true);
        for byte in bytes {
            let character = u8::try_from(byte.value).map_or('\u{fffd}', char::from);
            let is_text = matches!(character, ' '..='~' | '\n' | '\r' | '\t');
            (all, strange) = (all + 1, strange + u32::from(!is_text));
            if begins {
                // A string takes everything.
                let _ = write!(text.lines, "{:>10.6}  ", byte.start.get() as f64 * 1e-9);
            }
            begins = character == '\n';
            if character != '\r' {
                text.lines.push(if is_text { character } else { '\u{fffd}' });
            }
        }
        (all > 0 && strange * 100 <= all).then_some(text)
    });
    texts.flatten().collect()
}

#[cfg(test)]
mod tests {
    use rc10_sim::Nanos;

    use super::*;

    #[test]
    fn lines_have_their_time_and_bytes_are_no_text() {
        let said = |uart, text: &'static [u8]| {
            text.iter().map(move |&byte| SentByte {
                uart,
                value: byte.into(),
                start: Nanos::new(1_500_000_000),
                end: Nanos::new(1_500_100_000),
            })
        };
        let sent: Vec<_> = said(1, b"no remote\r\nready\n").chain(said(7, &[0x55, 0xFF])).collect();
        let texts = of(&sent);
        assert_eq!(texts.len(), 1);
        assert_eq!(texts[0].file_name, "uart1.txt");
        assert_eq!(texts[0].lines, "  1.500000  no remote\n  1.500000  ready\n");
    }
}
