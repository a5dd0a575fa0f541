//! A payload in the formats of four controller manufacturers.

use crate::rotation::{quaternion, z_y_x_angles};
use dynident_model::{InertialParameters, Mat3, Vec3};
use dynident_text::identifier;
use nalgebra::Matrix3;

const MAX_RAPID_NAME_LENGTH: usize = 32;

/// Manufacturer of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControllerBrand {
    /// Universal Robots: `set_target_payload` of URScript.
    UniversalRobots,
    /// Franka: JSON of the end effector in Desk, the numbers of `setLoad` of libfranka.
    Franka,
    /// KUKA: `LOAD_DATA` of KRL.
    Kuka,
    /// ABB: `loaddata` of RAPID.
    Abb,
}

/// A physically consistent payload, in the frame of the flange (or of the link that carries it).
#[derive(Clone, Debug, PartialEq)]
pub struct PayloadBody {
    /// Name of the payload.
    pub name: String,
    /// Mass, centre of mass and inertia in the frame of the link.
    pub inertial: InertialParameters,
}

/// Returns the command, declaration or JSON that sets the payload of a controller; `None` for a body without mass or
/// with numbers that are not finite.
///
/// Units and axes depend on the controller. UR and Franka use the inertia about the centre of mass in kg m² along the
/// axes of the flange (UR in the order xx, yy, zz, xy, xz, yz; Franka all nine entries). KUKA and ABB use the centre
/// of mass in mm and principal moments. The principal axes are angles A, B, C in degrees about Z, Y', X'' (KUKA) or a
/// quaternion (ABB). `comment` contains lines for a comment before the command; JSON has no comments.
pub fn payload_command(payload: &PayloadBody, reader: ControllerBrand, comment: &[String]) -> Option<String> {
    let (mass, com) = (payload.inertial.mass_kg(), payload.inertial.com_m()?.0);
    let i = payload.inertial.inertia_at_com()?.0;
    let ([x, y, z], mut name) = (com, identifier(&payload.name));
    name.truncate(MAX_RAPID_NAME_LENGTH);
    if ![mass].iter().chain(&com).chain(i.as_flattened()).all(|x| x.is_finite()) {
        return None;
    }
    let mm = com.map(|x| 1e3 * x);
    let mark = match reader {
        ControllerBrand::UniversalRobots => Some('#'),
        ControllerBrand::Franka => None,
        ControllerBrand::Kuka => Some(';'),
        ControllerBrand::Abb => Some('!'),
    };
    let lines = comment.iter().map(|line| mark.map(|mark| format!("{mark} {}\n", one_line(line))).unwrap_or_default());
    let head: String = lines.collect();
    let command = match reader {
        ControllerBrand::UniversalRobots => format!(
            "set_target_payload({mass:?}, [{x:?}, {y:?}, {z:?}], [{:?}, {:?}, {:?}, {:?}, {:?}, {:?}])\n",
            i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2]
        ),
        ControllerBrand::Franka => format!(
            "{{\"mass\": {mass:?}, \"centerOfMass\": [{x:?}, {y:?}, {z:?}], \"inertia\": [{:?}, {:?}, {:?}, {:?}, {:?}, {:?}, {:?}, {:?}, {:?}]}}\n",
            i[0][0], i[1][0], i[2][0], i[0][1], i[1][1], i[2][1], i[0][2], i[1][2], i[2][2]
        ),
        ControllerBrand::Kuka => {
            let (moments, axes) = principal(&i);
            let [a, b, c] = z_y_x_angles(&axes).map(f64::to_degrees);
            format!(
                "LOAD_DATA[1]={{M {mass:.6},CM {{X {:.6},Y {:.6},Z {:.6},A {a:.6},B {b:.6},C {c:.6}}},J {{X {:.9},Y {:.9},Z {:.9}}}}}\n",
                mm[0], mm[1], mm[2], moments[0], moments[1], moments[2]
            )
        }
        ControllerBrand::Abb => {
            let (moments, axes) = principal(&i);
            let [q1, q2, q3, q4] = quaternion(&axes);
            format!(
                "PERS loaddata {name}:=[{mass:.6},[{:.6},{:.6},{:.6}],[{q1:.9},{q2:.9},{q3:.9},{q4:.9}],{:.9},{:.9},{:.9}];\n",
                mm[0], mm[1], mm[2], moments[0], moments[1], moments[2]
            )
        }
    };
    Some(head + &command)
}

/// Converts a text to one line of ASCII for a comment in a controller's language.
fn one_line(text: &str) -> String {
    dynident_text::comment(&text.replace('±', "+-"))
        .chars()
        .map(|c| if c.is_ascii_graphic() || c == ' ' { c } else { '?' })
        .collect()
}

/// Principal moments, and the right-handed rotation whose columns are the principal axes.
fn principal(inertia: &[[f64; 3]; 3]) -> ([f64; 3], Mat3) {
    let eigen = Matrix3::from_fn(|a, b| inertia[a][b]).symmetric_eigen();
    let v = eigen.eigenvectors;
    let first = Vec3([v[(0, 0)], v[(1, 0)], v[(2, 0)]]);
    let second = Vec3([v[(0, 1)], v[(1, 1)], v[(2, 1)]]);
    let third = first.cross(second);
    let axes = Mat3(core::array::from_fn(|row| [first[row], second[row], third[row]]));
    (eigen.eigenvalues.into(), axes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    fn box_() -> PayloadBody {
        let inertia = Mat3([[0.02, 0.001, -0.002], [0.001, 0.03, 0.003], [-0.002, 0.003, 0.04]]);
        let inertial = InertialParameters::from_centre_of_mass(2.0, Vec3([0.01, -0.02, 0.08]), &inertia);
        PayloadBody { name: "box 1".to_owned(), inertial }
    }

    /// All numbers of a text whose names contain no digits.
    fn numbers(text: &str) -> Vec<f64> {
        text.split(|c: char| !(c.is_ascii_digit() || "+-.e".contains(c))).filter_map(|word| word.parse().ok()).collect()
    }

    #[test]
    fn axes_of_the_flange() {
        let close = |text: &str, expected: &[f64]| {
            let found = numbers(text);
            assert_eq!(found.len(), expected.len(), "{text}");
            // Rounding error of the parallel-axis theorem in both directions.
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{text}");
        };
        let ur = payload_command(&box_(), ControllerBrand::UniversalRobots, &[]).unwrap();
        close(
            ur.strip_prefix("set_target_payload").unwrap(),
            &[2.0, 0.01, -0.02, 0.08, 0.02, 0.03, 0.04, 0.001, -0.002, 0.003],
        );
        let franka = payload_command(&box_(), ControllerBrand::Franka, &[]).unwrap();
        let matrix = [0.02, 0.001, -0.002, 0.001, 0.03, 0.003, -0.002, 0.003, 0.04];
        let values = [&[2.0, 0.01, -0.02, 0.08][..], &matrix].concat();
        close(&franka.replace(|c: char| c.is_alphabetic(), " "), &values);
    }

    #[test]
    fn principal_axes_turn_back_to_the_inertia() {
        let mut random = Random::new(5);
        for _ in 0..100 {
            let body = random.body();
            let com = body.com_m().unwrap();
            let payload = PayloadBody { name: "p".to_owned(), inertial: body };
            let inertia = body.inertia_at_com().unwrap();
            let kuka = payload_command(&payload, ControllerBrand::Kuka, &[]).unwrap();
            let n = numbers(kuka.strip_prefix("LOAD_DATA[1]").unwrap());
            let kuka_axes = Mat3::from_roll_pitch_yaw(n[6].to_radians(), n[5].to_radians(), n[4].to_radians());
            let abb = payload_command(&payload, ControllerBrand::Abb, &[]).unwrap();
            let m = numbers(&abb);
            let abb_axes = Mat3::from_quaternion([m[5], m[6], m[7], m[4]]);
            for (axes, moments, numbers) in [(kuka_axes, &n[7..10], &n), (abb_axes, &m[8..11], &m)] {
                let diagonal =
                    Mat3(core::array::from_fn(|a| core::array::from_fn(|b| if a == b { moments[a] } else { 0.0 })));
                let back = axes.mul_mat(&diagonal).mul_mat(&axes.transpose());
                let off = (back - inertia).0.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
                // Moments below one have nine decimals, degrees have six.
                assert!(off < 1e-7, "{off}");
                assert!((numbers[0] - body.mass_kg()).abs() < 1e-6);
                assert!((0..3).all(|k| (numbers[1 + k] - 1e3 * com[k]).abs() < 1e-6));
            }
        }
    }

    #[test]
    fn nothing_is_no_payload() {
        let nothing = PayloadBody { name: String::new(), inertial: InertialParameters::ZERO };
        assert_eq!(payload_command(&nothing, ControllerBrand::Abb, &[]), None);
        let mut huge = box_();
        huge.inertial.0[1] = 1e308;
        assert_eq!(payload_command(&huge, ControllerBrand::Abb, &[]), None);
    }
}
