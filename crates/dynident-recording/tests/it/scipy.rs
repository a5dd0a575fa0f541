//! Comparison of filters with SciPy and NumPy (`golden/scipy_filters.py`).
use dynident_recording::derivative::{
    ButterworthZeroPhase, CentralDifferences, Ends, FivePointCubic, FourierFit, FrequencyDomain, LowPass,
    SavitzkyGolay, SmoothedDifferences,
};
use dynident_recording::{DecimationSettings, Derivatives, Differentiator};
use serde_json::Value;

fn golden() -> Value {
    serde_json::from_str(include_str!("../../../../golden/scipy_filters.json")).unwrap()
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

/// Checks agreement within `tolerance` of the largest golden value.
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
        // Rounding of the recursion (condition up to 1e3); the golden differences have additional errors of rate ·
        // 2e-16 and rate² · 2e-15.
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
            // SciPy solves with powers of the sample number and loses precision at degree 8.
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

#[test]
fn the_causal_low_pass_is_sosfilt_and_its_delay_the_group_delay() {
    let golden = golden();
    let x = numbers(&golden["signal"]);
    for case in golden["low_pass"].as_array().unwrap() {
        let (order, cutoff, rate) =
            (case["order"].as_u64().unwrap(), number(&case["cutoff_hz"]), number(&case["rate_hz"]));
        let filter = LowPass::new(order as usize, cutoff).unwrap();
        let [q, dq, ddq] = derivatives(&filter, rate, &x);
        let what = format!("causal, order {order}, {cutoff} Hz");
        // As for the zero-phase filter.
        agree(&q, &numbers(&case["q"]), 1e-12, &what);
        agree(&dq, &numbers(&case["dq"]), 1e-11, &what);
        agree(&ddq, &numbers(&case["ddq"]), 1e-9, &what);
        // SciPy evaluates the delay at 1e-6 rad per sample from the quotient of polynomials, with lower precision.
        assert!((filter.delay_s(rate).unwrap() / number(&case["delay_s"]) - 1.0).abs() < 1e-6, "{what}");
    }
}

#[test]
fn the_fourier_fit_is_lstsq() {
    let golden = golden();
    let x = numbers(&golden["signal"]);
    for case in golden["fourier_fit"].as_array().unwrap() {
        let (base, harmonics) = (number(&case["base_hz"]), case["harmonics"].as_u64().unwrap() as usize);
        let fit = FourierFit::new(base, harmonics, case["trend"].as_bool().unwrap()).unwrap();
        let ours = derivatives(&fit, number(&case["rate_hz"]), &x);
        for (ours, key) in ours.iter().zip(["q", "dq", "ddq"]) {
            // Condition of the basis up to 1e3 (half a period with a line), squared.
            agree(ours, &numbers(&case[key]), 1e-10, &format!("fit at {base} Hz, {key}"));
        }
    }
}

#[test]
fn the_frequency_domain_is_numpys_transform() {
    let golden = golden();
    let x = numbers(&golden["signal"]);
    for case in golden["frequency_domain"].as_array().unwrap() {
        let ends = if case["mirrored"].as_bool().unwrap() { Ends::Mirrored } else { Ends::Periodic };
        let differentiator = FrequencyDomain::new(number(&case["cutoff_hz"]), ends).unwrap();
        let ours = derivatives(&differentiator, number(&case["rate_hz"]), &x);
        for (ours, key) in ours.iter().zip(["q", "dq", "ddq"]) {
            // Rounding of the transform, times the ratio of the cut-off to the signal's frequency.
            agree(ours, &numbers(&case[key]), 1e-12, &format!("{ends:?} {key}"));
        }
    }
}

#[test]
fn averages_and_five_points_are_numpys_and_scipys() {
    let golden = golden();
    let x = numbers(&golden["signal"]);
    for case in golden["smoothed_differences"].as_array().unwrap() {
        let window = case["window"].as_u64().unwrap() as usize;
        let rate = number(&case["rate_hz"]);
        let [_, dq, ddq] = derivatives(&SmoothedDifferences::new(2, window).unwrap(), rate, &x);
        // Second differences of a signal of order one: 1e-16 · rate² against accelerations of 10.
        agree(&dq, &numbers(&case["dq"]), 1e-12, "dq");
        agree(&ddq, &numbers(&case["ddq"]), 1e-11, &format!("window {window}"));
    }
    for case in golden["five_point_cubic"].as_array().unwrap() {
        let differentiator = FivePointCubic::new(case["passes"].as_u64().unwrap() as usize, 5.0).unwrap();
        let mut smooth = vec![0.0; x.len()];
        differentiator.smooth(200.0, &x, &mut smooth).unwrap();
        agree(&smooth, &numbers(&case["smooth"]), 1e-13, "five points");
    }
}
