//! `rc10 device`: registers of motors' devices, through the link, in simulation.

use crate::common::mixed::mixed;

fn device(arguments: &[&str]) -> (Option<i32>, String) {
    mixed(&[&["device"], arguments, &["--sim"]].concat())
}

#[test]
fn registers_are_printed_by_name_with_their_units() {
    let (code, all) = device(&["get", "arm"]);
    assert_eq!(code, Some(0), "{all}");
    for line in ["PMAX = 12.5 rad", "VMAX = 30 rad/s", "TIMEOUT = 100 ms", "CTRL_MODE = 1 (MIT)"] {
        assert!(all.lines().any(|it| it == line), "{line}:\n{all}");
    }
    assert_eq!(all.lines().count(), 45, "{all}");
    let some = device(&["get", "arm", "tmax", "22", "0x15"]);
    assert_eq!(some, (Some(0), "TMAX = 10 N m\nVMAX = 30 rad/s\nPMAX = 12.5 rad\n".into()));
    // A CyberGear, and a register without a name.
    let (code, some) = device(&["get", "wrist", "RUN_MODE", "0x701A"]);
    assert_eq!(code, Some(0), "{some}");
    let [mode, own] = some.lines().collect::<Vec<_>>()[..] else { panic!("{some}") };
    assert_eq!(mode, "RUN_MODE = 0 (motion)");
    assert!(own.starts_with("0x701a = ") && own.ends_with(" as f32)"), "{own}");
}

#[test]
fn registers_are_written_while_disarmed_and_read_back() {
    let (code, text) = device(&["set", "arm", "TIMEOUT=50", "ctrl_mode=mit", "KP_ASR=0.25"]);
    let how = "until its power is cut; --save keeps it";
    let written =
        format!("TIMEOUT = 50 ms\nCTRL_MODE = 1 (MIT)\nKP_ASR = 0.25\nwritten, {how}: arm\n");
    assert_eq!((code, text), (Some(0), written));
    let (code, text) = device(&["set", "wrist", "CURRENT_LIMIT=10"]);
    assert_eq!((code, text.lines().next()), (Some(0), Some("CURRENT_LIMIT = 10 A")));
    let (code, text) = device(&["set", "arm", "TIMEOUT=50", "--save"]);
    assert_eq!((code, text.lines().last()), (Some(0), Some("written, kept over a power-off: arm")));
}

#[test]
fn what_cannot_be_read_or_written_is_named() {
    for (arguments, sentence) in [
        (&["get", "leg"][..], "there is no motor `leg`; there are: "),
        (&["get", "flywheel"], "flywheel, ODrive"),
        (&["get", "arm", "KMAX"], "no register `KMAX`; there are UV_VALUE, "),
        (&["get", "arm", "49"], "the device did not answer in time"),
        (&["set", "arm", "TIMEOUT"], "`TIMEOUT`: it is to be REGISTER=VALUE"),
        (&["set", "arm", "TIMEOUT=soon"], "`soon` is no number"),
        (&["set", "arm", "TIMEOUT=0.01"], "`TIMEOUT=0.01`: it is to be 0 to "),
        (&["set", "arm", "TIMEOUT=-1"], "`TIMEOUT=-1`: it is to be 0 to "),
        (&["set", "arm", "KP_ASR=1e40"], "`KP_ASR=1e40`: too large"),
        (&["set", "arm", "KP_ASR=NaN"], "`KP_ASR=NaN`"),
        (&["set", "arm", "49=1"], "only a register with a name is written"),
        // The device keeps the old one, or has it to be read only.
        (
            &["set", "arm", "CTRL_MODE=7"],
            "CTRL_MODE: not written: refused: the device refused; it holds CTRL_MODE = 1 (MIT)",
        ),
        (&["set", "arm", "GR=2"], "; it holds GR = 10"),
        // No RobStride: it has nothing to save, and what it was told first is told.
        (
            &["set", "wrist", "CURRENT_LIMIT=10", "--save"],
            "not saved: refused: this motor cannot do that",
        ),
    ] {
        let (code, text) = device(arguments);
        assert!(code != Some(0) && text.contains(sentence), "{arguments:?}: {text}");
    }
}
