//! Gives models and limiters random input, and gives away every result.

use rc10_app::{
    Joules, NewtonMetres, PowerConfig, PowerInput, PowerLimiter, PowerModel, Rpm, Seconds, Watts,
};

use super::Chance;

const CONFIG: PowerConfig = PowerConfig {
    model: PowerModel {
        mechanical: 1.2,
        per_speed: 0.22,
        per_torque: 1.2,
        idle: 2.78,
        returned: 0.5,
    },
    uncertainty: 2.2,
    limits: [Watts::new(45.0), Watts::new(120.0)],
    buffer: Joules::new(60.0),
};

/// Walks through the family.
pub fn walk(put: &mut dyn FnMut(f32)) {
    let (mut chance, mut limiter) = (Chance(34), PowerLimiter::new(&CONFIG));
    let mut measured = [NewtonMetres::ZERO; 4];
    for step in 0..3_000_u32 {
        if step % 10 == 0 && step % 400 < 320 {
            let limit = if step % 700 == 0 { 500.0 } else { 80.0 };
            limiter.hear(
                &CONFIG,
                Watts::new(limit),
                Joules::new((chance.up_to(64.0) as i8).into()),
            );
        }
        let input = PowerInput {
            wished: measured.map(|_| NewtonMetres::new(chance.within(6.0))),
            measured,
            speeds: measured.map(|_| Rpm::new(chance.within(400.0))),
            others: Watts::new(chance.up_to(5.0)),
            derating: chance.up_to(1.2),
        };
        if step % 50 == 25 {
            let watts = Watts::new(chance.up_to(150.0));
            limiter.measure(&CONFIG, watts, &input.measured, &input.speeds);
        }
        let given = limiter.allocate(&CONFIG, &input, Seconds::new(0.01));
        measured = given.torques;
        put(given.share);
        put(measured[0].get());
        put(limiter.limit().get());
        put(limiter.energy().get());
        let model = limiter.model(&CONFIG);
        put(model.per_torque);
        put(model.power(&measured, &input.speeds).get());
        put(model.allocate(input.wished, input.speeds, input.others).share);
    }
}
