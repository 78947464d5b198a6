//! The language of texts for people: English in the code, Chinese by one table.
//!
//! A text is looked up where it is shown. So the code that finds a problem knows nothing of languages, and page,
//! report and terminal share the table.

use std::collections::HashMap;
use std::env;
use std::sync::LazyLock;

use clap::builder::StyledStr;
use clap::{Arg, ArgAction, Command, ValueEnum};
use serde_json::{Value, json};

/// Language of texts for people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Language {
    /// English.
    #[default]
    En,
    /// 简体中文
    Zh,
}

/// The Chinese of English texts: a line each, with a tab between. `{0}` to `{9}` stand for what changes.
const TABLE: &str = include_str!("zh.tsv");

/// The table's script for a page: in the language of the command line, or the browser's.
pub(crate) fn script() -> String {
    let language = Language::asked().map(|it| if it == Language::Zh { "zh" } else { "en" });
    let table: Value = TABLE.lines().map(|line| line.split('\t').collect::<Value>()).collect();
    // Of text within a script element.
    let table = json!([table, language]).to_string().replace('<', "\\u003c");
    include_str!("lang.js").replace("/*TABLE*/", &table)
}

/// A text with places for others.
struct Pattern {
    /// What stands before the first place, between two, and behind the last.
    pieces: Vec<&'static str>,
    /// The numbers of the places, in the order of the English text.
    places: Vec<char>,
    chinese: &'static str,
}

impl Pattern {
    fn new(english: &'static str, chinese: &'static str) -> Self {
        let mut pieces = english.split('{');
        let first = pieces.next().unwrap_or_default();
        let rest: Vec<_> =
            pieces.filter_map(|it| Some((it.chars().next()?, it.get(2..)?))).collect();
        let pieces = std::iter::once(first).chain(rest.iter().map(|(_, text)| *text)).collect();
        Self { pieces, places: rest.iter().map(|(place, _)| *place).collect(), chinese }
    }

    /// Number of letters that must be so.
    fn weight(&self) -> usize {
        self.pieces.iter().map(|piece| piece.len()).sum()
    }

    fn apply(&self, text: &str) -> Option<String> {
        let (first, rest) = self.pieces.split_first()?;
        let mut text = text.strip_prefix(first)?;
        let mut chinese = self.chinese.to_owned();
        for (index, (piece, place)) in rest.iter().zip(&self.places).enumerate() {
            let is_last = index + 1 == rest.len();
            let end = if is_last { text.strip_suffix(piece)?.len() } else { text.find(piece)? };
            let value = text.get(..end).filter(|value| !value.is_empty())?;
            chinese = chinese.replace(&format!("{{{place}}}"), &translated(value));
            text = &text[end + piece.len()..];
        }
        Some(chinese)
    }
}

static WHOLE: LazyLock<HashMap<&str, &str>> =
    LazyLock::new(|| TABLE.lines().filter_map(|line| line.split_once('\t')).collect());

static PATTERNS: LazyLock<Vec<Pattern>> = LazyLock::new(|| {
    let lines = TABLE.lines().filter_map(|line| line.split_once('\t'));
    let mut patterns: Vec<_> = lines
        .filter(|(english, _)| english.contains("{0}"))
        .map(|(english, chinese)| Pattern::new(english, chinese))
        .collect();
    patterns.sort_by_key(|pattern| std::cmp::Reverse(pattern.weight()));
    patterns
});

/// The Chinese of a line, as far as the table has it: names stay.
fn translated(line: &str) -> String {
    let text = line.trim();
    if !text.contains(|letter: char| letter.is_ascii_alphabetic()) {
        return line.into();
    }
    let whole = || WHOLE.get(text).map(|chinese| (*chinese).to_owned());
    let found = whole().or_else(|| PATTERNS.iter().find_map(|pattern| pattern.apply(text)));
    found.map_or_else(|| line.into(), |chinese| line.replace(text, &chinese))
}

impl Language {
    /// The language that a command line asks for by `--lang`.
    pub(crate) fn asked() -> Option<Self> {
        let mut arguments = env::args().skip_while(|it| !it.starts_with("--lang"));
        let named = arguments.next()?;
        let name = named.strip_prefix("--lang=").map(Into::into).or_else(|| arguments.next())?;
        Self::from_str(&name, true).ok()
    }

    /// The language of the environment.
    pub(crate) fn of_environment() -> Self {
        let named = ["LC_ALL", "LC_MESSAGES", "LANG"].into_iter().find_map(env::var_os);
        let is_chinese = named.is_some_and(|it| it.to_string_lossy().starts_with("zh"));
        if is_chinese { Self::Zh } else { Self::En }
    }

    /// The language of a command: the one asked for, or the environment's.
    pub(crate) fn spoken() -> Self {
        Self::asked().unwrap_or_else(Self::of_environment)
    }

    /// A text of one or more lines in this language.
    pub(crate) fn say(self, text: &str) -> String {
        match self {
            Self::En => text.into(),
            Self::Zh => text.split('\n').map(translated).collect::<Vec<_>>().join("\n"),
        }
    }

    /// A command whose help is in this language.
    pub(crate) fn help(self, command: Command) -> Command {
        if self == Self::En {
            return command;
        }
        let say = |text: &StyledStr| self.say(&text.to_string());
        let argument = |argument: Arg| {
            let heading = if argument.is_positional() { "参数" } else { "选项" };
            let help = argument.get_long_help().or_else(|| argument.get_help());
            let mut help = help.map(say).unwrap_or_default();
            for value in argument.get_default_values() {
                help += &format!(" [默认：{}]", value.to_string_lossy());
            }
            for value in argument.get_possible_values() {
                let about = value.get_help().filter(|_| !argument.is_hide_possible_values_set());
                help += &about.map_or_else(String::new, |about| {
                    format!("\n- {}：{}", value.get_name(), say(about))
                });
            }
            let takes = argument.get_action().takes_values();
            let argument = argument.hide_default_value(takes).hide_possible_values(takes);
            argument.help(help.clone()).long_help(help).help_heading(heading)
        };
        let flag = |name, letter, action, text| {
            Arg::new(name).short(letter).long(name).action(action).help(text)
        };
        let help = flag("help", 'h', ArgAction::Help, "Print help");
        let version = flag("version", 'V', ArgAction::Version, "Print version");
        let version = command.get_version().map(|_| version);
        let about = command.get_about().map(say).unwrap_or_default();
        let after = command.get_after_help().map(say).unwrap_or_default();
        command
            .disable_help_flag(true)
            .disable_version_flag(true)
            .args([help].into_iter().chain(version))
            .mut_args(argument)
            .mut_subcommands(|it| self.help(it))
            .subcommand_help_heading("命令")
            .help_template("{about-with-newline}\n用法：{usage}\n\n{all-args}{after-help}")
            .about(about)
            .after_help(after)
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    /// Lines of a text that the table lacks.
    fn missing(text: &str) -> Vec<&str> {
        let is_missing = |line: &&str| {
            let has_letters = line.contains(|letter: char| letter.is_ascii_alphabetic());
            has_letters && !WHOLE.contains_key(line.trim())
        };
        text.lines().filter(is_missing).collect()
    }

    #[test]
    fn the_table_has_all_help() {
        fn look(command: &Command) {
            let mut texts: Vec<_> = [command.get_about(), command.get_after_help()].into();
            for argument in command.get_arguments() {
                texts.extend([argument.get_help(), argument.get_long_help()]);
            }
            for text in texts.into_iter().flatten().map(ToString::to_string) {
                let missing = missing(&text);
                assert!(missing.is_empty(), "{}: no Chinese of {missing:#?}", command.get_name());
            }
            command.get_subcommands().for_each(look);
        }
        look(&crate::Arguments::command());
        Language::Zh.help(crate::Arguments::command()).debug_assert();
    }

    #[test]
    fn a_text_with_places_takes_its_values_over() {
        let (english, chinese) = ("{0}: lost since {1} s", "{1} s 起失联：{0}");
        let pattern = Pattern::new(english, chinese);
        assert_eq!(pattern.apply("arm: lost since 2.5 s").unwrap(), "2.5 s 起失联：arm");
        assert_eq!(pattern.apply("arm: lost since  s"), None, "nothing at a place");
        assert_eq!(pattern.apply("arm: lost"), None);
        assert_eq!(translated("  Print help"), "  打印帮助");
        assert_eq!(translated("no such text"), "no such text");
    }

    #[test]
    fn the_table_is_whole() {
        for line in TABLE.lines() {
            let (english, chinese) = line.split_once('\t').unwrap_or_else(|| panic!("{line}"));
            assert!(!chinese.contains('\t') && !chinese.is_empty(), "{line}");
            for place in 0..10 {
                let place = format!("{{{place}}}");
                assert_eq!(english.contains(&place), chinese.contains(&place), "{line}");
            }
        }
        assert_eq!(TABLE.lines().count(), WHOLE.len(), "a text stands in the table twice");
    }
}
