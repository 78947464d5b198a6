//! Many constants in few lines, as the manual's tables have them.

/// Constants of bits, by their numbers: `bits! { INIT: 0, CCE: 1 }`.
macro_rules! bits {
    ($visible:vis $($name:ident: $bit:literal),+ $(,)?) => {
        $($visible const $name: u32 = 1 << $bit;)+
    };
}

/// Constants of words, as offsets of registers are: `words! { CR: 0x00, SR: 0x20 }`.
macro_rules! words {
    ($visible:vis $($name:ident: $word:literal),+ $(,)?) => {
        $($visible const $name: u32 = $word;)+
    };
}
