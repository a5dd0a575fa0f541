//! Where the reproduction departs from the paper's text, each with its reason.

use crate::piece::Deviation;

/// All of them, in the order of the paper.
pub(crate) const DEVIATIONS: &[Deviation] = &[
    Deviation {
        place: "section 1",
        trouble: "the parameter vector of a link names I_zx twice and leaves I_zz out",
        here: "[m, m r_x, m r_y, m r_z, I_xx, I_xy, I_xz, I_yy, I_yz, I_zz], inertia about the link frame's origin",
    },
    Deviation {
        place: "Eq. 5",
        trouble: "beta_i = arctan(r_ix / r_iy) has the quotient upside down",
        here: "atan2(r_iy, r_ix), as the general algorithm has it",
    },
    Deviation {
        place: "Eq. 11",
        trouble: "the splice reaches rest only up to A / (1 + exp(wT/4)) in position, and T is not stated",
        here: "T = 40 / w: speed and acceleration at the ends stay below 1e-4 for every stroke inside the limits (18)",
    },
    Deviation {
        place: "Eqs. 15, 16",
        trouble: "the branch changes at half a period although a lagging arm is still on the other one, and a position outside (h, h + A) is mapped to a speed of the wrong sign",
        here: "in the columns 'as in the paper' the map is used literally; our own columns differentiate the deviation from the commanded stroke instead",
    },
    Deviation {
        place: "Table 3",
        trouble: "A1 = 2.313, w1 = 1.523 break the paper's own limits (18): speed 68 % and acceleration 146 % above",
        here: "shown as it is, with what it breaks; our own columns use the optimum inside (18), A = 1.991, w = 1.046",
    },
    Deviation {
        place: "Table 3",
        trouble: "delta = 367 and 246 have no unit",
        here: "read as samples at 100 Hz: 3.67 s and 2.46 s",
    },
    Deviation {
        place: "section 2.2",
        trouble: "the genetic algorithm's ranges are not stated, and it does not reach the optimum",
        here: "A in 0.1 to pi rad, w in 0.1 to 3 1/s, delta in 0.1 to 10 s; its distance from the optimum is told",
    },
    Deviation {
        place: "Eq. 23",
        trouble: "with e = q_d - q the signs before K_p and K_d are those of positive feedback",
        here: "plus signs; the literal law can be asked for by name and diverges",
    },
    Deviation {
        place: "after Eq. 23",
        trouble: "alpha_2 = 2 alpha_1 / alpha_1 + 1 lacks its brackets",
        here: "2 alpha_1 / (1 + alpha_1) = 0.8235; the paper rounds to 0.82",
    },
    Deviation {
        place: "Tables 4, 5",
        trouble: "with initial parameters of zero the law (23) gives no torque at all: the arm falls, and the 0.6 rad of Fig. 12 cannot come from it",
        here: "the first run uses a model-free joint PD (joint 2: 16 and 8, joint 1: 100 and 60), chosen so that Fig. 12 comes out",
    },
    Deviation {
        place: "section 3",
        trouble: "'joint at rest' needs something that holds it",
        here: "the resting joint is locked",
    },
    Deviation {
        place: "Table 6, Fig. 15",
        trouble: "the Fourier coefficients, the duration and the way to speed and acceleration are not given; an error of 0.02 without noise can only come from fitting or an unsettled run",
        here: "five harmonics designed inside (18), whole settled periods, speed and acceleration by a Fourier fit of the measured positions",
    },
    Deviation {
        place: "Eq. 25",
        trouble: "the verification motion sin t breaks (18) itself",
        here: "kept as the paper's verification, and said",
    },
];
