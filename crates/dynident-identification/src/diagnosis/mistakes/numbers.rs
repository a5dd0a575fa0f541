//! Search for the best number of a mistake.

/// Number of grid points before refinement. There are several because the residual has local minima between gear
/// ratios.
const GRID_POINTS: usize = 17;
/// Maximum ratio between the ends of a range of factors that is reported as a single factor.
pub(super) const MAX_RATIO_OF_ONE_FACTOR: f64 = 1.1;
/// Minimum logarithm of the ratio between a free factor and a unit; a free factor that is nearer does not replace the
/// unit.
pub(super) const MIN_LOG_RATIO_TO_UNIT: f64 = 0.1;

/// Free number of a mistake, with its search range.
#[derive(Clone, Copy, Debug)]
pub(in crate::diagnosis) struct Number {
    pub(in crate::diagnosis) at: f64,
    /// Half-width of the search range; for a factor, half-width of its logarithm.
    pub(in crate::diagnosis) reach: f64,
    pub(super) is_factor: bool,
    /// Whether the number is a common one, such as a unit. Another number must then be clearly better to replace it.
    pub(in crate::diagnosis) is_round: bool,
}

impl Number {
    /// A free number that is an angle, rad.
    pub(super) fn angle(at: f64, reach: f64) -> Self {
        Self { at, reach, is_factor: false, is_round: false }
    }

    pub(super) fn factor(at: f64, reach: f64) -> Self {
        Self { at, reach, is_factor: true, is_round: false }
    }

    /// The number with the smallest `value` within the search range.
    pub(super) fn minimum(self, value: impl Fn(f64) -> f64) -> f64 {
        self.local_minima(value).next().unwrap_or(self.at)
    }

    /// Numbers at the local minima of `value`, the smallest value first.
    pub(in crate::diagnosis) fn local_minima(self, value: impl Fn(f64) -> f64) -> impl Iterator<Item = f64> {
        let Self { at, reach, is_factor, .. } = self;
        let number = move |place: f64| if is_factor { at * place.exp() } else { place };
        local_minima(if is_factor { 0.0 } else { at }, reach, move |place| value(number(place))).map(number)
    }
}

/// Positions of the local minima of `value` within `reach` of `centre`, the smallest value first: minima on a grid,
/// refined by ternary search to an accuracy of 2 % of the reach.
fn local_minima(centre: f64, reach: f64, value: impl Fn(f64) -> f64) -> impl Iterator<Item = f64> {
    let spacing = 2.0 * reach / (GRID_POINTS - 1) as f64;
    let place = move |k: usize| centre - reach + spacing * k as f64;
    let values: Vec<f64> = (0..GRID_POINTS).map(|k| value(place(k))).collect();
    let around = |k: usize| [k.saturating_sub(1), (k + 1).min(GRID_POINTS - 1)];
    let is_minimum = |k: &usize| around(*k).iter().all(|&other| values[*k] <= values[other]);
    let mut minima: Vec<usize> = (0..GRID_POINTS).filter(is_minimum).collect();
    minima.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    minima.into_iter().map(move |k| ternary_search(around(k).map(place), 0.02 * reach, &value))
}

/// Position of the minimum of a unimodal function `value` between two ends, by ternary search to an accuracy of
/// `width`.
pub(in crate::diagnosis) fn ternary_search(ends: [f64; 2], width: f64, value: impl Fn(f64) -> f64) -> f64 {
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
