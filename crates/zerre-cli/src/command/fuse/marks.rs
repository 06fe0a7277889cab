//! Where people have marked points: truth for scores, and for learning.

use super::tables::{Table, number};
use crate::diagnostic::Diagnostic;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use zerre_lab::agreement::{Answer, agreement};
use zerre_vision::rgbd::RgbdFrame;

/// Where a point is in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mark {
    /// Pixels.
    pub at: [f64; 2],
    /// Depth, millimetres, where the table has it.
    pub mm: Option<f64>,
}

/// Marks of one point.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Marked {
    /// By number or name of the frame; those in which it cannot be seen have none.
    places: BTreeMap<String, Mark>,
    /// Who has marked it, at most, in a frame.
    pub operators: usize,
    /// Root of the mean square of the reference's standard errors, pixels, of several operators.
    pub floor: Option<f64>,
}

impl Marked {
    /// The mark of a frame, by its name, else by its place in the recording.
    pub(super) fn of(&self, frame: &RgbdFrame) -> Option<Mark> {
        let place = || self.places.get(&frame.index.to_string());
        self.places.get(&frame.name).or_else(place).copied()
    }

    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    /// How they came about, as a sentence.
    pub(super) fn about(&self) -> String {
        let floor = self.floor.map(zerre_lab::number);
        match (self.operators, floor) {
            (2.., Some(floor)) => format!(
                "The reference is the geometric median of up to {} operators; its standard error is {floor} px (root \
                 mean square over frames): nothing below that can be measured.",
                self.operators
            ),
            (_, Some(floor)) => format!(
                "The standard error of the reference is {floor} px (root mean square over frames): nothing below that \
                 can be measured."
            ),
            _ => "The reference has one mark per frame: how well it is known is not known.".to_owned(),
        }
    }
}

/// A table of marks.
#[derive(Clone, Debug)]
pub(super) struct Marks {
    pub path: PathBuf,
    /// By joint.
    pub joints: BTreeMap<String, Marked>,
}

/// Answers of a point, by operator, then by frame.
type Answers = BTreeMap<String, BTreeMap<String, Answer>>;

/// What a table says of a point before operators are put together.
#[derive(Default)]
struct Told {
    answers: Answers,
    depths: BTreeMap<String, f64>,
    errors: Vec<f64>,
}

impl Told {
    fn marked(self) -> Marked {
        let mut frames: Vec<&String> = self.answers.values().flat_map(BTreeMap::keys).collect();
        frames.sort();
        frames.dedup();
        let row =
            |of: &BTreeMap<String, Answer>| frames.iter().map(|frame| of.get(*frame).copied()).collect();
        let answers: Vec<Vec<Option<Answer>>> = self.answers.values().map(row).collect();
        let found = agreement(&answers);
        let place = |(frame, reference): (&&String, &Option<zerre_lab::agreement::Reference>)| {
            let at = reference.as_ref()?.place?;
            Some(((*frame).clone(), Mark { at, mm: self.depths.get(*frame).copied() }))
        };
        let places = frames.iter().zip(&found.reference).filter_map(place).collect();
        let operators = found.reference.iter().flatten().map(|r| r.seen + r.hidden).max().unwrap_or(0);
        let given = self.errors.iter().map(|e| e * e).sum::<f64>() / self.errors.len() as f64;
        let floor = if self.errors.is_empty() { found.floor } else { Some(given.sqrt()) };
        Marked { places, operators, floor }
    }
}

/// Marks of the joints: a place a frame, or answers of several operators, whose geometric median is taken;
/// where most of them cannot see the point there is none. Rows that name no point are of the first joint.
pub(super) fn marks(path: &Path, joints: &[String]) -> Result<Marks, Diagnostic> {
    let table = Table::open(path)?;
    table.needs(&["frame", "x", "y"])?;
    let mut told: BTreeMap<String, Told> = BTreeMap::new();
    let mut bad = None;
    table.rows(|line, cell| {
        let mut read = || -> Result<(), String> {
            let frame = cell("frame").ok_or("column frame is empty")?;
            let point = cell("point").or_else(|| cell("joint")).or_else(|| joints.first().cloned());
            let told = told.entry(point.unwrap_or_default()).or_default();
            let unseen = cell("visible").is_some_and(|text| text.parse::<f64>() == Ok(0.0));
            let hidden = unseen || (cell("x").is_none() && cell("y").is_none());
            let answer =
                if hidden { Answer::Hidden } else { Answer::Seen([number(cell, "x")?, number(cell, "y")?]) };
            // Rows that name nobody are of somebody each.
            let who = cell("operator").map_or_else(
                || {
                    let count = told.answers.values().filter(|of| of.contains_key(&frame)).count();
                    format!("{count:04}")
                },
                |who| format!("operator {who}"),
            );
            if told.answers.entry(who.clone()).or_default().insert(frame.clone(), answer).is_some() {
                return Err(format!("{who} has marked frame {frame} twice"));
            }
            if !hidden {
                for column in ["z_mm", "z"] {
                    if cell(column).is_some() {
                        told.depths.insert(frame.clone(), number(cell, column)?);
                    }
                }
                if cell("se").is_some() {
                    told.errors.push(number(cell, "se")?);
                }
            }
            Ok(())
        };
        if let Err(problem) = read() {
            bad.get_or_insert((line, problem));
        }
    })?;
    if let Some((line, problem)) = bad {
        return Err(Diagnostic::new(format!("{}, line {line}: {problem}", path.display())));
    }
    // One point and one joint are the same, whatever they are called.
    if let ([joint], 1) = (joints, told.len())
        && let Some((_, only)) = told.pop_first()
    {
        told.insert(joint.clone(), only);
    }
    let names: Vec<String> = told.keys().cloned().collect();
    let joints: BTreeMap<String, Marked> = (told.into_iter())
        .filter(|(name, _)| joints.contains(name))
        .map(|(name, told)| (name, told.marked()))
        .filter(|(_, marked)| marked.len() > 0)
        .collect();
    if joints.is_empty() {
        let what =
            format!("{} marks none of the points that are followed where it can be seen", path.display());
        return Err(Diagnostic::new(what).help(format!(
            "its points are {}: --joint chooses, `zerre label --point` names them",
            names.join(", ")
        )));
    }
    Ok(Marks { path: path.to_owned(), joints })
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerre::Time;
    use zerre_vision::Image;

    fn frame(index: usize) -> RgbdFrame {
        let (colour, depth) = (Image::filled(1, 1, [0; 3]), Image::filled(1, 1, 0));
        RgbdFrame { index, name: format!("f{index}.png"), time: Time::ZERO, colour, depth }
    }

    fn read(name: &str, text: &str, joints: &[&str]) -> Result<Marks, Diagnostic> {
        let path = std::env::temp_dir().join(format!("zerre-marks-{}-{name}.csv", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let joints: Vec<String> = joints.iter().map(|joint| (*joint).to_owned()).collect();
        let marks = marks(&path, &joints);
        std::fs::remove_file(&path).unwrap();
        marks
    }

    /// A wild mark of one of three moves the reference to no place but one of the others'; who does not see
    /// the point is outvoted, or outvotes.
    #[test]
    fn several_operators_have_one_reference() {
        let text = "frame,operator,point,x,y,visible\n\
                    f0.png,a,hand,10,20,1\nf0.png,b,hand,10,20,1\nf0.png,c,hand,900,20,1\n\
                    f1.png,a,hand,10,20,1\nf1.png,b,hand,,,0\nf1.png,c,hand,,,0\n\
                    f2.png,a,hand,4,5,1\nf2.png,b,hand,6,5,1\nf2.png,c,hand,,,0\n";
        let marks = read("several", text, &["hand"]).unwrap();
        let hand = &marks.joints["hand"];
        let at = |k: usize| hand.of(&frame(k)).map(|mark| mark.at);
        assert_eq!((at(0), at(1), at(2)), (Some([10.0, 20.0]), None, Some([5.0, 5.0])));
        assert_eq!((hand.len(), hand.operators), (2, 3));
        // Of the two places: (890 / 3) sqrt(8) / (pi sqrt(2)) and 1 / sqrt(2), root mean square.
        let errors: [f64; 2] = [890.0 / 3.0 * 2.0 / std::f64::consts::PI, 0.5_f64.sqrt()];
        let floor = ((errors[0].powi(2) + errors[1].powi(2)) / 2.0).sqrt();
        assert!((hand.floor.unwrap() - floor).abs() < 1e-9 && hand.about().contains("3 operators"));
    }

    #[test]
    fn references_and_truth_are_marks_too() {
        let text = "frame,point,x,y,se,operators\n0,hand,1,2,0.5,3\n1,hand,,,,3\n";
        let hand = read("reference", text, &["hand_right"]).unwrap().joints["hand_right"].clone();
        assert_eq!((hand.len(), hand.floor), (1, Some(0.5)));
        assert_eq!(hand.of(&frame(0)), Some(Mark { at: [1.0, 2.0], mm: None }));
        let text = "frame,x,y,z_mm,visible\nf0.png,1,2,900,0.8\nf1.png,1,2,900,0.0\n";
        let truth = read("truth", text, &["a", "b"]).unwrap().joints["a"].clone();
        assert_eq!(
            (truth.of(&frame(0)), truth.of(&frame(1))),
            (Some(Mark { at: [1.0, 2.0], mm: Some(900.0) }), None)
        );
        for (text, says) in [
            ("frame,point,x,y\n0,head,1,2\n0,foot,3,4\n", "its points are foot, head"),
            ("frame,x,y\n0,nan,2\n", "line 2: column x has `nan`"),
            ("frame,operator,x,y\n0,a,1,2\n0,a,1,2\n", "operator a has marked frame 0 twice"),
            ("frame,x,y\n0,,\n", "marks none"),
            ("time,x,y\n0,1,2\n", "no column `frame`"),
        ] {
            let said = format!("{:?}", read("bad", text, &["a", "b"]).unwrap_err());
            assert!(said.contains(says), "{text}: {said}");
        }
    }
}
