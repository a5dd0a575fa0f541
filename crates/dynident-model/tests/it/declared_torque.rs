//! Declared torques: the parser compared with another evaluation, slopes with differences, tables with SciPy.

use dynident_model::terms::{
    Declared, DeclaredLaw, Expression, ExpressionProblem, JointMotion, JointNames, TorqueTable, TorqueTableError,
    TorqueTerm, sort_terms,
};
use proptest::prelude::*;

fn names() -> Vec<String> {
    ["shoulder", "upper arm"].map(str::to_owned).to_vec()
}

fn parsed(text: &str) -> Expression {
    Expression::parse(text, &JointNames { own: Some(0), names: &names() }).unwrap_or_else(|error| panic!("{error}"))
}

fn at(text: &str, q: [f64; 2], dq: [f64; 2]) -> Option<f64> {
    parsed(text).value(|joint| q[joint], |joint| dq[joint])
}

fn term(law: DeclaredLaw) -> TorqueTerm {
    TorqueTerm::Declared(Declared {
        name: "spring".to_owned(),
        joint: 0,
        law,
        unit: "Nm".to_owned(),
        nominal: None,
        is_spring: false,
    })
}

/// Expected values were computed by hand.
#[test]
fn precedence_is_that_of_arithmetic() {
    let cases = [
        ("2 + 3 * 4", 14.0),
        ("2 - 3 - 4", -5.0),
        ("12 / 3 / 2", 2.0),
        ("-2^2", -4.0),
        ("(-2)^2", 4.0),
        ("2^-1", 0.5),
        ("2^3^2", 512.0),
        ("2 * -3", -6.0),
        ("2--3", 5.0),
        ("8^(1/3)", 2.0),
        ("-(1 + 2) * 3", -9.0),
        ("1.5e1 + .5", 15.5),
        ("max(1, 2) - min(1, 2)", 1.0),
        ("atan2(1, -1) / pi", 0.75),
        ("ln(exp(3)) + sqrt(16) + abs(-2)", 9.0),
        ("q2 - q(upper arm) + q(\"upper arm\")", 7.0),
        ("q * dq + dq(shoulder)", 3.0 * 5.0 + 5.0),
    ];
    for (text, expected) in cases {
        let found = at(text, [3.0, 7.0], [5.0, 11.0]).unwrap();
        assert!((found - expected).abs() < 1e-14, "{text} = {found}, not {expected}");
    }
}

#[test]
fn broken_expressions_name_the_place() {
    let names = names();
    for line in include_str!("../broken_expressions.tsv").lines() {
        let [text, character, fragment] = line.split('\t').collect::<Vec<_>>()[..] else { panic!("{line}") };
        let error = Expression::parse(text, &JointNames { own: Some(0), names: &names }).unwrap_err();
        let message = error.to_string();
        assert_eq!(error.character.to_string(), character, "{message}");
        assert!(message.contains(fragment), "{message}");
    }
    let deep = "(".repeat(5000);
    let long = format!("q{}", " + q".repeat(400));
    for text in [&deep, &long, &"-".repeat(1500), &"sin(".repeat(300), &"2^".repeat(500)] {
        let error = Expression::parse(text, &JointNames { own: Some(0), names: &names }).unwrap_err();
        assert!(matches!(error.problem, ExpressionProblem::TooLong { .. }), "{error}");
    }
    // The maximum depth is accepted.
    let signs = format!("{}q", "-".repeat(60));
    let read = Expression::parse(&signs, &JointNames { own: Some(0), names: &names }).unwrap();
    assert_eq!(Expression::try_from(read.to_string()), Ok(read));
    let whose = Expression::parse("q", &JointNames { own: None, names: &[] }).unwrap_err();
    assert!(matches!(whose.problem, ExpressionProblem::WhichJoint { .. }));
}

#[test]
fn undefined_values_are_none() {
    for text in ["sqrt(q - 4)", "1 / (q - 3)", "ln(0 * q)", "asin(q)", "(q - 4)^0.5", "exp(exp(q * 20))", "1e12 * q"] {
        assert_eq!(at(text, [3.0, 7.0], [5.0, 11.0]), None, "{text}");
    }
    // Also if the whole expression would be a number again.
    assert_eq!(at("atan(1 / (q - 3))", [3.0, 7.0], [0.0; 2]), None);
    assert_eq!(at("max(sqrt(q - 4), 0)", [3.0, 7.0], [0.0; 2]), None);
    assert_eq!(at("sqrt(max(q - 4, 0))", [3.0, 7.0], [0.0; 2]), Some(0.0));
    // Columns are zero there, and the undefined sample is reported.
    let term = term(DeclaredLaw::Expression(parsed("sqrt(q)")));
    let (q, zeros) = ([4.0, -1.0, 9.0], [0.0; 3]);
    let motion = JointMotion { samples: 3, q: &q, dq: &zeros, ddq: &zeros };
    let mut column = [f64::NAN; 3];
    term.column(0, &motion, &mut column);
    assert_eq!((column, term.undefined(&motion)), ([2.0, 0.0, 3.0], Some(1)));
}

fn expressions() -> Vec<&'static str> {
    vec![
        "sin(q - 0.3) * cos(q2)^3 + tan(q / 4)",
        "asin(q / 4) * acos(dq / 8) - atan(q2 * dq2)",
        "sinh(q / 2) / cosh(q2) + tanh(3 * dq)",
        "exp(-q^2) * ln(5 + q2) + sqrt(6 + q * q2)",
        "abs(q) * q + (5 + q)^1.5 - (5 + q)^-2",
        "atan2(sin(q), 2 + cos(q2)) + min(q, q2) * max(dq, dq2)",
        // Cable from a point on the base to a point on the link (law of cosines), with elongation beyond 0.8 m.
        "0.3 * 0.7 * sin(q + 0.2) * max(sqrt(0.3^2 + 0.7^2 - 2 * 0.3 * 0.7 * cos(q + 0.2)) - 0.8, 0)",
    ]
}

#[test]
fn slopes_equal_central_differences() {
    let laws = expressions().into_iter().map(|text| DeclaredLaw::Expression(parsed(text)));
    let table = TorqueTable::new(vec![[-1.5, -3.0], [-1.0, -1.0], [0.1, 0.4], [0.9, 2.0], [1.6, 2.5]]).unwrap();
    let h = 1e-6;
    for law in laws.chain([DeclaredLaw::Table(table)]) {
        let term = term(law);
        for sample in 0..50 {
            let state: [f64; 4] = core::array::from_fn(|k| 1.7 * (1.3 + 0.71 * f64::from(sample * 4 + k as i32)).sin());
            let value = |state: &[f64; 4]| {
                let motion = JointMotion { samples: 1, q: &state[..2], dq: &state[2..], ddq: &[0.0; 2] };
                let mut column = [f64::NAN];
                term.column(0, &motion, &mut column);
                column[0]
            };
            let motion = JointMotion { samples: 1, q: &state[..2], dq: &state[2..], ddq: &[0.0; 2] };
            let [mut by_q, mut by_dq, mut by_ddq] = [[0.0; 2]; 3];
            term.apply_adjoint(0, &motion, &[2.0], [&mut by_q, &mut by_dq, &mut by_ddq]);
            assert_eq!(by_ddq, [0.0; 2]);
            for (variable, found) in by_q.into_iter().chain(by_dq).enumerate() {
                let moved = |by: f64| {
                    let mut moved = state;
                    moved[variable] += by;
                    value(&moved)
                };
                let expected = 2.0 * (moved(h) - moved(-h)) / (2.0 * h);
                // Rounding error of 1e-16 / h, and h times second derivatives of about ten near a kink.
                assert!((found - expected).abs() < 1e-4 * (1.0 + expected.abs()), "{term:?}: {found} {expected}");
            }
        }
    }
}

/// Reference: `PchipInterpolator` of SciPy 1.17.1 with the same points.
#[test]
fn tables_are_the_curves_of_scipy() {
    let points = [[-1.5, -3.0], [-1.0, -1.0], [-0.2, -1.2], [0.1, 0.4], [0.9, 2.0], [1.0, 2.5], [2.5, 2.5]];
    let table = TorqueTable::new(points.to_vec()).unwrap();
    let q = [-1.5, -1.3, -0.7, -0.2, -0.05, 0.5, 0.95, 1.7, 2.5];
    let values = [
        -3.0,
        -1.8903076923076927,
        -1.0632812500000002,
        -1.2,
        -0.5171597633136094,
        1.1909974640743872,
        2.290178571428571,
        2.5,
        2.5,
    ];
    let slopes = [
        5.634615384615384,
        5.083846153846155,
        -0.3515624999999999,
        0.0,
        7.218934911242604,
        1.4153634826711752,
        6.696428571428574,
        0.0,
        0.0,
    ];
    for ((q, value), slope) in q.into_iter().zip(values).zip(slopes) {
        assert!((table.value(q) - value).abs() < 1e-14, "{q}: {} {value}", table.value(q));
        assert!((table.slope(q) - slope).abs() < 1e-13, "{q}: {} {slope}", table.slope(q));
    }
    assert_eq!([table.value(-9.0), table.value(9.0), table.slope(-9.0), table.slope(9.0)], [-3.0, 2.5, 0.0, 0.0]);
    // No overshoot beyond neighbouring points.
    for step in 0..4000 {
        let q = -1.5 + f64::from(step) * 1e-3;
        let place = points.iter().rposition(|point| point[0] <= q).unwrap().min(points.len() - 2);
        let [a, b] = [points[place][1], points[place + 1][1]];
        let value = table.value(q);
        assert!(value >= a.min(b) - 1e-15 && value <= a.max(b) + 1e-15, "{q}: {value}");
    }
}

#[test]
fn broken_tables_name_the_point() {
    let error = |points: &[[f64; 2]]| TorqueTable::new(points.to_vec()).unwrap_err();
    assert_eq!(error(&[[0.0, 1.0]]), TorqueTableError::Points { found: 1 });
    assert!(matches!(error(&[[0.0, 1.0], [1.0, f64::NAN]]), TorqueTableError::Number { number: 2, .. }));
    assert!(matches!(error(&[[0.0, 1.0], [1e300, 2.0]]), TorqueTableError::Number { number: 2, .. }));
    assert!(matches!(error(&[[0.0, 1.0], [1.0, 1.0], [1.0, 2.0]]), TorqueTableError::Order { number: 3, .. }));
    assert!(matches!(error(&[[0.0, 1.0], [-1.0, 1.0]]), TorqueTableError::Order { number: 2, .. }));
}

#[test]
fn declared_torques_follow_all_other_terms() {
    use dynident_model::terms::{Coupling, CouplingEffect, Offset};
    let coupling =
        Coupling { name: "m".into(), first: 0, second: 1, ratios: [1.0; 2], effect: CouplingEffect::Inertia };
    let declared = term(DeclaredLaw::Expression(parsed("q")));
    let mut terms =
        vec![declared.clone(), TorqueTerm::Coupling(coupling.clone()), TorqueTerm::Offset(Offset { joint: 1 })];
    sort_terms(&mut terms);
    assert_eq!(terms, [TorqueTerm::Offset(Offset { joint: 1 }), TorqueTerm::Coupling(coupling), declared.clone()]);
    assert!(!declared.is_friction() && declared.own_joint() == Some(0) && !declared.is_nonnegative());
}

/// A text with its value, computed independently of the parser.
type Meaning = Box<dyn Fn([f64; 4]) -> f64>;

fn written(choices: &mut impl Iterator<Item = u32>, depth: usize) -> (String, Meaning) {
    let mut next = |most: u32| choices.next().unwrap_or(0) % most;
    let kind = if depth == 0 { next(5) } else { next(13) };
    let mut part = |depth: usize| written(choices, depth);
    match kind {
        0 => ("q".to_owned(), Box::new(|x| x[0])),
        1 => ("q2".to_owned(), Box::new(|x| x[1])),
        2 => (" dq(shoulder)".to_owned(), Box::new(|x| x[2])),
        3 => ("dq( \"upper arm\" )".to_owned(), Box::new(|x| x[3])),
        4 => ("1.25e0".to_owned(), Box::new(|_| 1.25)),
        5..=8 => {
            let ((a, of_a), (b, of_b)) = (part(depth - 1), part(depth - 1));
            match kind {
                5 => (format!("({a} + {b})"), Box::new(move |x| of_a(x) + of_b(x))),
                6 => (format!("({a}-{b})"), Box::new(move |x| of_a(x) - of_b(x))),
                7 => (format!("({a})*({b})"), Box::new(move |x| of_a(x) * of_b(x))),
                _ => (format!("({a}) / ({b})"), Box::new(move |x| of_a(x) / of_b(x))),
            }
        }
        9 => {
            let (a, of_a) = part(depth - 1);
            (format!("-({a})"), Box::new(move |x| -of_a(x)))
        }
        10 => {
            let (a, of_a) = part(depth - 1);
            (format!("({a})^3"), Box::new(move |x| of_a(x).powi(3)))
        }
        11 => {
            let (a, of_a) = part(depth - 1);
            (format!("sin({a})"), Box::new(move |x| of_a(x).sin()))
        }
        _ => {
            let ((a, of_a), (b, of_b)) = (part(depth - 1), part(depth - 1));
            (format!("max({a}, {b})"), Box::new(move |x| of_a(x).max(of_b(x))))
        }
    }
}

proptest! {
    #[test]
    fn expressions_have_the_expected_values(
        choices in proptest::collection::vec(any::<u32>(), 1..60), state in proptest::array::uniform4(-3.0..3.0_f64)
    ) {
        let (text, meaning) = written(&mut choices.into_iter(), 5);
        let expression = Expression::parse(&text, &JointNames { own: Some(0), names: &names() });
        // Up to 63 parts have at most some hundred operations, but texts may be too long.
        let Ok(expression) = expression else { return Ok(()) };
        let (q, dq) = ([state[0], state[1]], [state[2], state[3]]);
        let expected = meaning(state);
        if let Some(found) = expression.value(|joint| q[joint], |joint| dq[joint]) {
            // The operations and their order are the same, but mathematics libraries may differ in the last bit.
            prop_assert!((found - expected).abs() <= 1e-12 * (1.0 + expected.abs()), "{text}: {found} {expected}");
        }
        // Its canonical text parses to the same expression.
        let again = Expression::try_from(expression.to_string());
        prop_assert_eq!(again.as_ref(), Ok(&expression), "{}", expression);
    }

    #[test]
    fn no_text_panics(text in "[q0-9.e+*/^(), a-dpimnxsN\"'_-]{0,60}") {
        if let Ok(expression) = Expression::parse(&text, &JointNames { own: Some(1), names: &names() }) {
            let value = expression.value(|_| 0.7, |_| -0.2);
            prop_assert!(value.is_none_or(f64::is_finite));
            prop_assert_eq!(Expression::try_from(expression.to_string()), Ok(expression));
        }
    }
}
