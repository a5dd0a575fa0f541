//! Random physical problems: noisy, near-singular, with optimum on the boundary, with and without limits.
use dynident_estimation::TriangularFactor;
use dynident_estimation::consistent::{
    BaseMap, Ellipsoid, PhysicalBody, PhysicalPrior, PhysicalProblem, PhysicalScalar, PhysicalSettings, rough_body,
};
use dynident_model::sample::Random;
use nalgebra::{DMatrix, DVector};

fn below(random: &mut Random, count: usize) -> usize {
    (random.uniform(0.0, 1.0) * count as f64) as usize
}

/// A body of point masses: always consistent; on the cone's boundary for at most three points.
fn points(random: &mut Random, count: usize) -> [f64; 10] {
    let mut body = [0.0; 10];
    let size = 10_f64.powf(random.uniform(-1.5, 0.0));
    for _ in 0..count {
        let m = random.uniform(0.1, 3.0);
        let [x, y, z] = [0, 1, 2].map(|_| size * random.uniform(-1.0, 1.0));
        let part =
            [1.0, x, y, z, y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y].map(|value| m * value);
        for (sum, value) in body.iter_mut().zip(part) {
            *sum += value;
        }
    }
    body
}

pub(crate) struct Case {
    pub(crate) problem: PhysicalProblem,
    pub(crate) settings: PhysicalSettings,
    /// R of the data, column by column, and ρ, for other solvers.
    #[allow(dead_code, reason = "used by the benchmark")]
    pub(crate) rows: (DMatrix<f64>, DVector<f64>),
    #[allow(dead_code, reason = "used by the benchmark")]
    pub(crate) total_mass_kg: Option<[f64; 2]>,
}

/// Problem number `seed` with `bodies` bodies.
pub(crate) fn case(seed: u64, bodies: usize) -> Case {
    let mut random = Random::new(seed.wrapping_mul(0xD134_2543_DE82_EF95) + 1);
    let kind = seed % 4;
    let scalars = 2 * bodies;
    let columns = 10 * bodies + scalars;
    let mut truth = Vec::new();
    let mut described = Vec::new();
    for index in 0..bodies {
        let count = if kind == 2 { 1 + below(&mut random, 4) } else { 4 + below(&mut random, 5) };
        let body = points(&mut random, count);
        truth.extend(body);
        let near = rough_body(body[0] * random.uniform(0.5, 2.0), random.uniform(0.05, 0.5));
        // A prior that is neither centred nor aligned.
        let other = points(&mut random, 5);
        let reference = core::array::from_fn(|k| near[k] + 0.2 * other[k]);
        let limited = kind == 3 && below(&mut random, 2) == 0;
        let mass = body[0];
        described.push(PhysicalBody {
            name: format!("link{}", index + 1),
            reference,
            known: (kind == 3 && index == 0).then_some(body),
            mass_kg: limited.then(|| [mass * random.uniform(0.3, 0.9), mass * random.uniform(1.1, 3.0)]),
            com_box_m: limited.then(|| {
                let com = [1, 2, 3].map(|k| body[k] / mass);
                [com.map(|c| c - 0.1), com.map(|c| c + 0.2)]
            }),
            inside: (limited && below(&mut random, 2) == 0)
                .then_some(Ellipsoid { centre_m: [0.0; 3], semi_axes_m: [1.8, 1.9, 2.0] }),
        });
    }
    let mut named = Vec::new();
    for index in 0..scalars {
        let value = if below(&mut random, 4) == 0 { 0.0 } else { random.uniform(0.0, 5.0) };
        truth.push(value);
        let upper = (below(&mut random, 5) == 0).then_some(6.0);
        named.push(PhysicalScalar {
            name: format!("friction{index}"),
            lower: Some(0.0),
            upper,
            prior: 0.0,
            scale: 1.0,
        });
    }
    // Base columns: about 60 % of the bodies' columns are independent, the others depend on up to four of them;
    // scalars are independent.
    let mut independent: Vec<usize> =
        (0..columns).filter(|&c| c >= 10 * bodies || random.uniform(0.0, 1.0) < 0.6).collect();
    independent.dedup();
    let dependent: Vec<usize> = (0..columns).filter(|c| !independent.contains(c)).collect();
    let inertial = independent.iter().filter(|&&c| c < 10 * bodies).count();
    let mut regrouping = DMatrix::zeros(independent.len(), dependent.len());
    for d in 0..dependent.len() {
        for _ in 0..below(&mut random, 5) {
            regrouping[(below(&mut random, inertial.max(1)), d)] = random.normal();
        }
    }
    let base = BaseMap::from_regrouping(&independent, &dependent, &regrouping).unwrap();
    let rows = independent.len();
    let scales: Vec<f64> = (0..rows)
        .map(|_| {
            let hidden = kind == 1 && below(&mut random, 8) == 0;
            10_f64.powf(random.uniform(0.5, 3.5)) * if hidden { 1.0e-7 } else { 1.0 }
        })
        .collect();
    let triangle = DMatrix::from_fn(rows, rows, |i, j| {
        let value = if i == j { 1.0 } else { 0.3 * random.normal() };
        if i <= j { value * scales[j] } else { 0.0 }
    });
    let noise = [1.0, 30.0, 300.0][below(&mut random, 3)];
    let theta = base.matrix() * DVector::from_column_slice(&truth);
    let right = &triangle * theta + DVector::from_fn(rows, |_, _| noise * random.normal());
    let panel: Vec<f64> = triangle.iter().chain(right.iter()).copied().collect();
    let factor = TriangularFactor::from_rows(rows, &panel, rows).unwrap();
    let mut problem = PhysicalProblem::new(base, described, named, &factor).unwrap();
    let total: f64 = (0..bodies).map(|body| truth[10 * body]).sum();
    let total_mass_kg = (kind == 3).then_some([total * 0.98, total * 1.01]);
    if let Some(limits) = total_mass_kg {
        problem = problem.with_total_mass_kg(limits).unwrap();
    }
    let prior = [PhysicalPrior::Entropic, PhysicalPrior::Pullback, PhysicalPrior::Euclidean][below(&mut random, 3)];
    let settings = PhysicalSettings {
        prior,
        prior_weight: [1.0e-2, 1.0, 1.0e-3][below(&mut random, 3)],
        ..PhysicalSettings::default()
    };
    Case { problem, settings, rows: (triangle, right), total_mass_kg }
}
