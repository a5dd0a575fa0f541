//! Polynomials that are orthonormal over equally spaced samples.

/// For each degree from 0 on, the values of a polynomial and of its first two derivatives at `samples` equally spaced
/// points i. The polynomials are functions of `x = (i - h)/h` with h = (samples - 1)/2 (rounded down for even numbers;
/// at least 0.5). The polynomials are orthonormal over the points, by two Gram-Schmidt passes on `x · p_{k-1}`.
pub(crate) fn orthonormal_polynomials(samples: usize, degree: usize) -> Vec<[Vec<f64>; 3]> {
    let half = half(samples);
    let abscissa: Vec<f64> = (0..samples).map(|i| (i as f64 - half) / half).collect();
    let mut basis: Vec<[Vec<f64>; 3]> = Vec::with_capacity(degree + 1);
    for k in 0..=degree {
        let mut next = match basis.get(k.wrapping_sub(1)) {
            None => [vec![1.0; samples], vec![0.0; samples], vec![0.0; samples]],
            Some([p, dp, ddp]) => {
                let at = |i: usize| (abscissa[i], p[i], dp[i], ddp[i]);
                [
                    (0..samples).map(at).map(|(x, p, _, _)| x * p).collect(),
                    (0..samples).map(at).map(|(x, p, dp, _)| p + x * dp).collect(),
                    (0..samples).map(at).map(|(x, _, dp, ddp)| 2.0 * dp + x * ddp).collect(),
                ]
            }
        };
        for _ in 0..2 {
            for known in &basis {
                let share: f64 = known[0].iter().zip(&next[0]).map(|(a, b)| a * b).sum();
                for (next, known) in next.iter_mut().zip(known) {
                    next.iter_mut().zip(known).for_each(|(next, known)| *next -= share * known);
                }
            }
        }
        let norm = next[0].iter().map(|p| p * p).sum::<f64>().sqrt();
        next.iter_mut().flatten().for_each(|value| *value /= norm);
        basis.push(next);
    }
    basis
}

/// Distance from the centre to abscissa 1, in samples.
pub(crate) fn half(samples: usize) -> f64 {
    ((samples / 2) as f64).max(0.5)
}
