//! The robot in three dimensions.

use crate::error::Error;
use crate::result::{ResultFile, StoredModel};
use dynident_dynamics::{Workspace, body_placements};
use dynident_excitation::limits::{CAPSULE_RADIUS_SHARE, arm_length_m, body_capsules, neutral_posture};
use dynident_model::collision::{CollisionGeometry, CollisionShape, MeshError, read_mesh};
use dynident_model::{Body, InertialParameters, JointKind, Model, Transform, Vec3};
use dynident_report::{BodyMotion, Ellipsoid, Scene, SceneBody, Surface};
use std::path::{Path, PathBuf};

/// A robot with the folder of its description, which contains the meshes: all data that a picture needs.
#[derive(Clone, Debug)]
pub struct RobotAppearance {
    model: Model,
    folder: PathBuf,
}

impl RobotAppearance {
    /// Creates the appearance from the model of the robot description at `path`.
    pub fn new(model: &Model, path: &Path) -> Self {
        Self { model: model.clone(), folder: path.parent().unwrap_or(Path::new("")).to_owned() }
    }

    /// Creates the appearance from the model in a result, without shapes; `None` if the result contains no complete
    /// model.
    ///
    /// # Errors
    /// A model that cannot be read.
    pub fn of_result(result: &ResultFile, path: &Path) -> Result<Option<Self>, Error> {
        let in_result = |source| Error::Export { path: path.to_owned(), source: Box::new(source) };
        let stored = result.model.as_ref().map(StoredModel::robot).transpose().map_err(in_result)?;
        Ok(stored.map(|stored| Self::new(stored.model(), path)))
    }

    pub(super) fn model(&self) -> &Model {
        &self.model
    }

    /// Bodies with the collision shapes of the description, in the neutral posture: every joint at zero, or as close
    /// to zero as its limits allow. If a body has no readable shape, it is drawn as capsules from joint to joint. The
    /// first body is the base.
    pub fn scene(&self, title: impl Into<String>) -> Scene {
        let model = &self.model;
        let posture = neutral_posture(model);
        let base =
            SceneBody { name: name_of(model.base(), "base"), pose: rows(&Transform::IDENTITY), ..SceneBody::default() };
        let mut bodies = vec![SceneBody { rotation: base.pose.0, ..base }];
        bodies.extend(model.tree_joints().iter().enumerate().map(|(index, joint)| {
            let (rotation, translation_m) = rows(&joint.placement);
            SceneBody {
                name: model.bodies()[index].name().to_owned(),
                parent: Some(joint.parent.map_or(0, |parent| parent + 1)),
                rotation,
                translation_m,
                motion: if joint.kind == JointKind::Prismatic { BodyMotion::Slides } else { BodyMotion::Turns },
                axis: joint.axis.0,
                drivers: model.drivers(index).collect(),
                offset: model.coupling().map_or(0.0, |coupling| coupling.offset(index)),
                ..SceneBody::default()
            }
        }));
        let mut simple = Vec::new();
        for (index, body) in bodies.iter_mut().enumerate() {
            let (surface, is_simple) = self.surface(index.checked_sub(1));
            body.surface = surface;
            if is_simple && !body.surface.triangles.is_empty() {
                simple.push(format!("`{}`", body.name));
            }
        }
        let note = match simple.len() {
            0 => String::new(),
            count if count + 1 >= bodies.len() => {
                "The robot description has no readable shapes; capsules connect the joints.".into()
            }
            _ => format!("Without readable shapes, drawn as capsules: {}.", simple.join(", ")),
        };
        let joints = model.joints().iter().map(|joint| joint.name.clone()).collect();
        let mut scene = Scene { title: title.into(), note, joints, bodies, posture, ..Scene::default() };
        self.place(&mut scene);
        scene
    }

    /// Places the bodies of the still picture at the scene's posture.
    pub fn place(&self, scene: &mut Scene) {
        let mut workspace = Workspace::new(&self.model);
        let placements = body_placements(&self.model, &mut workspace, &scene.posture);
        for (body, placement) in scene.bodies.iter_mut().skip(1).zip(placements) {
            body.pose = rows(placement);
        }
    }

    /// Surface of a body (`None`: the base) in its frame, and whether it consists of capsules.
    fn surface(&self, body: Option<usize>) -> (Surface, bool) {
        let model = &self.model;
        let links = &body.map_or(model.base(), |body| &model.bodies()[body]).links;
        let mut surface = Surface::default();
        for link in links {
            for shape in &link.collision {
                let Ok(own) = surface_of(shape, &self.folder) else { continue };
                let (rotation, translation) = rows(&link.placement.then(&shape.placement));
                surface.join(&own.placed(&rotation, translation));
            }
        }
        if !surface.triangles.is_empty() {
            return (surface, false);
        }
        let radius_m = CAPSULE_RADIUS_SHARE * arm_length_m(model);
        let place = links.first().map_or(Transform::IDENTITY, |link| link.placement);
        let capsules = body_capsules(model, body, radius_m).into_iter().filter(|_| radius_m > 0.0);
        for capsule in capsules {
            let ends = [capsule.corners_m.first(), capsule.corners_m.last()]
                .map(|end| place.point(Vec3(*end.unwrap_or(&[0.0; 3]))).0);
            surface.join(&Surface::rod(ends[0], ends[1], capsule.radius_m));
        }
        (surface, true)
    }
}

/// Surface of a shape in the frame of its link; meshes keep the orientation of their file.
fn surface_of(shape: &CollisionShape, folder: &Path) -> Result<Surface, MeshError> {
    Ok(match &shape.geometry {
        CollisionGeometry::Box { size_m } => Surface::cuboid(*size_m),
        CollisionGeometry::Cylinder { radius_m, length_m } => Surface::cylinder(*radius_m, *length_m),
        CollisionGeometry::Sphere { radius_m } => Surface::capsule(*radius_m, 0.0),
        CollisionGeometry::Capsule { radius_m, length_m } => Surface::capsule(*radius_m, *length_m),
        CollisionGeometry::Mesh { file, scale } => {
            let mesh = read_mesh(folder, file)?;
            let scaled = |vertex: &Vec3| std::array::from_fn(|axis| scale[axis] * vertex.0[axis]);
            let mut surface =
                Surface { vertices_m: mesh.vertices.iter().map(scaled).collect(), triangles: mesh.triangles };
            // The mesh is mirrored, or its faces point inward.
            if surface.volume_m3() < 0.0 {
                surface.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
            }
            surface
        }
        CollisionGeometry::Unsupported { what } => return Err(MeshError::Unsupported { what: what.clone() }),
    })
}

fn name_of(body: &Body, missing: &str) -> String {
    body.links.first().map_or(missing, |link| link.name.as_str()).to_owned()
}

fn rows(placement: &Transform) -> ([[f64; 3]; 3], [f64; 3]) {
    (placement.rotation.0, placement.translation.0)
}

/// The solid ellipsoid of uniform density with the mass distribution of a body. With the covariance `C` of the body's
/// mass about the centre of mass c, it is `p = √5 L u + c` over the unit sphere `u`, where `L Lᵀ = C`. `None` for a
/// body without mass or if the body is not physically consistent.
pub(super) fn ellipsoid(parameters: &[f64; 10], earlier: bool) -> Option<Ellipsoid> {
    let body = InertialParameters(*parameters);
    let mass = Some(body.mass_kg()).filter(|mass| *mass > 0.0)?;
    let inertia = body.inertia_at_com()?.0;
    let half_trace = 0.5 * (inertia[0][0] + inertia[1][1] + inertia[2][2]);
    let covariance = |a: usize, b: usize| (if a == b { half_trace } else { 0.0 } - inertia[a][b]) * 5.0 / mass;
    let mut shape = [[0.0; 3]; 3];
    for column in 0..3 {
        let square = covariance(column, column) - shape[column].iter().map(|x| x * x).sum::<f64>();
        // A point mass or a thin rod has no extent in some directions.
        let pivot = Some(square).filter(|square| *square > -1e-9)?.max(1e-12).sqrt();
        shape[column][column] = pivot;
        for row in column + 1..3 {
            let product: f64 = (0..column).map(|k| shape[row][k] * shape[column][k]).sum();
            shape[row][column] = (covariance(row, column) - product) / pivot;
        }
    }
    Some(Ellipsoid { centre: body.first_moment().scale(1.0 / mass).0, shape, earlier })
}
