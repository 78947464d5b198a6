//! A real board: probe-rs, a serial port, and a person at the terminal.

use std::io::{self, BufRead as _, BufReader, Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use super::walk::{Bench, Line};

/// How long probe-rs may take to let go of the probe, and to flash.
const LETS_GO: Duration = Duration::from_secs(3);
const FLASHES: Duration = Duration::from_secs(90);
const OFTEN: Duration = Duration::from_millis(50);
/// A line without an end is one all the same.
const LONGEST: u64 = 4096;
const NONE: &str = "cannot start probe-rs: cargo xtask setup";

/// A board at a probe.
pub(super) struct Probe {
    chip: String,
    elf: PathBuf,
    begun: Instant,
    sender: Sender<Line>,
    lines: Receiver<Line>,
    /// Lines that were heard already.
    first: Vec<Line>,
    /// Reads the log: a probe has one user.
    log: Option<Child>,
}

impl Probe {
    /// A chip for a program, with an adapter at its console perhaps. Fails if that cannot be opened.
    pub(super) fn new(chip: &str, elf: &Path, console: Option<(&str, u32)>) -> Result<Self> {
        let ((sender, lines), begun) = (channel(), Instant::now());
        if let Some((name, baud)) = console {
            let port = serialport::new(name, baud).timeout(Duration::MAX).open();
            pass_on(port.with_context(|| name.to_owned())?, "console", begun, sender.clone());
        }
        let (chip, elf, first) = (format!("{chip}Tx"), elf.into(), Vec::new());
        Ok(Self { chip, elf, begun, sender, lines, first, log: None })
    }

    /// Reads the log from now on: `run` flashes before, `attach` does not.
    fn follow(&mut self, how: &str) -> Result<()> {
        self.let_go();
        // As the runner in .cargo/config.toml.
        let catch_nothing = ["--no-catch-reset", "--no-catch-hardfault"];
        let mut command = Command::new("probe-rs");
        command.args([how, "--chip", &self.chip]).args(catch_nothing);
        command.args(["--log-format", "{L} {s}"]).arg(&self.elf);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().context(NONE)?;
        if let (Some(out), Some(errors)) = (child.stdout.take(), child.stderr.take()) {
            pass_on(out, "log", self.begun, self.sender.clone());
            pass_on(errors, "probe", self.begun, self.sender.clone());
        }
        self.log = Some(child);
        Ok(())
    }

    fn has_log(&mut self) -> bool {
        self.log.as_mut().is_some_and(|log| matches!(log.try_wait(), Ok(None)))
    }
}

impl Drop for Probe {
    fn drop(&mut self) {
        self.let_go();
    }
}

impl Bench for Probe {
    /// Ends probe-rs as a hand does, so that it leaves the core running.
    fn let_go(&mut self) {
        let since = Instant::now();
        if let Some(log) = self.log.as_ref().filter(|_| cfg!(unix)) {
            let _ = Command::new("kill").args(["-INT", &log.id().to_string()]).status();
            while self.has_log() && since.elapsed() < LETS_GO {
                thread::sleep(OFTEN);
            }
        }
        if let Some(mut log) = self.log.take() {
            let _ = log.kill();
            let _ = log.wait();
        }
    }

    fn start(&mut self) -> Result<()> {
        self.follow("run")?;
        let since = Instant::now();
        while self.has_log() && since.elapsed() < FLASHES {
            self.first.extend(self.lines.recv_timeout(OFTEN));
            if self.first.last().is_some_and(|line| line.from == "log") {
                break;
            }
        }
        Ok(())
    }

    fn listen(&mut self, seconds: f64) -> Result<Vec<Line>> {
        if seconds > 0.0 && !self.has_log() {
            self.follow("attach")?;
        }
        let until = Instant::now() + Duration::from_secs_f64(seconds);
        let mut lines = std::mem::take(&mut self.first);
        let left = || until.saturating_duration_since(Instant::now());
        while let Ok(line) = self.lines.recv_timeout(left()) {
            lines.push(line);
        }
        Ok(lines)
    }

    fn read(&mut self, address: u32) -> Result<u32> {
        self.let_go();
        let address = format!("{address:#010x}");
        let arguments = ["read", "--chip", &self.chip, "b32", &address, "1"];
        let output = Command::new("probe-rs").args(arguments).output().context(NONE)?;
        let [told, errors] = [&output.stdout, &output.stderr].map(|it| String::from_utf8_lossy(it));
        let word = told.split_whitespace().find_map(|word| u32::from_str_radix(word, 16).ok());
        match word.filter(|_| output.status.success()) {
            Some(word) => Ok(word),
            None => bail!("probe-rs read {address}: {}{}", told.trim(), errors.trim()),
        }
    }

    fn ask(&mut self, question: &str) -> Result<Option<String>> {
        print!("   {question}: ");
        io::stdout().flush()?;
        let mut answer = String::new();
        Ok((io::stdin().read_line(&mut answer)? > 0).then_some(answer))
    }
}

/// What probe-rs says of its version.
pub(super) fn version() -> String {
    let told = Command::new("probe-rs").arg("--version").output().ok();
    told.map(|it| String::from_utf8_lossy(&it.stdout).trim().into()).unwrap_or_default()
}

/// Passes on each line of a source with the time at which it ended, until that ends.
fn pass_on(from: impl Read + Send + 'static, name: &'static str, begun: Instant, to: Sender<Line>) {
    thread::spawn(move || {
        let (mut source, mut line) = (BufReader::new(from), Vec::new());
        while source.by_ref().take(LONGEST).read_until(b'\n', &mut line).is_ok_and(|it| it > 0) {
            let text = String::from_utf8_lossy(&line).trim_end().to_owned();
            line.clear();
            let at = begun.elapsed().as_secs_f64();
            if to.send(Line { from: name, at, text }).is_err() {
                return;
            }
        }
    });
}
