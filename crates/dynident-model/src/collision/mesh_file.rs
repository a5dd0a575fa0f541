//! Reads the mesh file that a robot description names.

use super::mesh::TriangleMesh;
use super::{collada, mesh_text, msh, stl};
use crate::spatial::Vec3;
use std::io::Read;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Size limit of a mesh file, bytes: five million triangles.
const MAX_MESH_BYTES: u64 = 256 << 20;

/// Coordinate limit before scaling, m: larger values cannot belong to a link.
const MAX_COORDINATE: f64 = 1e9;

/// Number of folders above the description that are searched for a package.
const MAX_PARENT_LEVELS: usize = 8;

/// Why a collision shape cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum MeshError {
    /// The robot description names a mesh file that Dynident does not find in its folder, nor, for `package://` names,
    /// in the folders above. Copy the mesh there, or correct the name.
    #[error("mesh `{name}` is missing (searched next to and above {})", folder.display())]
    Missing {
        name: String,
        /// Folder of the description.
        folder: PathBuf,
    },
    /// The mesh file exists, but you have no permission to read it. Correct the permissions.
    #[error("{}: cannot be read: {source}", path.display())]
    File { path: PathBuf, source: std::io::Error },
    /// The content of the mesh file is invalid. The text after the path has the cause; export the mesh again.
    #[error("{}: {fault}", path.display())]
    Content {
        path: PathBuf,
        #[source]
        fault: MeshFault,
    },
    /// The robot description has a shape that Dynident cannot convert, for example a mesh with an unsupported scale.
    /// The message names the element.
    #[error("{what}")]
    Unsupported {
        /// The element and what is wrong with it.
        what: String,
    },
}

/// A fault in the content of a mesh file.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MeshFault {
    /// The mesh is in a format that Dynident does not read. Convert it to STL or OBJ.
    #[error("unknown format; STL (binary or text), OBJ, MSH (.msh) and COLLADA (.dae) are read")]
    Format,
    /// The mesh is too detailed. Reduce its number of triangles, or use a simplified collision mesh.
    #[error("larger than {} MiB", MAX_MESH_BYTES >> 20)]
    TooLarge,
    /// The file has no points, so that it has no shape. Export the mesh again.
    #[error("no vertices")]
    Empty,
    /// A point of the mesh does not consist of three numbers. The file is truncated or damaged: export the mesh again.
    #[error("a vertex without three numbers")]
    Vertex,
    /// A coordinate is NaN, infinite or above 1e9. Export the mesh again, with lengths in m.
    #[error("a vertex that is not finite, or beyond 1e9")]
    NotFinite,
    /// A triangle refers to a point that the file does not contain. The file is truncated or damaged: export the mesh
    /// again.
    #[error("a face names a vertex that does not exist")]
    Face,
    /// The COLLADA file does not follow the rules of XML; often it is truncated. Export the mesh again.
    #[error("malformed XML: {0}")]
    Xml(String),
    /// An element of the COLLADA file is missing, wrong or not supported. Convert the mesh to STL or OBJ.
    #[error("COLLADA: {0}")]
    Collada(&'static str),
}

/// Finds the mesh file `name` of a description in `folder`. `package://NAME/rest` is searched in the folder and up to
/// eight levels above (as `NAME/rest`, as `rest` in a folder `NAME`, or as `rest`); any other name is a path, relative
/// to the folder.
pub fn find_mesh(folder: &Path, name: &str) -> Option<PathBuf> {
    let there = |path: PathBuf| path.is_file().then_some(path);
    let Some(of_package) = name.strip_prefix("package://").or_else(|| name.strip_prefix("model://")) else {
        return there(folder.join(name.strip_prefix("file://").unwrap_or(name)));
    };
    let (package, rest) = of_package.split_once('/')?;
    let absolute = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let above = || absolute.ancestors().take(MAX_PARENT_LEVELS);
    let named = |at: &Path| at.file_name().is_some_and(|name| name == package);
    above()
        .find_map(|at| there(at.join(package).join(rest)))
        .or_else(|| above().filter(|at| named(at)).find_map(|at| there(at.join(rest))))
        .or_else(|| above().find_map(|at| there(at.join(rest))))
}

/// Reads the unique vertices and the triangles of a mesh in the file's frame and unit. A COLLADA file defines its
/// unit and is converted to metres.
///
/// # Errors
/// File not found or not readable, or not an STL, OBJ, MSH or COLLADA file with at least one vertex.
pub fn read_mesh(folder: &Path, name: &str) -> Result<TriangleMesh, MeshError> {
    read_from(folder, name, mesh_text::Shapes::All)
}

/// Like [`read_mesh`], but as MuJoCo reads a mesh: coordinates in single precision, and only the faces of the first
/// object or group of an OBJ.
pub(crate) fn read_mujoco_mesh(folder: &Path, name: &str) -> Result<TriangleMesh, MeshError> {
    let mut mesh = read_from(folder, name, mesh_text::Shapes::First)?;
    for vertex in &mut mesh.vertices {
        *vertex = Vec3(vertex.0.map(|coordinate| f64::from(coordinate as f32)));
    }
    Ok(mesh)
}

fn read_from(folder: &Path, name: &str, shapes: mesh_text::Shapes) -> Result<TriangleMesh, MeshError> {
    let missing = || MeshError::Missing { name: name.to_owned(), folder: folder.to_owned() };
    let path = find_mesh(folder, name).ok_or_else(missing)?;
    let mut bytes = Vec::new();
    dynident_files::open(&path)
        .and_then(|file| file.take(MAX_MESH_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|source| MeshError::File { path: path.clone(), source })?;
    let parsed =
        if bytes.len() as u64 > MAX_MESH_BYTES { Err(MeshFault::TooLarge) } else { parse(&path, &bytes, shapes) };
    parsed.map_err(|fault| MeshError::Content { path, fault })
}

fn parse(path: &Path, bytes: &[u8], shapes: mesh_text::Shapes) -> Result<TriangleMesh, MeshFault> {
    // A `.msh` file has no signature at its beginning.
    let is_msh = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("msh"));
    let mesh = if is_msh {
        msh::read(bytes)?
    } else if stl::is_binary(bytes) {
        TriangleMesh::of_corners(&stl::binary(bytes))
    } else {
        let text = core::str::from_utf8(bytes).map_err(|_| MeshFault::Format)?;
        let text = text.trim_start_matches('\u{feff}').trim_start();
        if text.starts_with('<') {
            collada::read(text)?
        } else if text.starts_with("solid") {
            mesh_text::stl(text)?
        } else {
            mesh_text::obj(text, shapes)?.ok_or(MeshFault::Format)?
        }
    };
    if mesh.vertices.is_empty() {
        return Err(MeshFault::Empty);
    }
    let mesh = match shapes {
        mesh_text::Shapes::All => TriangleMesh::merged(&mesh.vertices, &mesh.triangles),
        mesh_text::Shapes::First => mesh,
    };
    let finite = |v: &Vec3| v.0.iter().all(|x| x.abs() <= MAX_COORDINATE);
    if mesh.vertices.iter().all(finite) { Ok(mesh) } else { Err(MeshFault::NotFinite) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "solid part\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1e0 0\n  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n   vertex 1 0 0\n   vertex 0 1 0\n   vertex 0 0 -2.5\n  endloop\n endfacet\nendsolid part\n";

    fn binary(head: &[u8; 80], corners: &[[f32; 3]]) -> Vec<u8> {
        let mut bytes = head.to_vec();
        bytes.extend((corners.len() as u32 / 3).to_le_bytes());
        for triangle in corners.chunks_exact(3) {
            bytes.extend([0_u8; 12]);
            bytes.extend(triangle.iter().flatten().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0_u8; 2]);
        }
        bytes
    }

    #[test]
    fn text_binary_and_obj_give_the_same_vertices() {
        let folder = tempfile_folder("same");
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let corners = [&corners[..], &[[0.0, 0.0, -2.5]]].concat();
        // The header of a binary file may begin like a text file.
        let mut head = [b' '; 80];
        head[..5].copy_from_slice(b"solid");
        std::fs::write(folder.join("a.stl"), TEXT).unwrap();
        std::fs::write(folder.join("b.stl"), binary(&head, &corners)).unwrap();
        std::fs::write(folder.join("c.obj"), "o x\nv 0 0 0\nv 1 0 0\nvn 0 0 1\nv 0 1 0\nv 0 0 -2.5\nf 1 2 3\n")
            .unwrap();
        let [a, b, c] = ["a.stl", "b.stl", "c.obj"].map(|name| read_mesh(&folder, name).unwrap());
        assert_eq!((a.vertices.len(), a.triangles.len()), (4, 2));
        assert_eq!((&a, &a.vertices), (&b, &c.vertices));
        assert_eq!(c.triangles, a.triangles[..1]);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn faulty_meshes_are_rejected_and_their_count_takes_no_memory() {
        let folder = tempfile_folder("faulty");
        let mut lying = binary(&[0; 80], &[[0.0; 3]; 3]);
        lying[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        for (name, bytes) in [
            ("lying.stl", lying),
            ("short.stl", vec![0; 40]),
            ("word.stl", b"solid\nvertex a b c\n".to_vec()),
            ("nan.obj", b"v nan 0 0\n".to_vec()),
            ("collada.dae", b"<COLLADA/>".to_vec()),
            ("html.dae", b"<html/>".to_vec()),
            ("face.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n".to_vec()),
            ("ply.ply", b"ply\nformat ascii 1.0\n".to_vec()),
            ("pointer.stl", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 3\n".to_vec()),
        ] {
            std::fs::write(folder.join(name), bytes).unwrap();
            let error = read_mesh(&folder, name).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
        assert!(matches!(read_mesh(&folder, "package://x/absent.stl"), Err(MeshError::Missing { .. })));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_package_is_found_beside_and_above() {
        let folder = tempfile_folder("package");
        let (urdf, meshes) = (folder.join("arm_description/urdf"), folder.join("arm_description/meshes"));
        for path in [&urdf, &meshes] {
            std::fs::create_dir_all(path).unwrap();
        }
        std::fs::write(meshes.join("a.stl"), TEXT).unwrap();
        for name in ["package://arm_description/meshes/a.stl", "../meshes/a.stl", "package://other/meshes/a.stl"] {
            assert!(find_mesh(&urdf, name).is_some(), "{name}");
        }
        assert!(find_mesh(&urdf, "package://arm_description/meshes/b.stl").is_none());
        std::fs::remove_dir_all(folder).unwrap();
    }

    fn tempfile_folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("dynident-mesh-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }
}
