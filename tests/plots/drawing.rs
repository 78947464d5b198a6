//! Lines in panels, one above the other, as an SVG. Pixels are whole numbers, so rounding in the last
//! place of a sine does not show.

use std::ops::Range;

use plotters::chart::{ChartBuilder, SeriesLabelPosition};
use plotters::drawing::IntoDrawingArea;
use plotters::element::PathElement;
use plotters::prelude::SVGBackend;
use plotters::series::LineSeries;
use plotters::style::{BLACK, Color, RGBColor, ShapeStyle, WHITE};

/// Seen apart by the colour-blind too (M. Okabe, K. Ito, Color Universal Design, 2008).
pub const BLUE: RGBColor = RGBColor(0, 114, 178);
pub const ORANGE: RGBColor = RGBColor(213, 94, 0);
pub const GREEN: RGBColor = RGBColor(0, 158, 115);
pub const PURPLE: RGBColor = RGBColor(204, 121, 167);
/// Setpoints and limits.
pub const GREY: RGBColor = RGBColor(150, 150, 150);

const WIDTH: u32 = 700;

pub struct Line {
    /// Empty: it belongs to the line before.
    pub label: &'static str,
    pub colour: RGBColor,
    pub points: Vec<(f32, f32)>,
}

pub fn line(label: &'static str, colour: RGBColor, points: Vec<(f32, f32)>) -> Line {
    Line { label, colour, points }
}

/// The same value everywhere.
pub fn level(label: &'static str, x: &Range<f32>, y: f32) -> Line {
    line(label, GREY, vec![(x.start, y), (x.end, y)])
}

pub struct Panel {
    /// Quantity and unit.
    pub x: (&'static str, Range<f32>),
    pub y: (&'static str, Range<f32>),
    pub legend: SeriesLabelPosition,
    /// In pixels.
    pub height: u32,
    pub lines: Vec<Line>,
}

/// With as many decimals as it needs, two at most.
fn number(value: f32) -> String {
    let text = format!("{value:.2}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

pub fn svg(panels: &[Panel]) -> String {
    let mut picture = String::new();
    let height = panels.iter().map(|panel| panel.height).sum();
    let mut rest = SVGBackend::with_string(&mut picture, (WIDTH, height)).into_drawing_area();
    rest.fill(&WHITE).unwrap();
    for panel in panels {
        let (area, below) = rest.split_vertically(panel.height);
        rest = below;
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .margin_right(16)
            .x_label_area_size(34)
            .y_label_area_size(58)
            .build_cartesian_2d(panel.x.1.clone(), panel.y.1.clone())
            .unwrap();
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .bold_line_style(BLACK.mix(0.12))
            .label_style(("sans-serif", 14))
            .axis_desc_style(("sans-serif", 14))
            .x_labels(11)
            .y_labels(6)
            .x_label_formatter(&|x| number(*x))
            .y_label_formatter(&|y| number(*y))
            .x_desc(panel.x.0)
            .y_desc(panel.y.0)
            .draw()
            .unwrap();
        for Line { label, colour, points } in &panel.lines {
            let style = ShapeStyle { color: colour.to_rgba(), filled: false, stroke_width: 2 };
            let drawn = chart.draw_series(LineSeries::new(points.iter().copied(), style)).unwrap();
            if !label.is_empty() {
                let swatch = move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style);
                drawn.label(*label).legend(swatch);
            }
        }
        chart
            .configure_series_labels()
            .position(panel.legend.clone())
            .background_style(WHITE.mix(0.85))
            .label_font(("sans-serif", 14))
            .draw()
            .unwrap();
    }
    rest.present().unwrap();
    drop(rest);
    picture
}
