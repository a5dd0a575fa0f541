//! `<geom>`: the mass and inertia of its solid, and its shape for collision checking.

use super::classes::Stated;
use super::compiler::Compiler;
use super::fault::{MjcfError, MjcfFault};
use super::meshes::Meshes;
use super::orientation::{from_z, place};
use crate::collision::{CollisionGeometry, CollisionShape};
use crate::inertial::InertialParameters;
use crate::spatial::{Mat3, Transform, Vec3};
use crate::xml::shortened;
use core::f64::consts::PI;

/// MuJoCo's default density of a geom, kg/m³ (water).
const DEFAULT_DENSITY_KG_M3: f64 = 1000.0;

#[derive(Clone, Debug, PartialEq)]
pub(super) enum GeomMass {
    /// No mass: a plane, a geom of mass zero, or a geom of a group that is not included.
    Massless,
    /// Known inertial in the body's frame.
    Known(InertialParameters),
    /// Mass properties of a mesh, with its pose in the body's frame.
    Mesh { name: String, placement: Transform, mass: MassOrDensity },
    /// Inertial is unknown, with the reason.
    Unknown(&'static str),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MassOrDensity {
    /// Mass, kg.
    Mass(f64),
    /// Density, kg/m³ (kg/m² for a shell).
    Density(f64),
}

impl GeomMass {
    /// Inertial in the body's frame (`None` for a geom without mass), or the reason why it is unknown.
    pub(super) fn inertial(&self, meshes: &mut Meshes<'_>) -> Result<Option<InertialParameters>, String> {
        match self {
            Self::Massless => Ok(None),
            Self::Known(inertial) => Ok(Some(*inertial)),
            Self::Unknown(why) => Err(format!("{why}, which is not supported")),
            Self::Mesh { name, placement, mass } => {
                let mesh =
                    meshes.inertia(name).map_err(|why| format!("follows from mesh `{}`: {why}", shortened(name)))?;
                let density = match mass {
                    MassOrDensity::Mass(mass) => mass / mesh.size,
                    MassOrDensity::Density(density) => *density,
                };
                let at_com = mesh.inertia_at_centre.scale(density);
                let own = InertialParameters::from_centre_of_mass(density * mesh.size, mesh.centre_m, &at_com);
                Ok(Some(own.expressed_in(placement)))
            }
        }
    }
}

pub(super) struct Geom {
    pub(super) mass: GeomMass,
    pub(super) shape: Option<CollisionShape>,
}

/// Solids, with half sizes, or radius and half length.
#[derive(Clone, Copy)]
enum Solid {
    Sphere,
    Capsule,
    Cylinder,
    Box,
    Ellipsoid,
}

/// Reads a geom of a body; `body_from_frame` is the pose of the surrounding `<frame>`.
pub(super) fn geom(
    stated: &Stated<'_>,
    body_from_frame: &Transform,
    compiler: &Compiler,
    meshes: &Meshes<'_>,
) -> Result<Geom, MjcfError> {
    let kind = stated.get("type").map_or("sphere", |kind| kind.value.trim());
    let group = stated.number("group")?.unwrap_or(0.0);
    let (contype, conaffinity) = (stated.number("contype")?, stated.number("conaffinity")?);
    let collides = contype != Some(0.0) || conaffinity != Some(0.0);
    let mass = stated.size("mass")?;
    let density = stated.size("density")?.unwrap_or(DEFAULT_DENSITY_KG_M3);
    let counts = compiler.groups[0] <= group && group <= compiler.groups[1];
    let weighs = counts && mass.unwrap_or(density) != 0.0;
    let unknown = |why, shape| Geom { mass: if weighs { GeomMass::Unknown(why) } else { GeomMass::Massless }, shape };
    let unsupported = |what: &str| {
        let geometry = CollisionGeometry::Unsupported { what: what.to_owned() };
        collides.then_some(CollisionShape { placement: Transform::IDENTITY, geometry })
    };
    let solid = match kind {
        "plane" | "hfield" => return Ok(Geom { mass: GeomMass::Massless, shape: None }),
        "mesh" => {
            let name = stated.get("mesh").map_or("", |mesh| &mesh.value);
            let placement = body_from_frame.then(&place(stated, compiler)?);
            let file = meshes.get(name).and_then(|mesh| Some((mesh, mesh.file.clone()?)));
            let shape = match file {
                // The file gives the shape of a mesh only if the mesh is not moved in its own frame.
                Some((mesh, file)) if mesh.reference == Transform::IDENTITY => collides.then_some(CollisionShape {
                    placement,
                    geometry: CollisionGeometry::Mesh { file, scale: mesh.scale },
                }),
                _ => unsupported(&format!(
                    "mesh `{}` without a file, or moved in its own frame (`refpos`, `refquat`)",
                    shortened(name)
                )),
            };
            if !weighs {
                return Ok(Geom { mass: GeomMass::Massless, shape });
            }
            if stated.flag("shellinertia")? == Some(true) {
                return Ok(unknown("follows from `shellinertia` of a mesh geom, which MuJoCo refuses", shape));
            }
            let mass = mass.map_or(MassOrDensity::Density(density), MassOrDensity::Mass);
            return Ok(Geom { mass: GeomMass::Mesh { name: name.to_owned(), placement, mass }, shape });
        }
        "sdf" => {
            return Ok(unknown("follows from a signed distance field", unsupported("geom of the type `sdf`")));
        }
        _ if stated.get("mesh").is_some() => {
            return Ok(unknown("follows from a solid fitted to a mesh", unsupported("geom fitted to a mesh")));
        }
        "sphere" => Solid::Sphere,
        "capsule" => Solid::Capsule,
        "cylinder" => Solid::Cylinder,
        "box" => Solid::Box,
        "ellipsoid" => Solid::Ellipsoid,
        _ => {
            let expected = "sphere, capsule, ellipsoid, cylinder, box, mesh, plane, hfield or sdf";
            return Err(match stated.get("type") {
                Some(attribute) => stated.word_fault(attribute, expected),
                None => stated.fault(MjcfFault::MissingAttribute { element: "geom".to_owned(), attribute: "type" }),
            });
        }
    };
    let (frame_from_geom, size) = placed(stated, compiler, solid)?;
    let placement = body_from_frame.then(&frame_from_geom);
    let geometry = collides.then(|| shape(solid, size));
    let shape = geometry.map(|geometry| CollisionShape { placement, geometry });
    if stated.flag("shellinertia")? == Some(true) {
        return Ok(unknown("follows from a shell", shape));
    }
    if !weighs {
        return Ok(Geom { mass: GeomMass::Massless, shape });
    }
    let mass = mass.unwrap_or_else(|| density * volume(solid, size));
    let [x, y, z] = moments(solid, size, mass);
    let at_com = Mat3([[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]);
    let own = InertialParameters::from_centre_of_mass(mass, Vec3::ZERO, &at_com);
    Ok(Geom { mass: GeomMass::Known(own.expressed_in(&placement)), shape })
}

/// Pose of the geom in its frame, and its half sizes (or radius, half length, and zero).
fn placed(stated: &Stated<'_>, compiler: &Compiler, solid: Solid) -> Result<(Transform, [f64; 3]), MjcfError> {
    let given = stated.numbers_between("size", 1, 3)?.unwrap_or_default();
    let mut size = [0.0; 3];
    size[..given.len()].copy_from_slice(&given);
    let (kind, needed) = match solid {
        Solid::Sphere => ("sphere", 1),
        Solid::Capsule => ("capsule", 2),
        Solid::Cylinder => ("cylinder", 2),
        Solid::Box => ("box", 3),
        Solid::Ellipsoid => ("ellipsoid", 3),
    };
    let ends = stated.numbers::<6>("fromto")?.filter(|_| !matches!(solid, Solid::Sphere));
    let transform = match ends {
        Some([a, b, c, d, e, f]) => {
            if stated.get("pos").is_some() {
                return Err(stated.fault(MjcfFault::Both {
                    element: "geom".to_owned(),
                    first: "fromto",
                    second: "pos",
                }));
            }
            let (from, to) = (Vec3([a, b, c]), Vec3([d, e, f]));
            let along = from - to;
            size[1] = 0.5 * along.norm();
            if matches!(solid, Solid::Box | Solid::Ellipsoid) {
                (size[2], size[1]) = (size[1], size[0]);
            }
            let z = stated.unit(along, "fromto").map_err(|fault| stated.fault(fault))?;
            Transform { rotation: from_z(z), translation: (from + to).scale(0.5) }
        }
        None => place(stated, compiler)?,
    };
    if size[..needed].iter().any(|&size| size <= 0.0) {
        let place = stated.get("size").map_or(stated.place, |size| size.place);
        return Err(stated.document.fault(place, MjcfFault::Size { kind, needed }));
    }
    Ok((transform, size))
}

fn volume(solid: Solid, size: [f64; 3]) -> f64 {
    let [a, b, c] = size;
    match solid {
        Solid::Sphere => 4.0 / 3.0 * PI * a * a * a,
        Solid::Capsule => PI * a * a * (2.0 * b + 4.0 / 3.0 * a),
        Solid::Cylinder => PI * a * a * 2.0 * b,
        Solid::Box => 8.0 * a * b * c,
        Solid::Ellipsoid => 4.0 / 3.0 * PI * a * b * c,
    }
}

/// Principal moments about the centre of mass in the geom's axes, kg m².
fn moments(solid: Solid, size: [f64; 3], mass: f64) -> [f64; 3] {
    let [a, b, c] = size;
    match solid {
        Solid::Sphere => [0.4 * mass * a * a; 3],
        Solid::Capsule => {
            let length = 2.0 * b;
            let ends = mass * 4.0 * a / (4.0 * a + 3.0 * length);
            let middle = mass - ends;
            // Two hemispheres with centres of mass 3/8 of the radius beyond the ends.
            let across = middle * (3.0 * a * a + length * length) / 12.0
                + ends * (0.4 * a * a + length * (3.0 * a + 2.0 * length) / 8.0);
            [across, across, 0.5 * middle * a * a + 0.4 * ends * a * a]
        }
        Solid::Cylinder => {
            let across = mass * (3.0 * a * a + 4.0 * b * b) / 12.0;
            [across, across, 0.5 * mass * a * a]
        }
        Solid::Box => [b * b + c * c, a * a + c * c, a * a + b * b].map(|sum| mass * sum / 3.0),
        Solid::Ellipsoid => [b * b + c * c, a * a + c * c, a * a + b * b].map(|sum| mass * sum / 5.0),
    }
}

fn shape(solid: Solid, size: [f64; 3]) -> CollisionGeometry {
    let [a, b, c] = size;
    match solid {
        Solid::Sphere => CollisionGeometry::Sphere { radius_m: a },
        Solid::Capsule => CollisionGeometry::Capsule { radius_m: a, length_m: 2.0 * b },
        Solid::Cylinder => CollisionGeometry::Cylinder { radius_m: a, length_m: 2.0 * b },
        // An ellipsoid is replaced by its bounding box, so that collision checks are conservative.
        Solid::Box | Solid::Ellipsoid => CollisionGeometry::Box { size_m: [2.0 * a, 2.0 * b, 2.0 * c] },
    }
}
