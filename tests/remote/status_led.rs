//! The pattern of the strip while the robot's state changes: the most important state wins.

use std::cell::RefCell;
use std::rc::Rc;

use rc10_cli::Receiver;
use rc10_module::led::pattern::{LampState, colour};
use rc10_motor::ArmState;
use rc10_sim::remote::{Controls, Stick, Switch};
use rc10_tasks::status_led;
use smart_leds_trait::{RGB8, SmartLedsWriteAsync};
use team::table::{LEDS, Name};

use super::{DOWN, Scene, millis, scene};

const STOP: Controls = Controls { left_switch: Switch::Down, ..Controls::REST };

impl Scene<'_> {
    fn status_led(&self) -> LampState {
        status_led::state(self.shared)
    }

    fn power(&self, name: Name, powered: bool) {
        self.around.motors[name as usize].set_power(powered);
    }
}

#[test]
fn what_matters_most_is_shown() {
    scene(Receiver::Dr16, 4, |mut scene| {
        scene.transmitter(false);
        scene.run(millis(50));
        assert_eq!(scene.status_led(), LampState::LinkLost, "nothing heard yet");
        scene.transmitter(true);
        scene.hands(DOWN);
        scene.run(millis(200));
        assert_eq!(scene.status_led(), LampState::Disarmed);
        scene.transmitter(false);
        scene.run(millis(200));
        assert_eq!((scene.status_led(), scene.arm()), (LampState::Suspended, ArmState::Disarmed));
        scene.transmitter(true);
        scene.arm_by_hand();
        assert_eq!(scene.status_led(), LampState::Armed);

        // A motor without power is a fault, armed or not; a remote that is missing is more.
        scene.power(Name::GimbalPitch, false);
        scene.run(millis(300));
        assert_eq!((scene.status_led(), scene.arm()), (LampState::Fault, ArmState::Armed));
        scene.transmitter(false);
        scene.run(millis(200));
        assert_eq!((scene.status_led(), scene.arm()), (LampState::Suspended, ArmState::Suspended));
        scene.run(millis(1000));
        assert_eq!((scene.status_led(), scene.arm()), (LampState::LinkLost, ArmState::Disarmed));
        scene.transmitter(true);
        scene.hands(DOWN);
        scene.run(millis(200));
        assert_eq!((scene.status_led(), scene.arm()), (LampState::Fault, ArmState::Disarmed));

        // A stop is more than anything else, and stays when the remote is lost.
        scene.hands(STOP);
        scene.run(millis(100));
        assert_eq!((scene.status_led(), scene.arm()), (LampState::Stopped, ArmState::EStopped));
        scene.power(Name::GimbalPitch, true);
        scene.transmitter(false);
        scene.run(millis(2000));
        assert_eq!((scene.status_led(), scene.arm()), (LampState::Stopped, ArmState::EStopped));
        scene.transmitter(true);
        scene.hands(Controls::REST);
        scene.run(millis(100));
        assert_eq!(scene.status_led(), LampState::Stopped);
        scene.hands(DOWN);
        scene.run(millis(100));
        assert_eq!(scene.status_led(), LampState::Disarmed);
        // A stick that is held, and let go.
        let held = Controls { left: Stick { x: 0.0, y: -1.0 }, ..Controls::REST };
        scene.hands(held);
        scene.run(millis(100));
        assert_eq!((scene.status_led(), scene.arm()), (LampState::NotAtRest, ArmState::Disarmed));
        let status = rc10_tasks::status::now(scene.shared).to_string();
        assert!(status.contains("not armed: left stick (up and down) is not at rest"), "{status}");
        scene.arm_by_hand();
        assert_eq!(scene.status_led(), LampState::Armed);
    });
}

/// A strip that keeps its last colours, and refuses every third write.
#[derive(Clone, Default)]
struct Strip(Rc<RefCell<(u32, Vec<RGB8>)>>);

impl SmartLedsWriteAsync for Strip {
    type Error = Refused;
    type Color = RGB8;

    async fn write<T, I>(&mut self, colours: T) -> Result<(), Refused>
    where
        T: IntoIterator<Item = I>,
        I: Into<RGB8>,
    {
        let mut strip = self.0.borrow_mut();
        strip.0 += 1;
        if strip.0.is_multiple_of(3) {
            return Err(Refused);
        }
        strip.1 = colours.into_iter().map(Into::into).collect();
        Ok(())
    }
}

struct Refused;

#[test]
fn the_strip_is_written_ten_times_a_second_whatever_it_says() {
    scene(Receiver::Dr16, 4, |mut scene| {
        let (shared, strip) = (scene.shared, Strip::default());
        let status_led = status_led::run(shared, strip.clone(), LEDS);
        scene.tasks.add(async {
            status_led.await;
        });
        scene.arm_by_hand();
        scene.hands(STOP);
        scene.run(millis(310));
        // Red, even and fast, all alike: on for two marks of 100 ms, off for two.
        let (mut on, mut off) = (0, 0);
        for _ in 0..20 {
            let before = strip.0.borrow().0;
            scene.run(millis(100));
            let (written, shown) = strip.0.borrow().clone();
            assert_eq!(written, before + 1);
            assert_eq!(shown.len(), LEDS);
            if written.is_multiple_of(3) {
                continue;
            }
            let begun = scene.now().get() / 100_000 * 100_000;
            let at = rc10_time::Micros::new(begun);
            let expected: Vec<_> =
                (0..LEDS).map(|led| colour(LampState::Stopped, at, led)).collect();
            assert_eq!(shown, expected, "{at}");
            if shown[0] == RGB8::default() { off += 1 } else { on += 1 }
        }
        assert!(on >= 5 && off >= 5, "{on} on, {off} off");
    });
}
