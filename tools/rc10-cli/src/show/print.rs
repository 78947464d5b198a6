//! The end of a run: its tables on the terminal, its report and logs in a folder.

use std::io::{self, Write};
use std::path::Path;

use crate::recording::Recording;
use crate::show::figures::{Figures, Tables, remote_lines, verdict};
use crate::terminal::wrapped;

pub(crate) fn print(
    recording: &Recording,
    figures: &Figures,
    headline: &str,
    folder: &Path,
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(out, "{headline}\n")?;
    let Tables { motors, buses, lines, parts, signals } = &figures.tables;
    let lines = lines.as_ref().map_or_else(String::new, |lines| format!("\n{}", lines.text()));
    let remote = wrapped(&remote_lines(recording));
    writeln!(out, "{}\n{}{lines}{remote}", motors.text(), buses.text())?;
    for table in [parts, signals].into_iter().flatten() {
        writeln!(out, "{}", table.text())?;
    }
    if let Some(path) = &figures.path {
        writeln!(out, "{}", wrapped(&path.lines()))?;
    }
    if recording.source.is_simulated() {
        writeln!(out, "trace {}", recording.trace_hash())?;
    }
    print_files(recording, folder, out)?;
    write!(out, "\n{}", verdict(recording, figures))
}

/// Prints the paths of a run's files.
pub(crate) fn print_files(
    recording: &Recording,
    folder: &Path,
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(out, "open  {}", folder.join("report.html").display())?;
    if recording.no_logs {
        return Ok(());
    }
    writeln!(out, "logs  {}  (rc10 decode reads them)", folder.join("bus*.log").display())
}
