//! Seeded mistakes in known descriptions are found, explained and corrected; correct descriptions have none.

use crate::common::ARM;
use dynident_model::{SlipKind, Slips, StatedInertial, Vec3, read_urdf, rewrite_inertials, slips, stated_inertials};
use dynident_testing::repository;

/// Published descriptions without a mistake: arms, humanoids, fingers.
const ROBOTS: [&str; 9] =
    ["planar2r", "ur10", "panda", "panda_arm7", "iiwa14", "tx40", "g1_29dof", "talos_reduced", "talos_full_v2"];

fn text(robot: &str) -> String {
    std::fs::read_to_string(repository(&format!("robots/{robot}.urdf"))).unwrap()
}

fn look(text: &str) -> Slips {
    slips(text, &read_urdf(text).unwrap().model, None).unwrap()
}

/// The text with every inertial (selected by `chosen`) changed by `spoil`.
fn spoilt(text: &str, chosen: impl Fn(&StatedInertial) -> bool, spoil: impl Fn(&mut StatedInertial)) -> String {
    let stated = stated_inertials(text).unwrap();
    let mut wrong = stated.clone();
    wrong.iter_mut().filter(|one| one.mass_kg > 0.0 && chosen(one)).for_each(spoil);
    rewrite_inertials(text, &stated, &wrong).unwrap()
}

/// Asserts that only this mistake is found, and that its correction restores the original: numbers to 1e-12 of the
/// link's largest (about ten roundings), all other bytes exactly.
fn undone(robot: &str, wrong: &str, kind: SlipKind) {
    let original = text(robot);
    let found = look(wrong);
    let kinds: Vec<&str> = found.found.iter().map(|slip| slip.kind.name()).collect();
    assert_eq!(kinds, [kind.name()], "{robot}: {:#?}", found.found);
    assert!(!found.found[0].corrections.is_empty() && !found.found[0].evidence.is_empty());
    let repaired = rewrite_inertials(wrong, &found.stated, &found.corrected).unwrap();
    let numbers = |text: &str| -> Vec<Vec<f64>> {
        let stated = stated_inertials(text).unwrap();
        stated.iter().map(|one| one.com_m.into_iter().chain(one.moments).chain([one.mass_kg]).collect()).collect()
    };
    for (ours, theirs) in numbers(&repaired).iter().zip(numbers(&original)) {
        let size = theirs.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        for (ours, theirs) in ours.iter().zip(&theirs) {
            assert!((ours - theirs).abs() <= 1e-12 * size, "{robot}, {}: {ours} {theirs}", kind.name());
        }
    }
    // Without digits, signs, points and exponents, the texts are equal.
    let frame = |text: &str| -> String {
        text.chars().filter(|c| !(c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e' | 'E'))).collect()
    };
    assert_eq!(frame(&repaired), frame(&original), "{robot}");
    assert_eq!(repaired.lines().count(), original.lines().count());
}

#[test]
fn published_descriptions_have_no_slip() {
    for robot in ROBOTS {
        let found = look(&text(robot)).found;
        assert!(found.is_empty(), "{robot}: {found:#?}");
    }
    assert!(look(ARM).found.is_empty());
}

#[test]
fn turned_signs_are_turned_back() {
    for robot in ["ur10", "iiwa14", "panda", "talos_reduced"] {
        let turned = |one: &mut StatedInertial| one.moments = one.moments.map(|moment| 0.0 - moment);
        undone(robot, &spoilt(&text(robot), |_| true, turned), SlipKind::NegatedMoments);
    }
    let one = spoilt(&text("iiwa14"), |one| one.link == "iiwa_link_3", |one| one.mass_kg = -one.mass_kg);
    undone("iiwa14", &one, SlipKind::NegatedMoments);
}

#[test]
fn digits_of_a_turned_number_stay() {
    let original = text("iiwa14");
    let turned = |one: &mut StatedInertial| one.moments = one.moments.map(|moment| 0.0 - moment);
    let wrong = spoilt(&original, |one| one.link == "iiwa_link_2", turned);
    let found = look(&wrong);
    let repaired = rewrite_inertials(&wrong, &found.stated, &found.corrected).unwrap();
    // Zeros of the file stay zeros, so that all bytes are equal.
    assert_eq!(repaired, original);
}

#[test]
fn row_major_moments_are_found() {
    let walk = |one: &mut StatedInertial| {
        let [xx, xy, xz, yy, yz, _] = one.moments;
        one.moments = [xx, xy, xz, xy, yy, yz];
    };
    for robot in ["iiwa14", "panda_arm7", "g1_29dof"] {
        let wrong = spoilt(&text(robot), |one| one.moments != [0.0; 6], walk);
        let found = look(&wrong);
        let slip = found.found.iter().find(|slip| slip.kind == SlipKind::RowMajor).expect(robot);
        assert!(slip.message.contains("iyy repeats ixy") && slip.message.contains("izz is not in the file"));
        // Numbers that the file does not contain are not invented.
        assert!(slip.corrections.is_empty());
        let broken = found.stated.iter().filter(|one| one.mass_kg > 0.0).count();
        assert!(2 * slip.links.len() > broken, "{robot}: {} of {broken}: {:#?}", slip.links.len(), found.found);
    }
}

#[test]
fn a_lower_triangle_is_read_as_one() {
    let walk = |one: &mut StatedInertial| {
        let [xx, xy, xz, yy, yz, zz] = one.moments;
        one.moments = [xx, xy, yy, xz, yz, zz];
    };
    for robot in ["ur10", "iiwa14", "panda_arm7"] {
        undone(robot, &spoilt(&text(robot), |one| one.moments != [0.0; 6], walk), SlipKind::LowerTriangle);
    }
}

/// Moves the moments to the link's origin, in the axes of `<origin>`.
fn moved(one: &mut StatedInertial) {
    let c = one.axes.transpose_mul_vec(Vec3(one.com_m)).0;
    let (m, square) = (one.mass_kg, c.iter().map(|x| x * x).sum::<f64>());
    let mut place = 0;
    for a in 0..3 {
        for b in a..3 {
            one.moments[place] += m * (if a == b { square } else { 0.0 } - c[a] * c[b]);
            place += 1;
        }
    }
}

#[test]
fn moments_about_the_origin_are_moved() {
    for robot in ["iiwa14", "ur10", "planar2r", "panda_arm7"] {
        let wrong = spoilt(&text(robot), |one| one.moments != [0.0; 6], moved);
        let found = look(&wrong);
        let kinds: Vec<&str> = found.found.iter().map(|slip| slip.kind.name()).collect();
        assert_eq!(kinds, ["about-origin"], "{robot}: {:#?}", found.found);
        let original = stated_inertials(&text(robot)).unwrap();
        for (ours, theirs) in found.corrected.iter().zip(&original) {
            let size = theirs.moments.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            for (ours, theirs) in ours.moments.iter().zip(theirs.moments) {
                // The subtracted term may be a hundred times the result.
                assert!((ours - theirs).abs() <= 1e-12 * size, "{robot}: {ours} {theirs}");
            }
        }
    }
}

#[test]
fn millimetres_and_grams_are_converted_back() {
    let times = |mass: f64, com: f64, moments: f64| {
        move |one: &mut StatedInertial| {
            one.mass_kg *= mass;
            one.com_m = one.com_m.map(|x| x * com);
            one.moments = one.moments.map(|x| x * moments);
        }
    };
    for robot in ["ur10", "iiwa14", "panda", "tx40", "g1_29dof"] {
        let original = text(robot);
        for (mass, com, moments) in
            [(1.0, 1.0, 1e6), (1.0, 1.0, 1e9), (1e3, 1.0, 1.0), (1.0, 1e3, 1.0), (1.0, 1e3, 1e6), (1e3, 1e3, 1e9)]
        {
            undone(robot, &spoilt(&original, |_| true, times(mass, com, moments)), SlipKind::Units);
        }
    }
    // Only one link.
    let wrong = spoilt(&text("iiwa14"), |one| one.link == "iiwa_link_4", times(1.0, 1.0, 1e6));
    undone("iiwa14", &wrong, SlipKind::Units);
    let wrong = spoilt(&text("iiwa14"), |one| one.link == "iiwa_link_4", times(1.0, 1e3, 1.0));
    undone("iiwa14", &wrong, SlipKind::Units);
}

#[test]
fn defaults_are_reported_and_not_corrected() {
    let default = |one: &mut StatedInertial| one.moments = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
    let found = look(&spoilt(&text("iiwa14"), |_| true, default)).found;
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].kind == SlipKind::Defaults && found[0].corrections.is_empty());
    assert_eq!(found[0].links.len(), 8);
}

#[test]
fn a_stated_total_finds_the_wrong_mass() {
    let original = text("iiwa14");
    let model = read_urdf(&original).unwrap().model;
    let total: f64 = stated_inertials(&original).unwrap().iter().map(|one| one.mass_kg).sum();
    assert!(slips(&original, &model, Some(total)).unwrap().found.is_empty());
    // A misplaced decimal point.
    let wrong = spoilt(&original, |one| one.link == "iiwa_link_2", |one| one.mass_kg *= 10.0);
    let found = slips(&wrong, &model, Some(total)).unwrap();
    assert_eq!(found.found.len(), 1, "{:#?}", found.found);
    assert_eq!(found.found[0].links, ["iiwa_link_2"]);
    assert_eq!(
        rewrite_inertials(&wrong, &found.stated, &found.corrected).unwrap().lines().count(),
        original.lines().count()
    );
    assert_eq!(found.corrected[2].mass_kg, stated_inertials(&original).unwrap()[2].mass_kg);
    // With the total in a comment.
    let commented = wrong.replacen("<link", &format!("<!-- total mass: {total} kg -->\n<link"), 1);
    assert_eq!(look(&commented).found[0].links, ["iiwa_link_2"]);
    // A total that nothing explains.
    let unclear = slips(&original, &model, Some(0.83 * total)).unwrap();
    assert!(
        unclear.found[0].corrections.is_empty() && unclear.found[0].message.contains("weigh"),
        "{:#?}",
        unclear.found
    );
    assert_eq!(unclear.corrected, unclear.stated);
}

#[test]
fn different_twins_are_reported() {
    let original = text("g1_29dof");
    let knee = |one: &StatedInertial| one.link == "left_knee_link";
    // One wrong number makes the body impossible; its twin gives the correction.
    let wrong = spoilt(&original, knee, |one| one.moments[0] *= 10.0);
    let found = look(&wrong);
    let kinds: Vec<&str> = found.found.iter().map(|slip| slip.kind.name()).collect();
    assert_eq!(kinds, ["twins"], "{:#?}", found.found);
    assert_eq!(found.found[0].corrections.len(), 1, "{:#?}", found.found);
    let (to, before) = (found.found[0].corrections[0].to, stated_inertials(&original).unwrap());
    let before = before.iter().find(|one| knee(one)).unwrap().moments[0];
    // The twins of this robot agree to one percent.
    assert!((to / before - 1.0).abs() < 0.01, "{to} {before}");
    // Both bodies are possible, so that nothing is changed.
    let found = look(&spoilt(&original, knee, |one| one.mass_kg *= 1.3));
    assert!(found.found.len() == 1 && found.found[0].kind == SlipKind::Twins, "{:#?}", found.found);
    assert!(found.found[0].corrections.is_empty() && found.found[0].evidence.contains("mass"));
}

#[test]
fn unexplained_inertials_are_reported() {
    let wrong =
        spoilt(&text("ur10"), |one| one.link == "forearm_link", |one| one.moments = [1.0, 0.1, 0.2, 5.0, 0.1, 1.0]);
    let found = look(&wrong).found;
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(
        found[0].kind == SlipKind::Unexplained && found[0].corrections.is_empty() && found[0].links == ["forearm_link"]
    );
}

/// A heavy base on a short column, as of large industrial arms: its size is not known from the joints, so that its mass
/// is not compared with their distance.
#[test]
fn a_heavy_base_is_not_in_grams() {
    let arm = text("ur10");
    let base = r#"<link name="base_link"><inertial><mass value="226"/><origin xyz="0 0 0.1"/>
        <inertia ixx="13" ixy="0" ixz="0" iyy="13" iyz="0" izz="13"/></inertial></link>"#;
    let from = arm.find("<link name=\"base_link\"").unwrap();
    let to = from + arm[from..].find("</link>").unwrap() + "</link>".len();
    let heavy = format!("{}{base}{}", &arm[..from], &arm[to..]);
    let found = look(&heavy);
    assert!(found.found.iter().all(|slip| slip.corrections.is_empty()), "{:#?}", found.found);
}

/// A correct light link far from its origin: without the parallel-axis term it would have less inertia than osmium.
#[test]
fn a_correction_never_gives_a_body_that_the_audit_reports() {
    let arm = text("ur10");
    let far = |one: &mut StatedInertial| {
        (one.mass_kg, one.com_m) = (0.7, [0.0, 0.0, 0.08]);
        let [square, small] = [0.7 * 0.08 * 0.08, 1e-7];
        one.moments = [square + small, 0.0, 0.0, square + small, 0.0, small];
    };
    let spoilt = spoilt(&arm, |one| one.link == "wrist_3_link", far);
    let found = look(&spoilt);
    assert!(found.found.iter().all(|slip| slip.corrections.is_empty()), "{:#?}", found.found);
    assert_eq!(found.stated, found.corrected);
}
