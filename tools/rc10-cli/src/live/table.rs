//! Changed parameters as lines for the robot's table, to be pasted there.

use rc10_motor::rc10_app::PidConfig;

use super::client::Parameter;
use crate::record::replay::Kit;

/// The lines for all parameters that are not as the table has them; empty if none is changed. Motors with the same
/// lines share them.
pub fn table_lines<'p>(parameters: impl Iterator<Item = &'p Parameter>, kit: &Kit<'_>) -> String {
    let all: Vec<_> = parameters.collect();
    let mut blocks: Vec<(Vec<&str>, String, String)> = Vec::new();
    for motor in all.chunk_by(|a, b| (&a.folder, &a.label) == (&b.folder, &b.label)) {
        let changed: Vec<_> = motor.iter().copied().filter(|it| it.is_changed()).collect();
        let Some(first) = changed.first() else { continue };
        let label = first.label.as_str();
        let was: Vec<_> =
            changed.iter().map(|it| format!("{} was {:?}", it.name, it.initial)).collect();
        let (was, lines) = if first.folder == "motors" {
            (was.join(", "), loops(label, motor, kit))
        } else {
            let [least, most] = first.range;
            let (unit, value) = (&first.unit, first.value);
            let line = format!("{label:?}, {unit:?}, {value:?}, [{least:?}, {most:?}];\n");
            (format!("in live!, was {:?}", first.initial), Some(line))
        };
        // Of a motor that this program does not have it does not know the rest of the line.
        let told = |it: &&Parameter| format!("// {} {:?}\n", it.name, it.value);
        let lines = lines.unwrap_or_else(|| changed.iter().map(told).collect());
        match blocks.iter_mut().find(|it| it.1 == was && it.2 == lines) {
            Some((labels, ..)) => labels.push(label),
            None => blocks.push((vec![label], was, lines)),
        }
    }
    let block = |(labels, was, lines): &(Vec<&str>, String, String)| {
        format!("// {}: {was}\n{lines}", labels.join(", "))
    };
    blocks.iter().map(block).collect()
}

/// The lines of a motor's `Cascade { .. }` in which something is changed.
fn loops(label: &str, parameters: &[&Parameter], kit: &Kit<'_>) -> Option<String> {
    let line = kit.description().motors.iter().position(|motor| motor.label == label)?;
    let cascade = (*kit.loops().get(line)?)?.cascade;
    let mut lines = String::new();
    for (name, mut pid) in [("speed", cascade.speed), ("angle", cascade.angle)] {
        let is_free = pid.integral_limit.to_bits() == pid.output_limit.to_bits();
        let mut is_changed = false;
        for it in parameters {
            let place = match it.name.strip_prefix(name) {
                Some("_kp") => &mut pid.kp,
                Some("_ki") => &mut pid.ki,
                Some("_kd") => &mut pid.kd,
                None if it.name == "limit" && name == "speed" => &mut pid.output_limit,
                _ => continue,
            };
            *place = it.value;
            is_changed |= it.is_changed();
        }
        if is_free {
            pid.integral_limit = pid.output_limit;
        }
        if is_changed {
            lines += &format!("{name}: {},\n", expression(&pid));
        }
    }
    Some(lines)
}

/// A controller as Rust.
pub(crate) fn expression(pid: &PidConfig) -> String {
    let plain = PidConfig::within(pid.output_limit);
    let mut text = format!("PidConfig::within({})", float(pid.output_limit));
    for (name, gain) in [("kp", pid.kp), ("ki", pid.ki), ("kd", pid.kd)] {
        if gain > 0.0 {
            text += &format!(".{name}({})", float(gain));
        }
    }
    let filter = |pid: &PidConfig| pid.derivative_filter.get();
    let others: String = [
        ("integral_limit", pid.integral_limit, plain.integral_limit),
        ("integral_separation", pid.integral_separation, plain.integral_separation),
        ("deadband", pid.deadband, plain.deadband),
        ("derivative_filter", filter(pid), filter(&plain)),
        ("setpoint_weight", pid.setpoint_weight, plain.setpoint_weight),
        ("tracking", pid.tracking, plain.tracking),
    ]
    .into_iter()
    .filter(|(_, value, plain)| value.to_bits() != plain.to_bits())
    .map(|(name, value, _)| match name {
        "derivative_filter" => format!("{name}: Seconds::new({}), ", float(value)),
        _ => format!("{name}: {}, ", float(value)),
    })
    .collect();
    if others.is_empty() { text } else { format!("PidConfig {{ {others}..{text} }}") }
}

pub(crate) fn float(value: f32) -> String {
    if value.is_finite() { format!("{value:?}") } else { "f32::INFINITY".into() }
}

#[cfg(test)]
mod tests {
    use rc10_motor::rc10_app::Seconds;

    use super::*;

    /// What is printed is the code that makes the same controller.
    #[test]
    fn a_controller_is_printed_as_the_code_that_makes_it() {
        macro_rules! same {
            ($($code:expr),* $(,)?) => {
                [$(($code, stringify!($code))),*]
            };
        }
        let all = same![
            PidConfig::within(20.0).kp(0.5).ki(4.0),
            PidConfig::within(3.0).kp(1e-5).kd(1.25),
            PidConfig { integral_limit: 2.0, ..PidConfig::within(20.0).kp(0.1) },
            PidConfig {
                integral_separation: 9.0,
                deadband: 0.1,
                derivative_filter: Seconds::new(0.01),
                setpoint_weight: 0.5,
                tracking: 3.0,
                ..PidConfig::within(f32::INFINITY).kd(0.1)
            },
        ];
        let bare = |text: &str| text.split([' ', '\n']).collect::<String>();
        for (pid, code) in all {
            assert_eq!(bare(&expression(&pid)), bare(code));
        }
    }
}
