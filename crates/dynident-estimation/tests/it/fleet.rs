//! Fleets: a published example, the false-alarm rate, and a deviating robot.

use crate::common::Random;
use dynident_estimation::fleet::{Member, drift, spread};

/// Cases and others, vaccinated and not, of thirteen trials of the BCG vaccine (Colditz et al., JAMA 271 (1994) 698).
const TRIALS: [[f64; 4]; 13] = [
    [4., 119., 11., 128.],
    [6., 300., 29., 274.],
    [3., 228., 11., 209.],
    [62., 13536., 248., 12619.],
    [33., 5036., 47., 5761.],
    [180., 1361., 372., 1079.],
    [8., 2537., 10., 619.],
    [505., 87886., 499., 87892.],
    [29., 7470., 45., 7232.],
    [17., 1699., 65., 1600.],
    [186., 50448., 141., 27197.],
    [5., 2493., 3., 2338.],
    [27., 16886., 29., 17825.],
];

/// Published results of DerSimonian and Laird's method for these trials (log risk ratios): Q = 152.23, τ² = 0.3088,
/// mean -0.7141 ± 0.1787, to the printed digits.
#[test]
fn vaccine_trials_give_the_published_result() {
    let trial = |[cases, others, cases_without, others_without]: [f64; 4]| {
        let (all, without) = (cases + others, cases_without + others_without);
        let variance = cases.recip() - all.recip() + cases_without.recip() - without.recip();
        let ratio = ((cases / all) / (cases_without / without)).ln();
        Member { name: "trial".to_owned(), values: vec![ratio], std: vec![variance.sqrt()] }
    };
    // This false-alarm rate excludes no trial.
    let found = spread(&TRIALS.map(trial), 1e-12).unwrap();
    let own = found.parameters[0].unwrap();
    assert!(found.members.iter().all(|one| !one.is_unlike));
    assert!((own.between_std.powi(2) - 0.3088).abs() < 5e-5, "{}", own.between_std.powi(2));
    assert!((own.mean + 0.7141).abs() < 5e-5 && (own.mean_std - 0.1787).abs() < 5e-5, "{own:?}");
    // Tail of chi-squared with 12 degrees of freedom beyond 152.23.
    assert!((own.tail / 2.0e-26).ln().abs() < 1.0 && own.differs, "{}", own.tail);
}

/// A fleet whose robots differ by `between` standard deviations; error bars of one to three units.
fn fleet(random: &mut Random, robots: usize, between: f64) -> Vec<Member> {
    let one = |robot: usize, random: &mut Random| {
        let std: Vec<f64> = (0..10).map(|_| 1.0 + 2.0 * random.uniform()).collect();
        let values = std.iter().map(|std| 100.0 + between * random.normal() + std * random.normal()).collect();
        Member { name: format!("robot {robot}"), values, std }
    };
    (0..robots).map(|robot| one(robot, random)).collect()
}

/// Of 1,000 fleets of equal robots at a false-alarm rate of 5 %, at most 50 + 3 √50 = 71 report a robot; the same for
/// fleets with a natural spread.
#[test]
fn false_alarms_of_outliers_have_the_nominal_rate() {
    for between in [0.0, 2.0, 20.0] {
        let mut random = Random::new(11);
        let mut named = 0;
        for _ in 0..1000 {
            let found = spread(&fleet(&mut random, 8, between), 0.05).unwrap();
            named += usize::from(found.members.iter().any(|one| one.is_unlike));
        }
        assert!(named <= 71, "{named} of 1000 fleets that differ by {between}");
    }
}

/// Two of twenty robots deviate strongly in one parameter each: both are reported with the parameter, and the rest
/// does not differ.
#[test]
fn outliers_are_named_with_the_reason() {
    for seed in 0..20 {
        let mut members = fleet(&mut Random::new(seed), 20, 0.0);
        members[4].values[3] += 60.0;
        members[13].values[7] -= 60.0;
        let found = spread(&members, 0.01).unwrap();
        let named: Vec<(&str, Option<usize>)> =
            found.members.iter().filter(|one| one.is_unlike).map(|one| (&one.name[..], one.worst)).collect();
        assert_eq!(named, [("robot 4", Some(3)), ("robot 13", Some(7))], "seed {seed}");
        assert!(found.parameters.iter().all(|one| !one.unwrap().differs), "seed {seed}");
    }
}

/// Of 1,000 unchanged robots at most 71 are reported as drifting at 5 %, also if the weeks scatter by twice their
/// error bars; a drifting robot is reported.
#[test]
fn false_alarms_of_drift_have_the_nominal_rate() {
    for scatter in [1.0, 2.0] {
        let mut random = Random::new(5);
        let (mut named, mut seen) = (0, 0);
        let weeks: Vec<f64> = (0..12).map(f64::from).collect();
        for _ in 0..1000 {
            let mut of = |slope: f64, week: f64| {
                let value = |parameter: usize| {
                    let drift = if parameter == 2 { slope * week } else { 0.0 };
                    50.0 + drift + scatter * random.normal()
                };
                Member { name: format!("week {week}"), values: (0..6).map(value).collect(), std: vec![1.0; 6] }
            };
            let still: Vec<Member> = weeks.iter().map(|week| of(0.0, *week)).collect();
            let wandering: Vec<Member> = weeks.iter().map(|week| of(2.0, *week)).collect();
            named += usize::from(drifts(&still, &weeks).contains(&true));
            seen += usize::from(drifts(&wandering, &weeks)[2]);
        }
        assert!(named <= 71, "{named} of 1000 that scatter by {scatter}");
        assert!(seen > 990, "{seen} of 1000 that scatter by {scatter}");
    }
}

fn drifts(members: &[Member], weeks: &[f64]) -> Vec<bool> {
    drift(members, weeks, 0.05).unwrap().parameters.iter().map(|one| one.unwrap().drifts).collect()
}

#[test]
fn incomparable_members_are_reported() {
    let one = |value: f64, std: f64| Member { name: "one".to_owned(), values: vec![value], std: vec![std] };
    let said = |members: &[Member], rate: f64| spread(members, rate).unwrap_err().to_string();
    assert!(said(&[one(1.0, 1.0), one(1.0, 1.0)], 0.01).contains("at least: expected 3, found 2"));
    assert!(said(&[one(1.0, 1.0), one(f64::NAN, 1.0), one(1.0, 1.0)], 0.01).contains("remove this estimate"));
    assert!(said(&[one(1.0, 1.0), one(1.0, -1.0), one(1.0, 1.0)], 0.01).contains("standard deviation"));
    assert!(said(&[one(1.0, 1.0), one(1.0, 1.0), one(1.0, 1.0)], 0.0).contains("false_alarm"));
    // A parameter without estimates is not compared; estimates at one time have no slope.
    let held = [one(1.0, 0.0), one(1.0, 0.0), one(1.0, 0.0)];
    assert!(spread(&held, 0.01).unwrap().parameters[0].is_none());
    let same_day = [one(1.0, 1.0), one(1.0, 1.0), one(1.0, 1.0)];
    assert!(drift(&same_day, &[7.0; 3], 0.01).unwrap().parameters[0].is_none());
}
