//! Sums of logistic strokes and their derivatives, several samples at a time.

use super::logistic_stroke::{LogisticStroke, MAX_WARP, StrokeDerivatives, logistic_and_bell, unit_stroke, warp};
use super::sampled_basis::{load_some, store_some};
use crate::motion::{Motion, MotionAdjoint};
use dynident_lanes::{Kernel, Lane};

enum Chunk<T> {
    Before,
    After,
    Within(T),
}

#[inline(always)]
fn chunk_of<T: Lane>(stroke: &LogisticStroke, times: &[f64]) -> Chunk<T> {
    let mut warped = [MAX_WARP; 8];
    let (mut least, mut most) = (MAX_WARP, -MAX_WARP);
    for (u, &time) in warped.iter_mut().zip(times) {
        *u = stroke.warped(time);
        (least, most) = (least.min(*u), most.max(*u));
    }
    if least >= MAX_WARP {
        Chunk::After
    } else if most <= -MAX_WARP {
        Chunk::Before
    } else {
        Chunk::Within(T::load(&warped))
    }
}

#[inline(always)]
fn lanes_stroke<T: Lane>(u: T, sharpness: f64) -> StrokeDerivatives<T> {
    let (psi, kappa) = (warp(u), T::splat(sharpness));
    let (mut values, mut bells) = ([0.0; 8], [0.0; 8]);
    (kappa * psi[0]).store(&mut values);
    for lane in 0..T::LANES {
        (values[lane], bells[lane]) = logistic_and_bell(values[lane]);
    }
    unit_stroke(&psi, kappa, T::load(&values), T::load(&bells))
}

/// Computes the motion of one joint.
pub(super) struct Forward<'a> {
    pub(super) strokes: &'a [LogisticStroke],
    pub(super) start_at: f64,
    pub(super) times_s: &'a [f64],
    pub(super) joint: usize,
    pub(super) out: &'a mut Motion,
}

impl Kernel for Forward<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { strokes, start_at, times_s, joint, out } = self;
        let start = out.of(joint).start;
        for (index, times) in times_s.chunks(T::LANES).enumerate() {
            let at = start + index * T::LANES;
            let mut sums = [T::splat(start_at), T::ZERO, T::ZERO, T::ZERO];
            for stroke in strokes {
                match chunk_of::<T>(stroke, times) {
                    Chunk::Before => {}
                    Chunk::After => sums[0] += T::splat(stroke.amplitude),
                    Chunk::Within(u) => {
                        let unit = lanes_stroke(u, stroke.sharpness);
                        let (mut scale, inverse) = (stroke.amplitude, 1.0 / stroke.half_duration_s);
                        for order in 0..4 {
                            sums[order] = unit.value[order].mul_add(T::splat(scale), sums[order]);
                            scale *= inverse;
                        }
                    }
                }
            }
            store_some(sums[0], &mut out.q, at, times.len());
            store_some(sums[1], &mut out.dq, at, times.len());
            store_some(sums[2], &mut out.ddq, at, times.len());
            store_some(sums[3], &mut out.dddq, at, times.len());
        }
    }
}

/// Computes the derivatives of a cost with respect to the strokes of one joint.
pub(super) struct Backward<'a> {
    pub(super) strokes: &'a [LogisticStroke],
    pub(super) times_s: &'a [f64],
    pub(super) joint: usize,
    pub(super) adjoint: &'a MotionAdjoint,
}

impl Kernel for Backward<'_> {
    /// Derivatives with respect to (A, c, w, κ) of each stroke.
    type Output = Vec<[f64; 4]>;
    #[inline(always)]
    fn run<T: Lane>(self) -> Vec<[f64; 4]> {
        let Self { strokes, times_s, joint, adjoint } = self;
        let start = adjoint.of(joint).start;
        let mut sums = vec![[T::ZERO; 4]; strokes.len()];
        for (index, times) in times_s.chunks(T::LANES).enumerate() {
            let at = start + index * T::LANES;
            let pulls: [T; 4] = [
                load_some(&adjoint.q, at, times.len()),
                load_some(&adjoint.dq, at, times.len()),
                load_some(&adjoint.ddq, at, times.len()),
                load_some(&adjoint.dddq, at, times.len()),
            ];
            for (stroke, sum) in strokes.iter().zip(&mut sums) {
                match chunk_of::<T>(stroke, times) {
                    Chunk::Before => {}
                    Chunk::After => sum[0] += pulls[0],
                    Chunk::Within(u) => {
                        let unit = lanes_stroke(u, stroke.sharpness);
                        let inverse = T::splat(1.0 / stroke.half_duration_s);
                        let mut scale = T::ONE;
                        // A shift of the middle by dc changes u by -dc/w; a change of w scales u, so the derivative
                        // of order n is -(u S_{n+1} + n S_n)/w.
                        let mut local = [T::ZERO; 4];
                        for order in 0..4 {
                            let pull = pulls[order] * scale;
                            let stretched =
                                u.mul_add(unit.value[order + 1], T::splat(order as f64) * unit.value[order]);
                            local[0] = pull.mul_add(unit.value[order], local[0]);
                            local[1] = pull.neg_mul_add(unit.value[order + 1], local[1]);
                            local[2] = pull.neg_mul_add(stretched, local[2]);
                            local[3] = pull.mul_add(unit.by_sharpness[order], local[3]);
                            scale = scale * inverse;
                        }
                        let amplitude = T::splat(stroke.amplitude);
                        sum[0] += local[0];
                        sum[1] += local[1] * amplitude * inverse;
                        sum[2] += local[2] * amplitude * inverse;
                        sum[3] += local[3] * amplitude;
                    }
                }
            }
        }
        sums.iter().map(|sum| sum.map(Lane::sum)).collect()
    }
}
