//! Filters against SciPy and NumPy (`golden/scipy_filters.py`).
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use dynident_recording::{
    ButterworthZeroPhase, CentralDifferences, DecimationSettings, Derivatives, Differentiator, SavitzkyGolay,
};
use serde_json::Value;

fn golden() -> Value {
    serde_json::from_str(include_str!("../../../golden/scipy_filters.json")).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn derivatives(filter: &dyn Differentiator, rate_hz: f64, x: &[f64]) -> [Vec<f64>; 3] {
    let mut out = [vec![0.0; x.len()], vec![0.0; x.len()], vec![0.0; x.len()]];
    let [q, dq, ddq] = &mut out;
    filter.differentiate(rate_hz, x, Derivatives { q, dq, ddq }).unwrap();
    out
}

/// Within `tolerance` of the largest golden value.
fn agree(ours: &[f64], golden: &[f64], tolerance: f64, what: &str) {
    assert_eq!(ours.len(), golden.len(), "{what}");
    let scale = golden.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
    for (i, (a, b)) in ours.iter().zip(golden).enumerate() {
        assert!((a - b).abs() <= tolerance * scale, "{what}, sample {i}: {a} and {b}");
    }
}

#[test]
fn butterworth_is_sosfiltfilt_and_its_central_differences() {
    let golden = golden();
    let x = numbers(&golden["signal"]);
    for case in golden["butterworth"].as_array().unwrap() {
        let (order, cutoff, rate) =
            (case["order"].as_u64().unwrap(), number(&case["cutoff_hz"]), number(&case["rate_hz"]));
        let filter = ButterworthZeroPhase::new(order as usize, cutoff).unwrap();
        let [q, dq, ddq] = derivatives(&filter, rate, &x);
        let what = format!("order {order}, {cutoff} Hz");
        // Rounding of the recursion (condition up to 1e3); the golden differences lose rate · 2e-16 and rate² · 2e-15 more.
        agree(&q, &numbers(&case["q"]), 1e-12, &what);
        agree(&dq, &numbers(&case["dq"]), 1e-11, &what);
        agree(&ddq, &numbers(&case["ddq"]), 1e-9, &what);
        let mut smooth = vec![0.0; x.len()];
        filter.smooth(rate, &x, &mut smooth).unwrap();
        agree(&smooth, &numbers(&case["q"]), 1e-12, &what);
    }
}

#[test]
fn savitzky_golay_is_savgol_filter_with_its_ends() {
    let golden = golden();
    let x = numbers(&golden["signal"]);
    for case in golden["savitzky_golay"].as_array().unwrap() {
        let (window, degree) = (case["window"].as_u64().unwrap(), case["degree"].as_u64().unwrap());
        let filter = SavitzkyGolay::new(window as usize, degree as usize).unwrap();
        let ours = derivatives(&filter, number(&case["rate_hz"]), &x);
        for (d, ours) in ours.iter().enumerate() {
            // SciPy solves with powers of the sample number, which costs it digits at degree 8.
            agree(ours, &numbers(&case["derivatives"][d]), 1e-8, &format!("{window} {degree} derivative {d}"));
        }
    }
}

#[test]
fn second_order_differences_are_numpys_gradient() {
    let golden = golden();
    let ours = derivatives(&CentralDifferences::new(2).unwrap(), 200.0, &numbers(&golden["signal"]));
    // Three products of order one times the rate.
    agree(&ours[1], &numbers(&golden["gradient"]), 1e-12, "gradient");
}

#[test]
fn decimation_taps_are_those_of_firwin() {
    for case in golden()["decimation"].as_array().unwrap() {
        let settings = DecimationSettings {
            factor: case["factor"].as_u64().unwrap() as usize,
            stop_band_db: number(&case["stop_band_db"]),
            ..DecimationSettings::default()
        };
        // Two evaluations of sinc and Bessel function: a few roundings.
        agree(&settings.taps(number(&case["rate_hz"])).unwrap(), &numbers(&case["taps"]), 1e-13, "taps");
    }
}
