//! Minima of a value over the number of a mistake.

/// Places at which a number is tried before it is narrowed down: the residual has several valleys between one gear
/// ratio and the next.
const PLACES: usize = 17;

/// The free number of a mistake, and where others are tried.
#[derive(Clone, Copy, Debug)]
pub(in crate::diagnosis) struct Number {
    /// The number.
    pub(super) at: f64,
    /// How far from it others are tried; of a factor in its logarithm.
    pub(in crate::diagnosis) reach: f64,
    pub(super) is_factor: bool,
    /// Whether it is a number that people write, so that another one has to be clearly better.
    pub(in crate::diagnosis) is_round: bool,
}

impl Number {
    /// An angle, rad.
    pub(super) fn angle(at: f64, reach: f64) -> Self {
        Self { at, reach, is_factor: false, is_round: false }
    }

    /// A factor.
    pub(super) fn factor(at: f64, reach: f64) -> Self {
        Self { at, reach, is_factor: true, is_round: false }
    }

    /// The number at which `value` is least.
    pub(super) fn least(self, value: impl Fn(f64) -> f64) -> f64 {
        self.valleys(value).next().unwrap_or(self.at)
    }

    /// Numbers whose `value` is less than around them, the least first.
    pub(in crate::diagnosis) fn valleys(self, value: impl Fn(f64) -> f64) -> impl Iterator<Item = f64> {
        let Self { at, reach, is_factor, .. } = self;
        let number = move |place: f64| if is_factor { at * place.exp() } else { place };
        valleys_in(if is_factor { 0.0 } else { at }, reach, move |place| value(number(place))).map(number)
    }
}

/// Local minima of `value` within `reach` of `centre`, the least first: of [`PLACES`] places those with less than their
/// neighbours, then by thirds around each, to a hundredth of the reach.
fn valleys_in(centre: f64, reach: f64, value: impl Fn(f64) -> f64) -> impl Iterator<Item = f64> {
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
