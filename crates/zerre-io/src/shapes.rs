//! Shapes of extended targets as a table: a row for each ellipse at each time.

use std::io::{self, Write};
use std::sync::Arc;
use zerre::Time;
use zerre::extended::statistics::eigen;
use zerre::math::{Matrix, atan2};

/// An ellipse of a target at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct EllipseRow {
    /// Identity of the track.
    pub id: Arc<str>,
    /// When.
    pub time: Time,
    /// Which of the target's ellipses, from 1. The same number is not always the same part of the body: ellipses split
    /// and merge.
    pub ellipse: usize,
    /// Share of the points.
    pub weight: f64,
    /// Its middle, m.
    pub middle: [f64; 2],
    /// Covariance of its points, m^2.
    pub extent: Matrix<2, 2>,
    /// 95 % intervals of the standard deviation along the long and the short axis, m.
    pub intervals: [[f64; 2]; 2],
}

/// Writes CSV: `id`, `time_s` (exact decimal text), `ellipse`, `weight`, its middle, the covariance of its points
/// (`extent_*_m2`), and the same as standard deviations along its axes with their 95 % intervals (`sd_*_m`) and the
/// direction of the longer one, counter-clockwise from the x axis, in (-pi/2, pi/2].
///
/// # Errors
/// Those of `out`.
pub fn write_ellipses(out: impl Write, rows: &[EllipseRow]) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record([
        "id",
        "time_s",
        "ellipse",
        "weight",
        "x_m",
        "y_m",
        "extent_xx_m2",
        "extent_xy_m2",
        "extent_yy_m2",
        "sd_major_m",
        "sd_minor_m",
        "orientation_rad",
        "sd_major_low_m",
        "sd_major_high_m",
        "sd_minor_low_m",
        "sd_minor_high_m",
    ])?;
    for row in rows {
        let ([large, small], [c, s]) = eigen(&row.extent);
        // Either end of the axis stands for it.
        let (c, s) = if c < 0.0 || c == 0.0 && s < 0.0 { (-c, -s) } else { (c, s) };
        let [[xx, xy], [_, yy]] = row.extent.0;
        let [major, minor] = row.intervals;
        csv.write_field(row.id.as_bytes())?;
        csv.write_field(row.time.to_string())?;
        csv.write_field(row.ellipse.to_string())?;
        let numbers = [row.weight, row.middle[0], row.middle[1], xx, xy, yy];
        let axes = [large.max(0.0).sqrt(), small.max(0.0).sqrt(), atan2(s, c)];
        for number in numbers.into_iter().chain(axes).chain(major).chain(minor) {
            // The shortest text that reads back to the same bits.
            csv.write_field(format!("{number:?}"))?;
        }
        csv.write_record(None::<&[u8]>)?;
    }
    csv.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ellipse of 4 m and 1 m turned by an eighth: (16 + 1) / 2 and (16 - 1) / 2 in its covariance.
    #[test]
    fn axes_and_direction_are_those_of_the_covariance() {
        let row = |extent| EllipseRow {
            id: Arc::from("a,b"),
            time: Time::from_secs(0.5),
            ellipse: 1,
            weight: 1.0,
            middle: [1.0, -2.0],
            extent,
            intervals: [[3.0, 5.0], [0.5, 1.5]],
        };
        let mut out = Vec::new();
        let rows = [
            row(Matrix([[8.5, 7.5], [7.5, 8.5]])),
            row(Matrix([[8.5, -7.5], [-7.5, 8.5]])),
            row(Matrix([[1.0, 0.0], [0.0, 16.0]])),
        ];
        write_ellipses(&mut out, &rows).unwrap();
        let text = String::from_utf8(out).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("id,time_s,ellipse,weight,x_m,y_m,extent_xx_m2"));
        let number = |line: usize, cell: usize| -> f64 {
            // The identity is one cell in quotes with a comma in it.
            lines[line].split(',').nth(cell + 1).unwrap().parse().unwrap()
        };
        assert!(lines[1].starts_with("\"a,b\",0.5,1,1.0,1.0,-2.0,8.5,7.5,8.5,"), "{}", lines[1]);
        for (line, angle) in [(1, 0.25), (2, -0.25), (3, 0.5)] {
            assert!((number(line, 9) - 4.0).abs() < 1e-12 && (number(line, 10) - 1.0).abs() < 1e-12);
            let expected = angle * std::f64::consts::PI;
            assert!((number(line, 11) - expected).abs() < 1e-12, "{}", lines[line]);
        }
        assert!(lines[1].ends_with(",3.0,5.0,0.5,1.5"));
    }
}
