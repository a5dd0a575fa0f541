//! Slow changes during a log: drift of a torque offset, friction that changes with time.

use crate::kind::EventKind;
use crate::normal::Normal;
use crate::rows::{LogRows, rms};
use crate::scan::Scan;

/// A slow change of one joint's torque.
#[derive(Clone, Debug)]
pub(crate) struct Trend {
    pub(crate) joint: usize,
    pub(crate) kind: EventKind,
    /// Root mean square of the torque of the change, Nm or N.
    pub(crate) size_nm: f64,
    /// Root mean square of the residual if the model includes the change, Nm or N.
    pub(crate) left_nm: f64,
    /// First bin after a sudden change of the offset; `None` if a slow change explains the residual about as well.
    pub(crate) step: Option<usize>,
}

/// Number of times that are first tried for a sudden change; times near the best follow.
const STEP_TIMES: usize = 40;

/// Further columns of a bin.
type Further<'a> = dyn Fn(usize, &mut Vec<f64>) + 'a;

fn none(_: usize, _: &mut Vec<f64>) {}

/// 1 from bin `first` on, else 0.
fn after(first: usize, bin: usize) -> f64 {
    f64::from(u8::from(bin >= first))
}

/// Sum of the weighted squared errors with which the other parts of the log predict each part. Of a log with few
/// strokes, further columns explain much of the residual by chance, but predict nothing.
fn prediction_error(rows: &LogRows, joint: usize, kept: &[bool], further: &Further<'_>) -> Option<f64> {
    let count = rows.settings.trend.parts;
    let part = |number: usize| number * rows.len() / count..(number + 1) * rows.len() / count;
    let of = |number: usize| Normal::of_range(rows, joint, part(number), |bin| kept[bin], further);
    let parts: Vec<Normal> = (0..count).map(of).collect();
    let of_part = |number: usize| {
        let mut others = Normal::zero(parts[number].width());
        parts.iter().enumerate().filter(|(other, _)| *other != number).for_each(|(_, other)| others.add(other));
        others.solution().map(|theta| parts[number].squares(&theta))
    };
    (0..count).map(of_part).sum()
}

/// Mean square residual and first bin of the best sudden change of one joint's offset.
fn best_step(rows: &LogRows, joint: usize, kept: &[bool]) -> Option<(f64, usize)> {
    let bins = rows.len();
    let at = |first: usize| {
        let step = |bin: usize, values: &mut Vec<f64>| values.push(after(first, bin));
        let normal = Normal::of_range(rows, joint, 0..bins, |bin| kept[bin], step);
        normal.solution().map(|theta| (normal.squares(&theta) / normal.weight, first))
    };
    let least = |found: Option<(f64, usize)>, next: (f64, usize)| match found {
        Some(found) if found.0 <= next.0 => Some(found),
        _ => Some(next),
    };
    let spacing = bins.div_ceil(STEP_TIMES).max(1);
    let coarse = (spacing..bins).step_by(spacing).filter_map(at).fold(None, least)?;
    let near = coarse.1.saturating_sub(spacing).max(1)..(coarse.1 + spacing).min(bins);
    near.filter_map(at).fold(Some(coarse), least)
}

/// Slow changes that explain at least [`min_share`](crate::TrendSettings::min_share) of a joint's squared residual.
pub(crate) fn trends(rows: &LogRows, scan: &Scan) -> Vec<Trend> {
    let (own, bins) = (rows.settings.trend, rows.len());
    let place = |bin: usize| 2.0 * bin as f64 / (bins - 1).max(1) as f64 - 1.0;
    let polynomials = |bin: usize| {
        let x = place(bin);
        [x, 1.5 * x * x - 0.5, 2.5 * x.powi(3) - 1.5 * x]
    };
    let mut found = Vec::new();
    let weighted = rows.weighted(&scan.variance);
    for joint in 0..rows.joints() {
        let step = rows.step[joint];
        let scale = rms(&rows.dq[joint]).max(f64::MIN_POSITIVE);
        let drift = |bin: usize, values: &mut Vec<f64>| values.extend(polynomials(bin));
        let warm_up = |bin: usize, values: &mut Vec<f64>| {
            let dq = rows.dq[joint][bin];
            for p in polynomials(bin) {
                values.extend([p * (dq / step).tanh(), p * dq / scale]);
            }
        };
        let squares = |further: &Further<'_>| {
            let normal = Normal::of_range(rows, joint, 0..bins, |bin| scan.kept[bin], further);
            normal.solution().map(|theta| normal.squares(&theta) / normal.weight)
        };
        let (Some(plain), Some(drifting), Some(warming)) = (squares(&none), squares(&drift), squares(&warm_up)) else {
            continue;
        };
        let torque = rms(&rows.tau[joint]);
        let (kind, least) =
            if drifting <= warming { (EventKind::Drift, drifting) } else { (EventKind::WarmUp, warming) };
        let size_nm = (plain - least).max(0.0).sqrt();
        if plain <= 0.0 || plain - least < own.min_share * plain || size_nm < own.min_effect * torque {
            continue;
        }
        let step = if kind == EventKind::Drift { best_step(rows, joint, &scan.kept) } else { None };
        let step = step.filter(|(squares, _)| *squares < own.max_step_ratio * least);
        let (least, step) = step.map_or((least, None), |(squares, bin)| (squares, Some(bin)));
        let of_step = |bin: usize, values: &mut Vec<f64>| values.push(after(step.unwrap_or(bins), bin));
        let of_kind: &Further<'_> = match (step, kind) {
            (Some(_), _) => &of_step,
            (None, EventKind::WarmUp) => &warm_up,
            _ => &drift,
        };
        let [plain_error, error] =
            [&none as &Further<'_>, of_kind].map(|of| prediction_error(&weighted, joint, &scan.kept, of));
        if plain_error.zip(error).is_none_or(|(plain, error)| error > (1.0 - own.min_share) * plain) {
            continue;
        }
        let size_nm = (plain - least).max(0.0).sqrt();
        let kind = if step.is_some() { EventKind::OffsetChange } else { kind };
        found.push(Trend { joint, kind, size_nm, left_nm: least.max(0.0).sqrt(), step });
    }
    found
}
