//! `<compiler>`: interpretation of the other elements.

use super::classes::Stated;
use super::expanded::Expanded;
use super::fault::{MjcfError, MjcfFault};

/// Selection of the bodies whose inertia is computed from their geoms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FromGeoms {
    Always,
    WhereMissing,
    Never,
}

/// Settings that affect the tree and its masses, with MuJoCo's defaults.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "each is an attribute of the element")]
pub(super) struct Compiler {
    pub(super) degrees: bool,
    /// Axes of `euler` in their order: lower case for rotating axes, upper case for fixed axes.
    pub(super) eulerseq: [u8; 3],
    pub(super) autolimits: bool,
    pub(super) from_geoms: FromGeoms,
    /// First and last group of the geoms that are included in the inertia.
    pub(super) groups: [f64; 2],
    pub(super) bound_mass: f64,
    pub(super) bound_inertia: f64,
    pub(super) balance: bool,
    pub(super) total_mass: Option<f64>,
    pub(super) meshdir: String,
    /// Whether folders in the names of mesh files are ignored.
    pub(super) strips_path: bool,
    /// `exactmeshinertia` of MuJoCo before 3.2.5: the mode of meshes without an explicit mode.
    pub(super) exact_mesh_inertia: bool,
}

impl Compiler {
    /// Reads all `<compiler>` sections; a later section overrides an earlier one.
    pub(super) fn new(document: &Expanded) -> Result<Self, MjcfError> {
        let mut found = Self {
            degrees: true,
            eulerseq: *b"xyz",
            autolimits: true,
            from_geoms: FromGeoms::WhereMissing,
            groups: [0.0, 5.0],
            bound_mass: 0.0,
            bound_inertia: 0.0,
            balance: false,
            total_mass: None,
            meshdir: String::new(),
            strips_path: false,
            exact_mesh_inertia: false,
        };
        for section in document.sections("compiler") {
            let stated = Stated::own(document, section);
            if let Some(angle) = stated.word("angle", &["degree", "radian"], "degree or radian")? {
                found.degrees = angle == "degree";
            }
            if let Some(sequence) = stated.get("eulerseq") {
                let letters = sequence.value.as_bytes();
                found.eulerseq = <[u8; 3]>::try_from(letters)
                    .ok()
                    .filter(|letters| letters.iter().all(|letter| b"xyzXYZ".contains(letter)))
                    .ok_or_else(|| stated.word_fault(sequence, "three of the letters x y z X Y Z"))?;
            }
            found.autolimits = stated.flag("autolimits")?.unwrap_or(found.autolimits);
            found.strips_path = stated.flag("strippath")?.unwrap_or(found.strips_path);
            found.exact_mesh_inertia = stated.flag("exactmeshinertia")?.unwrap_or(found.exact_mesh_inertia);
            found.balance = stated.flag("balanceinertia")?.unwrap_or(found.balance);
            if stated.get("inertiafromgeom").is_some() {
                found.from_geoms = match stated.flag("inertiafromgeom")? {
                    Some(true) => FromGeoms::Always,
                    Some(false) => FromGeoms::Never,
                    None => FromGeoms::WhereMissing,
                };
            }
            found.groups = stated.numbers("inertiagrouprange")?.unwrap_or(found.groups);
            found.bound_mass = stated.size("boundmass")?.unwrap_or(found.bound_mass);
            found.bound_inertia = stated.size("boundinertia")?.unwrap_or(found.bound_inertia);
            // MuJoCo scales only if the total is positive.
            if let Some(total) = stated.number("settotalmass")? {
                found.total_mass = (total > 0.0).then_some(total);
            }
            if let Some("global") = stated.word("coordinate", &["local", "global"], "local or global")? {
                let what = "coordinate=\"global\"".to_owned();
                let fix = "save the model with a recent MuJoCo, which writes local coordinates";
                return Err(stated.fault(MjcfFault::Unsupported { what, fix }));
            }
            for key in ["meshdir", "assetdir"] {
                if let Some(folder) = stated.get(key) {
                    found.meshdir.clone_from(&folder.value);
                    break;
                }
            }
        }
        Ok(found)
    }

    pub(super) fn radians(&self, angle: f64) -> f64 {
        if self.degrees { angle.to_radians() } else { angle }
    }
}
