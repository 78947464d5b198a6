use std::collections::BTreeSet;

const LONGEST: usize = 32;

/// A name as a DBC file takes it: letters, digits and underscores, at most 32, no digit first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name {
    /// The name in the file.
    pub short: String,
    /// The whole name.
    pub long: String,
}

#[derive(Default)]
pub(super) struct Names {
    taken: BTreeSet<String>,
}

impl Names {
    /// A name for `wanted`, with a number behind it if it is taken.
    pub(super) fn name(&mut self, wanted: &str) -> Name {
        let wanted = identifier(wanted);
        let long = self.free(&wanted, usize::MAX);
        let short = if long.len() > LONGEST { self.free(&long, LONGEST) } else { long.clone() };
        Name { short, long }
    }

    fn free(&mut self, wanted: &str, longest: usize) -> String {
        let numbered = |number: u32| {
            let behind = if number == 1 { String::new() } else { format!("_{number}") };
            let room = longest.saturating_sub(behind.len()).min(wanted.len());
            format!("{}{behind}", &wanted[..room])
        };
        let free = (1..).map(numbered).find(|name| !self.taken.contains(name));
        let free = free.unwrap_or_default();
        self.taken.insert(free.clone());
        free
    }
}

/// Replaces all other characters by underscores.
fn identifier(text: &str) -> String {
    let fits = |character: char| character.is_ascii_alphanumeric() || character == '_';
    let name: String = text.chars().map(|c| if fits(c) { c } else { '_' }).collect();
    if name.starts_with(|first: char| first.is_ascii_digit()) || name.is_empty() {
        format!("_{name}")
    } else {
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fit_the_format_and_differ() {
        let mut names = Names::default();
        let mut name = |wanted: &str| names.name(wanted).short;
        assert_eq!(name("wheel front-left"), "wheel_front_left");
        assert_eq!(name("wheel front left"), "wheel_front_left_2");
        assert_eq!(name("2nd arm"), "_2nd_arm");
        assert_eq!(name("电机"), "__");
        assert_eq!(name(""), "_");
        let long = "a".repeat(40);
        assert_eq!(names.name(&long), Name { short: "a".repeat(32), long: long.clone() });
        let second = names.name(&long);
        assert_eq!((second.short.len(), second.long), (32, format!("{long}_2")));
        assert_ne!(second.short, "a".repeat(32));
    }
}
