//! Deviations of the reproduction from the paper's text, each with its reason.

use crate::piece::Deviation;

/// Place, problem, and solution here, in the order of the paper.
const DEVIATIONS: &[[&str; 3]] = &[
    [
        "section 1",
        "the parameter vector of a link contains I_zx twice and omits I_zz",
        "[m, m r_x, m r_y, m r_z, I_xx, I_xy, I_xz, I_yy, I_yz, I_zz], inertia about the link frame's origin",
    ],
    ["Table 1", "a of row 2 is printed as m in the available copy of the paper", "a1 = 1 m, as in section 3"],
    [
        "Table 2, [15]",
        "base parameters by a recursion on modified D-H parameters",
        "by the rank of the regressor over random states, as for all robots; the six expressions are the same",
    ],
    [
        "section 1",
        "friction is assumed to be known and subtracted",
        "the simulated arm of Figs. 9 to 17 has no friction; your own studies identify it",
    ],
    [
        "Eq. 5",
        "beta_i = arctan(r_ix / r_iy) has an inverted quotient",
        "atan2(r_iy, r_ix), as in the general algorithm",
    ],
    [
        "Eq. 11",
        "the splice reaches rest only up to A / (1 + exp(wT/4)) in position, and T is not stated",
        "T = 40 / w: speed and acceleration at the ends stay below 1e-4 for every stroke inside the limits (18)",
    ],
    [
        "Figs. 4, 5",
        "the paper does not state ω and T of the curves",
        "ω = 0.6, 0.8, 1, 1.5 at T = 80; T = 70, 80, 90, 100 at ω = 0.6",
    ],
    [
        "Eqs. 9, 10",
        "torque is assumed to be measured at the sample's instant; a digital controller holds it until the next sample",
        "the mean of the values before and after a sample, in every identification here; the value after it alone would be half a sample late, about 1 % at 100 Hz",
    ],
    [
        "Eqs. 15, 16",
        "the branch changes at half a period although a lagging arm is still on the other branch, and a position outside (h, h + A) is mapped to a speed of the wrong sign",
        "in the columns 'as in the paper' the map is used literally; our own columns differentiate the deviation from the commanded stroke instead",
    ],
    [
        "Table 3",
        "A1 = 2.313, w1 = 1.523 violate the paper's own limits (18): speed 68 % and acceleration 146 % above",
        "shown unchanged, with the violated limits; our own columns use the optimum inside (18), A = 1.991, w = 1.046",
    ],
    ["Table 3", "delta = 367 and 246 have no unit", "interpreted as samples at 100 Hz: 3.67 s and 2.46 s"],
    [
        "section 2.2",
        "the genetic algorithm's ranges are not stated, and it does not reach the optimum",
        "A in 0.1 to pi rad, w in 0.1 to 3 1/s, delta in 0.1 to 10 s; its difference from the optimum is listed",
    ],
    [
        "Fig. 8, Eq. 20",
        "the stopping criterion needs the true parameters",
        "three and six runs for any error; on a robot the iteration ends when tracking and parameters have converged",
    ],
    [
        "Eq. 21",
        "Sig has an infinite slope at zero: sampled, the law chatters around it",
        "blended into a line below 1e-3 rad and 1e-2 rad/s; this changes the results by about 1 %",
    ],
    [
        "Eq. 23",
        "the signs of K_p and K_d result in positive feedback for e = q_d - q",
        "plus signs; the literal law is available under its own name and diverges",
    ],
    [
        "after Eq. 23",
        "alpha_2 = 2 alpha_1 / alpha_1 + 1 has no brackets",
        "2 alpha_1 / (1 + alpha_1) = 0.8235; the paper rounds to 0.82",
    ],
    [
        "Tables 4, 5",
        "with initial parameters of zero the law (23) has no torque: the arm falls, and cannot have the 0.6 rad of Fig. 12",
        "the first run uses a model-free joint PD (joint 2: 16 and 8, joint 1: 100 and 60), chosen to reproduce the first error of Fig. 12, whose agreement is therefore not a result",
    ],
    [
        "section 3",
        "sample rate and integrator of the simulation are not stated",
        "100 Hz with ten Runge-Kutta steps per sample in the columns 'as in the paper', 1 kHz in our variant, 100 Hz with one step per sample under equal conditions",
    ],
    ["section 3", "'joint at rest' does not state how the joint is held", "the resting joint is locked"],
    [
        "Table 6, Fig. 15",
        "the Fourier coefficients, the duration and the computation of velocity and acceleration are not stated; an error of 0.02 without noise can only be caused by fitting or by a run that has not converged",
        "five harmonics designed inside (18), one period of 40 s from rest to rest; velocity and acceleration by a Fourier fit, and by the same differentiators as for the logistic strokes",
    ],
    [
        "Table 6, Figs. 16, 17",
        "the paper does not state whether both methods had the same time, limits, controller, differentiator and number of runs, and has no noise",
        "all of them equal, without noise and with noise over several seeds: the chapter on equal conditions",
    ],
    [
        "Figs. 16, 17",
        "the controller along Eq. 25 and the computation of velocity and acceleration are not stated",
        "a simulated run under the law (23) with the true model, sampled at 1 kHz without noise, central differences of order 8, driving torque as the mean of the held values",
    ],
    ["Eq. 25", "the verification motion sin t violates (18)", "kept as the paper's verification, with a note"],
];

pub(crate) fn deviations() -> Vec<Deviation> {
    let one = |&[place, trouble, here]: &[&str; 3]| Deviation {
        place: place.to_owned(),
        trouble: trouble.to_owned(),
        here: here.to_owned(),
    };
    DEVIATIONS.iter().map(one).collect()
}
