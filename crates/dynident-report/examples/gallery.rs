//! Writes a page with all kinds of sections to the given file, for visual inspection.
//!
//! `cargo run -p dynident-report --example gallery -- gallery.html`

use dynident_report::{
    BarPlot, BodyMotion, BodyPair, Cell, Colouring, ConvergencePlot, Ellipsoid, Gauge, Heading, HeatMap, KeyFigures,
    LinePlot, Report, Scene, SceneBody, SceneMotion, Surface, Table, Text, Tone,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "gallery.html".to_owned());
    let time: Vec<f64> = (0..200_000).map(|i| f64::from(i) * 1e-3).collect();
    let torque = |scale: f64| -> Vec<f64> {
        // A gap of 10 s, and a spike of one sample.
        let value = |t: f64| {
            if (60.0..70.0).contains(&t) { f64::NAN } else { scale * (20.0 * (0.6 * t).sin() + 5.0 * (2.3 * t).cos()) }
        };
        time.iter().enumerate().map(|(i, t)| if i == 123_456 { 60.0 } else { value(*t) }).collect()
    };
    let mut page = Report::new("Gallery <of sections>").subtitle("all kinds of sections, with artificial data");
    page.add(Heading::new("Figures and words"));
    page.add(
        KeyFigures::new()
            .judged("held-out torque error", "2.7 %", "second run", Tone::Good)
            .judged("parameters identified", "52 of 54", "two are not excited", Tone::Warning)
            .judged("physically consistent", "no", "", Tone::Bad)
            .figure("condition number", "48.6", ""),
    );
    page.add(Text::new("A paragraph.").point(Tone::Plain, "a point").point(Tone::Bad, "a bad one & its reason"));
    page.add(Table::new("A table", ["joint", "viscous, Nm s", "verdict"]).note("click a name to sort").rows([
        vec!["elbow".into(), "2.10".into(), Cell::judged("fine", Tone::Good)],
        vec!["wrist".into(), "0.31".into(), Cell::judged("doubtful", Tone::Warning)],
    ]));
    page.add(Heading::new("A robot"));
    page.add(robot());
    page.add(Heading::new("Plots"));
    page.add(
        LinePlot::new("Torque of the elbow", "t, s", "Nm", time.clone())
            .note("200 000 samples, a gap and a spike")
            .line("measured", torque(1.0))
            .dashed("predicted", torque(0.97)),
    );
    page.add(
        ConvergencePlot::new("Tracking error", "rad")
            .log_y()
            .curve("joint 1", vec![0.6, 0.15, 2e-3, 4e-5])
            .curve("joint 2", vec![0.2, 0.01, 1e-3, 5e-5]),
    );
    page.add(
        ConvergencePlot::new("Parameters by run", "kg m²")
            .curve_with_bars("θ4", vec![0.4, 1.1, 0.99], vec![0.3, 0.1, 0.02])
            .curve_with_bars("θ5", vec![0.9, 0.8, 1.0], vec![0.2, 0.1, 0.02]),
    );
    page.add(
        BarPlot::new("Base parameters", "kg m²")
            .reference_label("robot description")
            .bar("Izz1 + 0.0488149 m2 + 0.441882 my2 + Izz2 + 0.0024 m3", 0.91, Some(0.02), Some(0.95))
            .bar("Ixy2", -0.4, Some(0.2), Some(-0.1))
            .bar("not excited", f64::NAN, None, None),
    );
    let names: Vec<String> = (1..=12).map(|k| format!("θ{k}")).collect();
    let value = |i: usize, j: usize| if i == j { 1.0 } else { ((i * 7 + j * 7) as f64).sin() * 0.8 };
    let values = (0..12).map(|i| (0..12).map(|j| value(i, j)).collect()).collect();
    page.add(HeatMap::new("Correlation", names.clone(), names, values).limit(1.0));
    std::fs::write(path, page.html()?)?;
    Ok(())
}

const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A base and four links that turn about z and y in turn.
fn robot() -> Scene {
    let mut base =
        SceneBody { name: "base".into(), rotation: UPRIGHT, pose: (UPRIGHT, [0.0; 3]), ..SceneBody::default() };
    base.surface = Surface::cuboid([0.3, 0.3, 0.06]);
    base.surface.join(&Surface::cylinder(0.09, 0.2).placed(&UPRIGHT, [0.0, 0.0, 0.1]));
    let mut bodies = vec![base];
    let lengths = [0.2, 0.45, 0.4, 0.12];
    let mut height = 0.2;
    for (k, length) in lengths.into_iter().enumerate() {
        let start = if k == 0 { 0.2 } else { lengths[k - 1] };
        bodies.push(SceneBody {
            name: format!("link {}", k + 1),
            parent: Some(k),
            rotation: UPRIGHT,
            translation_m: [0.0, 0.0, start],
            motion: BodyMotion::Turns,
            axis: if k % 2 == 0 { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] },
            drivers: vec![(k, 1.0)],
            surface: Surface::rod([0.0; 3], [0.0, 0.0, length], 0.06),
            ellipsoids: vec![Ellipsoid {
                centre: [0.0, 0.0, 0.5 * length],
                shape: [[0.05, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, 0.0, 0.4 * length]],
                earlier: false,
            }],
            pose: (UPRIGHT, [0.0, 0.0, height]),
            ..SceneBody::default()
        });
        height += length;
    }
    let times_s: Vec<f64> = (0..500).map(|k| 0.02 * f64::from(k)).collect();
    let wave = |joint: usize| times_s.iter().map(|t| (t * (0.6 + 0.3 * joint as f64)).sin()).collect::<Vec<f64>>();
    let q: Vec<Vec<f64>> = (0..4).map(wave).collect();
    let distance_m: Vec<f64> = times_s.iter().map(|t| 0.25 + 0.25 * (t + 1.0).cos()).collect();
    let gauge = Gauge { name: "position, rad".into(), values: q.clone(), limits: vec![Some([-1.0, 1.0]); 4] };
    Scene {
        title: "A robot of four joints".into(),
        note: "the second link is heavier than described".into(),
        is_low: false,
        words: "an upright arm".into(),
        joints: (1..=4).map(|k| format!("joint {k}")).collect(),
        posture: vec![0.0; 4],
        colourings: vec![
            Colouring {
                name: "how well each body is known".into(),
                classes: vec![("measured".into(), 2), ("partly".into(), 0), ("nominal".into(), 1)],
                of: vec![None, Some(2), Some(0), Some(1), Some(1)],
                words: ["", "nominal", "2.3 ± 0.1 kg", "1.1 ± 0.4 kg", "0.2 ± 0.1 kg"].map(Into::into).to_vec(),
                gauge: None,
            },
            Colouring {
                name: "position along the motion".into(),
                classes: vec![("zero".into(), 0), ("at a limit".into(), 1)],
                of: vec![None; 5],
                words: vec![String::new(); 5],
                gauge: Some(0),
            },
        ],
        motions: vec![SceneMotion {
            name: "waves".into(),
            times_s,
            ghost: q.iter().rev().cloned().collect(),
            q,
            gauges: vec![gauge],
            pairs: vec![BodyPair {
                name: "link 1 and link 3".into(),
                clearance_m: 0.05,
                near_m: 0.3,
                points_m: distance_m.iter().map(|distance| [[0.3, 0.0, 0.4], [0.3 + distance, 0.0, 0.4]]).collect(),
                distance_m,
            }],
        }],
        floor_m: Some(-0.03),
        column_m: Some([0.6, 0.0, 0.1]),
        boxes_m: vec![[[Some(-0.8), Some(0.8)], [Some(-0.8), Some(0.8)], [Some(0.0), None]]],
        bodies,
    }
}
