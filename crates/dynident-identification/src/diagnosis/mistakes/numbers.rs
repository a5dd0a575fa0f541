//! Minima of a value over the number of a mistake.

/// Places at which a number is tried before it is narrowed down: the residual has several valleys between one gear
/// ratio and the next.
const PLACES: usize = 17;

/// The free number of a mistake, and how far from it others are tried.
#[derive(Clone, Copy, Debug)]
pub(in crate::diagnosis) enum Number {
    /// An angle, rad.
    Angle { at: f64, reach: f64, is_round: bool },
    /// A factor; the reach is that of its logarithm.
    Factor { at: f64, reach: f64, is_round: bool },
}

impl Number {
    /// Whether it is a number that people write, so that another one has to be clearly better.
    pub(in crate::diagnosis) fn is_round(self) -> bool {
        let (Self::Angle { is_round, .. } | Self::Factor { is_round, .. }) = self;
        is_round
    }
}

/// The number whose `value` is least.
pub(super) fn least_number(number: Number, value: impl Fn(f64) -> f64) -> f64 {
    match number {
        Number::Angle { at, reach, .. } => least_in(at, reach, value),
        Number::Factor { at, reach, .. } => at * least_in(0.0, reach, |log| value(at * log.exp())).exp(),
    }
}

/// Where `value` is least within `reach` of `centre`, to a hundredth of the reach.
pub(super) fn least_in(centre: f64, reach: f64, value: impl Fn(f64) -> f64) -> f64 {
    valleys_in(centre, reach, value).next().unwrap_or(centre)
}

/// Local minima of `value` within `reach` of `centre`, the least first: of [`PLACES`] places those with less than their
/// neighbours, then by thirds around each, to a hundredth of the reach.
pub(super) fn valleys_in(centre: f64, reach: f64, value: impl Fn(f64) -> f64) -> impl Iterator<Item = f64> {
    let spacing = 2.0 * reach / (PLACES - 1) as f64;
    let place = move |k: usize| centre - reach + spacing * k as f64;
    let values: Vec<f64> = (0..PLACES).map(|k| value(place(k))).collect();
    let around = |k: usize| [k.saturating_sub(1), (k + 1).min(PLACES - 1)];
    let is_valley = |k: &usize| around(*k).iter().all(|&other| values[*k] <= values[other]);
    let mut deepest: Vec<usize> = (0..PLACES).filter(is_valley).collect();
    deepest.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    deepest.into_iter().map(move |k| least_by_thirds(around(k).map(place), 0.02 * reach, &value))
}

/// The minimum of `value`, which has one valley between two places, to within `width`.
pub(in crate::diagnosis) fn least_by_thirds(ends: [f64; 2], width: f64, value: impl Fn(f64) -> f64) -> f64 {
    let [mut low, mut high] = ends;
    while high - low > width {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if value(a) < value(b) {
            high = b;
        } else {
            low = a;
        }
    }
    0.5 * (low + high)
}
