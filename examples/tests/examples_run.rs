//! Every example runs, and shows what its page promises.

use std::process::Command;

fn output_of(program: &str) -> String {
    let output = Command::new(program).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The number after `label` in the line that holds `line`.
fn number(text: &str, line: &str, label: &str) -> f64 {
    let line = text.lines().find(|l| l.contains(line)).unwrap_or_else(|| panic!("no {line:?} in {text}"));
    let rest = &line[line.find(label).unwrap() + label.len()..];
    rest.split_whitespace().next().unwrap().parse().unwrap()
}

#[test]
fn first_filter_errs_less_than_its_sensor() {
    let text = output_of(env!("CARGO_BIN_EXE_01_first_filter"));
    let (filter, sensor) = (number(&text, "RMSE", "filter"), number(&text, "RMSE", "alone"));
    assert!(filter < sensor, "{text}");
}

#[test]
fn own_model_runs_under_three_filters() {
    let text = output_of(env!("CARGO_BIN_EXE_02_own_model"));
    for filter in ["extended Kalman", "unscented Kalman", "particles, 10 000"] {
        // The camera alone: asin(0.1 / 2), 2.9 degrees.
        assert!(number(&text, filter, filter) < 2.9, "{text}");
    }
}

#[test]
fn live_stream_counts_every_report() {
    let text = output_of(env!("CARGO_BIN_EXE_03_live_stream"));
    assert!(text.contains(r#"outcomes: {"gated": 1, "late": 1, "predicted": 8, "updated": 50}"#), "{text}");
    assert!(text.contains("goes back in time"), "{text}");
}

#[test]
fn comparing_filters_agree_where_they_must() {
    let text = output_of(env!("CARGO_BIN_EXE_04_comparing_filters"));
    let linear = text.split("Range").next().unwrap();
    let kalman = number(linear, "Kalman", "Kalman");
    for filter in ["extended", "unscented", "particles, 10 000"] {
        // 10 000 particles: the error that they add is a hundredth of a standard deviation; the table has 3 decimals.
        assert!((number(linear, filter, filter) - kalman).abs() < 0.02 * kalman, "{text}");
    }
    assert!(text.contains("Kalman               refuses"), "{text}");
}

#[test]
fn reading_csv_shows_the_offset_and_gains_the_velocity() {
    let text = output_of(env!("CARGO_BIN_EXE_05_reading_csv"));
    assert!(text.contains("133 rows, 133 used"), "{text}");
    let vessels: Vec<Vec<f64>> = text
        .lines()
        .filter(|line| line.trim_end().ends_with("m/s"))
        .map(|line| line.split_whitespace().filter_map(|word| word.parse().ok()).collect())
        .collect();
    assert_eq!(vessels.len(), 2, "{text}");
    for vessel in &vessels {
        let [_, _, plots, offset, filter, differences, velocity] = vessel[..] else { panic!("{text}") };
        assert!(offset > 0.5 * plots && filter < 1.05 * plots && velocity < 0.5 * differences, "{text}");
    }
}

#[test]
fn parameters_are_found_by_every_method() {
    let text = output_of(env!("CARGO_BIN_EXE_06_parameters"));
    for method in ["particles", "particle Gibbs", "SMC^2"] {
        let line = text.lines().find(|line| line.contains(method)).unwrap();
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let [.., step, step_sd, noise, noise_sd] = numbers[..] else { panic!("{text}") };
        // Three standard deviations; the record is the same for all.
        assert!((step - 0.5).abs() < 3.0 * step_sd && step_sd < 0.2, "{text}");
        assert!((noise - 1.0).abs() < 3.0 * noise_sd && noise_sd < 0.2, "{text}");
    }
    assert!(
        number(&text, "evidence", "of the walk") > number(&text, "evidence", "hardly wanders") + 10.0,
        "{text}"
    );
}

#[test]
fn swarm_shows_what_is_sound() {
    let text = output_of(env!("CARGO_BIN_EXE_07_swarm"));
    let errors = |line: &str| number(&text, line, line);
    let exact = errors("Kalman");
    assert!(errors("bees as papers have them") > 3.0 * exact, "{text}");
    for sound in ["bees as a proposal, weighed", "by degrees, random walk", "by degrees, exact bee move"] {
        // Some 80 to 400 particles: their mean errs by a fifth of a standard deviation at most, 2 % of the error.
        assert!(errors(sound) < 1.15 * exact, "{text}");
    }
}
