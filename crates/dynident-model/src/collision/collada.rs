//! Triangles of a COLLADA file (`.dae`).
//!
//! Specification: COLLADA 1.4.1 (Khronos 2008), sections 5 (geometry, scene) and 4 (asset). Supported are all
//! `<instance_geometry>` of the scene with the transforms of their nodes, and `<unit meter>`. A file without a scene
//! gives all its geometries. `<up_axis>` is **not** applied, because URDF tools (RViz, MoveIt, Gazebo, Pinocchio)
//! ignore it as well.
//!
//! This is a separate implementation, because no crate applies the transforms of several instances of one geometry
//! (decision 0053).

use super::MeshFault;
use super::mesh::TriangleMesh;
use crate::spatial::Vec3;
use crate::xml::{MAX_NODES, first_excess, parse_number, shortened};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::HashMap;

/// Maximum number of triangle corners, as in the largest STL file. The limit is necessary because nested instances
/// multiply the corners.
const MAX_CORNERS: usize = 16_000_000;

/// Maximum number of visited scene nodes, and maximum depth.
const MAX_VISITS: usize = 100_000;
const MAX_DEPTH: usize = 64;

/// Affine map `x -> a x + b` as rows `[a | b]`.
type Affine = [[f64; 4]; 3];

const IDENTITY: Affine = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

pub(super) fn read(text: &str) -> Result<TriangleMesh, MeshFault> {
    if first_excess(text).is_some() {
        return Err(MeshFault::Collada("too many attributes in one element, or too many nested namespaces"));
    }
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document =
        Document::parse_with_options(text, options).map_err(|error| MeshFault::Xml(shortened(&error.to_string())))?;
    let root = document.root_element();
    if !root.has_tag_name("COLLADA") {
        return Err(MeshFault::Format);
    }
    let by_id: HashMap<&str, Node<'_, '_>> =
        root.descendants().filter_map(|node| Some((node.attribute("id")?, node))).collect();
    let unit = child(root, "asset").and_then(|asset| child(asset, "unit")).and_then(|unit| unit.attribute("meter"));
    let unit = match unit {
        Some(meter) => parse_number(meter.trim())
            .ok()
            .filter(|unit| *unit > 0.0)
            .ok_or(MeshFault::Collada("`unit` has no positive `meter`"))?,
        None => 1.0,
    };
    let mut placed = IDENTITY;
    (0..3).for_each(|k| placed[k][k] = unit);
    let mut reader = Reader { by_id, corners: Vec::new(), visits: 0 };
    match scene(root, &reader.by_id) {
        Some(scene) => {
            for node in children(scene, "node") {
                reader.node(node, &placed, 0)?;
            }
        }
        None => {
            for library in children(root, "library_geometries") {
                for geometry in children(library, "geometry") {
                    reader.geometry(geometry, &placed)?;
                }
            }
        }
    }
    Ok(TriangleMesh::of_corners(&reader.corners))
}

/// The scene that the file names, otherwise the first scene of the file.
fn scene<'a, 'i>(root: Node<'a, 'i>, by_id: &HashMap<&str, Node<'a, 'i>>) -> Option<Node<'a, 'i>> {
    let named = child(root, "scene").and_then(|scene| child(scene, "instance_visual_scene"));
    let named = named.and_then(|instance| target(instance, by_id));
    named.or_else(|| child(child(root, "library_visual_scenes")?, "visual_scene"))
}

struct Reader<'a, 'i> {
    by_id: HashMap<&'a str, Node<'a, 'i>>,
    corners: Vec<Vec3>,
    visits: usize,
}

impl<'a, 'i> Reader<'a, 'i> {
    fn node(&mut self, node: Node<'a, 'i>, placed: &Affine, depth: usize) -> Result<(), MeshFault> {
        self.visits += 1;
        if self.visits > MAX_VISITS || depth > MAX_DEPTH {
            return Err(MeshFault::Collada("more than 100,000 nodes in the scene, or more than 64 levels"));
        }
        let mut placed = *placed;
        for element in node.children().filter(Node::is_element) {
            if let Some(transform) = transform(element)? {
                placed = product(&placed, &transform);
            }
        }
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "node" => self.node(element, &placed, depth + 1)?,
                "instance_node" => {
                    let missing = MeshFault::Collada("`instance_node` names a node that does not exist");
                    let of = target(element, &self.by_id).filter(|of| of.has_tag_name("node")).ok_or(missing)?;
                    self.node(of, &placed, depth + 1)?;
                }
                "instance_geometry" => {
                    let missing = MeshFault::Collada("`instance_geometry` names a geometry that does not exist");
                    let of = target(element, &self.by_id).filter(|of| of.has_tag_name("geometry")).ok_or(missing)?;
                    self.geometry(of, &placed)?;
                }
                "instance_controller" => return Err(MeshFault::Collada("skinned geometry is not supported")),
                _ => {}
            }
        }
        Ok(())
    }

    fn geometry(&mut self, geometry: Node<'a, 'i>, placed: &Affine) -> Result<(), MeshFault> {
        let Some(mesh) = child(geometry, "mesh") else {
            return Err(MeshFault::Collada("a geometry without `mesh` (`convex_mesh` and `spline` are not supported)"));
        };
        for form in mesh.children().filter(Node::is_element) {
            let kind = form.tag_name().name();
            if !matches!(kind, "triangles" | "polylist" | "polygons" | "tristrips" | "trifans") {
                continue;
            }
            let (offset, stride, places) = self.positions(mesh, form)?;
            let mut counts =
                child(form, "vcount").map(|node| indices(node)).transpose()?.unwrap_or_default().into_iter();
            let lists = form.children().filter(|node| node.has_tag_name("p"));
            // Only the outer boundary of a polygon with holes is used.
            let outer = children(form, "ph").filter_map(|node| child(node, "p"));
            for list in lists.chain(outer) {
                let corners = indices(list)?;
                let corners = corners.chunks_exact(stride).map(|corner| {
                    let place = places.get(corner[offset]).ok_or(MeshFault::Face)?;
                    Ok(applied(placed, *place))
                });
                let corners = corners.collect::<Result<Vec<Vec3>, MeshFault>>()?;
                match kind {
                    "triangles" => self.add(corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]))?,
                    "tristrips" => self.add(corners.windows(3).map(|c| [c[0], c[1], c[2]]))?,
                    "polylist" => {
                        let mut rest = corners.as_slice();
                        for count in counts.by_ref() {
                            let (polygon, after) = rest.split_at_checked(count).ok_or(MeshFault::Face)?;
                            self.add(fan(polygon))?;
                            rest = after;
                        }
                    }
                    _ => self.add(fan(&corners))?,
                }
            }
        }
        Ok(())
    }

    fn add(&mut self, triangles: impl Iterator<Item = [Vec3; 3]>) -> Result<(), MeshFault> {
        for triangle in triangles {
            if self.corners.len() >= MAX_CORNERS {
                return Err(MeshFault::Collada("more than 5 million triangles in the scene"));
            }
            self.corners.extend(triangle);
        }
        Ok(())
    }

    /// Offset of the position among the indices of a corner, number of indices per corner, and all positions.
    fn positions(&self, mesh: Node<'a, 'i>, form: Node<'a, 'i>) -> Result<(usize, usize, Vec<Vec3>), MeshFault> {
        const MISSING: MeshFault = MeshFault::Collada("a geometry without positions of its vertices");
        let offset = |input: Node<'_, '_>| input.attribute("offset").map_or(Ok(0), |text| text.trim().parse::<usize>());
        let mut stride = 1;
        let mut vertices = None;
        for input in children(form, "input") {
            let offset = offset(input).map_err(|_| MeshFault::Face)?;
            stride = stride.max(offset.saturating_add(1));
            if input.attribute("semantic") == Some("VERTEX") {
                vertices = Some((offset, input));
            }
        }
        // The limit on the number of inputs bounds the memory.
        if stride > 256 {
            return Err(MeshFault::Face);
        }
        let (offset, input) = vertices.ok_or(MISSING)?;
        let named = source(input, &self.by_id).or_else(|| child(mesh, "vertices")).ok_or(MISSING)?;
        let source = children(named, "input")
            .find(|input| input.attribute("semantic") == Some("POSITION"))
            .and_then(|input| source(input, &self.by_id))
            .ok_or(MISSING)?;
        let array = child(source, "float_array").ok_or(MISSING)?;
        let numbers = array.text().unwrap_or_default().split_ascii_whitespace();
        let numbers: Result<Vec<f64>, MeshFault> =
            numbers.map(|word| parse_number(word).map_err(|_| MeshFault::Vertex)).collect();
        let accessor = child(source, "technique_common").and_then(|common| child(common, "accessor"));
        let number = |name: &str, default: usize| {
            let text = accessor.and_then(|accessor| accessor.attribute(name));
            text.map_or(Some(default), |text| text.trim().parse().ok()).ok_or(MISSING)
        };
        let (step, first) = (number("stride", 3)?, number("offset", 0)?);
        if step < 3 {
            return Err(MISSING);
        }
        let numbers = numbers?;
        let places = numbers.get(first..).unwrap_or_default().chunks(step).filter(|chunk| chunk.len() >= 3);
        Ok((offset, stride, places.map(|chunk| Vec3([chunk[0], chunk[1], chunk[2]])).collect()))
    }
}

fn fan(corners: &[Vec3]) -> impl Iterator<Item = [Vec3; 3]> {
    corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]])
}

/// The map of a transform element; `None` for other elements.
fn transform(element: Node<'_, '_>) -> Result<Option<Affine>, MeshFault> {
    let mut map = IDENTITY;
    match element.tag_name().name() {
        "matrix" => {
            let m = numbers::<16>(element)?;
            map = core::array::from_fn(|row| core::array::from_fn(|column| m[4 * row + column]));
        }
        "translate" => {
            let shift = numbers::<3>(element)?;
            (0..3).for_each(|k| map[k][3] = shift[k]);
        }
        "scale" => {
            let factors = numbers::<3>(element)?;
            (0..3).for_each(|k| map[k][k] = factors[k]);
        }
        "rotate" => {
            let [x, y, z, degrees] = numbers::<4>(element)?;
            let axis = Vec3([x, y, z]);
            if axis.norm() > 0.0 {
                let unit = axis.scale(1.0 / axis.norm());
                let turned = crate::spatial::Mat3::from_axis_angle(unit, degrees.to_radians());
                (0..3).for_each(|k| map[k][..3].copy_from_slice(&turned.0[k]));
            }
        }
        "skew" | "lookat" => return Err(MeshFault::Collada("the transforms `skew` and `lookat` are not supported")),
        _ => return Ok(None),
    }
    Ok(Some(map))
}

fn product(first: &Affine, second: &Affine) -> Affine {
    core::array::from_fn(|row| {
        core::array::from_fn(|column| {
            let shift = if column == 3 { first[row][3] } else { 0.0 };
            (0..3).map(|k| first[row][k] * second[k][column]).sum::<f64>() + shift
        })
    })
}

fn applied(map: &Affine, place: Vec3) -> Vec3 {
    Vec3(core::array::from_fn(|row| {
        map[row][0] * place[0] + map[row][1] * place[1] + map[row][2] * place[2] + map[row][3]
    }))
}

fn numbers<const N: usize>(element: Node<'_, '_>) -> Result<[f64; N], MeshFault> {
    const FAULT: MeshFault = MeshFault::Collada("a transform without its numbers");
    let words = element.text().unwrap_or_default().split_ascii_whitespace();
    let numbers = words.map(|word| parse_number(word).map_err(|_| FAULT)).collect::<Result<Vec<f64>, _>>()?;
    numbers.try_into().map_err(|_| FAULT)
}

fn indices(element: Node<'_, '_>) -> Result<Vec<usize>, MeshFault> {
    let words = element.text().unwrap_or_default().split_ascii_whitespace();
    words.map(|word| word.parse().map_err(|_| MeshFault::Face)).collect()
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(name))
}

fn children<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |child| child.has_tag_name(name))
}

fn target<'a, 'i>(instance: Node<'a, 'i>, by_id: &HashMap<&str, Node<'a, 'i>>) -> Option<Node<'a, 'i>> {
    by_id.get(instance.attribute("url")?.trim().strip_prefix('#')?).copied()
}

fn source<'a, 'i>(input: Node<'a, 'i>, by_id: &HashMap<&str, Node<'a, 'i>>) -> Option<Node<'a, 'i>> {
    by_id.get(input.attribute("source")?.trim().strip_prefix('#')?).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit tetrahedron with two instances: one rotated and translated by nested nodes, one in a library node.
    fn document(asset: &str, scene: &str) -> String {
        format!(
            r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{asset}</asset>
<library_geometries><geometry id="g"><mesh>
 <source id="s"><float_array id="a" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array>
  <technique_common><accessor source="#a" count="4" stride="3"/></technique_common></source>
 <vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
 <polylist count="2"><input semantic="NORMAL" source="#s" offset="0"/><input semantic="VERTEX" source="#v" offset="1"/>
  <vcount>4 3</vcount><p>0 0 0 1 0 2 0 3 0 0 0 2 0 3</p></polylist>
</mesh></geometry></library_geometries>
<library_nodes><node id="n"><scale>2 1 1</scale><instance_geometry url="#g"/></node></library_nodes>
{scene}</COLLADA>"##
        )
    }

    const SCENE: &str = r##"<library_visual_scenes><visual_scene id="x">
 <node><translate>0 0 5</translate><node><rotate>0 0 1 90</rotate><instance_geometry url="#g"/></node></node>
 <node><matrix>1 0 0 7 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_node url="#n"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#x"/></scene>"##;

    #[test]
    fn nodes_and_the_unit_place_vertices_and_the_up_axis_does_not() {
        let asset = |up: &str| format!(r#"<unit name="centimeter" meter="0.01"/><up_axis>{up}</up_axis>"#);
        let [y, z] = ["Y_UP", "Z_UP"].map(|up| read(&document(&asset(up), SCENE)).unwrap());
        assert_eq!(y, z);
        // Per instance: a quadrilateral (two triangles) and a triangle.
        assert_eq!((y.vertices.len(), y.triangles.len()), (8, 6));
        // First instance: rotated by 90° about z, raised by 5. Second: scaled by 2 along x, shifted by 7. In
        // centimetres.
        let expected = [[0.0, 0.0, 5.0], [0.0, 1.0, 5.0], [-1.0, 0.0, 5.0], [0.0, 0.0, 6.0]];
        let expected = expected.into_iter().chain([[7.0, 0.0, 0.0], [9.0, 0.0, 0.0], [7.0, 1.0, 0.0], [7.0, 0.0, 1.0]]);
        for place in expected {
            let place = Vec3(place).scale(0.01);
            assert!(y.vertices.iter().any(|vertex| (*vertex - place).norm() < 1e-15), "{place:?} in {:?}", y.vertices);
        }
    }

    #[test]
    fn without_a_scene_all_geometries_are_read() {
        let mesh = read(&document("", "")).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (4, 3));
    }

    #[test]
    fn faults_are_named_and_instances_do_not_multiply_without_end() {
        let fault = |scene: &str| read(&document("", scene)).unwrap_err().to_string();
        let scene = |nodes: &str| {
            format!("<library_visual_scenes><visual_scene id=\"x\">{nodes}</visual_scene></library_visual_scenes>")
        };
        assert!(fault(&scene("<node><instance_geometry url=\"#none\"/></node>")).contains("instance_geometry"));
        assert!(fault(&scene("<node><skew/></node>")).contains("skew"));
        assert!(fault(&scene("<node><matrix>1 2</matrix></node>")).contains("transform"));
        assert!(fault(&scene("<node><instance_controller url=\"#c\"/></node>")).contains("skinned"));
        // A node that contains itself, and thirty levels that each contain the next one twice.
        assert!(fault(&scene("<node id=\"loop\"><instance_node url=\"#loop\"/></node>")).contains("64 levels"));
        let level = |k: usize| {
            let next = format!("<instance_node url=\"#l{}\"/>", k + 1);
            format!("<node id=\"l{k}\">{next}{next}</node>")
        };
        let levels = (0..30).map(level).collect::<Vec<String>>().concat();
        let levels = format!("<node><instance_node url=\"#l0\"/><node>{levels}<node id=\"l30\"/></node></node>");
        assert!(fault(&scene(&levels)).contains("100,000 nodes"));
        for text in ["<COLLADA", "<COLLADA/>", "<robot/>"] {
            assert!(read(text).map_or(true, |mesh| mesh.triangles.is_empty()), "{text}");
        }
        let negative = document("<unit meter=\"-1\"/>", "");
        assert!(read(&negative).unwrap_err().to_string().contains("unit"));
    }
}
