//! Random physical problems: noisy, near-singular, with their optimum on the boundary, with and without limits.
use dynident_estimation::TriangularFactor;
use dynident_estimation::consistent::{
    BaseMap, Ellipsoid, PhysicalBody, PhysicalPrior, PhysicalProblem, PhysicalScalar, PhysicalSettings, rough_body,
};
use nalgebra::{DMatrix, DVector};

/// A small generator of its own: the same numbers on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (core::f64::consts::TAU * self.uniform()).cos()
    }

    pub(crate) fn below(&mut self, count: usize) -> usize {
        (self.uniform() * count as f64) as usize
    }
}

/// A body of point masses: possible by construction, on the cone's boundary with three points or fewer.
pub(crate) fn points(random: &mut Random, count: usize) -> [f64; 10] {
    let mut body = [0.0; 10];
    let size = 10_f64.powf(random.within(-1.5, 0.0));
    for _ in 0..count {
        let m = random.within(0.1, 3.0);
        let [x, y, z] = [0, 1, 2].map(|_| size * random.within(-1.0, 1.0));
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
}

/// Problem number `seed` with `bodies` bodies.
pub(crate) fn case(seed: u64, bodies: usize) -> Case {
    let mut random = Random(seed.wrapping_mul(0xD134_2543_DE82_EF95) + 1);
    let kind = seed % 4;
    let scalars = 2 * bodies;
    let columns = 10 * bodies + scalars;
    let mut truth = Vec::new();
    let mut described = Vec::new();
    for index in 0..bodies {
        let count = if kind == 2 { 1 + random.below(4) } else { 4 + random.below(5) };
        let body = points(&mut random, count);
        truth.extend(body);
        let near = rough_body(body[0] * random.within(0.5, 2.0), random.within(0.05, 0.5));
        // A prior that is not centred and not aligned: the rough body and a share of another.
        let other = points(&mut random, 5);
        let reference = core::array::from_fn(|k| near[k] + 0.2 * other[k]);
        let limited = kind == 3 && random.below(2) == 0;
        let mass = body[0];
        described.push(PhysicalBody {
            name: format!("link{}", index + 1),
            reference,
            known: (kind == 3 && index == 0).then_some(body),
            mass_kg: limited.then(|| [mass * random.within(0.3, 0.9), mass * random.within(1.1, 3.0)]),
            com_box_m: limited.then(|| {
                let com = [1, 2, 3].map(|k| body[k] / mass);
                [com.map(|c| c - 0.1), com.map(|c| c + 0.2)]
            }),
            inside: (limited && random.below(2) == 0)
                .then_some(Ellipsoid { centre_m: [0.0; 3], semi_axes_m: [1.8, 1.9, 2.0] }),
        });
    }
    let mut named = Vec::new();
    for index in 0..scalars {
        let value = if random.below(4) == 0 { 0.0 } else { random.within(0.0, 5.0) };
        truth.push(value);
        let upper = (random.below(5) == 0).then_some(6.0);
        named.push(PhysicalScalar {
            name: format!("friction{index}"),
            lower: Some(0.0),
            upper,
            prior: 0.0,
            scale: 1.0,
        });
    }
    // Base columns: some 60 % of the bodies' are independent, the others go into up to four of them; scalars stand alone.
    let mut independent: Vec<usize> = (0..columns).filter(|&c| c >= 10 * bodies || random.uniform() < 0.6).collect();
    independent.dedup();
    let dependent: Vec<usize> = (0..columns).filter(|c| !independent.contains(c)).collect();
    let inertial = independent.iter().filter(|&&c| c < 10 * bodies).count();
    let mut regrouping = DMatrix::zeros(independent.len(), dependent.len());
    for d in 0..dependent.len() {
        for _ in 0..random.below(5) {
            regrouping[(random.below(inertial.max(1)), d)] = random.normal();
        }
    }
    let base = BaseMap::from_regrouping(&independent, &dependent, &regrouping).unwrap();
    let rows = independent.len();
    let scales: Vec<f64> = (0..rows)
        .map(|_| {
            let hidden = kind == 1 && random.below(8) == 0;
            10_f64.powf(random.within(0.5, 3.5)) * if hidden { 1.0e-7 } else { 1.0 }
        })
        .collect();
    let triangle = DMatrix::from_fn(rows, rows, |i, j| {
        let value = if i == j { 1.0 } else { 0.3 * random.normal() };
        if i <= j { value * scales[j] } else { 0.0 }
    });
    let noise = [1.0, 30.0, 300.0][random.below(3)];
    let theta = base.matrix() * DVector::from_column_slice(&truth);
    let right = &triangle * theta + DVector::from_fn(rows, |_, _| noise * random.normal());
    let panel: Vec<f64> = triangle.iter().chain(right.iter()).copied().collect();
    let factor = TriangularFactor::from_rows(rows, &panel, rows).unwrap();
    let mut problem = PhysicalProblem::new(base, described, named, &factor).unwrap();
    if kind == 3 {
        let total: f64 = (0..bodies).map(|body| truth[10 * body]).sum();
        problem = problem.with_total_mass_kg([total * 0.98, total * 1.01]).unwrap();
    }
    let prior = [PhysicalPrior::Entropic, PhysicalPrior::Pullback, PhysicalPrior::Euclidean][random.below(3)];
    let settings =
        PhysicalSettings { prior, prior_weight: [1.0e-2, 1.0, 1.0e-3][random.below(3)], ..PhysicalSettings::default() };
    Case { problem, settings }
}
