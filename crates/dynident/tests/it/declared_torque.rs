//! Springs and counterbalances in studies: declared, identified, validated, simulated, exported.
use crate::common::{Job, Motion, Random, Truth, assert_reads_back, repository};
use core::ops::ControlFlow;
use dynident::export::Target;
use dynident::{Error, design_study, export_model, identify, simulate_study, validate};
use std::fmt::Write;
use std::path::Path;

const RATE_HZ: f64 = 125.0;
/// Torque noise, Nm.
const NOISE: f64 = 0.3;
const COUNTERBALANCE: f64 = -35.0;
const SPRING: f64 = 4.0;

fn spring(q: f64) -> f64 {
    q + 0.4 * q * q * q
}

/// A UR10 near its description with a counterbalance at the elbow and a spring at the shoulder.
fn write_log(path: &Path, seconds: f64, seed: u64) {
    let truth = Truth::near(&repository("robots/ur10.urdf"), 0.2, false);
    let (motion, mut random) = (Motion::new(6, seed), Random(seed));
    let mut text = crate::common::header(6);
    let mut workspace = dynident::dynamics::Workspace::new(&truth.model);
    for k in 0..(RATE_HZ * seconds) as usize {
        let t = k as f64 / RATE_HZ;
        let [q, dq, ddq] = motion.at(t);
        let mut tau = truth.torque(&mut workspace, &q, &dq, &ddq);
        tau[2] += COUNTERBALANCE * (q[2] + 0.3).sin();
        tau[1] += SPRING * spring(q[1]);
        write!(text, "\n{t}").unwrap();
        for value in q.into_iter().chain(tau.into_iter().map(|tau| tau + NOISE * random.normal())) {
            write!(text, ",{value}").unwrap();
        }
    }
    std::fs::write(path, text + "\n").unwrap();
}

fn write_table(path: &Path) {
    let mut text = "position_rad,torque_nm\n# measured by hand\n".to_owned();
    for k in -30..=30 {
        let q = 0.1 * f64::from(k);
        writeln!(text, "{q},{}", spring(q)).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

const DECLARED: &str = r#"
    [[torque]]
    name = "counterbalance"
    joint = "elbow_joint"
    expression = "sin(q + 0.3)"
    [[torque]]
    name = "spring"
    joint = "shoulder_lift_joint"
    table_file = "spring.csv"
    unit = "of the table"
"#;

/// Friction is selected for one joint only, to save time.
const AUTO: &str = "[drive]\nfriction = \"stated\"\njoints.elbow_joint.friction = \"auto\"";

fn study(torques: &str) -> String {
    format!(
        "log = [{{ file = \"a.csv\" }}, {{ file = \"b.csv\", role = \"validate\" }}]\n[robot]\nfile = {:?}\n{torques}\n{}",
        repository("robots/ur10.urdf").display().to_string(),
        crate::common::format(6)
    )
}

fn recorded(folder: &Path) {
    write_log(&folder.join("a.csv"), 24.0, 1);
    write_log(&folder.join("b.csv"), 8.0, 2);
    write_table(&folder.join("spring.csv"));
}

#[test]
fn a_counterbalance_and_a_spring_are_found_within_their_bars() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let job = Job::new(folder.path(), &study(&format!("[drive]\nfriction = \"stated\"\n{DECLARED}")));
    let found = job.identify();
    for (name, truth, unit) in [("counterbalance", COUNTERBALANCE, "Nm"), ("spring", SPRING, "of the table")] {
        let base = found.result.base_parameters.iter().find(|one| one.symbol == name).unwrap();
        println!("{name}: {} +- {} (95 %), truth {truth}", base.value, base.half_width_95);
        assert_eq!((&*base.unit, &*base.expression), (unit, name));
        // Four standard deviations, and a meaningful error bar.
        assert!((base.value - truth).abs() < 4.0 * base.std, "{name}: {} +- {}", base.value, base.std);
        assert!(base.std < 0.2 * truth.abs(), "{name}: {} +- {}", base.value, base.std);
        let joint = found.result.joints.iter().find(|joint| joint.terms.iter().any(|term| term.symbol == name));
        assert_eq!(joint.unwrap().name, if name == "spring" { "shoulder_lift_joint" } else { "elbow_joint" });
    }
    let law = |name: &str| {
        let mut terms = found.result.joints.iter().flat_map(|joint| &joint.terms);
        terms.find(|term| term.symbol == name).unwrap().law.clone().unwrap()
    };
    assert_eq!(
        [law("counterbalance"), law("spring")],
        ["sin(q3 + 0.3)", "table of q2, 61 points from (-3, -13.8) to (3, 13.8)"]
    );
    assert!(found.result.method.coincident.is_empty(), "{:?}", found.result.method.coincident);
    assert!(found.result.provenance.as_ref().unwrap().inputs.iter().any(|input| input.file.ends_with("spring.csv")));
    let [with, without] = [&found, &Job::new(folder.path(), &study("[drive]\nfriction = \"stated\"")).identify()]
        .map(|found| found.result.validation[0].model.rmse_nm);
    println!("held-out rmse {with} Nm with the declarations, {without} Nm without");
    // Noise plus 10 %; without the declared torque, the non-rigid part of 4 Nm remains (0.4 q³ and more).
    assert!(with < 1.1 * NOISE, "{with}");
    assert!(without > 3.0 * with, "{without} and {with}");

    // The table file gives the same model, and a different study is rejected.
    let path = folder.path().join("result.json");
    std::fs::write(&path, serde_json::to_string(&found.result).unwrap()).unwrap();
    let again = validate(&path, &job.study, &job.path, &Job::options(1)).unwrap();
    assert!((again.validation[0].model.rmse_nm - with).abs() < 1e-12);
    let exported = |target| export_model(&path, &job.study, &job.path, None, target).unwrap();
    assert!(exported(Target::Python).text.contains("def declared(q, dq):"));
    let notes = exported(Target::Mjcf).notes.join("\n");
    let left_out = ["counterbalance of joint elbow_joint, -35.", "Nm times sin(q3 + 0.3), is left out"];
    assert!(left_out.iter().all(|fragment| notes.contains(fragment)), "{notes}");
    let other = Job::new(folder.path(), &study("[drive]\nfriction = \"stated\""));
    let refused = validate(&path, &other.study, &other.path, &Job::options(1)).unwrap_err().to_string();
    assert!(refused.contains("result.json"), "{refused}");
    let declared = DECLARED.replace("q + 0.3", "q + 0.2");
    let moved = Job::new(folder.path(), &study(&format!("[drive]\nfriction = \"stated\"\n{declared}")));
    let refused = validate(&path, &moved.study, &moved.path, &Job::options(1)).unwrap_err().to_string();
    assert!(refused.contains("`counterbalance` was `sin(q3 + 0.3)`, but is `sin(q3 + 0.2)`"), "{refused}");
}

/// Friction selection does not change declared torques.
#[test]
fn friction_is_chosen_beside_declared_torques() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let found = Job::new(folder.path(), &study(&format!("{AUTO}\n{DECLARED}"))).identify();
    let base = found.result.base_parameters.iter().find(|one| one.symbol == "counterbalance").unwrap();
    assert!((base.value - COUNTERBALANCE).abs() < 4.0 * base.std, "{} +- {}", base.value, base.std);
    assert!(found.result.validation[0].model.rmse_nm < 1.1 * NOISE);
}

/// A design moves into the region where the spring acts (beyond 0.8 rad).
#[test]
fn designs_look_for_declared_torques() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        r#"
        robot = {{ file = {:?}, joints = ["shoulder_lift_joint", "elbow_joint"] }}
        [design]
        search = {{ starts = 4, rounds = 0, evaluations_per_start = 600, polish_evaluations = 300, search_samples = 64 }}
        [design.defaults]
        floor = false
        self_collision = false
        [[torque]]
        name = "stop"
        joint = "elbow_joint"
        expression = "max(q - 0.8, 0)^2"
        "#,
        repository("robots/ur10.urdf").display().to_string()
    );
    let job = Job::new(folder.path(), &text);
    let designed = design_study(&job.study, &job.path, &Job::options(2), |_| ControlFlow::Continue(())).unwrap();
    assert_reads_back(&designed.file);
    let forecast = designed.file.forecast.iter().find(|one| one.expression == "stop").unwrap();
    println!("{forecast:?}");
    // Nm/rad² per Nm of noise: a motion outside of this region does not determine the coefficient.
    assert!(forecast.std.unwrap() < 0.2, "{forecast:?}");
}

const PENDULUM: &str = r#"<robot name="pendulum"><link name="base"/>
<link name="rod"><inertial><origin xyz="0.2 0.01 0.1"/><mass value="3"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/><limit lower="-2" upper="3" effort="100" velocity="4"/></joint></robot>"#;

fn pendulum(folder: &Path, torque: &str) -> String {
    std::fs::write(folder.join("pendulum.urdf"), PENDULUM).unwrap();
    let motion = Motion::new(1, 3);
    let mut text = "t_s,q1,dq1,ddq1".to_owned();
    for k in 0..=8000 {
        let t = f64::from(k) / 1000.0;
        write!(text, "\n{t}").unwrap();
        motion.at(t).iter().flatten().for_each(|x| write!(text, ",{x}").unwrap());
    }
    std::fs::write(folder.join("trajectory.csv"), text + "\n").unwrap();
    format!(
        r#"
        robot.file = "pendulum.urdf"
        drive = {{ friction = "stated", offset = false }}
        controller = {{ kind = "joint-pd", kp = 400.0, kd = 30.0 }}
        motion = {{ trim_s = 0.5, differentiator = {{ method = "butterworth", cutoff_hz = 30.0 }} }}
        [simulation]
        viscous = 0.5
        coulomb = 0.8
        sensors = {{ torque_std = 0.05, seed = 5 }}
        [iteration]
        trajectory = "trajectory.csv"
        [format]
        time = {{ column = "t_s" }}
        position = {{ columns = "q{{1..1}}" }}
        torque = {{ columns = "tau{{1..1}}" }}
        [[log]]
        file = "log.csv"
        [[torque]]
        name = "spring"
        joint = "hinge"
        {torque}
        "#
    )
}

fn simulated(folder: &Path, torque: &str) -> Job {
    let job = Job::new(folder, &pendulum(folder, torque));
    let run = simulate_study(&job.study, &job.path, &Job::options(1), &|_| ControlFlow::Continue(())).unwrap();
    assert!(run.file.done, "{:?}", run.file.status);
    assert_reads_back(&run.file);
    std::fs::write(folder.join("log.csv"), run.log).unwrap();
    job
}

/// The simulated spring equals the regressor's column.
#[test]
fn what_is_simulated_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let found = simulated(folder.path(), "expression = \"q - 0.4 + 0.05 * dq^3\"\nnominal = 6.0").identify();
    let base = found.result.base_parameters.iter().find(|one| one.symbol == "spring").unwrap();
    println!("spring {} +- {} (95 %)", base.value, base.half_width_95);
    assert_eq!(base.prior, Some(6.0));
    // Positions without noise: the filters leave an error below 0.01.
    assert!((base.value - 6.0).abs() < 4.0 * base.std + 0.06, "{} +- {}", base.value, base.std);
}

/// `sin(q + 0.3)` at a joint with a horizontal axis coincides with the weight of its link: the coefficient stays
/// nominal, the weight takes the difference, and the result reports this.
#[test]
fn a_torque_that_is_gravity_already_is_said_and_not_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let job = simulated(folder.path(), "expression = \"sin(q + 0.3)\"\nnominal = 3.0");
    let found = job.identify();
    assert!(!found.result.base_parameters.iter().any(|one| one.symbol == "spring"));
    let [sentence] = &found.result.method.coincident[..] else { panic!("{:?}", found.result.method) };
    assert!(sentence.contains("spring") && sentence.contains("hinge"), "{sentence}");
    assert!(
        sentence.contains("coincides with that of mx1, mz1") && sentence.contains("stays near its nominal 3;"),
        "{sentence}"
    );
    // The sums are identifiable: mx = 0.6 kg m contributes -g mx cos(q), mz = 0.3 kg m -g mz sin(q).
    let of = |symbol: &str| found.result.base_parameters.iter().find(|one| one.symbol == symbol).unwrap();
    let [x, z] = [of("mx1"), of("mz1")];
    let (g, phase) = (9.81, 0.3_f64);
    for (sum, expected) in [(x, 0.6 - 3.0 * phase.sin() / g), (z, 0.3 - 3.0 * phase.cos() / g)] {
        println!("{} = {} +- {}, {expected}", sum.expression, sum.value, sum.half_width_95);
        assert!(sum.expression.contains("spring"));
        assert!((sum.value - expected).abs() < 4.0 * sum.std + 0.005, "{} and {expected}", sum.value);
    }
    // The consistent set is the one nearest to all nominal values.
    let term = found.result.joints[0].terms.iter().find(|term| term.symbol == "spring").unwrap();
    assert!(term.std.is_none() && (term.value - 3.0).abs() < 0.3, "{term:?}");
    // The same applies at the shoulder of a level arm, where products of inertia compensate the reaction on the
    // previous joint, but not at its elbow.
    let torque = |joint: &str| {
        let torque = format!("[[torque]]\nname = \"balance\"\njoint = \"{joint}\"\nexpression = \"sin(q + 0.3)\"");
        Job::new(folder.path(), &study(&torque)).robot()
    };
    let at_shoulder = torque("shoulder_lift_joint");
    let [(term, others)] = &at_shoulder.base().coincident()[..] else { panic!("one torque") };
    assert_eq!(
        (term.symbol(), &others[..]),
        ("balance".to_owned(), &["mx2", "mz2", "Ixy2", "Iyz2"].map(str::to_owned)[..])
    );
    assert!(torque("elbow_joint").base().coincident().is_empty());
}

fn refused(folder: &Path, torque: &str) -> String {
    let job = Job::new(folder, &pendulum(folder, torque));
    let error: Error = identify(&job.study, &job.path, &Job::options(1)).unwrap_err();
    error.to_string()
}

#[test]
fn what_cannot_be_is_said_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulated(here, "expression = \"q\"\nnominal = 1.0");
    // The log covers about -1.5 to 1.5 rad.
    let message = refused(here, "table = [[-0.2, 1.0], [0.2, 2.0]]");
    assert!(message.contains("log `log`") && message.contains(" s: torque spring = table of q1"), "{message}");
    assert!(message.contains("hinge at ") && message.contains("widen the table"), "{message}");
    for (torque, fragments) in [
        ("expression = \"q +\"", ["torque `spring`: expression `q +`, character 4:", "a number, a name"]),
        ("expression = \"q(elbow)\"", ["character 3: there is no joint `elbow`", "hinge"]),
        ("expression = \"sqrt(q)\"", ["torque spring = sqrt(q1): no value at q1 = -", "inside the joints' limits"]),
        ("expression = \"0 * q\"", ["torque spring = 0.0 * q1", "remove it"]),
        ("table = [[0.0, 1.0], [0.0, 2.0]]", ["torque `spring`: table: point 2", "sort the points"]),
        ("table_file = \"none.csv\"", ["none.csv is in none of", "correct its path"]),
        ("table_file = \"log.csv\"", ["log.csv:2: `", "give two numbers, position and torque"]),
    ] {
        let message = refused(here, torque);
        assert!(fragments.iter().all(|fragment| message.contains(fragment)), "{message}");
    }
    for (torque, fragment) in [
        ("", "torque `spring`: no expression: give expression, table or table_file"),
        ("expression = \"q\"\ntable = [[0.0, 1.0]]", "expression and table are both given: keep one"),
        ("expression = \"q\"\nnominal = nan", "torque `spring`: nominal: give a finite number"),
        ("expression = \"q\"\nstiffness = 2.0", "unknown field `stiffness`"),
        ("expression = \"q\"\n[[torque]]\nname = \"spring\"\njoint = \"hinge\"\nexpression = \"q\"", "is given twice"),
    ] {
        let message = Job::new_error(here, &pendulum(here, torque));
        assert!(message.contains(fragment), "{message}");
    }
    let renamed = |name: &str| pendulum(here, "expression = \"q^2\"").replace("\"spring\"", &format!("\"{name}\""));
    assert!(Job::new_error(here, &renamed("2nd spring")).contains("name `2nd spring`"));
    for taken in ["mx1", "fv1"] {
        let job = Job::new(here, &renamed(taken));
        let message = identify(&job.study, &job.path, &Job::options(1)).unwrap_err().to_string();
        assert!(
            message.contains(&format!("torque {taken}: the name is invalid, or the symbol of another")),
            "{message}"
        );
    }
    let unknown = Job::new(here, &pendulum(here, "expression = \"q\"").replace("\"hinge\"", "\"knee\""));
    let message = identify(&unknown.study, &unknown.path, &Job::options(1)).unwrap_err().to_string();
    assert!(message.contains("torque `spring`") && message.contains("knee") && message.contains("hinge"), "{message}");
    // A simulation needs the coefficient.
    let job = Job::new(here, &pendulum(here, "expression = \"q\""));
    let run = simulate_study(&job.study, &job.path, &Job::options(1), &|_| ControlFlow::Continue(()));
    let message = run.map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("spring") && message.contains("nominal"), "{message}");
}
