//! The names that wrong robots are declared with.

pub use rc10_motor::Place::{Bus, Line};
pub use rc10_motor::damiao::{self, Damiao};
pub use rc10_motor::dji::{self, Dji};
pub use rc10_motor::motors as declare;
pub use rc10_motor::rc10_app::{Cascade, ConfigError, Direction};
pub use rc10_motor::rc10_can::{CanFrame, IdPattern};
pub use rc10_motor::rc10_time::Micros;
pub use rc10_motor::unitree::{GoM8010, GoModule, LineConfig, ModuleConfig};
pub use rc10_motor::vesc::Vesc;
pub use rc10_motor::{CanIds, Entry, Frames, MotorName, OtherDevice, Rate, Safety};

include!("own.rs");
