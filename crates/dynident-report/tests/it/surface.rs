//! Surfaces of bodies: closed, oriented, of the right volume, and coarser within a budget.
use core::f64::consts::PI;
use dynident_report::{Scene, SceneBody, Surface};

const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Area of a polygon with 24 corners on a unit circle, relative to the circle's.
const POLYGON: f64 = 0.988_615_929_465;

/// Every edge of a closed surface belongs to two triangles, in opposite directions.
fn assert_closed(surface: &Surface) {
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for [a, b, c] in &surface.triangles {
        edges.extend([[*a, *b], [*b, *c], [*c, *a]]);
    }
    edges.sort_unstable();
    for [a, b] in &edges {
        assert!(edges.binary_search(&[*b, *a]).is_ok(), "edge {a} {b} is open");
    }
}

#[test]
fn volumes_are_those_of_geometry() {
    let box_ = Surface::cuboid([0.2, 0.3, 0.5]);
    assert!((box_.volume_m3() - 0.03).abs() < 1e-15);
    let cylinder = Surface::cylinder(0.2, 0.5);
    assert!((cylinder.volume_m3() - POLYGON * PI * 0.04 * 0.5).abs() < 1e-12);
    // Twelve rings of a sphere miss about 2 % of its volume.
    let capsule = Surface::capsule(0.2, 0.5);
    let exact = PI * 0.04 * 0.5 + 4.0 / 3.0 * PI * 0.008;
    assert!(capsule.volume_m3() < exact && capsule.volume_m3() > 0.97 * exact);
    for surface in [box_, cylinder, capsule, Surface::capsule(0.1, 0.0)] {
        assert_closed(&surface);
    }
}

#[test]
fn a_rod_reaches_from_end_to_end() {
    let (from, to, radius) = ([0.1, -0.2, 0.3], [0.4, 0.2, 0.3], 0.05);
    let rod = Surface::rod(from, to, radius);
    assert_closed(&rod);
    assert!(rod.volume_m3() > 0.0);
    let distance = |point: &[f64; 3]| {
        let along = [0.6, 0.8, 0.0];
        let offset: [f64; 3] = std::array::from_fn(|a| point[a] - from[a]);
        let share = (0..3).map(|a| along[a] * offset[a]).sum::<f64>().clamp(0.0, 0.5);
        (0..3).map(|a| (offset[a] - share * along[a]).powi(2)).sum::<f64>().sqrt()
    };
    for vertex in &rod.vertices_m {
        assert!((distance(vertex) - radius).abs() < 1e-9, "{vertex:?}");
    }
}

#[test]
fn a_coarser_surface_keeps_its_extent() {
    let mut fine = Surface::default();
    for k in 0..200 {
        let angle = f64::from(k) * 0.1;
        fine.join(&Surface::capsule(0.05, 0.1).placed(&UPRIGHT, [angle.cos(), angle.sin(), 0.01 * f64::from(k)]));
    }
    let coarse = fine.within(5000);
    assert!(coarse.triangles.len() <= 5000 && coarse.triangles.len() > 2000, "{}", coarse.triangles.len());
    let [[low, high], [least, most]] = [fine.bounds_m(), coarse.bounds_m()];
    for axis in 0..3 {
        assert!((low[axis] - least[axis]).abs() < 0.05 && (high[axis] - most[axis]).abs() < 0.05);
    }
    assert_eq!(fine.within(fine.triangles.len()), fine);
}

#[test]
fn the_still_picture_shows_the_sides_that_face_the_viewer() {
    let body = SceneBody {
        name: "box".into(),
        surface: Surface::cuboid([1.0; 3]),
        pose: (UPRIGHT, [0.0; 3]),
        ..SceneBody::default()
    };
    let scene = Scene { title: "A box".into(), bodies: vec![body], ..Scene::default() };
    let picture = scene.svg(true).unwrap();
    // Three of six sides, two triangles each.
    assert_eq!(picture.matches("<path").count(), 6, "{picture}");
    assert!(picture.contains("aria-label=\"A box\""));
    // A robot without any surface has a picture, too.
    assert!(Scene { bodies: Vec::new(), ..scene }.svg(false).unwrap().starts_with("<svg"));
}
