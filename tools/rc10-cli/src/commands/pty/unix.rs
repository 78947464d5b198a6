//! Input, output and the wall clock of `rc10 pty`.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use rc10_sim::Tasks;
use rc10_time::Micros;

use crate::commands::pty::terminal::Terminal;
use crate::commands::pty::{PtyArgs, STEP};
use crate::formats::slcan::adapter::{Adapter, Counts, Flow};
use crate::world::environment::Environment;
use crate::world::robot::Robot;

/// Limit of unread bytes, 0.25 s of a full bus: then frames are lost, or lockstep waits.
const ROOM: usize = 64 * 1024;
/// Period of a step in real time.
const PACE: Duration = Duration::from_millis(1);
/// Largest delay behind the clock that is caught up.
const FURTHEST_BEHIND: Micros = Micros::from_millis(100);
/// Period at which a quiet client is checked in lockstep.
const PATIENCE: Duration = Duration::from_millis(100);
/// Time for the client to read what is left at the end.
const LAST_READ: Duration = Duration::from_secs(1);

/// Runs until its time is over or `stop` is set, which is checked every 100 ms. Prints `pty` and
/// the path of the pseudo-terminal first, and what went through and what was lost at the end. Fails
/// if the robot has no such bus or is not as described, or there is no pseudo-terminal.
pub fn serve(
    args: &PtyArgs,
    mut robot: Robot<'_>,
    out: &mut dyn Write,
    stop: &AtomicBool,
) -> Result<()> {
    if !args.alone {
        robot.fit(args.force)?;
    }
    let number = args.bus.context("--bus says which")?;
    let on_bus = robot.description().on_bus(number).count();
    let around = Environment::new(robot.description(), args.seed)?;
    let buses = around.wires.len();
    let bus = usize::from(number).checked_sub(1).filter(|&bus| bus < buses);
    let bus = bus.with_context(|| format!("--bus {number}: the robot has buses 1 to {buses}"))?;
    let tasks = if args.alone { Tasks::new() } else { robot.tasks(&around)? };
    let flow = if args.lockstep { Flow::Lossless } else { Flow::Lossy(ROOM) };
    let adapter = Adapter::new(around.wires[bus].clone(), flow, args.alone);
    let terminal = Terminal::new(args.link.as_deref())?;
    let path = terminal.path.display();
    writeln!(
        out,
        "pty {path}\n\
         bus {number} with {on_bus} devices, {}, {}; slcan at 1 Mbit/s (S8), for example:\n  \
         can.Bus(interface=\"slcan\", channel=\"{path}\", bitrate=1_000_000)",
        if args.alone { "without the robot's program" } else { "and the robot's program" },
        if args.lockstep { "in lockstep with the client" } else { "in real time" },
    )?;
    // A program that waits for the path shall not wait for the end.
    out.flush()?;
    let mut session = Session { around, tasks, bus, adapter, terminal, complained: 0 };
    let end = args.seconds.unwrap_or(Micros::new(u64::MAX));
    let behind = if args.lockstep {
        session.lockstep(end, stop)?;
        Micros::ZERO
    } else {
        session.real_time(end, stop)?
    };
    session.let_read()?;
    write!(out, "{}", summary(&session.adapter.counts(), session.now(), behind))?;
    Ok(())
}

struct Session<'r> {
    around: Environment,
    tasks: Tasks<'r>,
    /// The client's bus, 0 for the first.
    bus: usize,
    adapter: Adapter,
    terminal: Terminal,
    /// Wrong bit rates that were reported.
    complained: u64,
}

impl Session<'_> {
    fn now(&self) -> Micros {
        self.around.world.now()
    }

    fn run(&mut self, until: Micros) {
        self.around.run(&mut self.tasks, until);
        // The traces of the other buses are not read.
        let others = self.around.wires.iter().enumerate().filter(|(bus, _)| *bus != self.bus);
        others.for_each(|(_, wire)| drop(wire.take_trace()));
    }

    /// Runs in real time; returns the delay of the virtual time behind the clock at the end.
    fn real_time(&mut self, end: Micros, stop: &AtomicBool) -> Result<Micros> {
        let mut buffer = [0; 4096];
        let mut behind = Micros::ZERO;
        let start = Instant::now();
        while self.now() < end && !stop.load(Ordering::Relaxed) {
            let clock = Micros::new(start.elapsed().as_micros() as u64);
            let late = clock.since(behind).since(self.now());
            behind += late.since(FURTHEST_BEHIND);
            self.run(clock.since(behind).min(end));
            self.adapter.hear();
            self.terminal.write(self.adapter.out())?;
            self.terminal.wait(true, false, PACE)?;
            for command in self.adapter.take(self.terminal.read(&mut buffer)?) {
                self.adapter.answer(command);
            }
            self.complain();
        }
        Ok(behind)
    }

    fn lockstep(&mut self, end: Micros, stop: &AtomicBool) -> Result<()> {
        let mut buffer = [0; 4096];
        while self.now() < end && !stop.load(Ordering::Relaxed) {
            let unread = self.adapter.out().len();
            let has_room = unread < ROOM;
            self.terminal.wait(has_room, unread > 0, PATIENCE)?;
            self.terminal.write(self.adapter.out())?;
            if !has_room {
                continue;
            }
            for command in self.adapter.take(self.terminal.read(&mut buffer)?) {
                if self.adapter.answer(command) && self.now() < end {
                    self.run((self.now() + STEP).min(end));
                    self.adapter.hear();
                }
            }
            self.complain();
        }
        Ok(())
    }

    /// Reports a wrong bit rate: to the client the bus looks dead.
    fn complain(&mut self) {
        let wrong = self.adapter.counts().wrong_bit_rate;
        if wrong != self.complained {
            self.complained = wrong;
            eprintln!(
                "rc10 pty: the client wants another bit rate than the bus has: it must be \
                 1 Mbit/s (S8). The channel stays closed."
            );
        }
    }

    fn let_read(&mut self) -> Result<()> {
        let start = Instant::now();
        while !self.adapter.out().is_empty() && start.elapsed() < LAST_READ {
            self.terminal.write(self.adapter.out())?;
            self.terminal.wait(false, true, PACE)?;
        }
        Ok(())
    }
}

fn summary(counts: &Counts, now: Micros, behind: Micros) -> String {
    let &Counts { to_client, from_client, .. } = counts;
    let seconds = now.get() as f64 * 1e-6;
    let mut text =
        format!("{seconds} s: {to_client} frames to the client, {from_client} from it\n");
    let losses = [
        (counts.not_read, "frames lost: the client did not read them"),
        (counts.not_open, "frames refused: the channel was not open for sending"),
        (counts.queue_full, "frames refused: too many waited for the bus"),
        (counts.not_sent, "frames of the client still waited for the bus"),
        (counts.malformed, "lines refused: no slcan commands"),
        (counts.wrong_bit_rate, "times refused to open: not the bus's bit rate, S8"),
        (behind.get() / 1000, "ms behind the clock: this machine is too slow"),
    ];
    for (count, what) in losses.into_iter().filter(|(count, _)| *count > 0) {
        text += &format!("{count} {what}\n");
    }
    if losses.iter().all(|(count, _)| *count == 0) {
        text += "nothing lost\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;
    use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
    use std::path::PathBuf;
    use std::thread;

    use rc10_motor::dji::M3508;
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::fs::{Mode, OFlags, open};

    use super::*;
    use crate::robot::description::Description;
    use crate::robot::motor::Motor;

    fn args(link: PathBuf, lockstep: bool, seconds: u64) -> PtyArgs {
        let seconds = Some(Micros::from_millis(1000 * seconds));
        PtyArgs {
            bus: Some(1),
            seconds,
            lockstep,
            alone: true,
            link: Some(link),
            seed: 7,
            ..PtyArgs::default()
        }
    }

    fn link(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("rc10-pty-{name}-{}", std::process::id()))
    }

    /// A wheel on a bus, and a client on the pseudo-terminal; what was printed at the end.
    fn with_client(args: &PtyArgs, client: impl FnOnce(&mut File) + Send) -> String {
        let stop = AtomicBool::new(false);
        let link = args.link.clone().unwrap();
        thread::scope(|scope| {
            let server = scope.spawn(|| {
                let motors = vec![Motor::dji_on("wheel", 1, &M3508, 1)];
                let robot = Robot::new(Description { motors, buses: 1, ..<_>::default() });
                let mut out = Vec::new();
                serve(args, robot, &mut out, &stop).unwrap();
                String::from_utf8(out).unwrap()
            });
            while !link.exists() {
                assert!(!server.is_finished(), "no pseudo-terminal");
                thread::yield_now();
            }
            // Without `NOCTTY` it would become the controlling terminal of a test program that leads
            // a session, and its end would kill that program by SIGHUP.
            let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
            let open = || File::from(open(&link, flags, Mode::empty()).unwrap());
            // The other side ends also if the client fails.
            let result = catch_unwind(AssertUnwindSafe(|| client(&mut open())));
            stop.store(true, Ordering::Relaxed);
            let printed = server.join().unwrap();
            if let Err(panic) = result {
                resume_unwind(panic);
            }
            printed
        })
    }

    /// Reads `length` bytes. Says what came, should the rest never come.
    fn read(client: &mut File, length: usize) -> String {
        let mut bytes = Vec::new();
        while bytes.len() < length {
            let timeout = Timespec::try_from(Duration::from_secs(20)).unwrap();
            let ready = poll(&mut [PollFd::new(client, PollFlags::IN)], Some(&timeout)).unwrap();
            let so_far = String::from_utf8_lossy(&bytes);
            assert!(ready > 0, "{} of {length} bytes: {so_far:?}", bytes.len());
            let mut piece = vec![0; (length - bytes.len()).min(1000)];
            let count = client.read(&mut piece).unwrap();
            bytes.extend(&piece[..count]);
        }
        String::from_utf8(bytes).unwrap()
    }

    /// Fifty commands of 4 A, each of which lets one millisecond pass.
    const COMMAND: &str = "t20080CCD000000000000\r";

    fn lockstep_run(name: &str, piece: usize) -> String {
        let mut heard = String::new();
        let text = "S8\rO\r\r".to_owned() + &COMMAND.repeat(50);
        // An answer to each line, and a frame of the motor in each millisecond.
        let length = 2 + 51 * (1 + 22);
        let printed = with_client(&args(link(name), true, 3600), |client| {
            for piece in text.as_bytes().chunks(piece) {
                client.write_all(piece).unwrap();
            }
            heard = read(client, length);
        });
        assert!(printed.starts_with("pty /dev/"), "{printed}");
        let end = "0.051 s: 51 frames to the client, 50 from it\nnothing lost\n";
        assert!(printed.ends_with(end), "{printed}");
        assert!(!link(name).exists() && fs_is_free(&link(name)));
        heard
    }

    fn fs_is_free(link: &std::path::Path) -> bool {
        std::fs::symlink_metadata(link).is_err()
    }

    #[test]
    fn in_lockstep_the_client_hears_the_same_however_it_writes() {
        let heard = lockstep_run("whole", 10_000);
        assert_eq!(heard, lockstep_run("bytes", 1));
        assert_eq!(heard, lockstep_run("pieces", 37));
        // The motor turns faster from frame to frame: bytes 2 and 3 are its rotor's rpm.
        let rpm = |line: &str| i16::from_str_radix(line.get(9..13)?, 16).ok();
        let rpms: Vec<_> =
            heard.split('\r').filter(|line| line.starts_with('t')).filter_map(rpm).collect();
        assert_eq!(rpms.len(), 51);
        assert!(rpms.is_sorted() && rpms[50] > 200, "{rpms:?}");
    }

    #[test]
    fn in_lockstep_a_quiet_client_stops_time_and_an_unread_one_loses_nothing() {
        // More answers than the pseudo-terminal and the adapter together have room for.
        let frames = 6000;
        let mut heard = 0;
        let printed = with_client(&args(link("unread"), true, 3600), |client| {
            client.write_all(b"O\r").unwrap();
            let mut writer = client.try_clone().unwrap();
            let writing = thread::spawn(move || {
                let text = COMMAND.repeat(frames);
                writer.write_all(text.as_bytes()).unwrap();
            });
            thread::sleep(Duration::from_millis(300));
            heard = read(client, 1 + frames * 23).matches("t2018").count();
            writing.join().unwrap();
        });
        assert_eq!(heard, frames);
        assert!(printed.contains("6 s: 6000 frames to the client, 6000 from it\nnothing lost"));
    }

    #[test]
    fn in_real_time_frames_come_by_themselves_and_unread_ones_are_counted() {
        let mut heard = String::new();
        let printed = with_client(&args(link("real"), false, 3600), |client| {
            client.write_all(b"O\rnonsense\r").unwrap();
            heard = read(client, 2 + 50 * 22);
        });
        assert!(heard.contains('\x07') && heard.matches("t2018").count() >= 49, "{heard:?}");
        assert!(printed.contains("1 lines refused"), "{printed}");
        let short = args(link("end"), false, 1);
        let printed = with_client(&short, |client| {
            // Until the other side has closed.
            while client.read(&mut [0; 256]).is_ok_and(|count| count > 0) {}
        });
        assert!(printed.contains("1 s: 0 frames to the client, 0 from it"), "{printed}");
    }

    #[test]
    fn what_cannot_be_is_refused_in_words() {
        let complaint = |bus, link: Option<PathBuf>| {
            let robot = Robot::new(Description { buses: 2, ..<_>::default() });
            let args = PtyArgs { bus: Some(bus), link, ..args(PathBuf::new(), true, 1) };
            let stop = AtomicBool::new(true);
            serve(&args, robot, &mut Vec::new(), &stop).err().map(|error| error.to_string())
        };
        assert_eq!(complaint(2, None), None);
        for bus in [0, 3] {
            let expected = format!("--bus {bus}: the robot has buses 1 to 2");
            assert_eq!(complaint(bus, None), Some(expected));
        }
        let file = link("file");
        std::fs::write(&file, "in the way").unwrap();
        assert!(complaint(1, Some(file.clone())).unwrap().contains("no symbolic link"));
        std::fs::remove_file(&file).unwrap();
        // One that was left behind is replaced.
        std::os::unix::fs::symlink("nowhere", &file).unwrap();
        assert_eq!(complaint(1, Some(file.clone())), None);
        assert!(fs_is_free(&file));
    }
}
