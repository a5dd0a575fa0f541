//! Hostile names, written into every output and read by the target programs. No name is executed, no output has more
//! parts than with a harmless name, and no character is invisible.

use super::common::{repository, run_in};
use dynident::excitation::Motion;
use dynident::excitation::export::{
    LeRobotEpisode, Sampled, lerobot_episode, ros2_commands, ros2_joint_trajectory, trajectory_csv, waypoints_csv,
};
use dynident::export::{
    Actuator, ControllerBrand, Exported, PayloadBody, RobotModel, Target, export, isaac_lab, payload_command,
};
use dynident::model::terms::{Declared, DeclaredLaw, Expression, JointNames, Offset, TorqueTerm, Viscous};
use dynident::model::{
    InertialParameters, JointChange, LinkChange, Model, link_changes, load_robot, read_mjcf, read_sdf, read_urdf,
    rewrite_dh, rewrite_mjcf, rewrite_sdf, rewrite_urdf, write_urdf,
};
use dynident::simulation::PerJoint;
use dynident::simulation::Reference;
use dynident::simulation::controllers::{ControllerSettings, JointPdSettings};
use dynident::text::{is_invisible, xml};
use dynident::{ResultFile, RunOptions, Silent, Study, identification_report, identify};
use roxmltree::Document;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// A harmless name: all outputs must have the same structure with the other names.
const PLAIN: &str = "plain";

/// Names that end strings, comments and elements in some language.
const FIXED: [&str; 44] = [
    PLAIN,
    // Finding A2: code after the end of a line comment.
    "x\nimport os; os.system('touch MARKER')\n#",
    "x\npub fn pwned() -> i32 { std::process::id() as i32 }\n//",
    "x\nstatic int pwned = (__builtin_puts(\"PWNED\"), 1);\n//",
    "x\nsystem('touch MARKER');\n%",
    "x */ static int pwned(void){return 1;} /*",
    // Finding A3: invisible characters.
    "j\u{202e}\u{2066} /*evil*/ \u{2069}\u{200b}",
    "j\u{9b}31m\u{85}x\u{2028}y\u{2029}z",
    "\u{feff}a\u{ad}b\u{e0001}\u{e0041}\u{1d173}\u{61c}\u{180e}\u{fff9}",
    "a\u{1b}[2J\u{1b}]0;title\u{7}\u{8}\u{7f}",
    "\r\nsystem('touch MARKER')\r",
    // Ends of strings, comments and elements.
    "</script><script>document.title=\"PWNED\"</script><img src=x onerror=\"document.title='PWNED'\">",
    "j\"\"\"\nimport os;os.system(\"touch MARKER\")\n\"\"\"",
    "j */ #include \"/etc/passwd\"\n int evil=system(\"id\"); /* \"); system(\"touch MARKER\"); (\"",
    "j\\\nsystem(\"x\"); // ??/\nint q;",
    "j\"#; fn evil(){std::process::exit(3)} /* */ const X: &str = r#\"",
    "j'); system('touch MARKER'); ('%{\n%}",
    "%{",
    "%}\nsystem('touch MARKER')\n%{",
    "...\nsystem('touch MARKER')",
    "j: {a: b}\n- !!python/object/apply:os.system [\"touch MARKER\"]\n# ",
    "!!python/object/apply:os.system [\"touch MARKER\"]",
    "&a [*a, *a]",
    "a\": b\n---\nc: \"",
    "'; DROP TABLE x;--",
    "%s%n{0}{{7*7}}{% raw %}${jndi}",
    "a\"/><plugin filename=\"evil.so\"/><x y=\"<![CDATA[ ]]> --> <!-- ",
    "--><link name='evil'/><!--",
    "]]>&evil;<!DOCTYPE x [<!ENTITY e SYSTEM 'file:///etc/passwd'>]>",
    "<?xml version='1.1'?>",
    "a--b---",
    "$(find evil)/../../x ; rm -rf",
    "=cmd|' /C calc'!A0",
    "@SUM(1+1)*cmd",
    "\\",
    "ends with a backslash \\",
    "ends with blanks behind it \\ \t ",
    "???/",
    "*/",
    "/*",
    "coding: utf_7 +AAo-import os+AAo-os.system('touch MARKER')+AAo-",
    "vim: set fileencoding=utf-7 :",
    "`<b>`|[x](javascript:alert(1))",
    "if",
];

/// Pieces of further names.
const PIECES: [&str; 36] = [
    "\n", "\r", "\u{2028}", "\u{85}", "\\", "/", "*", "*/", "/*", "//", "#", "%", "%{", "%}", "\"", "'", "\"\"\"",
    "'''", "r#\"", "\"#", "?", "??/", "<", ">", "--", "-->", "]]>", "<script>", "&", ";", ": ", "- ", "{", "}",
    "\u{202e}", "\u{0}",
];

/// At least two hundred names: the fixed ones, a long one, and pieces in random order (Knuth's MMIX constants).
fn names() -> Vec<String> {
    let mut names: Vec<String> = FIXED.map(str::to_owned).to_vec();
    names.push("*/ \" long \\".repeat(10_000));
    let mut state: u64 = 20_261_128;
    let mut below = |most: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % most
    };
    while names.len() < 210 {
        let length = 1 + below(8);
        names.push((0..length).map(|_| PIECES[below(PIECES.len())]).collect());
    }
    names
}

fn assert_visible(what: &str, text: &str) {
    if let Some(c) = text.chars().find(|&c| c != '\n' && is_invisible(c)) {
        panic!("{what}: U+{:04X} in {}", u32::from(c), text.escape_debug().take(2000).collect::<String>());
    }
}

/// Whether a program can be run; prints a message if it is missing.
#[allow(clippy::print_stdout, reason = "a test says that it was skipped")]
fn has(program: &str, arguments: &[&str]) -> bool {
    let found = Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success());
    if !found {
        println!("skipped: there is no `{program}`, which would read what was written");
    }
    found
}

fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).current_dir(folder).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program}: {}", &errors[..errors.len().min(4000)]);
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The arm of the fixture with one name for everything.
fn arm(number: usize, name: &str) -> Model {
    let model = load_robot(super::common::broken().join("arm.urdf")).unwrap().model;
    let mut base = model.base().clone();
    base.links[0].name = format!("B{name}");
    let (mut joints, mut bodies) = (model.tree_joints().to_vec(), model.bodies().to_vec());
    for (place, (joint, body)) in joints.iter_mut().zip(&mut bodies).enumerate() {
        joint.name = format!("J{place}{name}");
        body.links[0].name = format!("L{place}{name}");
    }
    // Numbered, so that all of them can be compiled together.
    Model::new(&format!("n{number} {name}"), base, joints, bodies).unwrap()
}

fn robot(number: usize, name: &str) -> RobotModel {
    let model = arm(number, name);
    let law = DeclaredLaw::Expression(Expression::parse("sin(q)", &JointNames { own: Some(0), names: &[] }).unwrap());
    // Names of torques are checked where they are declared; units are not.
    let spring =
        Declared { name: "spring".to_owned(), joint: 0, law, unit: name.to_owned(), nominal: None, is_spring: false };
    let terms = vec![
        TorqueTerm::Viscous(Viscous { joint: 0 }),
        TorqueTerm::Offset(Offset { joint: 1 }),
        TorqueTerm::Declared(spring),
    ];
    RobotModel::new(model, terms, vec![0.5, 0.25, 1.5]).unwrap()
}

fn exported(robot: &RobotModel, target: Target, name: &str) -> String {
    let Exported { text, .. } = export(robot, target, &[format!("From the study {name}"), name.to_owned()]).unwrap();
    assert_visible(target.name(), &text);
    text
}

/// Lines of code without comments, with the robot's identifier as `N`.
fn code(text: &str, mark: &str, identifier: &str) -> String {
    let lines = text.lines().filter(|line| !line.trim_start().starts_with(mark));
    let text = lines.collect::<Vec<_>>().join("\n");
    text.replace(identifier, "N").replace(&identifier.to_uppercase(), "N")
}

#[test]
fn code_in_names_is_not_code_in_exports() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let marker = at.join("marker");
    let names: Vec<String> =
        names().into_iter().map(|name| name.replace("MARKER", &marker.display().to_string())).collect();
    let (mut c, mut cpp, mut rust, mut octave) = (String::new(), String::new(), String::new(), String::new());
    let mut identifiers = Vec::new();
    let mut plain: Vec<String> = Vec::new();
    for (number, name) in names.iter().enumerate() {
        let robot = robot(number, name);
        let identifier = robot.identifier();
        // Line comments end only at a newline.
        for (place, (target, mark)) in [
            (Target::Cpp, "//"),
            (Target::Rust, "//"),
            (Target::Python, "#"),
            (Target::Matlab, "%"),
            (Target::Ros2Yaml, "#"),
            (Target::Casadi, "#"),
            (Target::Jax, "#"),
            (Target::Pinocchio, "#"),
        ]
        .into_iter()
        .enumerate()
        {
            let text = exported(&robot, target, name);
            let own = code(&text, mark, &identifier);
            if number == 0 {
                plain.push(own);
            } else if ![Target::Ros2Yaml, Target::Pinocchio].contains(&target) {
                assert_eq!(own, plain[place], "{} with {name:?}", target.name());
            }
            match target {
                Target::Cpp => {
                    // All of them form one file, which is not a header.
                    let _ = writeln!(cpp, "{}\nint marker_{number};", text.replace("#pragma once", ""));
                }
                Target::Rust => {
                    let _ = writeln!(rust, "pub mod n{number} {{\n{text}\n}}");
                }
                Target::Python => std::fs::write(at.join(format!("n{number}.py")), &text).unwrap(),
                Target::Casadi | Target::Jax | Target::Pinocchio => {
                    std::fs::write(at.join(format!("{}{number}.py", target.name())), &text).unwrap();
                }
                Target::Matlab => {
                    std::fs::write(at.join(format!("{identifier}_dynamics.m")), &text).unwrap();
                    let _ = writeln!(octave, "assert(numel({identifier}_dynamics('gravity', [0.1 0.2])) == 2);");
                }
                _ => std::fs::write(at.join(format!("n{number}.yaml")), &text).unwrap(),
            }
        }
        let _ = writeln!(c, "{}\nint marker_{number};", exported(&robot, Target::C, name));
        identifiers.push(identifier);
    }
    for (compiler, language, standard, text) in [("cc", "c", "-std=c99", &c), ("c++", "c++", "-std=c++17", &cpp)] {
        if !has(compiler, &["--version"]) {
            continue;
        }
        let file = format!("all.{language}");
        std::fs::write(at.join(&file), text).unwrap();
        let flags = [
            "-x",
            language,
            standard,
            "-trigraphs",
            "-pedantic",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-Wno-unused-function",
            "-fsyntax-only",
        ];
        run(at, compiler, &[&flags[..], &[&file]].concat());
        // After the preprocessor the code is the same for every name.
        let without: Vec<&str> = text.lines().filter(|line| !line.starts_with("#include <")).collect();
        std::fs::write(at.join(&file), without.join("\n")).unwrap();
        let left = run(at, compiler, &["-x", language, standard, "-trigraphs", "-E", "-P", &file]);
        let mut rest = &left[..];
        let mut first = None;
        for (number, identifier) in identifiers.iter().enumerate() {
            let (own, after) = rest.split_once(&format!("int marker_{number};")).unwrap();
            rest = after;
            let own = own.replace(identifier, "N").replace(&identifier.to_uppercase(), "N");
            let own = own.split_whitespace().collect::<Vec<_>>().join(" ");
            assert_eq!(&own, first.get_or_insert_with(|| own.clone()), "{:?}", names[number]);
        }
    }
    let rustc = std::env::var("RUSTC").unwrap_or("rustc".to_owned());
    if has(&rustc, &["--version"]) {
        std::fs::write(at.join("all.rs"), rust).unwrap();
        run(at, &rustc, &["--edition=2021", "--crate-type=lib", "--emit=metadata", "-Dwarnings", "all.rs"]);
    }
    if has("octave-cli", &["--version"]) {
        std::fs::write(at.join("every_export.m"), octave).unwrap();
        run(at, "octave-cli", &["--norc", "--quiet", "every_export.m"]);
    }
    if has("python3", &["--version"]) {
        std::fs::write(at.join("look.py"), LOOK).unwrap();
        let told = run(at, "python3", &["look.py"]);
        print!("{told}");
        assert!(told.starts_with(&format!("{} modules", names.len())), "{told}");
    }
    assert!(!marker.exists(), "a name was executed");
}

/// Reads every module and every YAML file: the top-level parts are those of the first.
const LOOK: &str = r#"
import ast, glob
parts = {}
files = sorted(glob.glob("n*.py"))
for file in files:
    # Bytes: an encoding in a comment of the first lines counts.
    tree = ast.parse(open(file, "rb").read(), file)
    parts[file] = [(type(node).__name__, getattr(node, "name", "")) for node in tree.body]
    assert parts[file] == parts["n0.py"], (file, parts[file])
print(len(files), "modules")
# Names of joints are strings of the module for Pinocchio; everything else is the same for every name.
class WithoutStrings(ast.NodeTransformer):
    def visit_Constant(self, node):
        return ast.Constant("") if isinstance(node.value, str) else node
for kind in ("casadi", "jax", "pinocchio"):
    found = {ast.dump(WithoutStrings().visit(ast.parse(open(file, "rb").read(), file))) for file in glob.glob(kind + "*.py")}
    assert len(found) == 1, (kind, len(found))
try:
    import yaml
except ImportError:
    print("skipped: there is no module `yaml`, which would read parameters of ROS 2")
else:
    for file in sorted(glob.glob("n*.yaml")):
        read = yaml.safe_load(open(file, encoding="utf-8"))
        robot = read["/**"]["ros__parameters"]
        assert set(robot) == {"robot", "joints", "gravity_m_s2", "dynamics"}, (file, set(robot))
        assert len(robot["joints"]) == 2 and len(robot["dynamics"]) == 2, file
"#;

/// The elements of a document with the names of their attributes.
fn elements(text: &str) -> Vec<(String, Vec<String>)> {
    let document = Document::parse(text).unwrap_or_else(|error| panic!("{error}: {text}"));
    let all = document.descendants().filter(roxmltree::Node::is_element);
    all.map(|node| {
        let attributes = node.attributes().map(|attribute| attribute.name().to_owned()).collect();
        (node.tag_name().name().to_owned(), attributes)
    })
    .collect()
}

/// Whether XML can represent a name, and readers of robot descriptions accept it unchanged.
fn fits_xml(name: &str) -> bool {
    let is_control = |c: char| c < ' ' && !matches!(c, '\n' | '\r' | '\t') || matches!(c, '\u{fffe}' | '\u{ffff}');
    !name.contains(is_control) && !name.contains("${") && !name.contains("$(")
}

/// A name as in somebody else's file: markup is escaped, invisible characters are kept.
fn raw(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        match c {
            '&' | '<' | '>' | '"' | '\n' | '\r' | '\t' => text += &xml::escaped(&c.to_string()),
            c => text.push(c),
        }
    }
    text
}

#[test]
fn names_are_no_elements_of_descriptions() {
    let names = names();
    let mut plain: Vec<Vec<(String, Vec<String>)>> = Vec::new();
    for (number, name) in names.iter().enumerate() {
        let robot = robot(number, name);
        for (place, target) in [Target::Urdf, Target::Mjcf, Target::Sdf].into_iter().enumerate() {
            let found = elements(&exported(&robot, target, name));
            if number == 0 {
                plain.push(found);
            } else {
                assert_eq!(found, plain[place], "{} with {name:?}", target.name());
            }
        }
        // Xacro, through which ROS reads URDF, evaluates these as Python.
        let urdf = exported(&robot, Target::Urdf, name);
        assert!(!urdf.contains("${") && !urdf.contains("$("), "{urdf}");
        if fits_xml(name) {
            // Readers get exactly the same names, so references by name remain valid.
            let again = read_urdf(&exported(&robot, Target::Urdf, name)).unwrap().model;
            assert_eq!(again.joints()[1].name, robot.model().joints()[1].name);
            assert_eq!(again.name(), robot.model().name());
            rewritten(name);
        }
    }
}

fn rewritten(name: &str) {
    let own = raw(name);
    let note = own.replace("--", "- -").replace("--", "- -").replace("&#xd;", " ");
    let described = write_urdf(&arm(0, PLAIN));
    let (declaration, rest) = described.split_once('\n').unwrap();
    let urdf = format!("{declaration}\n<!-- {note} -->\n{}", rest.replace(PLAIN, &own));
    let model = read_urdf(&urdf).unwrap().model;
    let joint = |name: &str| JointChange {
        joint: name.to_owned(),
        damping: Some(0.5),
        friction: None,
        drive_inertia: None,
        stiffness: None,
    };
    let mut links = link_changes(&model, model.inertials()).unwrap();
    for link in &mut links {
        if let LinkChange::Set { note, .. } = link {
            *note = Some(format!("of {name}"));
        }
    }
    let written = rewrite_urdf(&urdf, &links, &[joint(&model.joints()[0].name)]).unwrap();
    assert_visible("identified.urdf", &written);
    let again = read_urdf(&written).unwrap().model;
    assert_eq!(again.joints()[0].name, model.joints()[0].name);
    assert_eq!(again.joints()[0].damping, Some(0.5));

    let inertial = "<inertial pos=\"0 0 0.1\" mass=\"2\" diaginertia=\"0.1 0.1 0.1\"/>";
    let mjcf = format!(
        "<mujoco><!-- {note} --><worldbody><body name=\"L{own}\">{inertial}<joint name=\"J{own}\" axis=\"0 1 0\"/></body></worldbody></mujoco>"
    );
    let model = read_mjcf(&mjcf).unwrap().model;
    let change = |link: &str, inertial: InertialParameters| LinkChange::Set {
        link: link.to_owned(),
        inertial,
        note: Some(format!("of {name}")),
    };
    let links = [change(model.bodies()[0].name(), model.inertials()[0])];
    let written = rewrite_mjcf(&mjcf, &mut |_: &str| Err(String::new()), &links, &[joint(&model.joints()[0].name)]);
    let written = written.unwrap();
    assert_visible("identified.xml", &written);
    assert_eq!(read_mjcf(&written).unwrap().model.joints()[0].name, model.joints()[0].name);

    // Readers of SDF compare names in the text of elements, from which they trim blanks.
    if name.contains("::") || name.trim() != name || name.is_empty() {
        return;
    }
    let sdf = format!(
        "<sdf version=\"1.7\"><!-- {note} --><model name=\"m\"><link name=\"B\"/><link name=\"L{own}\"><inertial><mass>2</mass>\
         <inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link><joint name=\"J{own}\" type=\"revolute\">\
         <parent>B</parent><child>L{own}</child><axis><xyz>0 1 0</xyz></axis></joint></model></sdf>"
    );
    let Ok(read) = read_sdf(&sdf) else { panic!("{sdf}") };
    let links = [change(read.model.bodies()[0].name(), read.model.inertials()[0])];
    let written = rewrite_sdf(&sdf, &links, &[joint(&read.model.joints()[0].name)]).unwrap();
    assert_visible("identified.sdf", &written);
    assert_eq!(read_sdf(&written).unwrap().model.joints()[0].name, read.model.joints()[0].name);
}

/// The texts of a LeRobot data set: one document, or one in each line.
fn data_set_has_names(name: &str, joints: &[String]) {
    let actions = vec![vec![0.5]; joints.len()];
    let episode = LeRobotEpisode { robot_type: name, task: name, rate_hz: 50.0, names: joints, actions: &actions };
    let files = lerobot_episode(&episode).unwrap();
    let texts: Vec<&str> = files[..4].iter().map(|(_, contents)| core::str::from_utf8(contents).unwrap()).collect();
    for text in &texts {
        assert_visible("lerobot", text);
    }
    let info: Value = serde_json::from_str(texts[0]).unwrap();
    assert_eq!((&info["features"]["action"]["names"], &info["robot_type"]), (&serde_json::json!(joints), &name.into()));
    assert!(texts[1..].iter().all(|text| text.lines().count() == 1));
    assert_eq!(serde_json::from_str::<Value>(texts[1]).unwrap()["task"], name);
}

/// Actuators of Isaac Lab: names are strings, and notes are comments.
#[test]
fn names_are_no_code_in_actuators() {
    let folder = tempfile::tempdir().unwrap();
    let names = names();
    for (number, name) in names.iter().enumerate() {
        let actuator = Actuator {
            joint: name.clone(),
            stiffness: 10.0,
            damping: 0.5,
            armature: 0.01,
            friction: 0.1,
            effort_limit: None,
            velocity_limit: None,
            delay_s: 0.01,
        };
        let text = isaac_lab(name, &[actuator], 0.005, vec![format!("From the study {name}")]).text;
        assert_visible("isaac-lab", &text);
        std::fs::write(folder.path().join(format!("drives{number}.py")), text).unwrap();
        std::fs::write(folder.path().join(format!("drives{number}.name")), name).unwrap();
    }
    if has("python3", &["--version"]) {
        std::fs::write(folder.path().join("look.py"), LOOK_AT_DRIVES).unwrap();
        let told = run(folder.path(), "python3", &["look.py"]);
        assert_eq!(told.trim(), format!("{} modules", names.len()));
    }
}

/// Reads every module without running it: its joint is the name, and everything else is that of the first.
const LOOK_AT_DRIVES: &str = r#"
import ast, glob
files = sorted(glob.glob("drives*.py"))
found = set()
for file in files:
    tree = ast.parse(open(file, "rb").read(), file)
    drives = next(node.value for node in tree.body if isinstance(node, ast.Assign) and node.targets[0].id == "DRIVES")
    [key] = drives.keys
    assert key.value.encode() == open(file.replace(".py", ".name"), "rb").read(), file
    key.value = ""
    found.add(ast.dump(tree))
assert len(found) == 1, len(found)
print(len(files), "modules")
"#;

#[test]
fn tables_and_json_hold_names_as_names() {
    let mut tables = 0;
    for (number, name) in names().iter().enumerate() {
        let model = arm(number, name);
        let joints: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
        let mut motion = Motion::default();
        motion.reset(2, 3);
        let sampled = Sampled { joints: &joints, times_s: &[0.0, 0.5, 1.0], motion: &motion };
        let trajectory = ros2_joint_trajectory(&sampled).unwrap();
        assert_visible("ros2", &trajectory);
        assert_eq!(trajectory.lines().count(), 4 + 2 + 1 + 3 * 4, "{trajectory}");
        assert_visible("trajectory.csv", &trajectory_csv(&sampled).unwrap());
        let commands = ros2_commands(&joints, &[0.0, 0.5], &[vec![0.0; 2], vec![1.0; 2]]).unwrap();
        assert_visible("commands.ros2.yaml", &commands);
        assert_eq!(commands.lines().count(), 4 + 2 + 1 + 2 * 2, "{commands}");
        data_set_has_names(name, &joints);
        let waypoints = waypoints_csv(&sampled).unwrap();
        assert_visible("waypoints.csv", &waypoints);
        let mut table = csv::Reader::from_reader(waypoints.as_bytes());
        let header = table.headers().unwrap().clone();
        assert_eq!((header.len(), table.records().flatten().count()), (3, 3), "{waypoints}");
        assert!(header.iter().all(|field| !field.starts_with(['=', '+', '-', '@'])), "{waypoints}");

        let reference = Reference::new(10.0, motion.clone()).unwrap();
        let gain = PerJoint::All(1.0);
        let settings = ControllerSettings::JointPd(JointPdSettings { kp: gain.clone(), kd: gain });
        let request = dynident::iteration::robot::RunRequest::new(1, &reference, &settings);
        let value = dynident::iteration::robot::controller_json(&request, &joints);
        let text = dynident::text::json::to_string_pretty(&value).unwrap();
        assert_visible("controller.json", &text);
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);

        let json: Value = serde_json::from_str(&exported(&robot(number, name), Target::Json, name)).unwrap();
        assert_eq!(json["joints"][1]["name"], joints[1]);
        assert_eq!(json["notes"][1], **name);

        let arm = dynident::export::SimulatorFile::of(&robot(number, name), &knowledge(), core::slice::from_ref(name))
            .unwrap();
        let table = arm.table().text;
        assert_visible("simulator-table", &table);
        assert!(!table.contains('<'), "{table}");
        let cells = |line: &&str| line.replace("\\|", "").matches('|').count();
        assert!(table.lines().filter(|line| line.starts_with('|')).all(|line| cells(&line) == 8), "{table}");

        let body = PayloadBody { name: name.clone(), inertial: model.inertials()[0] };
        for reader in
            [ControllerBrand::UniversalRobots, ControllerBrand::Franka, ControllerBrand::Kuka, ControllerBrand::Abb]
        {
            let command = payload_command(&body, reader, &[]).unwrap();
            assert_visible("payload", &command);
            assert_eq!((command.lines().count(), command.matches([';', '"']).count() <= 7), (1, true), "{command}");
            let commented = payload_command(&body, reader, core::slice::from_ref(name)).unwrap();
            assert_visible("payload", &commented);
            let (head, last) = commented.trim_end().rsplit_once('\n').unwrap_or(("", commented.trim_end()));
            assert_eq!(last, command.trim_end());
            assert!(head.lines().count() <= 1 && head.is_ascii(), "{commented}");
        }

        let table = format!(
            "# {}\nname = {quoted}\nconvention = \"standard\"\n[[joint]]\nname = {quoted} # {}\nlink = 'L'\na_m = 0.3\n",
            name.replace(|c: char| c.is_control(), " "),
            name.replace(|c: char| c.is_control(), " "),
            quoted = toml::Value::String(name.clone()),
        );
        let Ok(read) = dynident::model::read_dh(&table) else { continue };
        let change = JointChange {
            joint: read.joints()[0].name.clone(),
            damping: Some(0.5),
            friction: None,
            drive_inertia: None,
            stiffness: None,
        };
        let written = rewrite_dh(&table, &[], &[change]).unwrap();
        assert_visible("identified.toml", &written.replace(['\t', '\r'], " "));
        let again: toml::Table = written.parse().unwrap();
        assert_eq!(again["name"].as_str(), Some(&**name));
        tables += 1;
    }
    assert!(tables > 200, "{tables}");
}

fn knowledge() -> dynident::export::DriveKnowledge {
    dynident::export::DriveKnowledge {
        term_products: vec![vec![None; 3]; 3],
        term_notes: vec![None; 3],
        common_delay: None,
        delays: vec![None; 2],
        actuator_gains: vec![
            dynident::export::SimulatorValue {
                value: 1.0,
                half_width_95: None,
                unit: String::new(),
                note: None
            };
            2
        ],
    }
}

/// Names of the elements and of their attributes, without the text of scripts.
fn markup(page: &str) -> (std::collections::BTreeSet<String>, usize) {
    let (mut found, mut scripts) = (std::collections::BTreeSet::new(), 0);
    let mut rest = page;
    while let Some(at) = rest.find('<') {
        rest = &rest[at + 1..];
        let name: String = rest.chars().take_while(|c| c.is_ascii_alphanumeric() || "!/-".contains(*c)).collect();
        let mut quote = None;
        let mut outside = String::new();
        let mut length = rest.len();
        for (at, c) in rest.char_indices() {
            match (quote, c) {
                (None, '>') => {
                    length = at;
                    break;
                }
                (None, '"' | '\'') => quote = Some(c),
                (Some(open), c) if c == open => quote = None,
                (None, c) => outside.push(c),
                _ => {}
            }
        }
        rest = &rest[length..];
        for attribute in outside[name.len()..].split_whitespace() {
            found.insert(format!("{name} {}", attribute.split('=').next().unwrap()));
        }
        if name == "script" {
            scripts += 1;
            rest = &rest[rest.find("</script").unwrap()..];
        }
        if name == "style" {
            rest = &rest[rest.find("</style").unwrap()..];
        }
        found.insert(name);
    }
    (found, scripts)
}

#[test]
fn names_are_no_markup_of_pages() {
    // The fixture is identified once with unique names, which are then replaced, also in sentences.
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let urdf = std::fs::read_to_string(super::common::broken().join("arm.urdf")).unwrap();
    let urdf = ["arm", "base", "upper", "lower", "shoulder", "elbow"]
        .iter()
        .fold(urdf, |text, name| text.replace(&format!("\"{name}\""), &format!("\"QQ{name}\"")));
    std::fs::write(at.join("QQarm.urdf"), urdf).unwrap();
    let log = super::common::broken().join("log.csv");
    std::fs::copy(log, at.join("QQlog.csv")).unwrap();
    let text = "name = \"QQstudy\"\n[robot]\nfile = \"QQarm.urdf\"\n[format]\ntime = { column = \"t\" }\n\
        position = { columns = \"q{1..2}\" }\ntorque = { columns = \"tau{1..2}\" }\n[drive]\nfriction = \"stated\"\n\
        [[log]]\nname = \"QQlog\"\nfile = \"QQlog.csv\"\n";
    let path = at.join("QQstudy.toml");
    let study = Study::parse(text, &path).unwrap();
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    let outcome = identify(&study, &path, &options).unwrap();
    let mut result = serde_json::to_value(&outcome.result).unwrap();
    result["provenance"].as_object_mut().unwrap().remove("content_sha256").unwrap();
    result["problems"] = vec!["QQarm: a sentence on QQelbow"].into();
    result["method"]["functions"] = vec!["QQfunction"].into();
    result["provenance"]["command"] = "dynident identify QQstudy.toml".into();
    let page = |name: &str| {
        let value = renamed(&result, name);
        let file = ResultFile::parse(value.to_string().as_bytes(), Path::new("result.json")).unwrap();
        let json = dynident::text::json::to_string_pretty(&file).unwrap();
        assert_visible("result.json", &json);
        assert_eq!(serde_json::from_str::<Value>(&json).unwrap()["robot"]["name"], value["robot"]["name"]);
        let mut traces = outcome.traces.clone();
        for trace in &mut traces {
            trace.log = trace.log.replace("QQlog", name);
        }
        identification_report(&file, &traces, Some(&outcome.robot)).unwrap()
    };
    let plain = page(PLAIN);
    let (known, scripts) = markup(&plain);
    assert!(scripts > 2 && known.contains("script data-plot") && !known.contains("img"), "{known:?}");
    for name in names() {
        let page = page(&name);
        assert_visible("report.html", &page);
        let (found, own) = markup(&page);
        let strange: Vec<&String> = found.difference(&known).collect();
        assert!(strange.is_empty() && own == scripts, "{name:?}: {strange:?}, {own} scripts of {scripts}");
    }
}

fn renamed(value: &Value, name: &str) -> Value {
    match value {
        Value::String(text) => {
            let mut text = text.clone();
            for (place, word) in
                ["QQarm", "QQbase", "QQupper", "QQlower", "QQshoulder", "QQelbow", "QQlog", "QQstudy", "QQfunction"]
                    .iter()
                    .enumerate()
            {
                text = text.replace(word, &format!("{place}{name}"));
            }
            Value::String(text)
        }
        Value::Array(values) => values.iter().map(|value| renamed(value, name)).collect(),
        Value::Object(values) => {
            Value::Object(values.iter().map(|(key, value)| (key.clone(), renamed(value, name))).collect())
        }
        other => other.clone(),
    }
}

/// The command on ten names: everything that it prints and writes, and the code that it exports.
#[test]
fn the_command_executes_no_name() {
    for number in [1, 2, 4, 6, 7, 9, 11, 14, 26, 40] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let name = FIXED[number].replace("MARKER", "marker");
        let own = |text: &str| xml::escaped(text).into_owned();
        let urdf = std::fs::read_to_string(super::common::broken().join("arm.urdf")).unwrap();
        let mut urdf = urdf.replace("\"arm\"", &format!("\"{}\"", own(&name)));
        for part in ["upper", "elbow"] {
            urdf = urdf.replace(&format!("\"{part}\""), &format!("\"{}\"", own(&format!("{part}{name}"))));
        }
        std::fs::write(at.join("r.urdf"), urdf).unwrap();
        let log = std::fs::read_to_string(super::common::broken().join("log.csv")).unwrap();
        std::fs::write(at.join("log.csv"), &log).unwrap();
        let (head, rows) = log.split_once('\n').unwrap();
        let column = name.replace(['\n', '\r', ',', '"'], " ");
        std::fs::write(at.join("new.csv"), format!("{head},{column}\n{}", rows.replace('\n', ",1\n"))).unwrap();
        let string = dynident::text::quoted(&name);
        let study = format!(
            "name = {string}\nsource = {string}\n[robot]\nfile = \"r.urdf\"\n[format]\ntime = {{ column = \"t\" }}\n\
             position = {{ columns = \"q{{1..2}}\" }}\ntorque = {{ columns = \"tau{{1..2}}\" }}\n[drive]\nfriction = \"stated\"\n\
             [[log]]\nname = {string}\nfile = \"log.csv\"\n"
        );
        std::fs::write(at.join("s.toml"), study).unwrap();
        let done = |arguments: &[&str]| {
            let outcome = run_in(at, arguments);
            assert_ne!(outcome.status, -1, "{name:?}: {arguments:?}");
            assert_visible("stdout", &outcome.stdout);
            assert_visible("stderr", &outcome.stderr);
            outcome
        };
        let found = done(&["identify", "s.toml", "--out", "r"]);
        assert!(found.status < 2, "{name:?}: {}", found.stderr);
        for file in ["result.json", "report.html", "identified.urdf"] {
            assert_visible(file, &std::fs::read_to_string(at.join("r").join(file)).unwrap().replace('\r', ""));
        }
        for form in ["c", "cpp", "rust", "python", "matlab", "mjcf", "urdf", "sdf", "ros2-yaml", "json"] {
            let written = done(&["export", "r/result.json", "--study", "s.toml", "--to", form]);
            assert_eq!(written.status, 0, "{name:?} {form}: {}", written.stderr);
            std::fs::write(at.join(format!("robot.{form}")), written.stdout).unwrap();
        }
        done(&["inspect", "r.urdf"]);
        done(&["log", "new.csv", "--json"]);
        done(&["check", "s.toml"]);
        done(&["new", "--robot", "r.urdf", "--log", "new.csv", "--out", "new.toml"]);
        if let Ok(text) = std::fs::read_to_string(at.join("new.toml")) {
            assert_visible("new.toml", &text);
            assert!(text.parse::<toml::Table>().is_ok(), "{text}");
        }
        if has("python3", &["-c", "import numpy"]) {
            run(at, "python3", &["-c", "exec(compile(open('robot.python', 'rb').read(), 'robot.python', 'exec'))"]);
        }
        assert!(!at.join("marker").exists(), "{name:?} was executed");
    }
}

#[test]
fn there_is_one_writer_of_json() {
    fn sources(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                sources(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.push(path);
            }
        }
    }
    let mut strays = Vec::new();
    for entry in std::fs::read_dir(repository("crates")).unwrap() {
        let folder = entry.unwrap().path();
        // Benchmarks and Python keep the JSON in memory, or it contains no file names.
        if ["dynident-text", "dynident-python", "dynident-benchmark", "dynident-testing"]
            .iter()
            .any(|name| folder.ends_with(name))
        {
            continue;
        }
        let mut files = Vec::new();
        sources(&folder.join("src"), &mut files);
        for file in files {
            let text = std::fs::read_to_string(&file).unwrap();
            let code = text.split("#[cfg(test)]\nmod ").next().unwrap();
            let writes = ["serde_json::to_string", "serde_json::to_vec", "serde_json::to_writer"];
            // The head of a factor file is not read by people; its bytes are hashed with the numbers after it.
            let is_head = file.ends_with("factors/file.rs");
            strays.extend(writes.iter().filter(|word| code.contains(**word) && !is_head).map(|_| file.clone()));
        }
    }
    assert!(strays.is_empty(), "write JSON by dynident_text::json: {strays:?}");
}
