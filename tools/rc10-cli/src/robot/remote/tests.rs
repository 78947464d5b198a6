use rc10_sim::remote::Switch;

use super::*;

pub(crate) fn control() -> RemoteControl {
    let line = |millis, right_switch| ScriptLine {
        at: Micros::from_millis(millis),
        label: "",
        controls: Controls { right_switch, ..Controls::REST },
    };
    RemoteControl {
        receiver: Receiver::Dr16,
        channels: Receiver::Dr16.channels(),
        arming: ArmingConfig::DEFAULT,
        receivers: vec![Receiver::Dr16, Receiver::Ppm],
        uart: 5,
        script: vec![line(0, Switch::Down), line(100, Switch::Up)],
        repeats_after: Some(Micros::from_millis(1000)),
        lost: Vec::new(),
    }
}

pub(crate) fn faults(texts: &[&str]) -> Vec<Fault> {
    texts.iter().map(|text| text.parse().unwrap()).collect()
}

#[test]
fn what_cannot_be_is_refused_in_words() {
    let mut control = control();
    let lose = |control: &mut RemoteControl, texts: &[&str]| {
        control.lose(&faults(texts)).map_err(|error| error.to_string())
    };
    for twice in [["remote-lost@1s", "remote-lost@2s"], ["remote-lost@2s", "remote-lost@1s..2s"]] {
        let error = lose(&mut control, &twice).unwrap_err();
        assert_eq!(error, "remote-lost@2s: the remote is lost already, since 1 s");
    }
    assert_eq!(lose(&mut control, &["remote-lost@2.1s", "remote-lost@1s..2s"]), Ok(()));
    let error = control.plug(Receiver::Sbus).unwrap_err().to_string();
    assert_eq!(error, "no sbus: this robot takes dr16, ppm");
    control.plug(Receiver::Ppm).unwrap();
    assert_eq!(control.receiver, Receiver::Ppm);
}
