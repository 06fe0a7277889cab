use super::*;
use crate::metric::test_noise::Noise;
use crate::report::study::render;

fn seen(x: f64, y: f64) -> Option<Answer> {
    Some(Answer::Seen([x, y]))
}

const HIDDEN: Option<Answer> = Some(Answer::Hidden);

fn job(answers: Vec<Vec<Option<Answer>>>) -> Job {
    Job {
        frames: (0..answers[0].len()).map(|k| format!("frame {}", k + 1)).collect(),
        points: vec!["hand".to_owned()],
        operators: (0..answers.len()).map(|k| format!("operator {k}")).collect(),
        answers: vec![answers],
    }
}

/// Two operators, each the other's reference: every number by hand.
#[test]
fn two_operators_by_hand() {
    let answers = [
        vec![seen(0.0, 0.0), seen(10.0, 4.0), seen(20.0, 8.0), None],
        vec![seen(3.0, 4.0), seen(13.0, 8.0), HIDDEN, None],
    ];
    let found = agreement(&answers);
    let first = found.reference[0].unwrap();
    assert_eq!((first.place, first.seen, first.hidden), (Some([1.5, 2.0]), 2, 0));
    // Half the distance of 5 over sqrt 2.
    assert!((first.error.unwrap() - 2.5 / 2f64.sqrt()).abs() < 1e-12);
    let split = found.reference[2].unwrap();
    assert_eq!((split.place, split.error, split.seen, split.hidden), (Some([20.0, 8.0]), None, 1, 1));
    assert_eq!(found.reference[3], None);
    let [a, b] = &found.operators[..] else { panic!() };
    assert_eq!((a.answered, a.seen, a.compared, b.answered, b.seen, b.compared), (3, 3, 2, 3, 2, 2));
    assert_eq!(a.bias.unwrap().map(|bias| bias.value), [-3.0, -4.0]);
    assert_eq!(b.bias.unwrap().map(|bias| bias.value), [3.0, 4.0]);
    assert_eq!((a.spread, a.distance), (Some([0.0; 2]), Some([5.0; 3])));
    assert_eq!((a.same_visibility, b.same_visibility), (Some(2.0 / 3.0), Some(2.0 / 3.0)));
    assert_eq!(found.distances[1], [Some(5.0), Some(5.0), None, None]);
    // Within a frame: squares of 4.5 and 8 twice over one degree of freedom each.
    let [x, y] = found.deviation.unwrap();
    assert!((x - 4.5f64.sqrt()).abs() < 1e-12 && (y - 8f64.sqrt()).abs() < 1e-12);
    assert_eq!(found.correlated, [2, 2]);
    // Rows 1.5 and 11.5 (MSR 100), columns 5 and 8 (MSC 9), no rest: 100 / (100 + 2 * 9 / 2).
    assert!((found.correlation[0].unwrap().value - 100.0 / 109.0).abs() < 1e-12);
    let frames: Vec<_> = found.again.iter().map(|again| (again.frame, again.split)).collect();
    assert_eq!(frames, [(2, [1, 1])]);
}

#[test]
fn a_point_that_most_do_not_see_has_no_place() {
    let answers = [vec![seen(1.0, 1.0)], vec![HIDDEN], vec![HIDDEN]];
    let found = agreement(&answers);
    let reference = found.reference[0].unwrap();
    assert_eq!((reference.place, reference.error, reference.seen, reference.hidden), (None, None, 1, 2));
    assert_eq!(found.operators[0].same_visibility, Some(0.0));
    assert_eq!(found.operators[1].same_visibility, Some(1.0), "a tie of the others is agreement");
}

#[test]
fn nobody_and_one_alone() {
    let none = agreement(&[]);
    assert_eq!((none.reference.len(), none.again.len(), none.deviation), (0, 0, None));
    let alone = job(vec![vec![seen(1.0, 2.0), None], vec![None, None]]);
    let found = agreement(&alone.answers[0]);
    assert_eq!(found.operators[0].bias, None);
    assert_eq!((found.correlation, found.correlated), ([None; 2], [0, 0]));
    assert_eq!(alone.of_those_who_answered().operators, ["operator 0"]);
    let page = render(&page("t".to_owned(), Vec::new(), &alone, &[found]));
    assert!(!page.contains("NaN") && page.contains("none"), "{page}");
}

/// Five operators with known biases and noise on 400 frames, one of them with a slip of hundreds of pixels.
#[test]
fn simulated_operators_are_found_out() {
    let mut noise = Noise(5);
    let biases = [[2.0, -1.0], [0.0, 0.0], [-1.0, 1.5], [0.5, 0.0], [-0.5, -0.5]];
    let deviations = [1.0, 1.0, 1.0, 1.0, 3.0];
    let mut answers = vec![Vec::new(); 5];
    for frame in 0..400 {
        let place = [300.0 + 100.0 * (f64::from(frame) / 40.0).sin(), 200.0 + f64::from(frame) / 4.0];
        for (k, answers) in answers.iter_mut().enumerate() {
            let mark = [0, 1].map(|axis| place[axis] + biases[k][axis] + deviations[k] * noise.normal());
            answers.push(Some(Answer::Seen(mark)));
        }
    }
    answers[1][123] = seen(0.0, 0.0);
    let found = agreement(&answers);
    let truth = |k: usize, axis: usize| biases[k][axis];
    for (k, operator) in found.operators.iter().enumerate().filter(|(k, _)| *k != 1) {
        // The others' median lies near their middle, which their biases move by less than their largest, 2.
        for axis in 0..2 {
            let bias = operator.bias.unwrap()[axis];
            assert!((bias.value - truth(k, axis)).abs() < 1.0, "{k} {axis}: {bias:?}");
            // Own noise, and that of a median of four: at most 1.3 of 1.5 squared over four.
            let spread = operator.spread.unwrap()[axis] / deviations[k];
            assert!((0.9..1.5).contains(&spread), "{k} {axis}: {spread}");
        }
    }
    assert_eq!((found.again[0].frame, found.again[0].far.unwrap().1), (123, 1));
    // The noisy operator is beyond the limit of the others now and then; the quiet rest is not listed.
    assert!(found.again.iter().all(|again| again.frame == 123 || again.far.unwrap().1 == 4));
    // Variances: 833 of the object down and 5000 across; against them noise 2.6, biases 1, and the one slip,
    // 27 down (230 squared over 2000 marks) and 45 across.
    assert!(found.correlation.iter().all(|icc| (0.95..0.995).contains(&icc.unwrap().value)));
    let tables = job(answers);
    let references = tables.reference(std::slice::from_ref(&found));
    assert_eq!((references.rows.len(), tables.labels().rows.len()), (400, 2000));
    let again = tables.again(std::slice::from_ref(&found)).csv();
    assert!(again.starts_with("frame,point,distance_px,operator,visible,not_visible\nframe 124,hand,"));
    let statistics = statistics(&tables, &[found]).csv();
    assert!(statistics.contains("\nhand,operator 0,bias_x_px,") && statistics.contains("\nhand,,icc_x,0.9"));
}

#[test]
fn labels_are_rows_in_a_fixed_order() {
    let mut two = job(vec![vec![seen(1.5, 2.25), HIDDEN], vec![None, seen(3.0, 4.5)]]);
    two.points.push("elbow".to_owned());
    two.answers.push(vec![vec![None, seen(7.5, 8.5)], vec![HIDDEN, None]]);
    assert_eq!(
        two.labels().csv(),
        "frame,operator,point,x,y,visible\n\
         frame 1,operator 0,hand,1.5,2.25,1\n\
         frame 1,operator 1,elbow,,,0\n\
         frame 2,operator 0,hand,,,0\n\
         frame 2,operator 0,elbow,7.5,8.5,1\n\
         frame 2,operator 1,hand,3.0,4.5,1\n"
    );
}
