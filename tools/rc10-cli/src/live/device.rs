//! `rc10 device`: the registers of a motor's own device, through the robot.

use std::io::Write;

use anyhow::{Context, Result, bail, ensure};
use clap::{Args, Subcommand};
use rc10_link::Action;
use rc10_motor::signals::{Kind, Message, Presence, Signal};

use super::client::Answer;
use super::session::Session;
use super::source::SourceArgs;
use crate::recording::sample::rounded;
use crate::robot::motor::Motor;
use crate::world::robot::Robot;

/// Arguments of `rc10 device`.
#[derive(Args, Debug)]
pub struct DeviceArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Debug)]
enum What {
    /// Prints registers of a motor's device
    Get(GetRegisterArgs),
    /// Writes registers of a motor's device, until its power is cut; only while the robot is disarmed
    Set(SetRegisterArgs),
}

#[derive(Args, Debug)]
struct GetRegisterArgs {
    /// The motor's name
    #[arg(value_name = "MOTOR")]
    motor: String,
    /// Names or numbers of registers [default: all that have a name]
    #[arg(value_name = "REGISTER")]
    registers: Vec<String>,
    #[command(flatten)]
    at: SourceArgs,
}

#[derive(Args, Debug)]
struct SetRegisterArgs {
    /// The motor's name
    #[arg(value_name = "MOTOR")]
    motor: String,
    /// Changes, one after the other
    #[arg(required = true, value_name = "REGISTER=VALUE")]
    changes: Vec<String>,
    /// The device keeps all its registers over a power-off, too; its memory bears that about 10,000 times
    #[arg(long)]
    save: bool,
    #[command(flatten)]
    at: SourceArgs,
}

/// Prints or writes registers of a motor's device. Fails without a robot, such a motor or register, or if the robot or
/// its device refuses.
pub fn device(args: &DeviceArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    match &args.what {
        What::Get(args) => get(args, robot, out),
        What::Set(args) => set(args, robot, out),
    }
}

fn get(args: &GetRegisterArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let (label, named) = motor(&args.motor, &robot)?;
    let is_list = args.registers.is_empty();
    let asked = args.registers.iter().map(|it| find(it, &named)).collect::<Result<_>>()?;
    let mut device = Device::meet(&args.at, robot, &label)?;
    for register in if is_list { named } else { asked } {
        match device.read(&register) {
            Ok(line) => writeln!(out, "{line}")?,
            // Not every model and firmware has all of them.
            Err(error) if is_list => writeln!(out, "{}: {error}", register.name())?,
            Err(error) => return Err(error.context(register.name())),
        }
    }
    Ok(())
}

fn set(args: &SetRegisterArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let (label, named) = motor(&args.motor, &robot)?;
    let changes = args.changes.iter().map(|change| read(change, &named));
    let changes = changes.collect::<Result<Vec<_>>>()?;
    let mut device = Device::meet(&args.at, robot, &label)?;
    let number = device.number;
    for (register, bits) in &changes {
        let write = Action::WriteRegister(number, register.number, *bits);
        if let Err(error) = device.session.carry_out(write) {
            let holds = device
                .read(register)
                .map_or_else(|_| String::new(), |it| format!("; it holds {it}"));
            bail!("{}: not written: {error:#}{holds}", register.name());
        }
    }
    for (register, _) in &changes {
        let line = device.read(register).with_context(|| register.name())?;
        writeln!(out, "{line}")?;
    }
    if args.save {
        device.session.carry_out(Action::SaveRegisters(number)).context("not saved")?;
    }
    // Whether it is as the table says now is looked at again.
    let cleared = device.session.carry_out(Action::ClearFault(number));
    cleared.context("its fault is not cleared")?;
    let how =
        if args.save { "kept over a power-off" } else { "until its power is cut; --save keeps it" };
    writeln!(out, "written, {how}: {label}")?;
    Ok(())
}

/// The label of the motor of a name, and its device's registers.
fn motor(name: &str, robot: &Robot<'_>) -> Result<(String, Vec<Register>)> {
    let motor = &robot.description().motors[robot.description().motor_called(name)?];
    let named = registers(motor);
    ensure!(!named.is_empty(), "{}, {}: no registers are known", motor.label, motor.name());
    Ok((motor.label.to_string(), named))
}

/// A motor's device, through its robot.
struct Device<'r> {
    session: Session<'r>,
    number: u8,
}

impl<'r> Device<'r> {
    fn meet(at: &SourceArgs, robot: Robot<'r>, label: &str) -> Result<Self> {
        let session = Session::meet(at.open_disarmed(robot)?)?;
        let number =
            session.client.motor(label).context("the robot that runs has no such motor")?;
        Ok(Self { session, number })
    }

    /// A line with a register and its value.
    fn read(&mut self, register: &Register) -> Result<String> {
        match self.session.carry_out(Action::ReadRegister(self.number, register.number))? {
            Answer::Register(bits) => Ok(register.tell(bits)),
            _ => bail!("the robot told no value"),
        }
    }
}

/// A register of a device, and how its four bytes are read, if that is known.
#[derive(Clone, Copy)]
struct Register {
    number: u16,
    signal: Option<&'static Signal>,
}

/// The registers of a motor's device that have a name.
fn registers(motor: &Motor) -> Vec<Register> {
    // Damiao, then CyberGear and RobStride.
    let tells =
        |it: &Signal| it.presence == Presence::Switch && ["REGISTER", "INDEX"].contains(&it.name);
    let messages = motor.messages();
    let has_values = |it: &&Message| it.signals.len() > 1 && it.signals.iter().any(tells);
    let signals = messages.iter().find(has_values).map_or(&[][..], |it| it.signals);
    let register = |signal: &'static Signal| match signal.presence {
        Presence::If(number) => {
            Some(Register { number: number.try_into().ok()?, signal: Some(signal) })
        }
        _ => None,
    };
    signals.iter().filter_map(register).collect()
}

/// The register of a name or a number, which may have no name.
fn find(text: &str, named: &[Register]) -> Result<Register> {
    let number = match text.strip_prefix("0x") {
        Some(hex) => u16::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    };
    let is_meant = |it: &&Register| {
        Some(it.number) == number || it.signal.is_some_and(|it| it.name.eq_ignore_ascii_case(text))
    };
    if let Some(known) = named.iter().find(is_meant) {
        return Ok(*known);
    }
    let names: Vec<_> = named.iter().map(Register::name).collect();
    let number =
        number.with_context(|| format!("no register `{text}`; there are {}", names.join(", ")));
    Ok(Register { number: number?, signal: None })
}

/// A change, and the bytes that it writes.
fn read(change: &str, named: &[Register]) -> Result<(Register, u32)> {
    let both = change.split_once('=');
    let (name, value) = both.with_context(|| format!("`{change}`: it is to be REGISTER=VALUE"))?;
    let register = find(name, named)?;
    let signal = register.signal;
    let signal =
        signal.with_context(|| format!("{name}: only a register with a name is written"))?;
    if let Some((raw, _)) = signal.values().find(|(_, name)| name.eq_ignore_ascii_case(value)) {
        return Ok((register, raw));
    }
    let number: f64 =
        value.parse().with_context(|| format!("`{change}`: `{value}` is no number"))?;
    let raw = (number - signal.offset) / signal.factor;
    let most = (1_u64 << signal.bits) - 1;
    if signal.kind == Kind::Float {
        ensure!((raw as f32).is_finite(), "`{change}`: too large");
        return Ok((register, (raw as f32).to_bits()));
    }
    let is_whole = (raw - raw.round()).abs() < 1e-6 && raw > -0.5 && raw <= most as f64;
    ensure!(
        is_whole,
        "`{change}`: it is to be 0 to {}, in steps of {}",
        most as f64 * signal.factor,
        signal.factor
    );
    Ok((register, raw.round() as u32))
}

impl Register {
    fn name(&self) -> String {
        self.signal.map_or_else(|| format!("{:#06x}", self.number), |it| it.name.to_owned())
    }

    /// A line with its value.
    fn tell(&self, bits: u32) -> String {
        let Some(signal) = self.signal else {
            return format!(
                "{} = {bits} ({bits:#010x}, {} as f32)",
                self.name(),
                f32::from_bits(bits)
            );
        };
        // Both vendors have it behind what names the register.
        let payload = (u64::from(bits) << 32).to_le_bytes();
        let (raw, value) = (signal.raw(&payload), signal.physical(&payload).unwrap_or(f64::NAN));
        let named = signal.values().find(|(it, _)| raw == Some(u64::from(*it)));
        let after = named.map_or_else(|| signal.unit.into(), |(_, name)| format!("({name})"));
        format!("{} = {} {after}", signal.name, rounded(value, 6)).trim_end().to_owned()
    }
}
