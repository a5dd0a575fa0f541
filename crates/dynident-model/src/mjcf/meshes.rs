//! `<mesh>` under `<asset>`: the file for collision checking, and the mass properties for bodies without `<inertial>`.

use super::classes::{Classes, MAIN, Stated};
use super::compiler::Compiler;
use super::expanded::Expanded;
use super::fault::MjcfError;
use crate::collision::{MeshInertia, MeshInertiaMode, TriangleMesh, mesh_inertia};
use crate::spatial::{Mat3, Transform, Vec3};
use crate::xml::shortened;
use std::collections::HashMap;

/// Returns the mesh of a file, or the reason why it cannot be read.
pub(super) type ReadMesh<'f> = dyn FnMut(&str) -> Result<TriangleMesh, String> + 'f;

pub(super) struct MeshAsset {
    /// Path from the folder of the main file; `None` for a mesh in the MJCF.
    pub(super) file: Option<String>,
    pub(super) scale: [f64; 3],
    /// Pose of the mesh frame in the frame of the file (`refpos`, `refquat`); MuJoCo applies it before the scale.
    pub(super) reference: Transform,
    mode: MeshInertiaMode,
    /// Vertices and faces in the MJCF itself.
    inline: TriangleMesh,
}

impl MeshAsset {
    fn new(stated: &Stated<'_>, compiler: &Compiler) -> Result<Self, MjcfError> {
        let mode = stated.word("inertia", &["legacy", "exact", "convex", "shell"], "legacy, exact, convex or shell")?;
        let mode = match mode {
            None if compiler.exact_mesh_inertia => MeshInertiaMode::Exact,
            None | Some("legacy") => MeshInertiaMode::Legacy,
            Some("exact") => MeshInertiaMode::Exact,
            Some("convex") => MeshInertiaMode::Convex,
            Some(_) => MeshInertiaMode::Shell,
        };
        let [w, x, y, z] = stated.numbers("refquat")?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let norm = (w * w + x * x + y * y + z * z).sqrt();
        // A quaternion of length zero is replaced by the identity, as in MuJoCo.
        let rotation =
            if norm < 1e-15 { Mat3::IDENTITY } else { Mat3::from_quaternion([x, y, z, w].map(|part| part / norm)) };
        let reference = Transform { rotation, translation: stated.vector("refpos")?.unwrap_or(Vec3::ZERO) };
        let file = stated.get("file").map(|file| {
            let name = if compiler.strips_path { stem_and_extension(&file.value) } else { &file.value };
            let folder = compiler.meshdir.trim_end_matches('/');
            if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") }
        });
        let vertices = stated.numbers_between("vertex", 0, usize::MAX)?.unwrap_or_default();
        let single = |x: f64| f64::from(x as f32);
        let vertices: Vec<Vec3> = vertices.chunks_exact(3).map(|v| Vec3([v[0], v[1], v[2]].map(single))).collect();
        let corners = stated.numbers_of_any_size("face", 0, usize::MAX)?.unwrap_or_default();
        let triangles =
            corners.chunks_exact(3).map(|corners| [corners[0] as u32, corners[1] as u32, corners[2] as u32]);
        let inline = TriangleMesh { triangles: triangles.collect(), vertices };
        Ok(Self { file, scale: stated.numbers("scale")?.unwrap_or([1.0; 3]), reference, mode, inline })
    }

    /// Inertia of the mesh in its frame: moved, rotated, then scaled; a negative scale reverses the faces.
    fn inertia(&self, read: &mut ReadMesh<'_>) -> Result<MeshInertia, String> {
        let mut mesh = match &self.file {
            Some(file) => read(file)?,
            None => self.inline.clone(),
        };
        if mesh.triangles.iter().flatten().any(|&corner| corner as usize >= mesh.vertices.len()) {
            return Err("a face names a vertex that does not exist".to_owned());
        }
        let mesh_from_file = self.reference.inverse();
        for vertex in &mut mesh.vertices {
            let moved = mesh_from_file.point(*vertex);
            *vertex = Vec3(core::array::from_fn(|axis| moved[axis] * self.scale[axis]));
        }
        if self.file.is_some() && self.scale.iter().product::<f64>() <= 0.0 {
            for corners in &mut mesh.triangles {
                corners.swap(1, 2);
            }
        }
        mesh_inertia(&mesh, self.mode).map_err(|fault| fault.to_string())
    }
}

/// Meshes by name. Files are read only for bodies whose mass depends on them.
pub(super) struct Meshes<'f> {
    assets: HashMap<String, MeshAsset>,
    read: &'f mut ReadMesh<'f>,
    known: HashMap<String, Result<MeshInertia, String>>,
}

impl<'f> Meshes<'f> {
    pub(super) fn new<'t>(
        document: &'t Expanded,
        classes: &'t Classes<'t>,
        compiler: &Compiler,
        read: &'f mut ReadMesh<'f>,
    ) -> Result<Self, MjcfError> {
        let mut assets = HashMap::new();
        for element in document.sections("asset").flat_map(|asset| document.children(asset)) {
            if element.tag != "mesh" {
                continue;
            }
            let file = element.attribute("file").map_or("", |file| stem_and_extension(&file.value));
            let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
            let name = element.attribute("name").map_or(stem, |name| &name.value);
            let asset = MeshAsset::new(&classes.stated(document, element, MAIN)?, compiler)?;
            assets.insert(name.to_owned(), asset);
        }
        Ok(Self { assets, read, known: HashMap::new() })
    }

    pub(super) fn get(&self, name: &str) -> Option<&MeshAsset> {
        self.assets.get(name)
    }

    /// Mass properties of a mesh with the density 1, or the reason why they are unknown.
    pub(super) fn inertia(&mut self, name: &str) -> Result<MeshInertia, String> {
        let asset = self.assets.get(name).ok_or_else(|| format!("no mesh `{}` under <asset>", shortened(name)))?;
        let read = &mut self.read;
        self.known.entry(name.to_owned()).or_insert_with(|| asset.inertia(*read)).clone()
    }
}

fn stem_and_extension(file: &str) -> &str {
    file.rsplit(['/', '\\']).next().unwrap_or(file)
}
