//! A range finder that looks ahead: a `TFmini` at 115,200 baud.

use rc10::io::Read;
use rc10::module::listen as listen_to;
use rc10::module::ranging::Range;
use rc10::module::ranging::tfmini::TfMini;
use rc10::prelude::*;

use crate::Shared;

/// Says how far the wall is.
pub async fn listen(shared: &Shared<'_>, reception: &Reception, port: impl Read) {
    listen_to(port, TfMini, reception, |measured, _| {
        shared.own.wall.set(match measured.range() {
            Range::Distance(millimetres) => millimetres as f32 * 1e-3,
            _ => f32::NAN,
        });
    })
    .await;
}
