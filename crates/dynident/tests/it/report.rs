//! The report of an identification: plots of every joint, gaps, escaped names.
use crate::common::{Job, Motion, Truth, header, plain, repository, write_log};

const NAME: &str = "elbow</script><b>&quot;";

#[test]
fn every_joint_is_drawn_and_no_name_becomes_markup() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = std::fs::read_to_string(repository("robots/planar2r.urdf")).unwrap();
    let escaped = NAME.replace('&', "&amp;").replace('<', "&lt;");
    let robot = folder.path().join("robot.urdf");
    std::fs::write(&robot, urdf.replace("\"joint2\"", &format!("\"{escaped}\""))).unwrap();
    let truth = Truth::near(&robot, 0.2, false);
    for seed in [1, 2] {
        let path = folder.path().join(format!("log{seed}.csv"));
        write_log(&path, &truth, &Motion::new(2, seed), (100.0, 20.0), &header(2), plain);
    }
    // A gap of 2 s in the second log.
    let log = std::fs::read_to_string(folder.path().join("log2.csv")).unwrap();
    let lines: Vec<&str> = log.lines().enumerate().filter(|(i, _)| !(1000..1200).contains(i)).map(|(_, l)| l).collect();
    std::fs::write(folder.path().join("log2.csv"), lines.join("\n") + "\n").unwrap();
    let text = r#"
        name = "two joints </title>"
        robot.file = "robot.urdf"
        [motion]
        differentiator = { method = "central-differences", order = 8 }
        [format]
        time = { column = "t" }
        position = { columns = "q{1..2}" }
        torque = { columns = "tau{1..2}" }
        [[log]]
        file = "log1.csv"
        [[log]]
        file = "log2.csv"
        role = "validate"
    "#;
    let found = Job::new(folder.path(), text).identify();
    assert_eq!(found.traces.iter().map(|trace| trace.role.name()).collect::<Vec<_>>(), ["identify", "validate"]);
    // Differences of order 8 leave out 8 samples at either end of a piece.
    for (trace, gaps) in found.traces.iter().zip([2 * 8, 4 * 8]) {
        assert_eq!((trace.joints.len(), trace.cut), (2, false));
        for joint in &trace.joints {
            assert_eq!(joint.measured_nm.len(), joint.predicted_nm.len());
            assert_eq!(joint.measured_nm.iter().filter(|value| value.is_nan()).count(), gaps, "{}", trace.log);
            // A noise-free log of a known robot: only rounding differs.
            let both = joint.measured_nm.iter().zip(&joint.predicted_nm).filter(|(m, _)| !m.is_nan());
            assert!(both.clone().count() > 1000 && both.into_iter().all(|(m, p)| (m - p).abs() < 1e-3));
        }
    }
    let page = found.report().unwrap();
    // Two joints per log, with residuals in a strip of the same plot.
    assert_eq!(page.matches("data-plot=\"plot-").count(), 2 * 2);
    assert!(page.matches("measured minus predicted").count() >= 2 * 2, "residuals are drawn");
    assert!(!page.contains(NAME) && !page.contains("</script><b>") && !page.contains("joints </title>"));
    for heading in ["Torque", "Parameters", "Friction and drives", "Bodies", "Logs", "Origin and time"] {
        assert!(page.contains(&format!(">{heading}</h2>")), "{heading}");
    }
    assert!(page.contains("steps longer than three median steps"), "findings about the log");
    // Both joints are revolute.
    assert!(page.contains("torque, Nm") && !page.contains("Nm (N)"), "unit of the joints");
    // The plot of the joint with the largest torque is before all tables, the other plots are behind them.
    let at = |what: &str| page.find(what).unwrap_or_else(|| panic!("{what} is not on the page"));
    assert!(
        at("joint with the largest torque") < at("<table>") && at("<table>") < page.rfind("data-plot=\"plot-").unwrap()
    );
}
