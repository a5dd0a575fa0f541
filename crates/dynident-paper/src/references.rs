//! References [7] to [20] of the paper, and the corresponding parts of this project.

use crate::piece::PaperReference;

/// Number, authors, idea that the paper uses, and the corresponding part of this project. The available copy of the
/// paper ends before its list of references, so the names are those of its text.
const REFERENCES: &[(usize, &str, &str, &str)] = &[
    (
        7,
        "Atkeson et al.",
        "a finite polynomial as the motion, low-pass filtered positions; condition number of the observation matrix",
        "`method = \"low-pass\"`, families `quintic` and `b-spline`, `criterion = \"condition-number\"`; book: Differentiators, Design",
    ),
    (
        8,
        "Kinsheel et al.",
        "central differences of high order",
        "`method = \"central-differences\"`, order 2 to 8; book: Filters and differentiation",
    ),
    (
        9,
        "Swevers et al.",
        "a finite Fourier series as the motion; derivatives of the fitted series, or in the frequency domain",
        "`family = { kind = \"fourier\" }`, `method = \"fourier-fit\"`, `method = \"frequency-domain\"`; here Eq. 24, Fig. 15, Table 6",
    ),
    (
        10,
        "Xu et al.",
        "acceleration and torque smoothed after central differences",
        "`method = \"smoothed-differences\"` with `smooth_torque`",
    ),
    (
        11,
        "Zhang et al.",
        "five-point cubic smoothing of the torque, low-pass filtered differences",
        "`method = \"five-point-cubic\"`; harmonic drives: friction law `cube-root`",
    ),
    (
        12,
        "Feng et al.",
        "least squares reweighted by the torque's noise; acceleration from a Fourier series of the filtered speed",
        "`method = \"speed-series\"`; estimators that weight and reweight: book, Estimation",
    ),
    (
        13,
        "not named in the text",
        "the dynamics as a linear form of inertial parameters, Eq. 2",
        "`torque_regressor` of dynident-dynamics; book: Dynamics",
    ),
    (
        14,
        "Kawasaki et al.",
        "base parameters by recursion on modified D-H parameters",
        "Table 2 here; `BaseParameters` of dynident-dynamics, for any tree of joints and by rank instead of recursion; book: Base parameters",
    ),
    (
        15,
        "Huo et al.",
        "a simpler recursion for the same",
        "as [14]; modified D-H robots: `convention = \"modified\"` of a robot's table",
    ),
    (
        16,
        "not named in the text",
        "Coulomb and viscous friction",
        "keys `viscous` and `coulomb` of `[drive]`; book: Friction",
    ),
    (
        17,
        "not named in the text",
        "the Stribeck effect",
        "`laws = [{ law = \"stribeck\" }]`; chosen by the data where no key states friction",
    ),
    (18, "not named in the text", "the Stribeck effect", "as [17]"),
    (19, "not named in the text", "the genetic algorithm", "`optimiser = \"genetic\"`; here Fig. 7, Table 3"),
    (
        20,
        "not named in the text",
        "the robust finite-time law, Eq. 23",
        "controller `kind = \"finite-time\"`; book: Simulation",
    ),
];

pub(crate) fn references() -> Vec<PaperReference> {
    let one = |&(number, source, idea, here): &(usize, &str, &str, &str)| PaperReference {
        number,
        source: source.to_owned(),
        idea: idea.to_owned(),
        here: here.to_owned(),
    };
    REFERENCES.iter().map(one).collect()
}
