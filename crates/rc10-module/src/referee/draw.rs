//! Drawings on the operator's screen, 1920 by 1080 from its lower left: interaction data (0x0301) to the own client.
//!
//! All commands of 0x0301 together may come 30 times a second, and 3,720 bytes.

use heapless::Vec;

use super::{LONGEST, frame};

/// What is done to a figure of that name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Operation {
    /// Draws it anew.
    Add = 1,
    /// Changes it.
    Change = 2,
    /// Takes it away.
    Remove = 3,
}

/// A figure's colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs, reason = "colours")]
pub enum Colour {
    /// Red or blue: the own side's.
    Own = 0,
    Yellow = 1,
    Green = 2,
    Orange = 3,
    Magenta = 4,
    Pink = 5,
    Cyan = 6,
    Black = 7,
    White = 8,
}

/// The shape of a figure: pixels, x and y below 2,048.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Shape {
    /// From here to there.
    Line([u16; 2], [u16; 2]),
    /// From a corner to the one across.
    Rectangle([u16; 2], [u16; 2]),
    /// A middle and a radius below 1,024.
    Circle([u16; 2], u16),
    /// A middle and half axes.
    Ellipse([u16; 2], [u16; 2]),
    /// A middle, half axes, and degrees from and to, clockwise from above, 0 to 360.
    Arc([u16; 2], [u16; 2], [u16; 2]),
    /// A place, a height of letters, and a number in thousandths.
    Thousandths([u16; 2], u16, i32),
    /// A place, a height of letters, and a whole number.
    Number([u16; 2], u16, i32),
}

/// A figure.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Figure {
    /// Its name: the client tells figures apart by it.
    pub name: [u8; 3],
    /// What is done to it.
    pub operation: Operation,
    /// 0 to 9; higher ones lie above.
    pub layer: u8,
    /// Its colour.
    pub colour: Colour,
    /// Width of its lines, pixels, below 1,024.
    pub width: u16,
    /// Its shape.
    pub shape: Shape,
}

/// What cannot be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DrawError {
    /// A number that its field has no room for.
    #[error("{what} is {value}, must be at most {most}")]
    Beyond {
        /// The number's name.
        what: &'static str,
        /// The number.
        value: u16,
        /// The greatest that fits.
        most: u16,
    },
    /// No figure, or more than one frame has.
    #[error("{0} figures, must be 1 to 7")]
    Count(usize),
    /// Text of more than one frame.
    #[error("{0} bytes of text, must be 1 to 30")]
    Text(usize),
}

const NO_FIGURE: [u8; 15] = [0; 15];
/// Figures of a frame, and its content.
const CONTENTS: [(usize, u16); 4] = [(1, 0x0101), (2, 0x0102), (5, 0x0103), (7, 0x0104)];
const TEXT: usize = 30;

impl Figure {
    /// Its 15 bytes; `written` are a text's height of letters and its length.
    fn bytes(&self, written: Option<([u16; 2], u16, u8)>) -> Result<[u8; 15], DrawError> {
        let whole = |value: i32| {
            // A number takes the three fields of 10, 11 and 11 bits.
            let bits = value.cast_unsigned();
            [bits & 0x3FF, bits >> 10 & 0x7FF, bits >> 21].map(|it| u16::try_from(it).unwrap_or(0))
        };
        let (kind, [a, b], [x, y], [c, d, e]) = match (written, self.shape) {
            (Some((at, height, length)), _) => (7, [height, length.into()], at, [0; 3]),
            (_, Shape::Line(from, [d, e])) => (0, [0; 2], from, [0, d, e]),
            (_, Shape::Rectangle(from, [d, e])) => (1, [0; 2], from, [0, d, e]),
            (_, Shape::Circle(at, radius)) => (2, [0; 2], at, [radius, 0, 0]),
            (_, Shape::Ellipse(at, [d, e])) => (3, [0; 2], at, [0, d, e]),
            (_, Shape::Arc(at, [d, e], angles)) => (4, angles, at, [0, d, e]),
            (_, Shape::Thousandths(at, height, value)) => (5, [height, 0], at, whole(value)),
            (_, Shape::Number(at, height, value)) => (6, [height, 0], at, whole(value)),
        };
        let angles_to = if kind == 4 { 360 } else { 511 };
        let mut fields = [
            ("the layer", self.layer.into(), 9, 4),
            ("the colour", self.colour as u16, 8, 4),
            (if kind == 4 { "an angle" } else { "the height of letters" }, a, angles_to, 9),
            (if kind == 4 { "an angle" } else { "the length" }, b, angles_to, 9),
            ("the width of lines", self.width, 1023, 10),
            ("x", x, 2047, 11),
            ("y", y, 2047, 11),
            ("the radius", c, 1023, 10),
            ("x", d, 2047, 11),
            ("y", e, 2047, 11),
        ]
        .into_iter();
        let first = u128::from(self.operation as u8) | kind << 3;
        let (bits, _) =
            fields.try_fold((first, 6_u32), |(bits, at), (what, value, most, width)| {
                if value > most {
                    return Err(DrawError::Beyond { what, value, most });
                }
                Ok((bits | u128::from(value) << at, at + width))
            })?;
        let mut bytes = NO_FIGURE;
        let (name, rest) = bytes.split_at_mut(3);
        name.copy_from_slice(&self.name);
        rest.copy_from_slice(bits.to_le_bytes().first_chunk::<12>().unwrap_or(&[0; 12]));
        Ok(bytes)
    }
}

/// A frame of interaction data from a robot to its client.
fn interaction(sequence: u8, robot: u8, content: u16, data: &[&[u8]]) -> Vec<u8, LONGEST> {
    let client = 0x0100 | u16::from(robot);
    let head = [content, u16::from(robot), client].map(u16::to_le_bytes);
    let all = head.as_flattened().iter().chain(data.iter().copied().flatten()).copied();
    let data: Vec<u8, 118> = all.collect();
    frame(sequence, 0x0301, &data).unwrap_or_default()
}

/// A frame that draws, changes or removes up to seven figures. Those of a frame are 1, 2, 5 or 7: it is filled up with
/// nothing.
///
/// # Errors
/// If a number does not fit, or their count.
pub fn figures(sequence: u8, robot: u8, figures: &[Figure]) -> Result<Vec<u8, LONGEST>, DrawError> {
    let count = figures.len();
    let fitting = CONTENTS.into_iter().find(|(room, _)| (1..=*room).contains(&count));
    let (room, content) = fitting.ok_or(DrawError::Count(count))?;
    let mut drawn = [NO_FIGURE; 7];
    for (bytes, figure) in drawn.iter_mut().zip(figures) {
        *bytes = figure.bytes(None)?;
    }
    let drawn = drawn.as_flattened().get(..15 * room).unwrap_or_default();
    Ok(interaction(sequence, robot, content, &[drawn]))
}

/// A frame that writes a text of ASCII at a place; of `figure` all but the shape counts.
///
/// # Errors
/// If a number does not fit, or the text has no byte or more than 30.
pub fn text(
    sequence: u8,
    robot: u8,
    figure: &Figure,
    at: [u16; 2],
    height: u16,
    text: &str,
) -> Result<Vec<u8, LONGEST>, DrawError> {
    let length = text.len();
    let fits = u8::try_from(length).ok().filter(|_| (1..=TEXT).contains(&length));
    let figure = figure.bytes(Some((at, height, fits.ok_or(DrawError::Text(length))?)))?;
    let padding = [0; TEXT];
    let padding = padding.get(length..).unwrap_or_default();
    Ok(interaction(sequence, robot, 0x0110, &[&figure, text.as_bytes(), padding]))
}

/// Which layers are erased.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Layers {
    /// One, 0 to 9.
    One(u8),
    /// All.
    All,
}

/// A frame that erases a layer, or all.
///
/// # Errors
/// If there is no such layer.
pub fn erase(sequence: u8, robot: u8, layers: Layers) -> Result<Vec<u8, LONGEST>, DrawError> {
    let data = match layers {
        Layers::One(layer @ 0..=9) => [1, layer],
        Layers::One(layer) => {
            return Err(DrawError::Beyond { what: "the layer", value: layer.into(), most: 9 });
        }
        Layers::All => [2, 0],
    };
    Ok(interaction(sequence, robot, 0x0100, &[&data]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: Figure = Figure {
        name: *b"aim",
        operation: Operation::Add,
        layer: 9,
        colour: Colour::White,
        width: 1023,
        shape: Shape::Line([1, 2046], [1919, 1079]),
    };

    fn drawn(shape: Shape) -> [u8; 15] {
        Figure { shape, ..LINE }.bytes(None).unwrap()
    }

    /// Field by field, as the manual numbers their bits.
    fn field(bytes: &[u8; 15], at: usize, width: usize) -> u32 {
        (0..width).fold(0, |value, bit| {
            let place = 24 + at + bit;
            value | u32::from(bytes[place / 8] >> (place % 8) & 1) << bit
        })
    }

    #[test]
    fn every_field_of_a_figure_lies_where_it_should() {
        let line = drawn(LINE.shape);
        assert_eq!(line[..3], *b"aim");
        let fields = [
            (0, 3),
            (3, 3),
            (6, 4),
            (10, 4),
            (14, 9),
            (23, 9),
            (32, 10),
            (42, 11),
            (53, 11),
            (64, 10),
            (74, 11),
            (85, 11),
        ];
        let read = |bytes: &[u8; 15]| fields.map(|(at, width)| field(bytes, at, width));
        assert_eq!(read(&line), [1, 0, 9, 8, 0, 0, 1023, 1, 2046, 0, 1919, 1079]);
        let arc = read(&drawn(Shape::Arc([5, 6], [7, 8], [90, 360])));
        assert_eq!(arc[4..], [90, 360, 1023, 5, 6, 0, 7, 8]);
        assert_eq!(read(&drawn(Shape::Circle([5, 6], 77)))[9..], [77, 0, 0]);
        assert_eq!(
            [drawn(Shape::Rectangle([0; 2], [0; 2])), drawn(Shape::Ellipse([0; 2], [0; 2]))]
                .map(|it| read(&it)[1]),
            [1, 3]
        );
        for value in [0, -1, 12_345, i32::MIN, i32::MAX] {
            for (kind, shape) in
                [(5, Shape::Thousandths([1, 2], 20, value)), (6, Shape::Number([1, 2], 20, value))]
            {
                let bytes = drawn(shape);
                assert_eq!(i32::from_le_bytes(*bytes.last_chunk().unwrap()), value);
                assert_eq!(read(&bytes)[1..6], [kind, 9, 8, 20, 0]);
            }
        }
    }

    #[test]
    fn a_frame_is_filled_up_to_what_there_is() {
        for (count, room, content) in
            [(1, 1, 1), (2, 2, 2), (3, 5, 3), (5, 5, 3), (6, 7, 4), (7, 7, 4)]
        {
            let sent = figures(3, 103, &[LINE; 7][..count]).unwrap();
            assert_eq!(sent.len(), 7 + 6 + 15 * room + 2);
            assert_eq!(sent[5..13], [1, 3, content, 1, 103, 0, 103, 1]);
            assert!(sent[13 + 15 * count..13 + 15 * room].iter().all(|byte| *byte == 0));
        }
        assert_eq!(figures(0, 1, &[]), Err(DrawError::Count(0)));
        assert_eq!(figures(0, 1, &[LINE; 8]), Err(DrawError::Count(8)));
    }

    #[test]
    fn text_and_what_is_erased() {
        let sent = text(0, 1, &LINE, [100, 200], 20, "power 55 W").unwrap();
        assert_eq!((sent.len(), &sent[7..9]), (60, &[0x10, 1][..]));
        let figure: &[u8; 15] = sent[13..].first_chunk().unwrap();
        assert_eq!(
            [(3, 3), (14, 9), (23, 9), (42, 11), (53, 11)]
                .map(|(at, width)| field(figure, at, width)),
            [7, 20, 10, 100, 200]
        );
        assert_eq!(&sent[28..39], b"power 55 W\0");
        for long in ["", "0123456789012345678901234567890"] {
            assert_eq!(text(0, 1, &LINE, [0; 2], 20, long), Err(DrawError::Text(long.len())));
        }
        assert_eq!(erase(0, 1, Layers::One(9)).unwrap()[7..15], [0, 1, 1, 0, 1, 1, 1, 9]);
        assert_eq!(erase(0, 1, Layers::All).unwrap()[13], 2);
        assert!(erase(0, 1, Layers::One(10)).is_err());
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_name() {
        let refused = |figure: Figure| figure.bytes(None).unwrap_err();
        let beyond = |what, value, most| DrawError::Beyond { what, value, most };
        assert_eq!(refused(Figure { layer: 10, ..LINE }), beyond("the layer", 10, 9));
        assert_eq!(
            refused(Figure { width: 1024, ..LINE }),
            beyond("the width of lines", 1024, 1023)
        );
        let of = |shape| refused(Figure { shape, ..LINE });
        assert_eq!(of(Shape::Line([2048, 0], [0; 2])), beyond("x", 2048, 2047));
        assert_eq!(of(Shape::Line([0; 2], [0, 2048])), beyond("y", 2048, 2047));
        assert_eq!(of(Shape::Circle([0; 2], 1024)), beyond("the radius", 1024, 1023));
        assert_eq!(of(Shape::Arc([0; 2], [0; 2], [0, 361])), beyond("an angle", 361, 360));
        assert_eq!(of(Shape::Number([0; 2], 512, 0)), beyond("the height of letters", 512, 511));
    }
}
