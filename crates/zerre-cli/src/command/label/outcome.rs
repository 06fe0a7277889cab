//! What a job came to: tables, page, record.

use super::answer;
use crate::args::Label;
use crate::diagnostic::Diagnostic;
use crate::run::{EstimatesDigest, Folder, Record, State};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;
use zerre_lab::agreement::{self, Agreement, agreement, statistics};
use zerre_lab::report::study::render;
use zerre_lab::study::interval::Estimate;
use zerre_lab::{number, signed};
use zerre_web::label::{Answers, Job};

pub(super) struct Outcome {
    job: agreement::Job,
    title: String,
    agreements: Vec<Agreement>,
    /// Operators who logged in and answered nothing.
    idle: Vec<String>,
}

/// A job that nobody has begun.
pub(super) fn nothing(points: &[String]) -> agreement::Job {
    let answers = vec![Vec::new(); points.len()];
    agreement::Job { frames: Vec::new(), points: points.to_vec(), operators: Vec::new(), answers }
}

pub(super) fn write(folder: &mut Folder, name: &str, text: &str) -> Result<(), Diagnostic> {
    folder.write(name, |file| file.write_all(text.as_bytes()))
}

impl Outcome {
    pub(super) fn of(job: &Job, answers: Answers) -> Outcome {
        let everybody = agreement::Job {
            frames: job.frames.clone(),
            points: job.points.clone(),
            operators: answers.operators,
            answers: answers
                .answers
                .into_iter()
                .map(|point| {
                    let cells =
                        |list: Vec<Option<zerre_web::label::Answer>>| -> Vec<Option<agreement::Answer>> {
                            list.into_iter().map(|cell| cell.map(answer)).collect()
                        };
                    point.into_iter().map(cells).collect()
                })
                .collect(),
        };
        let job_of_all = everybody.of_those_who_answered();
        let idle =
            everybody.operators.into_iter().filter(|who| !job_of_all.operators.contains(who)).collect();
        let agreements = job_of_all.answers.iter().map(|answers| agreement(answers)).collect();
        Outcome { job: job_of_all, title: job.title.clone(), agreements, idle }
    }

    /// Whether everybody who answered anything has answered everything.
    pub(super) fn is_whole(&self) -> bool {
        let full = |point: &Vec<Vec<Option<agreement::Answer>>>| point.iter().flatten().all(Option::is_some);
        !self.job.operators.is_empty() && self.job.answers.iter().all(full)
    }

    pub(super) fn write(
        &self,
        args: &Label,
        record: &mut Record,
        folder: &mut Folder,
    ) -> Result<(), Diagnostic> {
        let mut digest = EstimatesDigest::default();
        for reference in self.agreements.iter().flat_map(|agreement| agreement.reference.iter().flatten()) {
            let [x, y] = reference.place.unwrap_or([f64::NAN; 2]);
            digest.push(&[
                x,
                y,
                reference.error.unwrap_or(f64::NAN),
                reference.seen as f64,
                reference.hidden as f64,
            ]);
        }
        let digest = digest.finish();
        for table in [
            self.job.labels(),
            self.job.reference(&self.agreements),
            statistics(&self.job, &self.agreements),
            self.job.again(&self.agreements),
        ] {
            write(folder, &format!("{}.csv", table.name), &table.csv())?;
        }
        let mut page = agreement::page(
            format!("Labels of {}", self.title),
            self.facts(args),
            &self.job,
            &self.agreements,
        );
        page.command = command_line(args);
        page.digest.clone_from(&digest);
        write(folder, "report.html", &render(&page))?;
        record.estimates_digest = Some(digest);
        if !self.idle.is_empty() {
            record.outcomes_of(
                "operator without an answer",
                "left out of all tables",
                self.idle.len() as u64,
            );
        }
        let again: usize = self.agreements.iter().map(|agreement| agreement.again.len()).sum();
        if again > 0 {
            record.outcomes_of("frame to look at again", "listed in again.csv", again as u64);
        }
        Ok(())
    }

    fn facts(&self, args: &Label) -> Vec<(String, String)> {
        let frames = self.job.frames.len();
        let every = if args.every.get() > 1 { format!(", every {}", args.every) } else { String::new() };
        let mut facts = vec![
            ("Input", args.input.display().to_string()),
            ("Frames", format!("{frames}{every}")),
            ("Points", self.job.points.join(", ")),
            ("Operators", self.job.operators.join(", ")),
        ];
        if !self.idle.is_empty() {
            facts.push(("Without an answer", self.idle.join(", ")));
        }
        facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        for who in &self.idle {
            warnings.push(format!("{who} has answered nothing and is left out"));
        }
        match self.job.operators.len() {
            0 => warnings.push("nobody has marked anything: the tables are empty".to_owned()),
            1 => warnings
                .push("one operator alone: there is nothing to compare, and no standard error".to_owned()),
            _ => {}
        }
        let all = self.job.frames.len() * self.job.points.len();
        for (k, who) in self.job.operators.iter().enumerate() {
            let given: usize = self.agreements.iter().map(|agreement| agreement.operators[k].answered).sum();
            if given < all {
                warnings.push(format!("{who} has answered {given} of {all}: the same command goes on"));
            }
        }
        warnings
    }

    /// A line per point and operator.
    pub(super) fn table(&self) -> String {
        let wide = |names: &[String]| names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(8);
        let (of_point, of_operator) = (wide(&self.job.points), wide(&self.job.operators));
        let mut text = format!(
            "{:<of_point$}  {:<of_operator$}  {:>7}  {:>7}  {:>7}  {:>8}  {:>8}  {:>11}\n",
            "point", "operator", "answers", "bias_x", "bias_y", "spread_x", "spread_y", "distance_px"
        );
        let mut notes = String::new();
        for (point, agreement) in self.job.points.iter().zip(&self.agreements) {
            for (who, operator) in self.job.operators.iter().zip(&agreement.operators) {
                let bias =
                    |axis: usize| operator.bias.map_or("-".to_owned(), |bias| signed(bias[axis].value));
                let spread =
                    |axis: usize| operator.spread.map_or("-".to_owned(), |spread| number(spread[axis]));
                let distance = operator.distance.map_or("-".to_owned(), |distance| number(distance[0]));
                // Writing to a string cannot fail, here and below.
                let _ = writeln!(
                    text,
                    "{point:<of_point$}  {who:<of_operator$}  {:>7}  {:>7}  {:>7}  {:>8}  {:>8}  {distance:>11}",
                    operator.answered,
                    bias(0),
                    bias(1),
                    spread(0),
                    spread(1)
                );
            }
            let shown = |estimate: Option<Estimate>| {
                estimate.map_or_else(
                    || "unknown".to_owned(),
                    |e| format!("{:.4} ({:.4} to {:.4})", e.value, e.low, e.high),
                )
            };
            let [x, y] = agreement.correlation;
            let floor =
                agreement.floor.map_or_else(|| "unknown".to_owned(), |floor| format!("{} px", number(floor)));
            let _ = writeln!(
                notes,
                "{point}: ICC(A,1) x {}, y {}; standard error of the reference {floor}; {} frames to look at again",
                shown(x),
                shown(y),
                agreement.again.len()
            );
        }
        text + &notes
    }

    pub(super) fn document(&self, out: &Path, state: State, digest: Option<&str>) -> Value {
        let interval =
            |e: Option<Estimate>| e.map(|e| json!({ "value": e.value, "low": e.low, "high": e.high }));
        let points = self.job.points.iter().zip(&self.agreements).map(|(point, agreement)| {
            let operators = self.job.operators.iter().zip(&agreement.operators).map(|(who, operator)| {
                json!({
                    "operator": who, "answered": operator.answered, "visible": operator.seen,
                    "compared": operator.compared,
                    "bias_x_px": interval(operator.bias.map(|bias| bias[0])),
                    "bias_y_px": interval(operator.bias.map(|bias| bias[1])),
                    "spread_px": operator.spread, "distance_mean_px": operator.distance.map(|distance| distance[0]),
                    "same_visibility": operator.same_visibility,
                })
            });
            json!({
                "point": point, "operators": operators.collect::<Vec<_>>(),
                "icc_x": interval(agreement.correlation[0]), "icc_y": interval(agreement.correlation[1]),
                "deviation_px": agreement.deviation, "reference_se_px": agreement.floor,
                "limit_px": agreement.limit, "again": agreement.again.len(),
            })
        });
        json!({
            "frames": self.job.frames.len(), "operators": self.job.operators, "idle": self.idle,
            "points": points.collect::<Vec<_>>(), "out": out.display().to_string(), "estimates_digest": digest,
            "state": state,
        })
    }
}

fn command_line(args: &Label) -> String {
    let mut line = format!("zerre label {}", args.input.display());
    for point in &args.point {
        let _ = write!(line, " --point {point}");
    }
    if args.every.get() > 1 {
        let _ = write!(line, " --every {}", args.every);
    }
    line
}
