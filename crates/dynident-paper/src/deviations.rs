//! Where the reproduction departs from the paper's text, each with its reason.

use crate::piece::Deviation;

/// Place, trouble, and what is done here, in the order of the paper.
const DEVIATIONS: &[[&str; 3]] = &[
    [
        "section 1",
        "the parameter vector of a link names I_zx twice and leaves I_zz out",
        "[m, m r_x, m r_y, m r_z, I_xx, I_xy, I_xz, I_yy, I_yz, I_zz], inertia about the link frame's origin",
    ],
    ["Table 1", "a of row 2 is printed as m in the copy of the paper that we have", "a1 = 1 m, as section 3 takes it"],
    [
        "Table 2, [15]",
        "base parameters by a recursion on modified D-H parameters",
        "by the rank of the regressor over random states, as for every robot; the six expressions are the same",
    ],
    [
        "section 1",
        "friction is taken as known and subtracted",
        "the simulated arm of Figs. 9 to 17 has none; studies of your own identify it",
    ],
    [
        "Eq. 5",
        "beta_i = arctan(r_ix / r_iy) has the quotient upside down",
        "atan2(r_iy, r_ix), as the general algorithm has it",
    ],
    [
        "Eq. 11",
        "the splice reaches rest only up to A / (1 + exp(wT/4)) in position, and T is not stated",
        "T = 40 / w: speed and acceleration at the ends stay below 1e-4 for every stroke inside the limits (18)",
    ],
    [
        "Figs. 4, 5",
        "the paper does not say for which ω and T the curves are drawn",
        "ω = 0.6, 0.8, 1, 1.5 at T = 80; T = 70, 80, 90, 100 at ω = 0.6",
    ],
    [
        "Eqs. 9, 10",
        "torque is taken as measured at the sample's instant; a digital controller holds it until the next sample",
        "the mean of the values before and after a sample, in every identification here; the value after it alone would be half a sample late, about 1 % at 100 Hz",
    ],
    [
        "Eqs. 15, 16",
        "the branch changes at half a period although a lagging arm is still on the other one, and a position outside (h, h + A) is mapped to a speed of the wrong sign",
        "in the columns 'as in the paper' the map is used literally; our own columns differentiate the deviation from the commanded stroke instead",
    ],
    [
        "Table 3",
        "A1 = 2.313, w1 = 1.523 break the paper's own limits (18): speed 68 % and acceleration 146 % above",
        "shown as it is, with what it breaks; our own columns use the optimum inside (18), A = 1.991, w = 1.046",
    ],
    ["Table 3", "delta = 367 and 246 have no unit", "read as samples at 100 Hz: 3.67 s and 2.46 s"],
    [
        "section 2.2",
        "the genetic algorithm's ranges are not stated, and it does not reach the optimum",
        "A in 0.1 to pi rad, w in 0.1 to 3 1/s, delta in 0.1 to 10 s; its distance from the optimum is given",
    ],
    [
        "Fig. 8, Eq. 20",
        "the error that ends the procedure needs the true parameters",
        "three and six runs are made whatever the error; on a robot the iteration ends when tracking and parameters have settled",
    ],
    [
        "Eq. 21",
        "Sig has an infinite slope at zero: sampled, the law chatters around it",
        "blended into a line below 1e-3 rad and 1e-2 rad/s; this moves the results by about 1 %",
    ],
    [
        "Eq. 23",
        "with e = q_d - q the signs before K_p and K_d are those of positive feedback",
        "plus signs; the literal law can be asked for by name and diverges",
    ],
    [
        "after Eq. 23",
        "alpha_2 = 2 alpha_1 / alpha_1 + 1 lacks its brackets",
        "2 alpha_1 / (1 + alpha_1) = 0.8235; the paper rounds to 0.82",
    ],
    [
        "Tables 4, 5",
        "with initial parameters of zero the law (23) gives no torque at all: the arm falls, and the 0.6 rad of Fig. 12 cannot come from it",
        "the first run uses a model-free joint PD (joint 2: 16 and 8, joint 1: 100 and 60), chosen so that the first error of Fig. 12 comes out: that it agrees is no finding",
    ],
    [
        "section 3",
        "sample rate and integrator of the simulation are not given",
        "100 Hz with ten Runge-Kutta steps a sample in the columns 'as in the paper', 1 kHz in our variant, 100 Hz with one step a sample under equal conditions",
    ],
    ["section 3", "'joint at rest' needs something that holds it", "the resting joint is locked"],
    [
        "Table 6, Fig. 15",
        "the Fourier coefficients, the duration and the way to velocity and acceleration are not given; an error of 0.02 without noise can only come from fitting or an unsettled run",
        "five harmonics designed inside (18), one period of 40 s from rest to rest; velocity and acceleration by a Fourier fit, and by the differentiators that the logistic strokes get too",
    ],
    [
        "Table 6, Figs. 16, 17",
        "whether both methods had the same time, limits, controller, differentiator and number of runs is not said, and there is no noise",
        "all of them alike, without and with noise over several seeds: the chapter on equal conditions",
    ],
    [
        "Figs. 16, 17",
        "which controller follows Eq. 25 is not said, nor how velocity and acceleration come from its positions",
        "a simulated run under the law (23) with the true model, sampled at 1 kHz without noise, central differences of order 8, driving torque as the mean of the held values",
    ],
    ["Eq. 25", "the verification motion sin t breaks (18) itself", "kept as the paper's verification, and said"],
];

/// All of them, in the order of the paper.
pub(crate) fn deviations() -> Vec<Deviation> {
    let one = |&[place, trouble, here]: &[&str; 3]| Deviation {
        place: place.to_owned(),
        trouble: trouble.to_owned(),
        here: here.to_owned(),
    };
    DEVIATIONS.iter().map(one).collect()
}
