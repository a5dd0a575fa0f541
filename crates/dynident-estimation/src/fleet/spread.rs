//! Differences between robots: parameters that vary over the fleet, and robots that differ from the others.
//!
//! ```text
//!     y_i = μ + u_i + e_i,   u_i ~ N(0, τ²) between robots,   e_i ~ N(0, v_i) of the estimate
//!     Q = Σ w_i (y_i − ȳ)²,  w_i = 1/v_i;   τ² = max(0, (Q − (k − 1)) / (Σw − Σw²/Σw))
//! ```
//!
//! Q has k − 1 degrees of freedom if the robots do not differ. Each robot is compared with the others only: `t_i =
//! (y_i − μ₋ᵢ) / √(v_i + τ₋ᵢ² + Var μ₋ᵢ)`, Student's with k − 2 degrees of freedom. The most deviating robot is
//! excluded and the test repeated, so that a faulty robot is not hidden by the variance that it causes. DerSimonian
//! and Laird, Controlled Clinical Trials 7 (1986) 177; Viechtbauer and Cheung, Research Synthesis Methods 1 (2010)
//! 112, for the deleted residuals.

use super::member::{Member, checked};
use crate::error::EstimationError;
use crate::uncertainty::{chi_squared_tail, f_tail};
use serde::Serialize;

const MIN_ROBOTS: usize = 3;

/// One parameter over the fleet, without the excluded robots.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ParameterSpread {
    /// Mean μ of the fleet.
    pub mean: f64,
    /// Standard deviation of `mean`.
    pub mean_std: f64,
    /// Standard deviation τ between robots, in addition to the error bars.
    pub between_std: f64,
    /// p-value: probability of at least this spread if all robots are equal.
    pub tail: f64,
    /// Whether robots differ: `tail` is below the false-alarm rate, corrected for the number of parameters.
    pub differs: bool,
    /// Number of robots with an estimate of the parameter.
    pub robots: usize,
}

/// Comparison of one robot with the others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MemberDeviation {
    /// Name of the member.
    pub name: String,
    /// Deviation t of every parameter in standard deviations; `None` if it was not estimated for this robot or for
    /// too few others.
    pub deviation: Vec<Option<f64>>,
    /// Index of the most deviating parameter; `None` without a comparison.
    pub worst: Option<usize>,
    /// p-value: probability that any parameter of an equal robot deviates at least as much.
    pub tail: f64,
    /// Whether the robot differs from the others: `tail` is below the false-alarm rate, corrected for the number of
    /// robots.
    pub is_unlike: bool,
}

/// Result for a fleet.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// One entry per parameter; `None` if too few robots have it.
    pub parameters: Vec<Option<ParameterSpread>>,
    /// One entry per robot, in the order given.
    pub members: Vec<MemberDeviation>,
}

/// Compares the estimates of several robots. `false_alarm` is the probability that any robot of a fleet of equal
/// robots, or any of its parameters, is reported as different (Bonferroni's inequality over robots and parameters).
///
/// ```
/// use dynident_estimation::fleet::{Member, spread};
/// let of = |name: &str, friction: f64| Member { name: name.into(), values: vec![friction], std: vec![0.1] };
/// let fleet = [("a", 5.02), ("b", 4.93), ("c", 5.08), ("d", 4.99), ("e", 9.0), ("f", 5.05), ("g", 4.95)];
/// let found = spread(&fleet.map(|(name, friction)| of(name, friction)), 0.01)?;
/// let unlike: Vec<&str> = found.members.iter().filter(|one| one.is_unlike).map(|one| &one.name[..]).collect();
/// assert_eq!(unlike, ["e"]);
/// assert!(!found.parameters[0].unwrap().differs); // the others are alike
/// # Ok::<(), dynident_estimation::EstimationError>(())
/// ```
///
/// # Errors
/// [`EstimationError::Mismatch`] for fewer than three estimates or different parameters, [`EstimationError::Setting`]
/// for values that are not finite or an invalid false-alarm rate.
pub fn spread(members: &[Member], false_alarm: f64) -> Result<Spread, EstimationError> {
    let parameters = checked(members, MIN_ROBOTS, false_alarm)?;
    let mut is_excluded = vec![false; members.len()];
    let deviations = loop {
        let found: Vec<MemberDeviation> =
            (0..members.len()).map(|index| deviation(members, &is_excluded, index, false_alarm)).collect();
        let candidates = (0..members.len()).filter(|&index| !is_excluded[index] && found[index].is_unlike);
        let worst = candidates.min_by(|&a, &b| found[a].tail.total_cmp(&found[b].tail));
        // At most half of the fleet can be excluded.
        let excluded = is_excluded.iter().filter(|excluded| **excluded).count();
        match worst {
            Some(index) if 2 * (excluded + 1) < members.len() => is_excluded[index] = true,
            _ => break found,
        }
    };
    let of_parameter = |parameter: usize| {
        let known = known(members, parameter, |index| !is_excluded[index]);
        let fleet = Fleet::new(&known)?;
        let tail = chi_squared_tail(fleet.q, (known.len() - 1) as f64);
        Some(ParameterSpread {
            mean: fleet.mean,
            mean_std: fleet.mean_variance.sqrt(),
            between_std: fleet.between.sqrt(),
            tail,
            differs: tail < false_alarm / parameters as f64,
            robots: known.len(),
        })
    };
    Ok(Spread { parameters: (0..parameters).map(of_parameter).collect(), members: deviations })
}

/// Value and variance of a parameter of the `included` members.
fn known(members: &[Member], parameter: usize, included: impl Fn(usize) -> bool) -> Vec<(f64, f64)> {
    (0..members.len()).filter(|&index| included(index)).filter_map(|index| members[index].known(parameter)).collect()
}

/// Compares member `index` with the members that are not excluded.
fn deviation(members: &[Member], is_excluded: &[bool], index: usize, false_alarm: f64) -> MemberDeviation {
    let own = &members[index];
    let mut found = MemberDeviation {
        name: own.name.clone(),
        deviation: vec![None; own.values.len()],
        worst: None,
        tail: 1.0,
        is_unlike: false,
    };
    let mut compared = 0;
    for parameter in 0..own.values.len() {
        let others = known(members, parameter, |other| other != index && !is_excluded[other]);
        let (Some((value, variance)), Some(fleet)) = (own.known(parameter), Fleet::new(&others)) else { continue };
        let t = (value - fleet.mean) / (variance + fleet.between + fleet.mean_variance).sqrt();
        let tail = f_tail(t * t, 1.0, (others.len() - 1) as f64);
        found.deviation[parameter] = Some(t);
        compared += 1;
        if found.worst.is_none() || tail < found.tail {
            (found.worst, found.tail) = (Some(parameter), tail);
        }
    }
    found.tail = (found.tail * f64::from(compared.max(1))).min(1.0);
    found.is_unlike = found.tail < false_alarm / members.len() as f64;
    found
}

/// Mean of a parameter and its variance between robots.
struct Fleet {
    mean: f64,
    mean_variance: f64,
    between: f64,
    q: f64,
}

impl Fleet {
    /// `None` for fewer than two robots.
    fn new(known: &[(f64, f64)]) -> Option<Self> {
        if known.len() < 2 {
            return None;
        }
        // Scaled by the smallest variance, to be independent of units.
        let unit = known.iter().map(|(_, variance)| *variance).fold(f64::INFINITY, f64::min);
        let mean = |between: f64| {
            let weights = || known.iter().map(move |(_, variance)| unit / (variance + between));
            let sum: f64 = weights().sum();
            (weights().zip(known).map(|(weight, (value, _))| weight * value).sum::<f64>() / sum, unit / sum)
        };
        let (fixed, _) = mean(0.0);
        let q: f64 = known.iter().map(|(value, variance)| (value - fixed).powi(2) / variance).sum();
        let weights = || known.iter().map(|(_, variance)| unit / variance);
        let (sum, squares) = (weights().sum::<f64>(), weights().map(|weight| weight * weight).sum::<f64>());
        let between = (q - (known.len() - 1) as f64).max(0.0) * unit / (sum - squares / sum);
        let (mean, mean_variance) = mean(between);
        Some(Self { mean, mean_variance, between, q })
    }
}
