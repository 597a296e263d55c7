//! Plots as SVG: lines and points with axes.

use std::fmt::Write;

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 420.0;
/// Left, right, top and bottom margin.
const MARGIN: [f64; 4] = [70.0, 20.0, 44.0, 54.0];
const COLOURS: [&str; 5] = ["#2f7ed8", "#e8743b", "#19a979", "#bf399e", "#8c6bd1"];

/// One set of points.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points in the units of the axes.
    pub points: Vec<[f64; 2]>,
    /// True to connect the points, false to mark each.
    pub connected: bool,
}

/// A plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Title above it.
    pub title: String,
    /// Titles of the x and the y axis, with units.
    pub axes: [String; 2],
    /// Sets of points.
    pub series: Vec<Series>,
}

impl Plot {
    /// Returns the plot as an SVG document; its axes contain all finite points.
    pub fn to_svg(&self) -> String {
        let ranges = [0, 1].map(|axis| self.range(axis));
        let x = |value: f64| scale(value, ranges[0], [MARGIN[0], WIDTH - MARGIN[1]]);
        let y = |value: f64| scale(value, ranges[1], [HEIGHT - MARGIN[3], MARGIN[2]]);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#ffffff\"/>\n"
        );
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"22\" font-size=\"15\" font-weight=\"600\">{}</text>",
            MARGIN[0],
            escaped(&self.title)
        );
        for value in ticks(ranges[0]) {
            let at = x(value);
            let (top, bottom) = (MARGIN[2], HEIGHT - MARGIN[3]);
            let _ = writeln!(
                svg,
                "<path d=\"M{at:.1} {top}V{bottom}\" stroke=\"#dde3ea\"/>"
            );
            let _ = writeln!(
                svg,
                "<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\" fill=\"#5c6b7a\">{}</text>",
                bottom + 18.0,
                label(value)
            );
        }
        for value in ticks(ranges[1]) {
            let at = y(value);
            let (left, right) = (MARGIN[0], WIDTH - MARGIN[1]);
            let _ = writeln!(
                svg,
                "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#dde3ea\"/>"
            );
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#5c6b7a\">{}</text>",
                left - 8.0,
                at + 4.0,
                label(value)
            );
        }
        let [across, up] = self.axes.each_ref().map(|text| escaped(text));
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{across}</text>",
            WIDTH / 2.0,
            HEIGHT - 14.0
        );
        let middle = HEIGHT / 2.0;
        let _ = writeln!(
            svg,
            "<text transform=\"translate(18 {middle}) rotate(-90)\" text-anchor=\"middle\">{up}</text>"
        );
        for (index, series) in self.series.iter().enumerate() {
            let colour = COLOURS[index % COLOURS.len()];
            let places = series
                .points
                .iter()
                .filter(|point| is_finite(point))
                .map(|point| (x(point[0]), y(point[1])));
            if series.connected {
                let line = places
                    .map(|(x, y)| format!("{x:.1},{y:.1}"))
                    .collect::<Vec<_>>()
                    .join(" ");
                let _ = writeln!(
                    svg,
                    "<polyline points=\"{line}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"/>"
                );
            } else {
                for (x, y) in places {
                    let _ = writeln!(
                        svg,
                        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.6\" fill=\"{colour}\" fill-opacity=\"0.6\"/>"
                    );
                }
            }
            let at = WIDTH - MARGIN[1] - 190.0;
            let row = MARGIN[2] + 16.0 + 18.0 * index as f64;
            let _ = writeln!(
                svg,
                "<rect x=\"{at}\" y=\"{}\" width=\"10\" height=\"10\" fill=\"{colour}\"/>",
                row - 9.0
            );
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{row}\">{}</text>",
                at + 16.0,
                escaped(&series.name)
            );
        }
        svg.push_str("</svg>\n");
        svg
    }

    fn range(&self, axis: usize) -> [f64; 2] {
        let points = self
            .series
            .iter()
            .flat_map(|series| &series.points)
            .filter(|point| is_finite(point));
        let values: Vec<f64> = points.map(|point| point[axis]).collect();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if low > high {
            return [0.0, 1.0];
        }
        let room = ((high - low) * 0.05).max(1e-6 * high.abs().max(1.0));
        [low - room, high + room]
    }
}

fn is_finite(point: &[f64; 2]) -> bool {
    point.iter().all(|value| value.is_finite())
}

fn scale(value: f64, from: [f64; 2], to: [f64; 2]) -> f64 {
    to[0] + (value - from[0]) / (from[1] - from[0]) * (to[1] - to[0])
}

/// Returns round values inside a range, some seven of them.
fn ticks([low, high]: [f64; 2]) -> Vec<f64> {
    let rough = (high - low) / 7.0;
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|step| *step >= rough);
    let step = step.unwrap_or(10.0 * power);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).map(|index| index as f64 * step).collect()
}

fn label(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks([0.3, 7.2]), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        assert_eq!(ticks([-0.1, 0.1]).len(), 5);
        assert_eq!(label(-0.0), "0");
    }

    #[test]
    fn every_point_is_inside_the_plot() {
        let series = Series {
            name: "a < b".to_owned(),
            points: vec![[0.0, -3.0], [1.0, f64::NAN], [2.0, 8.0]],
            connected: false,
        };
        let plot = Plot {
            title: "title".to_owned(),
            axes: ["x".to_owned(), "y".to_owned()],
            series: vec![series],
        };
        let svg = plot.to_svg();
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(svg.contains("a &lt; b"));
        for part in svg.split("cy=\"").skip(1) {
            let value: f64 = part.split('"').next().unwrap().parse().unwrap();
            assert!((MARGIN[2]..=HEIGHT - MARGIN[3]).contains(&value), "{value}");
        }
    }
}
