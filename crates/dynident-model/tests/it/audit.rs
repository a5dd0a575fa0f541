//! The audit: a correct arm passes, and every seeded defect is found.

use crate::common::{ARM, foreign_urdfs};
use dynident_model::{AuditFinding, AuditLevel, audit, load_robot, read_urdf};

fn findings(text: &str) -> Vec<AuditFinding> {
    audit(&read_urdf(text).expect("a readable arm").model)
}

fn above_info(findings: &[AuditFinding]) -> Vec<&AuditFinding> {
    findings.iter().filter(|finding| finding.level > AuditLevel::Info).collect()
}

#[test]
fn a_clean_arm_passes() {
    let findings = findings(ARM);
    assert!(above_info(&findings).is_empty(), "{findings:?}");
    assert_eq!((findings[0].check, findings[0].place.as_str()), ("summary", "model"));
    // 6.5 + 3.25 + 1.5 + 0.6 kg.
    assert!(findings[0].message.contains("11.8500 kg"), "{}", findings[0].message);
}

#[test]
fn published_descriptions_of_common_arms_pass() {
    let directory = dynident_testing::repository("robots");
    for name in ["planar2r", "ur10", "panda", "panda_arm7", "iiwa14"] {
        let findings = audit(&load_robot(directory.join(format!("{name}.urdf"))).unwrap().model);
        assert!(above_info(&findings).is_empty(), "{name}: {findings:?}");
    }
}

#[test]
fn known_defects_of_published_descriptions_are_found() {
    // Known mistakes in published files.
    let known = [
        ("kuka_lwr4.urdf", "link lwr_7_link", "inertia-too-large", AuditLevel::Warning),
        ("tiago.urdf", "link arm_1_link", "triangle-inequality", AuditLevel::Problem),
        ("talos_reduced.urdf", "link imu_link", "placeholder", AuditLevel::Warning),
        ("double_pendulum_designC.urdf", "joint elbow", "massless-subtree", AuditLevel::Problem),
    ];
    for path in foreign_urdfs() {
        let all = audit(&load_robot(&path).unwrap().model);
        for (file, place, check, level) in known {
            if path.ends_with(file) {
                let found = all.iter().any(|f| (f.place.as_str(), f.check, f.level) == (place, check, level));
                assert!(found, "{file} {place} {check}: {all:?}");
            }
        }
    }
}

/// An arm of two links; `upper` has its elbow at 0.42 m.
fn upper_arm(inertia: [f64; 3], collision: &str) -> Vec<AuditFinding> {
    let [x, y, z] = inertia;
    let text = format!(
        r#"<robot name="r"><link name="base"/>
        <link name="upper"><inertial><origin xyz="0.02 0 0.14"/><mass value="6.8"/>
          <inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial>{collision}</link>
        <link name="fore"><inertial><origin xyz="0 0 0.1"/><mass value="2"/>
          <inertia ixx="0.02" iyy="0.02" izz="0.003" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="a" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
        <joint name="b" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0 -0.12 0.42"/></joint>
        </robot>"#
    );
    findings(&text).into_iter().filter(|finding| finding.level > AuditLevel::Info).collect()
}

#[test]
fn an_inertia_is_compared_with_the_link_length_and_the_collision_shapes() {
    let of = |size: &str, at: &str| {
        format!(r#"<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision>"#)
    };
    let around = of("0.1 0.1 0.42", "0 0 0.2");
    let mesh = r#"<collision><geometry><mesh filename="absent.stl"/></geometry></collision>"#;
    let correct = [0.12, 0.12, 0.02];
    for collision in ["", &around, mesh] {
        assert!(upper_arm(correct, collision).is_empty(), "{collision}");
    }
    // The radius of gyration is 0.62 m.
    for collision in ["", &around, mesh] {
        let found = upper_arm([0.013, 2.61, 2.62], collision);
        assert_eq!(found.len(), 1, "{collision}: {found:?}");
        assert_eq!((found[0].check, &*found[0].place), ("inertia-against-size", "link upper"));
        assert!(found[0].message.starts_with("has a radius of gyration of 0.621 m"), "{}", found[0].message);
    }
    // A large shape explains the same inertia.
    assert!(upper_arm([0.013, 2.61, 2.62], &of("1.2 0.1 0.1", "0.3 0 0")).is_empty());
    // 14 times less than the box; the shapes of several elements count together.
    let halves = of("0.1 0.1 0.21", "0 0 0.095") + &of("0.1 0.1 0.21", "0 0 0.305");
    for collision in [&around, &halves] {
        let found = upper_arm([0.00711, 0.00711, 0.0019], collision);
        assert_eq!(found.len(), 1, "{collision}: {found:?}");
        assert!(found[0].message.starts_with("has 13.8 times less inertia than a uniform box"), "{}", found[0].message);
    }
    // Nothing is known about the size of a single link with its joint at the base.
    let fan = |collision: &str| {
        let text = format!(
            r#"<robot name="r"><link name="base"/><link name="fan"><inertial><mass value="1"/>
            <inertia ixx="0.04" iyy="0.04" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>{collision}</link>
            <joint name="a" type="continuous"><parent link="base"/><child link="fan"/></joint></robot>"#
        );
        above_info(&findings(&text)).len()
    };
    assert_eq!((fan(""), fan(mesh), fan(&of("0.1 0.1 0.1", "0 0 0"))), (0, 0, 1));
}

#[test]
fn a_base_with_several_limbs_is_reported_as_fixed() {
    let leg = |name: &str| {
        format!(
            r#"<link name="{name}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
            <joint name="{name}_joint" type="continuous"><parent link="trunk"/><child link="{name}"/></joint>"#
        )
    };
    let notes = |mass: &str, legs: &str| -> Vec<AuditFinding> {
        let text = format!(r#"<robot name="r"><link name="trunk">{mass}</link>{legs}</robot>"#);
        findings(&text).into_iter().filter(|finding| finding.check == "base-fixed").collect()
    };
    let mass = r#"<inertial><mass value="7"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>"#;
    let both = leg("left") + &leg("right");
    let found = notes(mass, &both);
    assert_eq!((found.len(), found[0].level, &*found[0].place), (1, AuditLevel::Info, "link trunk"));
    assert!(found[0].message.contains("7.000 kg and 2 chains of joints"), "{}", found[0].message);
    assert!(notes(mass, &leg("left")).is_empty() && notes("", &both).is_empty());
}

#[test]
fn every_seeded_defect_is_found() {
    use AuditLevel::{Info, Problem, Warning};
    let upper = r#"<inertia ixx="0.006" ixy="0.0" ixz="0.0003" iyy="0.05" iyz="0" izz="0.051"/>"#;
    let shoulder = r#"<limit lower="-2.5" upper="2.5" velocity="3" effort="120"/>"#;
    let fore_inertial = &ARM[ARM.find(r#"<origin xyz="0.15 0.01 0"/>"#).unwrap()..];
    let fore_inertial = &fore_inertial[..fore_inertial.find("    </inertial>").unwrap()];
    // Original text, replacement, and expected finding.
    let defects: [(&str, &str, &str, &str, AuditLevel); 28] = [
        (r#"<mass value="3.25"/>"#, r#"<mass value="-3.25"/>"#, "mass-not-positive", "link upper", Problem),
        (r#"<mass value="3.25"/>"#, r#"<mass value="0"/>"#, "mass-not-positive", "link upper", Problem),
        (r#"<mass value="3.25"/>"#, r#"<mass value="3250"/>"#, "mass-absurd", "link upper", Warning),
        (
            upper,
            r#"<inertia ixx="-0.006" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.051"/>"#,
            "inertia-not-positive",
            "link upper",
            Problem,
        ),
        (
            upper,
            r#"<inertia ixx="0.006" ixy="0.03" ixz="0" iyy="0.05" iyz="0" izz="0.051"/>"#,
            "inertia-not-positive",
            "link upper",
            Problem,
        ),
        (
            upper,
            r#"<inertia ixx="0.006" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.08"/>"#,
            "triangle-inequality",
            "link upper",
            Problem,
        ),
        (
            upper,
            r#"<inertia ixx="0.006" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.0562"/>"#,
            "triangle-inequality",
            "link upper",
            Warning,
        ),
        // kg mm^2 and g mm^2 instead of kg m^2, and the inverse.
        (
            upper,
            r#"<inertia ixx="6000" ixy="0" ixz="300" iyy="50000" iyz="0" izz="51000"/>"#,
            "inertia-too-large",
            "link upper",
            Problem,
        ),
        (
            upper,
            r#"<inertia ixx="6e6" ixy="0" ixz="3e5" iyy="5e7" iyz="0" izz="5.1e7"/>"#,
            "inertia-too-large",
            "link upper",
            Problem,
        ),
        (
            upper,
            r#"<inertia ixx="6e-9" ixy="0" ixz="3e-10" iyy="5e-8" iyz="0" izz="5.1e-8"/>"#,
            "inertia-too-small",
            "link upper",
            Warning,
        ),
        (
            upper,
            r#"<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>"#,
            "inertia-too-small",
            "link upper",
            Warning,
        ),
        // 3.25 kg at 0.2 m: m r^2 = 0.13 is added about y and z, as for an inertia about the link's origin.
        (
            upper,
            r#"<inertia ixx="0.0063" ixy="0" ixz="-0.0062" iyy="0.1803" iyz="0" izz="0.181"/>"#,
            "inertia-at-origin",
            "link upper",
            Warning,
        ),
        (
            r#"<origin xyz="0.2 0 0.01"/>"#,
            r#"<origin xyz="200 0 10"/>"#,
            "centre-of-mass-outside",
            "link upper",
            Problem,
        ),
        (
            r#"<origin xyz="0.2 0 0.01"/>"#,
            r#"<origin xyz="1.5 0 0.01"/>"#,
            "centre-of-mass-outside",
            "link upper",
            Warning,
        ),
        (
            fore_inertial,
            r#"<mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>"#,
            "placeholder",
            "link fore",
            Warning,
        ),
        (
            fore_inertial,
            r#"<mass value="1"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/>"#,
            "placeholder",
            "link fore",
            Warning,
        ),
        (r#"<origin xyz="0.4 0 0"/>"#, r#"<origin xyz="400 0 0"/>"#, "length-unit", "joint elbow", Problem),
        (shoulder, "", "limit-missing", "joint shoulder", Warning),
        (shoulder, r#"<limit velocity="3" effort="120"/>"#, "limit-missing", "joint shoulder", Warning),
        (
            shoulder,
            r#"<limit lower="2.5" upper="-2.5" velocity="3" effort="120"/>"#,
            "limit-order",
            "joint shoulder",
            Problem,
        ),
        (
            shoulder,
            r#"<limit lower="0" upper="0" velocity="3" effort="120"/>"#,
            "limit-range",
            "joint shoulder",
            Warning,
        ),
        (
            shoulder,
            r#"<limit lower="-150" upper="150" velocity="3" effort="120"/>"#,
            "limit-unit",
            "joint shoulder",
            Warning,
        ),
        (
            shoulder,
            r#"<limit lower="-2" upper="2" velocity="180" effort="120"/>"#,
            "limit-unit",
            "joint shoulder",
            Warning,
        ),
        (
            shoulder,
            r#"<limit lower="-2" upper="2" velocity="0" effort="120"/>"#,
            "velocity-limit",
            "joint shoulder",
            Warning,
        ),
        (
            shoulder,
            r#"<limit lower="-2" upper="2" velocity="3" effort="0"/>"#,
            "effort-limit",
            "joint shoulder",
            Warning,
        ),
        (r#"lower="0" upper="0.8""#, r#"lower="0" upper="800""#, "limit-unit", "joint lift", Warning),
        (r#"damping="0.4""#, r#"damping="-0.4""#, "friction-negative", "joint shoulder", Problem),
        (
            shoulder,
            r#"<limit lower="-2" upper="2" velocity="3" effort="9"/><mimic joint="elbow"/>"#,
            "mimic",
            "joint shoulder",
            Info,
        ),
    ];
    for (old, new, check, place, level) in defects {
        assert_eq!(ARM.matches(old).count(), 1, "{old}");
        let found = findings(&ARM.replace(old, new));
        let hit = found.iter().any(|f| (f.check, f.place.as_str(), f.level) == (check, place, level));
        assert!(hit, "{check} at {place} for {new}: {found:?}");
    }
}

#[test]
fn unknown_and_equal_inertials_are_found() {
    // Without any inertial, all bodies are unknown and all joints are massless; the tip of the correct arm is only a
    // frame.
    let is = |check: &'static str, level: AuditLevel| move |f: &&AuditFinding| f.check == check && f.level == level;
    let mut bare = ARM.to_owned();
    while let Some(start) = bare.find("<inertial>") {
        let end = bare.find("</inertial>").unwrap() + "</inertial>".len();
        bare.replace_range(start..end, "");
    }
    let found = findings(&bare);
    assert_eq!(found.iter().filter(is("inertial-unknown", AuditLevel::Warning)).count(), 3);
    assert_eq!(found.iter().filter(is("massless-subtree", AuditLevel::Problem)).count(), 3);
    assert_eq!(findings(ARM).iter().filter(is("inertial-unknown", AuditLevel::Info)).count(), 1);

    let same = r#"<inertial><origin xyz="0.1 0 0"/><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.011" iyz="0" izz="0.012"/></inertial>"#;
    let mut equal = bare;
    for link in ["carriage", "upper", "fore"] {
        let open = format!("<link name=\"{link}\">");
        equal = equal.replace(&open, &format!("{open}{same}"));
    }
    assert_eq!(findings(&equal).iter().filter(is("equal-inertials", AuditLevel::Warning)).count(), 1);
}
