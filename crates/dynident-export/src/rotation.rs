//! Conversion of rotations to quaternions and Z-Y-X angles.

use dynident_model::Mat3;

/// The unit quaternion w x y z of a rotation, computed from its largest entry (Shepperd 1978).
pub(crate) fn quaternion(r: &Mat3) -> [f64; 4] {
    let m = &r.0;
    let trace = m[0][0] + m[1][1] + m[2][2];
    let squares = [trace, m[0][0], m[1][1], m[2][2]];
    let largest = (1..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let q = match largest {
        0 => [1.0 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]],
        k => {
            let (i, j, l) = (k - 1, k % 3, (k + 1) % 3);
            let mut q = [m[l][j] - m[j][l], 0.0, 0.0, 0.0];
            q[1 + i] = 1.0 + m[i][i] - m[j][j] - m[l][l];
            q[1 + j] = m[i][j] + m[j][i];
            q[1 + l] = m[i][l] + m[l][i];
            q
        }
    };
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.map(|x| x / norm)
}

/// Angles A, B, C in rad with `R = Rz(A) Ry(B) Rx(C)`; C is zero if B is ±90°.
pub(crate) fn z_y_x_angles(r: &Mat3) -> [f64; 3] {
    let r = &r.0;
    let level = r[0][0].hypot(r[1][0]);
    let b = (-r[2][0]).atan2(level);
    // Below this limit the sines of the other two angles are rounding errors.
    if level < 1e-12 {
        return [(-r[0][1]).atan2(r[1][1]), b, 0.0];
    }
    [r[1][0].atan2(r[0][0]), b, r[2][1].atan2(r[2][2])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    #[test]
    fn they_give_the_rotation_back() {
        let mut random = Random::new(3);
        for _ in 0..200 {
            let rotation = Mat3::from_axis_angle(random.direction(), random.uniform(-3.2, 3.2));
            let [w, x, y, z] = quaternion(&rotation);
            let [a, b, c] = z_y_x_angles(&rotation);
            for back in [Mat3::from_quaternion([x, y, z, w]), Mat3::from_roll_pitch_yaw(c, b, a)] {
                let off = (back - rotation).0.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
                assert!(off < 1e-14, "{off}");
            }
        }
    }
}
