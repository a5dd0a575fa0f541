//! One target for each input format.

use super::Run;
use dynident::iteration::IterationStore;
use dynident::iteration::robot::{ToHost, read_log_table};
use dynident::model::collision::{MeshInertiaMode, mesh_inertia, read_mesh};
use dynident::model::terms::{Expression, JointNames};
use dynident::model::{
    AuditFinding, Joint, JointChange, Model, audit, link_changes, read_dh, read_mjcf_with, read_sdf, read_urdf,
    rewrite_inertials, rewrite_mjcf, rewrite_sdf, rewrite_urdf, slips, write_urdf,
};
use dynident::recording::log::{ChannelGroup, ColumnRef, Columns, TimeColumn};
use dynident::recording::{LogFormat, MotionBlock, MotionSettings, MotionStream};
use dynident::{DesignFile, Factors, Quantity, ResultFile, Study};
use sha2::{Digest, Sha256};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A target without state.
struct Plain(fn(&[u8]) -> bool);

impl Run for Plain {
    fn run(&mut self, _: &str, input: &[u8]) -> bool {
        self.0(input)
    }
}

/// A target that reads a file.
struct OfFile {
    folder: TempDir,
    file: &'static str,
    read: fn(&Path) -> bool,
}

impl Run for OfFile {
    fn run(&mut self, _: &str, input: &[u8]) -> bool {
        let path = self.folder.path().join(self.file);
        std::fs::write(&path, input).is_ok() && (self.read)(&path)
    }
}

#[allow(clippy::unnecessary_wraps, reason = "all targets have the same signature")]
fn plain(run: fn(&[u8]) -> bool) -> io::Result<Box<dyn Run>> {
    Ok(Box::new(Plain(run)))
}

fn of_file(file: &'static str, read: fn(&Path) -> bool) -> io::Result<Box<dyn Run>> {
    let folder = tempfile::tempdir()?;
    if let Some(parent) = folder.path().join(file).parent() {
        std::fs::create_dir_all(parent)?;
    }
    Ok(Box::new(OfFile { folder, file, read }))
}

/// A mesh of a collision shape.
pub(crate) fn mesh() -> io::Result<Box<dyn Run>> {
    of_file("mesh", |path| match read_mesh(path.parent().unwrap_or(path), "mesh") {
        Ok(mesh) => {
            assert!(mesh.vertices.iter().flat_map(|vertex| vertex.0).all(f64::is_finite), "not finite");
            assert!(mesh.triangles.iter().flatten().all(|place| (*place as usize) < mesh.vertices.len()), "no vertex");
            for mode in
                [MeshInertiaMode::Legacy, MeshInertiaMode::Exact, MeshInertiaMode::Convex, MeshInertiaMode::Shell]
            {
                if let Ok(found) = mesh_inertia(&mesh, mode) {
                    let numbers = found.inertia_at_centre.0.iter().flatten().chain(&found.centre_m.0);
                    assert!(found.size > 0.0 && numbers.copied().all(f64::is_finite), "inertia that is not finite");
                }
            }
            true
        }
        Err(error) => said(&error),
    })
}

/// Checks that a message is not empty.
fn said(message: &impl ToString) -> bool {
    assert!(!message.to_string().trim().is_empty(), "an empty message");
    false
}

fn sound(model: &Model) {
    let findings: Vec<AuditFinding> = audit(model);
    assert!(findings.iter().all(|finding| !finding.message.is_empty()));
    assert!(model.inertials().iter().all(|inertial| inertial.0.iter().all(|x| x.is_finite())), "not finite");
}

/// URDF: read, audit, find description errors, write.
pub(crate) fn urdf() -> io::Result<Box<dyn Run>> {
    plain(|input| {
        let Ok(text) = core::str::from_utf8(input) else { return false };
        let robot = match read_urdf(text) {
            Ok(robot) => robot,
            Err(error) => return said(&error),
        };
        sound(&robot.model);
        assert_eq!(rewrite_urdf(text, &[], &[]).as_deref(), Ok(text));
        if let Ok(changes) = link_changes(&robot.model, robot.model.inertials())
            && let Ok(written) = rewrite_urdf(text, &changes, &[])
        {
            assert!(read_urdf(&written).is_ok(), "the written description cannot be read");
        }
        match slips(text, &robot.model, None) {
            Ok(found) => match rewrite_inertials(text, &found.stated, &found.corrected) {
                Ok(mended) => assert!(read_urdf(&mended).is_ok(), "the corrected description cannot be read"),
                Err(error) => return said(&error),
            },
            Err(error) => return said(&error),
        }
        true
    })
}

/// MJCF: read with includes, write.
pub(crate) fn mjcf() -> io::Result<Box<dyn Run>> {
    plain(|input| {
        let Ok(text) = core::str::from_utf8(input) else { return false };
        // A file that includes itself, and a missing file.
        let mut include = |file: &str| match file {
            "itself.xml" => Ok(text.to_owned()),
            _ => Err("no such file".to_owned()),
        };
        let robot = match read_mjcf_with(text, &mut include) {
            Ok(robot) => robot,
            Err(error) => return said(&error),
        };
        sound(&robot.model);
        assert_eq!(rewrite_mjcf(text, &mut include, &[], &[]).as_deref(), Ok(text));
        if let Ok(changes) = link_changes(&robot.model, robot.model.inertials())
            && let Ok(written) = rewrite_mjcf(text, &mut include, &changes, &[])
        {
            assert!(read_mjcf_with(&written, &mut include).is_ok(), "the written description cannot be read");
        }
        true
    })
}

/// SDF: read, convert to URDF, write new drive values.
pub(crate) fn sdf() -> io::Result<Box<dyn Run>> {
    plain(|input| {
        let Ok(text) = core::str::from_utf8(input) else { return false };
        let robot = match read_sdf(text) {
            Ok(robot) => robot,
            Err(error) => return said(&error),
        };
        sound(&robot.model);
        assert!(!write_urdf(&robot.model).is_empty());
        // Writing equal drive values a second time must not change the file.
        let drive = |joint: &Joint| JointChange {
            joint: joint.name.clone(),
            damping: Some(0.25),
            friction: Some(0.5),
            drive_inertia: None,
            stiffness: Some(2.0),
        };
        let joints: Vec<JointChange> = robot.model.joints().iter().map(drive).collect();
        match rewrite_sdf(text, &[], &joints) {
            Ok(written) => {
                let Ok(again) = read_sdf(&written) else { panic!("the written SDF cannot be read: {written}") };
                assert!(again.model.joints().iter().all(|joint| joint.damping == Some(0.25)));
                assert_eq!(rewrite_sdf(&written, &[], &joints).ok(), Some(written));
            }
            Err(error) => drop(said(&error)),
        }
        true
    })
}

/// D-H table.
pub(crate) fn dh() -> io::Result<Box<dyn Run>> {
    plain(|input| {
        let Ok(text) = core::str::from_utf8(input) else { return false };
        match read_dh(text) {
            Ok(model) => {
                sound(&model);
                true
            }
            Err(error) => said(&error),
        }
    })
}

/// Study: read, with the names and formats of its logs.
pub(crate) fn study() -> io::Result<Box<dyn Run>> {
    plain(|input| {
        let Ok(text) = core::str::from_utf8(input) else { return false };
        match Study::parse(text, Path::new("study.toml")) {
            Ok(study) => {
                for log in 0..study.log.len() {
                    assert!(!study.log_name(log).is_empty());
                    let _ = study.format_of(log).validate(&["a".to_owned(), "b".to_owned()]);
                }
                true
            }
            Err(error) => said(&error),
        }
    })
}

fn two_joints() -> Vec<String> {
    ["shoulder", "elbow"].map(str::to_owned).to_vec()
}

/// Text tables of samples, with clock and differentiator, and the table of a robot program.
pub(crate) fn log() -> io::Result<Box<dyn Run>> {
    of_file("log.csv", |path| {
        let time = TimeColumn::seconds(ColumnRef::Name("t".to_owned()));
        let group = |name: &str| ChannelGroup::new(Columns::Pattern(format!("{name}{{1..2}}")));
        let format = LogFormat::with_time(time, group("q"), group("tau"));
        if let Err(error) = read_log_table(path, &two_joints(), 100.0) {
            said(&error);
        }
        let mut stream = match MotionStream::open(&format, path, &two_joints(), &MotionSettings::default()) {
            Ok(stream) => stream,
            Err(error) => return said(&error),
        };
        let mut block = MotionBlock::default();
        loop {
            match stream.next_block(&mut block) {
                Ok(true) => {
                    let numbers = block.q.iter().chain(&block.dq).chain(&block.ddq).chain(&block.tau);
                    assert!(numbers.into_iter().all(|x| x.is_finite()), "not finite");
                }
                Ok(false) => return true,
                Err(error) => return said(&error),
            }
        }
    })
}

/// The arm of the small commands.
fn arm() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus/jobs/arm.urdf")
}

/// Tables of states.
pub(crate) fn states() -> io::Result<Box<dyn Run>> {
    of_file("states.csv", |path| {
        let Ok(robot) = dynident::model::load_robot(arm()) else { return false };
        let quantities = [
            Quantity::InverseDynamics,
            Quantity::ForwardDynamics,
            Quantity::MassMatrix,
            Quantity::Gravity,
            Quantity::Regressor,
        ];
        let mut accepted = false;
        for quantity in quantities {
            match dynident::evaluate(&robot.model, path, quantity, &mut io::sink()) {
                Ok(_) => accepted = true,
                Err(error) => {
                    said(&error);
                }
            }
        }
        accepted
    })
}

/// An expression of a declared torque: checks that values and slopes are numbers and that its text can be parsed.
pub(crate) fn expression() -> io::Result<Box<dyn Run>> {
    plain(|input| {
        let text = String::from_utf8_lossy(input);
        let names = ["shoulder".to_owned(), "upper arm".to_owned()];
        match Expression::parse(&text, &JointNames { own: Some(0), names: &names }) {
            Ok(expression) => {
                let (q, dq) = ([0.7, -1.3], [0.4, 2.1]);
                let value = expression.value(|joint| q[joint], |joint| dq[joint]);
                assert!(value.is_none_or(f64::is_finite), "{expression}: {value:?}");
                let slope = |_, _, slope: f64| assert!(slope.is_finite(), "{expression}: {slope}");
                expression.slopes(|joint| q[joint], |joint| dq[joint], slope);
                assert_eq!(Expression::try_from(expression.to_string()).as_ref(), Ok(&expression));
                true
            }
            Err(error) => said(&error),
        }
    })
}

/// `result.json`.
pub(crate) fn result() -> io::Result<Box<dyn Run>> {
    of_file("result.json", |path| match ResultFile::read_edited(path) {
        Ok(_) => true,
        Err(error) => said(&error),
    })
}

/// A file of factors with a recomputed hash; otherwise every mutated file would be rejected for its hash.
pub(crate) fn factors() -> io::Result<Box<dyn Run>> {
    plain(|input| {
        let hash = Sha256::digest(input);
        match Factors::from_bytes(&[input, &hash[..]].concat()) {
            Ok(factors) => factors.to_bytes().is_ok(),
            Err(error) => said(&error),
        }
    })
}

/// `design.json`.
pub(crate) fn design() -> io::Result<Box<dyn Run>> {
    plain(|input| match serde_json::from_slice::<DesignFile>(input) {
        Ok(file) => serde_json::to_string(&file).is_ok(),
        Err(error) => said(&error),
    })
}

/// `run.json` in the folder of an iteration.
pub(crate) fn iterations() -> io::Result<Box<dyn Run>> {
    of_file("runs/run_1/run.json", |path| {
        let Some(folder) = path.ancestors().nth(3) else { return false };
        match IterationStore::open(folder, "fuzz", true).and_then(|store| store.records()) {
            Ok(records) => !records.is_empty(),
            Err(error) => said(&error),
        }
    })
}

/// Messages of a robot program.
pub(crate) fn protocol() -> io::Result<Box<dyn Run>> {
    plain(|input| {
        let mut accepted = false;
        for line in input.split(|byte| *byte == b'\n') {
            match serde_json::from_slice::<ToHost>(line) {
                Ok(message) => accepted |= !message.kind().is_empty(),
                Err(error) => {
                    said(&error);
                }
            }
        }
        accepted
    })
}
