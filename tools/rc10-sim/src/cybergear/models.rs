use crate::plant::Plant;

/// Differences between the models.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// The name, as the vendor writes it.
    pub name: &'static str,
    /// End of the range of position, ± rad.
    pub position: f64,
    /// End of the range of velocity, ± rad/s.
    pub velocity: f64,
    /// End of the range of torque, ± N m.
    pub torque: f64,
    /// Largest kp, N m / rad.
    pub kp: f64,
    /// Largest kd, N m s / rad.
    pub kd: f64,
    /// Largest current, A.
    pub current: f64,
    /// The motor stops itself at this temperature, °C.
    pub too_hot: f64,
    /// The motor warns from this temperature on, °C.
    pub hot: f64,
    /// A RobStride: saves parameters, reports by itself, knows a time-out.
    pub robstride: bool,
    /// Torque per ampere at the output, N m / A.
    pub torque_constant: f64,
    /// Rotor turns per turn of the output.
    gear: f64,
    /// Speed of the output without load at full supply, rpm.
    no_load_rpm: f64,
    /// V.
    supply: f64,
    /// Inertia of the rotor, kg m²: estimated.
    rotor_inertia: f64,
}

/// Xiaomi CyberGear. Manual: gear 7.75, 24 V, 4 N m at 6.5 A, 12 N m at 23 A, 296 rpm without load,
/// 80 °C, warning at 75 °C.
pub const CYBERGEAR: Model = Model {
    name: "CyberGear",
    position: 12.5,
    velocity: 30.0,
    torque: 12.0,
    kp: 500.0,
    kd: 5.0,
    current: 23.0,
    too_hot: 80.0,
    hot: 75.0,
    robstride: false,
    torque_constant: 4.0 / 6.5,
    gear: 7.75,
    no_load_rpm: 296.0,
    supply: 24.0,
    rotor_inertia: 2.5e-5,
};

/// Ranges: RobStride manuals 260428. Torque constants follow from peak torque and current where a
/// parameter table tells the current (RS00, RS04, RS05); the other currents, gears, no-load speeds
/// and inertias are estimates in proportion to torque and velocity.
const fn robstride(
    name: &'static str,
    [velocity, torque]: [f64; 2],
    [kp, kd]: [f64; 2],
    [current, gear, rotor_inertia]: [f64; 3],
) -> Model {
    Model {
        name,
        position: 12.57,
        velocity,
        torque,
        kp,
        kd,
        current,
        too_hot: 135.0,
        hot: 130.0,
        robstride: true,
        torque_constant: torque / current,
        gear,
        no_load_rpm: velocity * 9.549 * 0.97,
        supply: 48.0,
        rotor_inertia,
    }
}

const SMALL: [f64; 2] = [500.0, 5.0];
const LARGE: [f64; 2] = [5000.0, 100.0];

/// RobStride RS00.
pub const RS00: Model = robstride("RS00", [33.0, 14.0], SMALL, [16.0, 10.0, 1.7e-5]);
/// RobStride RS01.
pub const RS01: Model = robstride("RS01", [44.0, 17.0], SMALL, [23.0, 7.75, 3.5e-5]);
/// RobStride RS02.
pub const RS02: Model = robstride("RS02", [44.0, 17.0], SMALL, [23.0, 7.75, 3.5e-5]);
/// RobStride RS03.
pub const RS03: Model = robstride("RS03", [20.0, 60.0], LARGE, [43.0, 9.0, 9.0e-5]);
/// RobStride RS04.
pub const RS04: Model = robstride("RS04", [15.0, 120.0], LARGE, [90.0, 9.0, 1.8e-4]);
/// RobStride RS05.
pub const RS05: Model = robstride("RS05", [50.0, 5.5], SMALL, [11.0, 7.75, 1.1e-5]);
/// RobStride RS06.
pub const RS06: Model = robstride("RS06", [50.0, 36.0], LARGE, [36.0, 9.0, 5.5e-5]);

/// All of them.
pub const ALL: [&Model; 8] = [&CYBERGEAR, &RS00, &RS01, &RS02, &RS03, &RS04, &RS05, &RS06];

impl Model {
    /// Its motor, with nothing on the shaft. Resistance, friction and thermal figures are
    /// estimates.
    pub const fn plant(&self) -> Plant {
        let (torque, current) = (self.torque, self.current);
        // A quarter of the supply at the largest current.
        let resistance = 0.25 * self.supply / current;
        let motor =
            Plant::motor(self.gear, self.torque_constant, resistance, current, self.rotor_inertia)
                .with_friction(0.002 * torque / self.velocity, 0.008 * torque, 0.010 * torque)
                .with_heating(1.5, 200.0);
        Plant { supply: self.supply, current_time_constant: 0.5e-3, ..motor }
            .with_no_load_speed(self.no_load_rpm * self.gear)
    }
}
