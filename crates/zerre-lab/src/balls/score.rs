//! Followed balls against the truth: distances, identity swaps, GOSPA.

use crate::error::{Error, Result};
use crate::metric::gospa;
use std::collections::BTreeMap;
use zerre_vision::balls::{BallRow, TrueBall};

/// Cut-off of GOSPA, px.
const CUTOFF: f64 = 20.0;
/// Share of a ball that must be visible for it to count as missed where it has no track.
const VISIBLE: f64 = 0.5;

/// The truth of a clip by frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TruthTable(BTreeMap<usize, Vec<TrueBall>>);

/// What a clip was worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct BallScores {
    /// Frames with truth.
    pub frames: usize,
    /// True balls of which at least half was visible, frame by frame.
    pub visible: usize,
    /// Those that had a track within a radius.
    pub held: usize,
    /// How often the track of a true ball was another one than before.
    pub swaps: usize,
    /// Root mean square distance of held balls from the truth, px.
    pub rmse_px: f64,
    /// Mean GOSPA of the frames, cut-off 20 px, order 2, px. A ball that is less than half visible is neither missed
    /// nor false.
    pub gospa_px: f64,
}

impl TruthTable {
    /// A table from its frames.
    pub fn new(frames: impl IntoIterator<Item = (usize, Vec<TrueBall>)>) -> TruthTable {
        TruthTable(frames.into_iter().collect())
    }

    /// Reads `frame,ball,x,y,radius,visible` with a head.
    ///
    /// # Errors
    /// The number of the line and what is wrong with it.
    pub fn read(text: &str) -> Result<TruthTable, String> {
        let mut lines = text.lines().zip(1..).filter(|(line, _)| !line.trim().is_empty());
        let head = "frame,ball,x,y,radius,visible";
        match lines.next() {
            Some((line, _)) if line.trim() == head => {}
            _ => return Err(format!("line 1: the head `{head}` is needed")),
        }
        let mut frames: BTreeMap<usize, Vec<TrueBall>> = BTreeMap::new();
        for (line, number) in lines {
            let bad = || format!("line {number}: `{line}` is not a frame, a ball and four finite numbers");
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let [frame, ball, numbers @ ..] = &cells[..] else { return Err(bad()) };
            let numbers: Vec<f64> = numbers.iter().filter_map(|cell| cell.parse().ok()).collect();
            let &[x, y, radius, visible] = &numbers[..] else { return Err(bad()) };
            if cells.len() != 6 || numbers.iter().any(|v| !v.is_finite()) || radius <= 0.0 {
                return Err(bad());
            }
            let frame = frame.parse().map_err(|_| bad())?;
            let ball = ball.parse().map_err(|_| bad())?;
            let ball = TrueBall { ball, centre: [x, y], radius, visible };
            frames.entry(frame).or_default().push(ball);
        }
        Ok(TruthTable(frames))
    }

    /// The balls of a frame.
    pub fn of_frame(&self, frame: usize) -> &[TrueBall] {
        self.0.get(&frame).map_or(&[], Vec::as_slice)
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt()
}

/// Scores rows against the truth of the frames before `frames`.
///
/// # Errors
/// Rows that are not finite.
pub fn score(rows: &[BallRow], truth: &TruthTable, frames: usize) -> Result<BallScores> {
    let mut of_frame: BTreeMap<usize, Vec<&BallRow>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        let [value, other] = row.known.centre;
        if !(value.is_finite() && other.is_finite()) {
            return Err(Error::NotFinite { what: "centre of a ball", index, value: value + other });
        }
        of_frame.entry(row.frame).or_default().push(row);
    }
    let mut scores = BallScores::default();
    let mut last: BTreeMap<usize, usize> = BTreeMap::new();
    let (mut squares, mut all_gospa) = (0.0, 0.0);
    for (frame, balls) in truth.0.range(..frames) {
        scores.frames += 1;
        let found = of_frame.get(frame).map_or(&[][..], Vec::as_slice);
        for ball in balls.iter().filter(|ball| ball.visible >= VISIBLE) {
            scores.visible += 1;
            let far = |row: &&&BallRow| distance(row.known.centre, ball.centre);
            let nearest = found.iter().min_by(|a, b| far(a).total_cmp(&far(b)));
            let Some(row) = nearest.filter(|row| far(row) < ball.radius) else { continue };
            scores.held += 1;
            squares += far(&row).powi(2);
            let before = last.insert(ball.ball, row.ball);
            scores.swaps += usize::from(before.is_some_and(|before| before != row.ball));
        }
        // Balls of which little is seen count if they have a track, and are forgiven if not.
        let near = |ball: &TrueBall| found.iter().any(|row| distance(row.known.centre, ball.centre) < CUTOFF);
        let counts = balls.iter().filter(|ball| ball.visible >= VISIBLE || near(ball));
        let places: Vec<[f64; 2]> = counts.map(|ball| ball.centre).collect();
        let estimates: Vec<[f64; 2]> = found.iter().map(|row| row.known.centre).collect();
        all_gospa += gospa(&estimates, &places, 2.0, CUTOFF)?.distance;
    }
    scores.rmse_px = (squares / scores.held as f64).sqrt();
    scores.gospa_px = all_gospa / scores.frames as f64;
    Ok(scores)
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerre_vision::balls::Known;

    fn row(frame: usize, ball: usize, x: f64) -> BallRow {
        let known = Known { centre: [x, 0.0], velocity: [0.0; 2], covariance: [[1.0, 0.0], [0.0, 1.0]] };
        BallRow { frame, ball, known, area: 300.0, detected: None }
    }

    /// Two balls 50 px apart over three frames; their tracks change places in the last, one is 3 px off in the first.
    #[test]
    fn swaps_are_counted_by_hand() {
        let text = "frame,ball,x,y,radius,visible\n0,1,0,0,10,1\n0,2,50,0,10,1\n1,1,0,0,10,1\n1,2,50,0,10,1\n\
                    2,1,0,0,10,1\n2,2,50,0,10,1\n2,3,90,0,10,0.1\n";
        let truth = TruthTable::read(text).unwrap();
        let rows = [
            row(0, 1, 3.0),
            row(0, 2, 50.0),
            row(1, 1, 0.0),
            row(1, 2, 50.0),
            row(2, 2, 0.0),
            row(2, 1, 50.0),
        ];
        let found = score(&rows, &truth, 3).unwrap();
        assert_eq!((found.frames, found.visible, found.held, found.swaps), (3, 6, 6, 2));
        assert!((found.rmse_px - (9.0_f64 / 6.0).sqrt()).abs() < 1e-12);
        // Only the first frame has an error, of 3 px.
        assert!((found.gospa_px - 1.0).abs() < 1e-12, "{found:?}");
        assert_eq!(score(&rows, &truth, 2).unwrap().swaps, 0);
        assert!(score(&[row(0, 1, f64::NAN)], &truth, 3).is_err());
    }

    #[test]
    fn bad_truth_names_its_line() {
        assert!(TruthTable::read("x,y\n").unwrap_err().contains("line 1"));
        let bad = "frame,ball,x,y,radius,visible\n0,1,NaN,0,10,1\n";
        assert!(TruthTable::read(bad).unwrap_err().contains("line 2"));
        assert!(TruthTable::read("").is_err());
    }
}
