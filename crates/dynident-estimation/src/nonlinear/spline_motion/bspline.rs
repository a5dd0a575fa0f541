//! Quintic B-splines on uniform knots at sample instants, and their roughness penalty.

use super::banded_arrow::BandedArrow;

/// Number of nonzero functions at one instant.
pub(super) const ACTIVE: usize = 6;
/// Coefficients of u⁰ to u⁵ of the functions over one interval, in units of 1/120, with the functions in order (de
/// Boor, A Practical Guide to Splines, IX).
const PIECES: [[f64; ACTIVE]; ACTIVE] = [
    [1.0, -5.0, 10.0, -10.0, 5.0, -1.0],
    [26.0, -50.0, 20.0, 20.0, -20.0, 5.0],
    [66.0, 0.0, -60.0, 0.0, 30.0, -10.0],
    [26.0, 50.0, 20.0, -20.0, -20.0, 10.0],
    [1.0, 5.0, 10.0, 10.0, 5.0, -5.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
];
const SYMBOL_FREQUENCIES: usize = 4096;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spline {
    pub(super) samples: usize,
    /// Number of samples between two knots.
    pub(super) step: usize,
    rate_hz: f64,
    /// Values of the six functions, with first and second derivatives (1/s, 1/s²), at each sample of an interval.
    table: Vec<[[f64; ACTIVE]; 3]>,
}

impl Spline {
    pub(super) fn new(samples: usize, step: usize, rate_hz: f64) -> Self {
        let table = (0..step).map(|phase| {
            let u = phase as f64 / step as f64;
            core::array::from_fn(|order| {
                let scale = (rate_hz / step as f64).powi(order as i32);
                core::array::from_fn(|k| scale * derivative(&PIECES[k], order, u) / 120.0)
            })
        });
        Self { samples, step, rate_hz, table: table.collect() }
    }

    pub(super) fn functions(&self) -> usize {
        self.samples.saturating_sub(1) / self.step + ACTIVE
    }

    /// First nonzero function at a sample.
    pub(super) fn first(&self, sample: usize) -> usize {
        sample / self.step
    }

    /// The six functions at a sample, with derivatives.
    pub(super) fn at(&self, sample: usize) -> &[[f64; ACTIVE]; 3] {
        &self.table[sample % self.step]
    }

    /// Position, velocity and acceleration of joint `joint` at samples `from..from + count`; coefficients are ordered
    /// by function, with `joints` numbers each.
    pub(super) fn motion(&self, coefficients: &[f64], joint: usize, joints: usize, from: usize, out: [&mut [f64]; 3]) {
        let [q, dq, ddq] = out;
        let end = from + q.len();
        let mut sample = from;
        while sample < end {
            let interval = self.first(sample);
            let own: [f64; ACTIVE] = core::array::from_fn(|k| coefficients[(interval + k) * joints + joint]);
            let until = end.min((interval + 1) * self.step);
            for at in sample..until {
                let [values, rates, seconds] = &self.table[at - interval * self.step];
                let sum = |b: &[f64; ACTIVE]| b.iter().zip(&own).map(|(b, c)| b * c).sum::<f64>();
                (q[at - from], dq[at - from], ddq[at - from]) = (sum(values), sum(rates), sum(seconds));
            }
            sample = until;
        }
    }

    /// Measured positions minus the spline.
    pub(super) fn residual(&self, coefficients: &[f64], joint: usize, joints: usize, q: &[f64]) -> Vec<f64> {
        let mut left = Vec::with_capacity(q.len());
        for (interval, q) in q.chunks(self.step).enumerate() {
            let own: [f64; ACTIVE] = core::array::from_fn(|k| coefficients[(interval + k) * joints + joint]);
            let of =
                |(q, [b, ..]): (&f64, &[[f64; ACTIVE]; 3])| q - b.iter().zip(&own).map(|(b, c)| b * c).sum::<f64>();
            left.extend(q.iter().zip(&self.table).map(of));
        }
        left
    }

    pub(super) fn interval_samples(&self, interval: usize) -> usize {
        self.samples.saturating_sub(interval * self.step).min(self.step)
    }

    /// `∫ (dʳb/dtʳ)(dʳb/dtʳ)ᵀ dt` over one interval.
    pub(super) fn roughness(&self, order: usize) -> [[f64; ACTIVE]; ACTIVE] {
        let h = self.step as f64 / self.rate_hz;
        let scale = h.powi(1 - 2 * order as i32) / (120.0 * 120.0);
        let pieces: Vec<Vec<f64>> = PIECES.iter().map(|piece| coefficients(piece, order)).collect();
        core::array::from_fn(|a| {
            core::array::from_fn(|b| {
                let mut integral = 0.0;
                for (i, x) in pieces[a].iter().enumerate() {
                    for (j, y) in pieces[b].iter().enumerate() {
                        integral += x * y / (i + j + 1) as f64;
                    }
                }
                scale * integral
            })
        })
    }

    /// Penalty `cᵀ P c` and its gradient `P c` of one joint by function, for coefficients c and the roughness matrix
    /// P.
    pub(super) fn penalty(
        &self,
        gram: &[[f64; ACTIVE]; ACTIVE],
        coefficients: &[f64],
        joint: usize,
        joints: usize,
    ) -> (f64, Vec<f64>) {
        let mut product = vec![0.0; self.functions()];
        let mut sum = 0.0;
        for interval in 0..self.functions() + 1 - ACTIVE {
            // Constants have zero penalty; subtracting them avoids cancellation.
            let base = coefficients[interval * joints + joint];
            let own: [f64; ACTIVE] = core::array::from_fn(|k| coefficients[(interval + k) * joints + joint] - base);
            for (a, row) in gram.iter().enumerate() {
                let value: f64 = row.iter().zip(&own).map(|(p, c)| p * c).sum();
                product[interval + a] += value;
                sum += own[a] * value;
            }
        }
        (sum.max(0.0), product)
    }

    /// Adds `position · BᵀB` of one joint to the band, and `position · Bᵀ r` to its right-hand side.
    pub(super) fn add_positions(
        &self,
        matrix: &mut BandedArrow,
        joint: usize,
        joints: usize,
        position: f64,
        residual: &[f64],
    ) {
        let full = self.products(self.step);
        for interval in 0..self.functions() + 1 - ACTIVE {
            let count = self.interval_samples(interval);
            let own = if count == self.step { full } else { self.products(count) };
            for a in 0..ACTIVE {
                for b in 0..=a {
                    let value = position * own[a][b];
                    matrix.add((interval + a) * joints + joint, (interval + b) * joints + joint, value);
                }
            }
            let from = interval * self.step;
            for (k, r) in residual[from..from + count].iter().enumerate() {
                for (a, b) in self.table[k][0].iter().enumerate() {
                    matrix.add_right((interval + a) * joints + joint, position * b * r);
                }
            }
        }
    }

    /// Adds `penalty · P` of one joint to the band, and `−penalty · P c` to its right-hand side.
    pub(super) fn add_roughness(
        &self,
        matrix: &mut BandedArrow,
        joint: usize,
        joints: usize,
        penalty: f64,
        gram: &[[f64; ACTIVE]; ACTIVE],
        pulled: &[f64],
    ) {
        for interval in 0..self.functions() + 1 - ACTIVE {
            for (a, row) in gram.iter().enumerate() {
                for (b, value) in row.iter().enumerate().take(a + 1) {
                    matrix.add((interval + a) * joints + joint, (interval + b) * joints + joint, penalty * value);
                }
            }
        }
        for (function, value) in pulled.iter().enumerate() {
            matrix.add_right(function * joints + joint, -penalty * value);
        }
    }

    /// `Σ b bᵀ` over the first samples of an interval.
    pub(super) fn products(&self, count: usize) -> [[f64; ACTIVE]; ACTIVE] {
        let mut sum = [[0.0; ACTIVE]; ACTIVE];
        for [values, ..] in &self.table[..count] {
            for (row, x) in sum.iter_mut().zip(values) {
                row.iter_mut().zip(values).for_each(|(sum, y)| *sum += x * y);
            }
        }
        sum
    }

    /// Mean logarithm of the nonzero eigenvalues of the roughness matrix, from its symbol (Szegő's limit theorem). It
    /// normalises a prior of that order.
    pub(super) fn mean_log_roughness(&self, order: usize) -> f64 {
        let gram = self.roughness(order);
        // Interior rows are sums along the diagonals.
        let lag = |lag: usize| -> f64 { (0..ACTIVE - lag).map(|k| gram[k][k + lag]).sum() };
        let lags: [f64; ACTIVE] = core::array::from_fn(lag);
        // Near zero frequency the symbol is a power of the frequency, which rounding hides. The power is divided out;
        // its mean logarithm is zero.
        let mean = (0..SYMBOL_FREQUENCIES).map(|k| {
            let omega = core::f64::consts::PI * (k as f64 + 0.5) / SYMBOL_FREQUENCIES as f64;
            let symbol = lags[0] + 2.0 * (1..ACTIVE).map(|l| lags[l] * (l as f64 * omega).cos()).sum::<f64>();
            let zero = (2.0 - 2.0 * omega.cos()).powi(order as i32);
            if omega < 0.3 { None } else { Some((symbol / zero).ln()) }
        });
        let (sum, count) = mean.flatten().fold((0.0, 0), |(sum, count), x| (sum + x, count + 1));
        sum / f64::from(count.max(1))
    }

    /// Rows with `Gram = Σ e eᵀ` for the roughness of an interval; six minus `order` of them.
    pub(super) fn roughness_rows(&self, order: usize) -> Vec<[f64; ACTIVE]> {
        let mut left = self.roughness(order);
        let mut rows = Vec::new();
        // Pivoted Cholesky of a matrix of known rank.
        for _ in 0..ACTIVE - order {
            let pivot = (0..ACTIVE).max_by(|a, b| left[*a][*a].total_cmp(&left[*b][*b])).unwrap_or(0);
            let root = left[pivot][pivot].max(f64::MIN_POSITIVE).sqrt();
            let row: [f64; ACTIVE] = core::array::from_fn(|k| left[pivot][k] / root);
            for a in 0..ACTIVE {
                for b in 0..ACTIVE {
                    left[a][b] -= row[a] * row[b];
                }
            }
            rows.push(row);
        }
        rows
    }
}

fn coefficients(piece: &[f64; ACTIVE], order: usize) -> Vec<f64> {
    let mut own = piece.to_vec();
    for _ in 0..order {
        own = own.iter().enumerate().skip(1).map(|(power, x)| power as f64 * x).collect();
    }
    own
}

fn derivative(piece: &[f64; ACTIVE], order: usize, u: f64) -> f64 {
    coefficients(piece, order).iter().rev().fold(0.0, |sum, x| sum * u + x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The functions sum to one; a cubic is exact (its coefficients are the blossom at the knots); and the integral of
    /// its squared third derivative is exact.
    #[test]
    fn splines_reproduce_polynomials() {
        let spline = Spline::new(41, 4, 20.0);
        for sample in 0..41 {
            let [values, rates, second] = spline.at(sample);
            assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(rates.iter().sum::<f64>().abs() < 1e-13 && second.iter().sum::<f64>().abs() < 1e-12);
        }
        // t³ in knots: the blossom at (k−2, .., k+2) about the middle is k³ minus the mean of pair products.
        let h = 0.2;
        let cubic = |k: f64| -> f64 {
            let knots = [k - 2.0, k - 1.0, k, k + 1.0, k + 2.0];
            let mut sum = 0.0;
            for a in 0..5 {
                for b in 0..a {
                    for c in 0..b {
                        sum += knots[a] * knots[b] * knots[c];
                    }
                }
            }
            sum / 10.0 * h * h * h
        };
        let coefficients: Vec<f64> = (0..spline.functions()).map(|k| cubic(k as f64 - 2.0)).collect();
        let mut out = [vec![0.0; 41], vec![0.0; 41], vec![0.0; 41]];
        let [q, dq, ddq] = &mut out;
        spline.motion(&coefficients, 0, 1, 0, [q, dq, ddq]);
        for (k, ((q, dq), ddq)) in q.iter().zip(dq.iter()).zip(ddq.iter()).enumerate() {
            let t = k as f64 / 20.0;
            assert!((q - t.powi(3)).abs() < 1e-12 && (dq - 3.0 * t * t).abs() < 1e-11 && (ddq - 6.0 * t).abs() < 1e-10);
        }
        let length = h * (spline.functions() - 5) as f64;
        let (penalty, _) = spline.penalty(&spline.roughness(3), &coefficients, 0, 1);
        assert!((penalty - 36.0 * length).abs() < 1e-9 * penalty);
        let rows = spline.roughness_rows(3);
        let from_rows: f64 = (0..spline.functions() - 5)
            .flat_map(|i| rows.iter().map(move |row| (i, row)))
            .map(|(i, row)| row.iter().enumerate().map(|(k, e)| e * coefficients[i + k]).sum::<f64>().powi(2))
            .sum();
        assert!((from_rows - penalty).abs() < 1e-9 * penalty);
    }

    /// Compared with the eigenvalues of the matrix; boundary effects are of the order of one over its size.
    #[test]
    fn the_symbol_gives_the_determinant() {
        let spline = Spline::new(3001, 10, 500.0);
        for order in 2..=5 {
            let gram = spline.roughness(order);
            let n = spline.functions();
            let mut matrix = nalgebra::DMatrix::<f64>::zeros(n, n);
            for i in 0..n - 5 {
                for a in 0..6 {
                    for b in 0..6 {
                        matrix[(i + a, i + b)] += gram[a][b];
                    }
                }
            }
            let mut eigenvalues: Vec<f64> = matrix.symmetric_eigenvalues().iter().copied().collect();
            eigenvalues.sort_by(f64::total_cmp);
            // Small eigenvalues are below rounding of the largest for higher orders, so only order up to 2 is
            // compared.
            if order <= 2 {
                let own = eigenvalues[order..].iter().map(|x| x.ln()).sum::<f64>() / (n - order) as f64;
                assert!((own - spline.mean_log_roughness(order)).abs() < 0.2, "{order}: {own}");
            }
        }
    }
}
