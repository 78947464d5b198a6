use rc10_can::CanFrame;
use rc10_motor::cybergear::wire::Parameter;
use rc10_motor::cybergear::{Model, Reply};

/// What our codec reads from a frame, under the names of the signal table. Empty for what only a
/// host sends: there is nothing of ours that reads it.
pub fn values(message: &str, frame: &CanFrame, model: &Model) -> Vec<(&'static str, f64)> {
    if !["FEEDBACK_STOPPED", "FEEDBACK_RUNNING", "FAULTS", "PARAMETER", "IDENTITY"]
        .iter()
        .any(|what| message.ends_with(&format!("{}_{what}", vendor(model))))
    {
        return Vec::new();
    }
    match Reply::unpack(frame, &model.limits) {
        Ok(Reply::Feedback(heard)) => vec![
            ("POSITION", heard.position.into()),
            ("VELOCITY", heard.velocity.into()),
            ("TORQUE", heard.torque.into()),
            ("TEMPERATURE", heard.temperature.get().into()),
        ],
        Ok(Reply::Faults(report)) => {
            let bits = |name, mask: u32| {
                let raw = (report.faults & mask) >> mask.trailing_zeros();
                (name, f64::from(raw))
            };
            let mut all: Vec<_> = fault_names(model)
                .iter()
                .zip(model.details)
                .map(|(&name, &(mask, _))| bits(name, mask))
                .collect();
            all.push(("GETS_HOT", f64::from(report.warnings & 1)));
            all
        }
        Ok(Reply::Parameter(value)) => {
            let mut all = vec![("INDEX", f64::from(value.parameter.0))];
            let known = PARAMETERS.iter().find(|(parameter, _)| *parameter == value.parameter);
            if value.parameter == Parameter::RUN_MODE {
                all.push(("RUN_MODE", f64::from(value.byte())));
            } else if value.parameter == Parameter::TIMEOUT && model.saves {
                all.push(("CAN_TIMEOUT", f64::from(u32::from_le_bytes(value.bytes)) * 0.05));
            } else if let (Some((_, name)), Some(real)) = (known, value.real()) {
                all.push((name, real.into()));
            }
            all
        }
        Ok(Reply::Identity { chip, .. }) => vec![("CHIP", chip as f64)],
        _ => Vec::new(),
    }
}

fn vendor(model: &Model) -> &'static str {
    if model.saves { "ROBSTRIDE" } else { "CYBERGEAR" }
}

fn fault_names(model: &Model) -> &'static [&'static str] {
    if model.saves {
        &[
            "DRIVER_CHIP",
            "OVER_CURRENT_A",
            "OVER_CURRENT_B",
            "OVER_CURRENT_C",
            "TOO_HOT",
            "OVERLOAD",
            "OVER_VOLTAGE",
            "UNDER_VOLTAGE",
            "NOT_INITIALISED",
            "NOT_RECOGNISED",
            "NOT_CALIBRATED",
        ]
    } else {
        &[
            "DRIVER_CHIP",
            "OVER_CURRENT_A",
            "OVER_CURRENT_B",
            "OVER_CURRENT_C",
            "TOO_HOT",
            "OVERLOAD",
            "OVER_VOLTAGE",
            "UNDER_VOLTAGE",
            "NOT_CALIBRATED",
        ]
    }
}

/// The f32 parameters of the signal table.
pub const PARAMETERS: [(Parameter, &str); 9] = [
    (Parameter::CURRENT, "CURRENT"),
    (Parameter::VELOCITY, "VELOCITY"),
    (Parameter::TORQUE_LIMIT, "TORQUE_LIMIT"),
    (Parameter::POSITION, "POSITION"),
    (Parameter::VELOCITY_LIMIT, "VELOCITY_LIMIT"),
    (Parameter::CURRENT_LIMIT, "CURRENT_LIMIT"),
    (Parameter::MEASURED_POSITION, "MEASURED_POSITION"),
    (Parameter::MEASURED_VELOCITY, "MEASURED_VELOCITY"),
    (Parameter::SUPPLY, "SUPPLY"),
];
