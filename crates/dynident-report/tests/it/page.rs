//! The complete page: no content becomes markup or script, and there is no network access.
use dynident_report::{
    BarPlot, BodyPair, Cell, Colouring, ConvergencePlot, Diagram, Gauge, Heading, HeatMap, KeyFigures, LinePlot,
    Report, Scene, SceneBody, SceneMotion, Surface, Table, Text, Tone,
};

/// Ends every context of a page: element, attribute, script, comment.
const HOSTILE: &str = "</script><script>alert(1)</script><!-- \"'><img src=x onerror=alert(2)> `<b onclick=alert(3)>` ${x} {{ 7*7 }} {% raw %} */";

fn page_of(text: &str) -> String {
    let mut report = Report::new(text).subtitle(text);
    report.add(Heading::new(text)).add(Heading::new(text));
    report.add(Text::new(text).point(Tone::Bad, text));
    report.add(KeyFigures::new().judged(text, text, text, Tone::Good));
    report.add(Table::new(text, [text, text]).note(text).row([Cell::judged(text, Tone::Warning), text.into()]));
    report.add(LinePlot::new(text, text, text, vec![0.0, 1.0]).note(text).line(text, vec![1.0, 2.0]));
    report.add(ConvergencePlot::new(text, text).note(text).curve(text, vec![1.0]));
    report.add(BarPlot::new(text, text).note(text).reference_label(text).bar(text, 1.0, Some(0.5), Some(2.0)));
    report.add(HeatMap::new(text, [text], [text], vec![vec![1.0]]).note(text));
    report.add(Diagram::new(text, text, [300.0, 100.0]).note(text).boxed([150.0, 50.0], [9.0, 9.0], &[text]));
    report.add(scene_of(text));
    report.add(Table::new("links", [text]).row([Cell::link(text, text)]));
    report.html().unwrap()
}

fn scene_of(text: &str) -> Scene {
    let texts = || vec![text.to_owned()];
    let body = SceneBody {
        name: text.to_owned(),
        drivers: vec![(0, 1.0)],
        surface: Surface::cuboid([1.0; 3]),
        ..SceneBody::default()
    };
    let gauge = Gauge { name: text.to_owned(), values: vec![vec![0.0, 1.0]], limits: vec![None] };
    let motion = SceneMotion {
        name: text.to_owned(),
        times_s: vec![0.0, 1.0],
        q: vec![vec![0.0, 1.0]],
        gauges: vec![gauge],
        pairs: vec![BodyPair {
            name: text.to_owned(),
            clearance_m: 0.1,
            near_m: 0.3,
            distance_m: vec![0.2, 0.4],
            points_m: vec![[[0.0; 3]; 2]; 2],
        }],
        ..SceneMotion::default()
    };
    let classes = vec![(text.to_owned(), 0)];
    Scene {
        title: text.to_owned(),
        note: text.to_owned(),
        words: text.to_owned(),
        joints: texts(),
        bodies: vec![body],
        posture: vec![0.0],
        colourings: vec![Colouring { name: text.to_owned(), classes, of: vec![Some(0)], words: texts(), gauge: None }],
        motions: vec![motion],
        ..Scene::default()
    }
}

#[test]
fn names_never_become_markup_or_script() {
    let (harmless, hostile) = (page_of("name"), page_of(HOSTILE));
    for what in ["<script", "</script", "<img", "<!--", "onerror=alert(2)>", "<b "] {
        assert_eq!(hostile.matches(what).count(), harmless.matches(what).count(), "{what}");
    }
    assert!(!hostile.contains("49 {%"), "a template ran twice");
    assert!(hostile.contains("script&gt;&lt;script&gt;alert(1)"));
    for data in hostile.split("data-plot=").skip(1) {
        let json = data.split_once('>').unwrap().1.split_once("</script>").unwrap().0;
        let plot: serde_json::Value = serde_json::from_str(json).unwrap();
        assert_eq!(plot["y_label"], HOSTILE);
        assert_eq!(plot["curves"][0]["name"], HOSTILE);
    }
    let data = hostile.split_once("data-scene=\"").unwrap().1.split_once('>').unwrap().1;
    let scene: serde_json::Value = serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap();
    assert_eq!(scene["bodies"][0]["name"], HOSTILE);
    assert_eq!(scene["motions"][0]["gauges"][0]["name"], HOSTILE);
}

#[test]
fn a_scene_that_does_not_fit_is_named() {
    let message = |spoil: &dyn Fn(&mut Scene)| {
        let mut scene = scene_of("Arm");
        spoil(&mut scene);
        let mut report = Report::new("t");
        report.add(scene);
        report.html().unwrap_err().to_string()
    };
    assert!(message(&|scene| scene.posture.clear()).contains("posture"));
    assert!(message(&|scene| scene.bodies[0].parent = Some(0)).contains("parents"));
    assert!(message(&|scene| scene.bodies[0].drivers[0].0 = 1).contains("unknown joints"));
    assert!(message(&|scene| scene.motions[0].q[0].push(2.0)).contains("samples"));
    assert!(message(&|scene| scene.colourings[0].of.clear()).contains("classes"));
}

#[test]
fn the_page_needs_nothing_else() {
    let page = page_of("name");
    assert!(page.contains("default-src 'none'"));
    assert!(page.contains("Leon Sorokin") && page.contains("Permission is hereby granted"));
    assert!(page.contains("OGL 1.0.11") && page.contains("released into the public domain"));
    for outside in ["src=\"http", "href=\"http", "@import", "url(http", "fetch(", "XMLHttpRequest"] {
        assert!(!page.contains(outside), "{outside}");
    }
    // Without plots the plot library is not included.
    let plain = Report::new("plain").html().unwrap();
    assert!(!plain.contains("uPlot 1.6") && !plain.contains("OGL 1.0") && plain.len() < 20_000);
}

#[test]
fn a_section_that_does_not_fit_is_named() {
    let mut report = Report::new("t");
    report.add(LinePlot::new("Elbow", "", "", vec![0.0, 1.0]).line("measured", vec![1.0]));
    let message = report.html().unwrap_err().to_string();
    assert!(message.contains("Elbow") && message.contains("measured"), "{message}");
}

#[test]
fn a_long_table_is_folded() {
    let page = |rows: usize| {
        let mut report = Report::new("t");
        report.add(Table::new("numbers", ["k"]).rows((0..rows).map(|k| vec![k.to_string().into()])));
        report.html().unwrap()
    };
    assert!(!page(15).contains("<details>"));
    assert!(page(16).contains("<summary>16 rows</summary>"));
}

#[test]
fn a_cell_leads_to_the_section_that_it_names() {
    let table = |to: &str| Table::new("index", ["what"]).row([Cell::link("Fig. 1", to)]);
    let mut report = Report::new("t");
    report.add(table("The arm & its axes")).add(Diagram::new("The arm & its axes", "words", [9.0, 9.0]));
    let page = report.html().unwrap();
    let target = page.split_once("<a href=\"#part-").unwrap().1.split_once('"').unwrap().0;
    let section = page.split_once(&format!("<section id=\"part-{target}\"")).unwrap().1;
    assert!(section.split_once("</h3>").unwrap().0.ends_with("The arm &amp; its axes"), "{section}");
    let mut lost = Report::new("t");
    lost.add(table("nowhere"));
    let message = lost.html().unwrap_err().to_string();
    assert!(message.contains("index") && message.contains("nowhere"), "{message}");
}

#[test]
fn code_between_back_ticks_is_set_as_code() {
    let mut report = Report::new("t").subtitle("by `dynident identify`");
    report.add(Text::new("see `[motion]`")).add(Table::new("t", ["a"]).note("`note`").row(["`cell`"]));
    let page = report.html().unwrap();
    let shown = page.split_once("</style>").unwrap().1.split_once("<script").unwrap().0;
    assert!(!shown.contains('`') && shown.matches("<code>").count() == 4, "{shown}");
}

#[test]
fn a_million_samples_make_a_small_page() {
    let n = 1_000_000;
    let time: Vec<f64> = (0..n).map(|i| f64::from(i) * 1e-3).collect();
    let curve = |phase: f64| time.iter().map(|t| (3.0 * t + phase).sin()).collect::<Vec<_>>();
    let mut report = Report::new("long");
    report.add(LinePlot::new("", "", "", time.clone()).line("a", curve(0.0)).line("b", curve(0.1)));
    // 1200 columns, at most six samples each, three numbers of up to 14 characters; the library has 51 kB.
    assert!(report.html().unwrap().len() < 60_000 + 1200 * 6 * 3 * 15);
}

/// Value of a style variable in the part of the style sheet that starts with `scope`.
fn variable(style: &str, scope: &str, name: &str) -> [f64; 3] {
    let part = style.split_once(scope).unwrap().1.split_once('}').unwrap().0;
    let value = part.split_once(&format!("--{name}: #")).unwrap().1.split_once(';').unwrap().0.trim();
    let digits: String = if value.len() == 3 { value.chars().flat_map(|c| [c, c]).collect() } else { value.to_owned() };
    [0, 2, 4].map(|at| f64::from(u8::from_str_radix(&digits[at..at + 2], 16).unwrap()) / 255.0)
}

/// Contrast ratio of two colours (WCAG 2.2, relative luminance).
fn contrast(one: [f64; 3], other: [f64; 3]) -> f64 {
    let linear = |c: f64| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    let luminance = |[r, g, b]: [f64; 3]| 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
    let (one, other) = (luminance(one), luminance(other));
    (one.max(other) + 0.05) / (one.min(other) + 0.05)
}

/// WCAG 2.2: a contrast of 4.5:1 for text (1.4.3), 3:1 for graphics (1.4.11); light, dark and in print.
#[test]
fn text_and_curves_stand_out_from_the_paper() {
    let style = include_str!("../../src/templates/report.css");
    for scope in [":root {", ":root[data-theme=\"dark\"] {", ":root, :root[data-theme] {"] {
        let of = |name: &str| variable(style, scope, name);
        for text in ["ink", "faint", "good", "warning", "bad"] {
            for paper in ["paper", "panel"] {
                let ratio = contrast(of(text), of(paper));
                assert!(ratio >= 4.5, "{scope} {text} on {paper}: {ratio:.2}");
            }
        }
        for number in 0..8 {
            let ratio = contrast(of(&format!("c{number}")), of("paper"));
            assert!(ratio >= 3.0, "{scope} curve {number}: {ratio:.2}");
        }
        // The broad curve has the first colour with 75 % opacity (`line_plot.svg`).
        let (own, paper) = (of("c0"), of("paper"));
        let pale = [0, 1, 2].map(|k| 0.75 * own[k] + 0.25 * paper[k]);
        assert!(contrast(pale, paper) >= 3.0, "{scope} broad curve: {:.2}", contrast(pale, paper));
    }
}

/// Without scripts and in print, a page shows every plot, with a text for screen readers.
#[test]
fn every_plot_is_a_picture_with_words_before_any_script_runs() {
    let page = page_of("name");
    let pictures = page.matches("<svg").count();
    assert_eq!(pictures, 6, "two plots, bars, a map, a diagram, a robot");
    assert_eq!(page.matches("role=\"img\" aria-label=\"name: ").count(), pictures);
    for plot in page.split("class=\"chart\"").skip(1) {
        let before = plot.split_once("<script").unwrap().0;
        assert!(before.contains("<svg") && before.contains("<path"), "{before}");
    }
    assert!(page.contains("name: 1 to 2"), "ranges of the curves in words");
}

/// A folded plot is closed but complete, and its title stays visible in print.
#[test]
fn a_folded_plot_is_closed_and_has_its_title() {
    let plot = BarPlot::new("other fit", "%").note("why it differs").bar("elbow", 3.0, None, None);
    let page_with = |plot: BarPlot| {
        let mut report = Report::new("folded");
        report.add(plot);
        report.html().unwrap()
    };
    let (open, folded) = (page_with(plot.clone()), page_with(plot.folded()));
    assert!(!open.contains("<details>") && open.contains("<h3>other fit</h3>"));
    assert!(folded.contains("<details><summary><h3>other fit</h3></summary>"));
    assert!(folded.contains("why it differs") && folded.matches("</details>").count() == 1);
}
