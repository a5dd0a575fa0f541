//! The paper's design problem: section 2.2, limits (18), Table 3.

use core::f64::consts::PI;
use dynident_excitation::step_wise::{Stroke, StrokeConstants};

/// Constants of both joints; rate, T and ranges are assumptions, because the paper does not state them.
pub(crate) fn constants() -> StrokeConstants {
    StrokeConstants {
        gravity: super::arm::GRAVITY,
        rate_hz: 100.0,
        period_times_steepness: 40.0,
        position_limit_rad: PI,
        speed_limit: PI / 6.0,
        acceleration_limit: PI / 15.0,
        rest_limit: 1e-4,
        penalty: 1000.0,
        amplitude_range: [0.1, PI],
        steepness_range: [0.1, 3.0],
        window_range: [0.1, 10.0],
    }
}

/// The paper's Table 3, joint 1 first. δ (367 and 246) has no unit there and is interpreted as a number of samples at
/// `delta_rate_hz`.
pub(crate) fn table_3(delta_rate_hz: f64) -> [Stroke; 2] {
    let stroke = |amplitude_rad, steepness_per_s, samples: f64| Stroke {
        amplitude_rad,
        steepness_per_s,
        window_s: samples / delta_rate_hz,
    };
    [stroke(2.313, 1.523, 367.0), stroke(2.094, 0.996, 246.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::ops::ControlFlow;
    use dynident_excitation::optimisers::{
        BinaryGeneticSettings, CmaEsSettings, CmaEsStatus, Progress, binary_genetic, cma_es,
    };
    use dynident_excitation::step_wise::{StepWiseJoint, StepWiseProblem, StrokeLimit, StrokeQuantity};

    /// The optimum inside (18), from an independent program, and the tolerance that the project requires.
    const OPTIMUM: f64 = 161.3;
    const MAX_FITNESS: f64 = OPTIMUM * 1.001;

    fn problem() -> StepWiseProblem {
        StepWiseProblem { joints: [0, 1].map(|joint| StepWiseJoint { joint, constants: constants() }).to_vec() }
    }

    #[test]
    fn table_3_breaks_the_limits_by_two_thirds_and_by_one_and_a_half() {
        let table = table_3(100.0);
        assert!((table[0].window_s - 3.67).abs() < 1e-12);
        let limits = table.map(|stroke| constants().limits(&stroke));
        let find = |joint: usize, quantity| limits[joint].iter().find(|l| l.quantity == quantity).unwrap();
        // Digits of the reading notes: 0.881 compared with π/6 and 0.516 compared with π/15; joint 2 keeps both with
        // 0.521 and 0.200.
        let speed = find(0, StrokeQuantity::Speed);
        assert!((speed.value - 0.881).abs() < 5e-4 && (speed.excess() - 0.68).abs() < 5e-3, "{speed:?}");
        let acceleration = find(0, StrokeQuantity::Acceleration);
        assert!((acceleration.value - 0.516).abs() < 5e-4, "{acceleration:?}");
        assert!((acceleration.excess() - 1.465).abs() < 5e-3);
        assert!((find(1, StrokeQuantity::Speed).value - 0.521).abs() < 5e-4);
        assert!((find(1, StrokeQuantity::Acceleration).value - 0.200).abs() < 5e-4);
        assert!(limits[1].iter().all(StrokeLimit::kept));
        assert!(problem().fitness(&[2.313, 1.523, 3.67, 2.094, 0.996, 2.46]) > 1000.0);
    }

    #[test]
    fn cma_es_reaches_the_optimum_from_every_seed() {
        let problem = problem();
        let bounds = problem.bounds();
        for seed in 0..10 {
            let settings = CmaEsSettings { seed, restarts: 4, function_tolerance: 1e-6, ..Default::default() };
            let start: Vec<f64> = bounds.iter().map(|[low, high]| 0.5 * (low + high)).collect();
            let steps: Vec<f64> = bounds.iter().map(|[low, high]| 0.3 * (high - low)).collect();
            let mut enough = |p: &Progress<'_>| {
                if problem.fitness(p.best) <= MAX_FITNESS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let result = cma_es(|x| problem.graded_fitness(x), &start, &steps, &bounds, &settings, &mut enough);
            let result = result.unwrap();
            assert_eq!(result.status, CmaEsStatus::Stopped, "seed {seed}: {result:?}");
            assert!(problem.fitness(&result.best) <= MAX_FITNESS);
        }
    }

    #[test]
    fn the_papers_genetic_algorithm_reaches_the_known_range() {
        let problem = problem();
        let ends: Vec<f64> = (0..6)
            .map(|seed| {
                let settings = BinaryGeneticSettings { seed, ..Default::default() };
                let mut never = |_: &Progress<'_>| ControlFlow::Continue(());
                let result = binary_genetic(|x| problem.fitness(x), &problem.bounds(), &settings, &mut never).unwrap();
                assert_eq!((result.history.len(), result.evaluations), (500, 20_000));
                assert!(result.history.windows(2).all(|w| w[1].best_so_far <= w[0].best_so_far));
                let kept = |stroke: &Stroke| constants().limits(stroke).iter().all(StrokeLimit::kept);
                assert!(problem.strokes(&result.best).iter().all(kept), "seed {seed}");
                result.value
            })
            .collect();
        // An independent program reached 176 to 217 over six seeds; the interval is wider for other seeds, and no
        // result can be below the optimum.
        assert!(ends.iter().filter(|end| (165.0..=230.0).contains(*end)).count() >= 4, "{ends:?}");
        assert!(ends.iter().all(|end| *end > OPTIMUM - 0.15), "{ends:?}");
    }
}
