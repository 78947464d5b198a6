//! Vectors of protocol `ws2812`: a colour as bytes of SPI.

use rc10_module::led::ws2812::{SPI_ONE, SPI_ZERO, spi_bytes};

use crate::fields::{Check, Fields, Tolerance, narrow, text, unknown};

/// One vector of protocol `ws2812`.
pub fn ws2812(kind: &str, vector: &mut Fields, _: &mut Tolerance) -> Check {
    if kind != "encode" {
        return Err(format!("this runner does not know the kind `{kind}`"));
    }
    let mut inputs = vector.object("inputs")?;
    // A sender with other codes for a bit sends the same bits: ours become the vector's.
    let codes: [u8; 2] = [narrow(&inputs.take("code0")?)?, narrow(&inputs.take("code1")?)?];
    let rgb: Vec<u8> = inputs.list("rgb")?.iter().map(narrow).collect::<Check<_>>()?;
    let rgb: [u8; 3] = rgb.try_into().map_err(|rgb| format!("no colour: {rgb:?}"))?;
    inputs.finish()?;
    let code = |byte| match byte {
        SPI_ZERO => Ok(codes[0]),
        SPI_ONE => Ok(codes[1]),
        other => Err(format!("{other:#04x} is neither 0 nor 1")),
    };
    let codes = spi_bytes(rgb.into()).into_iter().map(code).collect::<Check<Vec<u8>>>()?;
    let bytes: String = codes.iter().map(|code| format!("{code:02x}")).collect();
    for (field, value) in vector.object("expect")?.into_expectations()? {
        match field.as_str() {
            "spi_bytes" if text(&value)? == bytes => {}
            "spi_bytes" => return Err(format!("spi_bytes are {bytes}, not {value}")),
            other => return Err(unknown(other)),
        }
    }
    Ok(())
}
