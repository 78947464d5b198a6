//! The origin of a recording, for people: no figure and no hash depends on it.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{SystemTime, UNIX_EPOCH};
use std::{env, iter};

/// The robot and the program that made a recording; texts that are not known are empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Name of the robot.
    pub robot: String,
    /// The command line.
    pub command: String,
    /// Date and time, UTC.
    pub date: String,
    /// The git revision of the folder in which the command ran.
    pub revision: String,
}

impl Origin {
    /// The origin of what this program records now.
    pub fn now(robot: &str) -> Self {
        let mut words = env::args();
        let program = words.next().unwrap_or_default();
        let program = Path::new(&program).file_stem().map(|it| it.to_string_lossy().into_owned());
        let command: Vec<_> =
            iter::once(program.unwrap_or_default()).chain(words.map(quoted)).collect();
        let git = Command::new("git")
            .args(["describe", "--always", "--dirty"])
            .stdin(Stdio::null())
            .output();
        let said = git.ok().filter(|it| it.status.success()).map(|it| it.stdout);
        let since = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |it| it.as_secs());
        Self {
            robot: robot.to_owned(),
            command: command.join(" "),
            date: date(since),
            revision: String::from_utf8_lossy(&said.unwrap_or_default()).trim().to_owned(),
        }
    }

    /// The origin as a record has it.
    pub(crate) fn read<'t>(text: &impl Fn(&str) -> &'t str) -> Self {
        let text = |key| text(key).to_owned();
        let [robot, command] = [text("robot"), text("command")];
        Self { robot, command, date: text("date"), revision: text("revision") }
    }

    pub(crate) fn entries(self) -> [(String, String); 4] {
        let Self { robot, command, date, revision } = self;
        let all = [("robot", robot), ("command", command), ("date", date), ("revision", revision)];
        all.map(|(key, text)| (key.to_owned(), text))
    }
}

/// A word as a shell takes it.
fn quoted(word: String) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || "-_./:=,@+".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) {
        word
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// Seconds since 1970 as a date: civil from days, after Howard Hinnant.
fn date(since: u64) -> String {
    let (days, minutes) = (since / 86_400 + 719_468, since / 60 % 1440);
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let (month, next) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    let (year, hour, minute) = (400 * era + year + next, minutes / 60, minutes % 60);
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_has_a_command_that_a_shell_takes_and_a_date() {
        for (since, wanted) in [
            (0, "1970-01-01 00:00 UTC"),
            (951_782_399, "2000-02-28 23:59 UTC"),
            (951_782_400, "2000-02-29 00:00 UTC"),
            (1_764_343_312, "2025-11-28 15:21 UTC"),
            (1_767_225_600, "2026-01-01 00:00 UTC"),
        ] {
            assert_eq!(date(since), wanted);
        }
        let words = ["--fault", "cut:2@1s..2s", "it's", ""].map(|it| quoted(it.to_owned()));
        assert_eq!(words, ["--fault", "cut:2@1s..2s", r"'it'\''s'", "''"]);
        let origin = Origin::now("team");
        let map: std::collections::BTreeMap<_, _> = origin.clone().entries().into();
        assert_eq!(Origin::read(&|key: &str| map[key].as_str()), origin);
    }
}
