//! Table 1 and the paper's two drawings, Figs. 1 and 8.

use crate::arm::Arm;
use crate::piece::{PaperCell, PaperFigure, PaperTable};
use dynident_model::Vec3;
use dynident_report::{Diagram, LineStyle};

/// Table 1: modified Denavit-Hartenberg parameters; ours are computed from the model that the reproduction uses.
pub(crate) fn table_1(arm: &Arm) -> PaperTable {
    let note = "the available copy of the paper prints m for a of row 2; section 3 uses a₁ = 1. Our values are those of the robot model that all results on this page use";
    let columns = ["i", "α of i−1, rad", "a of i−1, paper", "a of i−1, here, m", "d of i, m", "q of i"];
    let mut table = PaperTable::new(1, "Modified D-H parameters of the robot", &columns, note);
    for (place, (joint, length)) in arm.model.joints().iter().zip(["0", "a₁"]).enumerate() {
        let Vec3([a, _, d]) = joint.placement.translation;
        // Rotation of the joint's axis about x relative to the previous axis; with modified parameters it is in the
        // last column of the rotation matrix.
        let rotation = joint.placement.rotation.0;
        let alpha = (-rotation[1][2]).atan2(rotation[2][2]);
        table.row([
            PaperCell::Text((place + 1).to_string()),
            alpha.into(),
            length.into(),
            a.into(),
            d.into(),
            PaperCell::Text(format!("q{}", ["₁", "₂"][place])),
        ]);
    }
    table
}

/// Fig. 1: the arm with its frames, by the modified D-H convention.
pub(crate) fn figure_1() -> PaperFigure {
    // Joint 1, joint 2 and tip in the drawing, px; angles from the horizontal.
    let (first, reach) = ([170.0, 330.0], 180.0);
    let (one, two) = (30.0_f64.to_radians(), 75.0_f64.to_radians());
    let along = |[x, y]: [f64; 2], angle: f64, length: f64| [x + length * angle.cos(), y - length * angle.sin()];
    let second = along(first, one, reach);
    let tip = along(second, two, 140.0);
    let arc = |centre: [f64; 2], from: f64, to: f64, radius: f64| -> Vec<[f64; 2]> {
        (0..=12).map(|k| along(centre, from + (to - from) * f64::from(k) / 12.0, radius)).map(rounded).collect()
    };
    let up = core::f64::consts::FRAC_PI_2;
    let words = "a planar arm of two rods in the vertical plane; frame 0 and frame 1 share their origin at the first joint, frame 2 is at the second joint, a₁ along x₁ from the first; q₁ from x₀ to x₁, q₂ from x₁ to x₂; all z axes point towards the reader, gravity along minus y₀";
    let mut drawing = Diagram::new("Modified D-H model of the robot", words, [620.0, 400.0]);
    for (points, style) in [
        (vec![first, second, tip], LineStyle::Broad),
        (vec![first, along(first, 0.0, 150.0)], LineStyle::Arrow),
        (vec![first, along(first, up, 120.0)], LineStyle::Arrow),
        (vec![first, along(first, one, 300.0)], LineStyle::Arrow),
        (vec![first, along(first, one + up, 90.0)], LineStyle::Arrow),
        (vec![second, along(second, two, 190.0)], LineStyle::Arrow),
        (vec![second, along(second, two + up, 90.0)], LineStyle::Arrow),
        (arc(first, 0.0, one, 70.0), LineStyle::Arrow),
        (arc(second, one, two, 60.0), LineStyle::Arrow),
        (vec![[540.0, 60.0], [540.0, 120.0]], LineStyle::Arrow),
        (vec![[130.0, 348.0], [210.0, 348.0]], LineStyle::Thin),
    ] {
        drawing = drawing.line(&points.into_iter().map(rounded).collect::<Vec<_>>(), style);
    }
    drawing = drawing.ring(first, 9.0).ring(rounded(second), 9.0);
    let [middle_x, middle_y] = along(first, one, 0.5 * reach);
    for (at, text) in [
        (along(first, 0.0, 156.0), "x₀"),
        (along(first, up, 126.0), "y₀"),
        (along(first, one, 306.0), "x₁"),
        (along(first, one + up, 102.0), "y₁"),
        (along(second, two, 196.0), "x₂"),
        (along(second, two + up, 104.0), "y₂"),
        (along(first, 0.5 * one, 80.0), "q₁"),
        (along(second, 0.5 * (one + two), 70.0), "q₂"),
        ([middle_x - 6.0, middle_y - 14.0], "a₁"),
        ([546.0, 95.0], "g"),
        ([130.0, 372.0], "z₀, z₁, z₂ towards the reader"),
    ] {
        drawing = drawing.word(rounded(at), text);
    }
    PaperFigure::new(1, drawing, "drawn from Table 1, not to scale")
}

/// Fig. 8: the procedure of the paper's section 3, with the changes of the reproduction.
pub(crate) fn figure_8() -> PaperFigure {
    let words = "initial parameters; then a loop: run the excitation trajectory under the controller with the present parameters, sample positions and torques, compute velocity and acceleration from position, least squares, and the error of Eq. 20: if it is small the procedure ends, otherwise the controller gets the parameters and the trajectory is run again";
    let x = 240.0;
    let (top, step) = (30.0, 66.0);
    let y = |place: f64| top + step * place;
    let wide = [330.0, 42.0];
    let mut chart = Diagram::new("Parameter identification process", words, [620.0, 470.0]);
    let lines: [&[&str]; 5] = [
        &["initial parameters θ = 0"],
        &["run the excitation trajectory, Eq. 14, under", "the law (23); here the first run under a joint PD"],
        &["sample q and τ"],
        &["q̇, q̈ from q by the map, Eqs. 15, 16"],
        &["θ by least squares: joint 2 by Eq. 9, then joint 1 by Eq. 10"],
    ];
    for (place, lines) in (0..).zip(lines) {
        let place = f64::from(place);
        chart = chart.boxed([x, y(place)], wide, lines);
        chart = chart.line(&[[x, y(place) + 21.0], [x, y(place + 1.0) - 21.0]], LineStyle::Arrow);
    }
    let decision = y(5.0) + 8.0;
    chart = chart
        .decision([x, decision], [300.0, 58.0], &["error Δ, Eq. 20, small?"])
        .line(&[[x + 150.0, decision], [590.0, decision], [590.0, y(1.0)], [x + 173.0, y(1.0)]], LineStyle::Arrow)
        .word([x + 162.0, decision - 7.0], "no: θ into the controller")
        .line(&[[x, decision + 29.0], [x, decision + 62.0]], LineStyle::Arrow)
        .word([x + 10.0, decision + 48.0], "yes")
        .boxed([x, decision + 80.0], [180.0, 34.0], &["end"]);
    PaperFigure::new(
        8,
        chart,
        "from the paper's text. The true values of Eq. 20 are unknown for a real robot, so Dynident ends an iteration when tracking and parameters have converged",
    )
}

fn rounded(point: [f64; 2]) -> [f64; 2] {
    let [x, y] = point;
    [x.round(), y.round()]
}
