//! Exported code, compiled with warnings as errors and run at a thousand states.

use super::common::{all_terms, compare, expected, has, rigid_accelerations, tree};
use core::fmt::Write;
use dynident_export::{RobotModel, Target, export};
use std::path::Path;
use std::process::Command;

const FUNCTIONS: [(&str, &[&str]); 7] = [
    ("inverse_dynamics", &["q", "dq", "ddq"]),
    ("gravity", &["q"]),
    ("coriolis", &["q", "dq"]),
    ("friction", &["dq"]),
    ("mass_matrix", &["q"]),
    ("forward_dynamics", &["q", "dq", "tau"]),
    ("declared", &["q", "dq"]),
];

fn robots() -> Vec<RobotModel> {
    vec![all_terms("ur10.urdf"), all_terms("iiwa14.urdf"), tree()]
}

/// Compiles `program` next to the file `name` with `text`, or shows the compiler's messages.
fn compiled(folder: &Path, name: &str, text: &str, main: &str, program: &str, compiler: &[&str]) -> Command {
    std::fs::write(folder.join(name), text).unwrap();
    std::fs::write(folder.join(main), program).unwrap();
    let output =
        Command::new(compiler[0]).args(&compiler[1..]).args([main, "-o", "program"]).current_dir(folder).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Command::new(folder.join("program"))
}

#[test]
fn c_computes_what_the_core_computes() {
    if !has("cc") {
        println!("skipped: there is no C compiler `cc`");
        return;
    }
    for robot in robots() {
        let (name, dof) = (robot.identifier(), robot.model().dof());
        let mut calls = String::new();
        for (function, inputs) in FUNCTIONS {
            let length = if function == "mass_matrix" { dof * dof } else { dof };
            let _ = writeln!(
                calls,
                "    {{ double out[{length}]; {name}_{function}({}, out); for (int k = 0; k < {length}; k++) printf(\"%.17g \", out[k]); }}",
                inputs.join(", ")
            );
        }
        let program = format!(
            "#include <stdio.h>\n#include \"robot.h\"\nint main(void) {{\n  double v[4 * {dof}];\n  for (;;) {{\n    \
             for (int k = 0; k < 4 * {dof}; k++) if (scanf(\"%lf\", v + k) != 1) return 0;\n    \
             const double *q = v, *dq = v + {dof}, *ddq = v + 2 * {dof}, *tau = v + 3 * {dof};\n{calls}    printf(\"\\n\");\n  }}\n}}\n"
        );
        let folder = tempfile::tempdir().unwrap();
        let text = export(&robot, Target::C, &[]).unwrap().text;
        let flags = ["cc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2", "-ffp-contract=off"];
        let compiler: Vec<&str> = flags.into_iter().collect();
        // The mathematics library must follow the program in the command.
        std::fs::write(folder.path().join("robot.h"), &text).unwrap();
        std::fs::write(folder.path().join("main.c"), &program).unwrap();
        let output = Command::new(compiler[0])
            .args(&compiler[1..])
            .args(["main.c", "-o", "program", "-lm"])
            .current_dir(&folder)
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        compare(&mut Command::new(folder.path().join("program")), &robot, &expected(&robot));
    }
}

#[test]
fn cpp_computes_what_the_core_computes() {
    if !has("c++") {
        println!("skipped: there is no C++ compiler `c++`");
        return;
    }
    for robot in robots() {
        let (name, dof) = (robot.identifier(), robot.model().dof());
        let calls: Vec<String> = FUNCTIONS
            .iter()
            .map(|(function, inputs)| {
                format!(
                    "    for (double x : {name}_dynamics::{function}({})) std::printf(\"%.17g \", x);\n",
                    inputs.join(", ")
                )
            })
            .collect();
        let calls = calls.concat();
        let program = format!(
            "#include <cstdio>\n#include \"robot.hpp\"\nint main() {{\n  {name}_dynamics::Vector q, dq, ddq, tau;\n  for (;;) {{\n    \
             for (auto v : {{&q, &dq, &ddq, &tau}}) for (std::size_t k = 0; k < {dof}; k++) if (std::scanf(\"%lf\", &(*v)[k]) != 1) return 0;\n\
             {calls}    std::printf(\"\\n\");\n  }}\n}}\n"
        );
        let folder = tempfile::tempdir().unwrap();
        let text = export(&robot, Target::Cpp, &[]).unwrap().text;
        let compiler = ["c++", "-std=c++17", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1"];
        let mut program = compiled(folder.path(), "robot.hpp", &text, "main.cpp", &program, &compiler);
        compare(&mut program, &robot, &expected(&robot));
    }
}

#[test]
fn rust_computes_what_the_core_computes() {
    let rustc = std::env::var("RUSTC").unwrap_or("rustc".to_owned());
    if !has(&rustc) {
        println!("skipped: there is no Rust compiler `{rustc}`");
        return;
    }
    for robot in robots() {
        let dof = robot.model().dof();
        let calls: Vec<String> = FUNCTIONS
            .iter()
            .map(|(function, inputs)| {
                let inputs: Vec<String> = inputs.iter().map(|input| format!("&{input}")).collect();
                format!(
                    "        for x in robot::{function}::<Std>({}) {{ print!(\"{{x:?}} \"); }}\n",
                    inputs.join(", ")
                )
            })
            .collect();
        let calls = calls.concat();
        let program = format!(
            "mod robot;\nstruct Std;\nimpl robot::Math for Std {{\n    fn sin(x: f64) -> f64 {{ x.sin() }}\n    fn cos(x: f64) -> f64 {{ x.cos() }}\n    \
             fn tan(x: f64) -> f64 {{ x.tan() }}\n    fn asin(x: f64) -> f64 {{ x.asin() }}\n    fn acos(x: f64) -> f64 {{ x.acos() }}\n    fn atan(x: f64) -> f64 {{ x.atan() }}\n    fn sinh(x: f64) -> f64 {{ x.sinh() }}\n    fn cosh(x: f64) -> f64 {{ x.cosh() }}\n    fn ln(x: f64) -> f64 {{ x.ln() }}\n    fn atan2(y: f64, x: f64) -> f64 {{ y.atan2(x) }}\n    \
             fn tanh(x: f64) -> f64 {{ x.tanh() }}\n    fn exp(x: f64) -> f64 {{ x.exp() }}\n    fn powf(x: f64, exponent: f64) -> f64 {{ x.powf(exponent) }}\n}}\n\
             fn main() {{\n    for line in std::io::stdin().lines() {{\n        let v: Vec<f64> = line.unwrap().split(' ').map(|x| x.parse().unwrap()).collect();\n        \
             let part = |k: usize| -> [f64; {dof}] {{ v[k * {dof}..(k + 1) * {dof}].try_into().unwrap() }};\n        \
             let (q, dq, ddq, tau) = (part(0), part(1), part(2), part(3));\n{calls}        println!();\n    }}\n}}\n"
        );
        let folder = tempfile::tempdir().unwrap();
        let text = export(&robot, Target::Rust, &[]).unwrap().text;
        let compiler = [rustc.as_str(), "--edition", "2021", "-O", "-D", "warnings"];
        let mut run = compiled(folder.path(), "robot.rs", &text, "main.rs", &program, &compiler);
        compare(&mut run, &robot, &expected(&robot));
        // The module also compiles alone, as a library without the standard library.
        std::fs::write(folder.path().join("alone.rs"), format!("#![no_std]\n{text}")).unwrap();
        let alone = Command::new(&rustc)
            .args(["--edition", "2021", "--crate-type", "lib", "--emit", "metadata", "-D", "warnings", "alone.rs"])
            .current_dir(&folder)
            .output()
            .unwrap();
        assert!(alone.status.success(), "{}", String::from_utf8_lossy(&alone.stderr));
    }
}

/// The reference of the accelerations is verified with the articulated-body algorithm, for a robot without drives.
#[test]
fn accelerations_are_those_of_articulated_bodies() {
    let with_drives = all_terms("iiwa14.urdf");
    let rigid = RobotModel::new(with_drives.model().clone(), Vec::new(), Vec::new()).unwrap();
    for state in expected(&rigid).iter().take(50) {
        let found = rigid_accelerations(rigid.model(), state);
        let largest = found.iter().zip(&state.ddq).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(largest < 1e-9, "{largest}");
    }
}

#[test]
fn octave_computes_what_the_core_computes() {
    if !has("octave-cli") {
        println!("skipped: there is no `octave-cli`");
        return;
    }
    // Octave needs milliseconds per state, so only the tree is tested, which has every term and a prismatic joint.
    let robot = tree();
    let (name, dof) = (robot.identifier(), robot.model().dof());
    let calls: Vec<String> = FUNCTIONS
        .iter()
        .map(|(function, inputs)| {
            // Rows of a matrix follow each other.
            format!("  fprintf('%.17g ', {name}_dynamics('{function}', {}).');\n", inputs.join(", "))
        })
        .collect();
    let parts = ["q", "dq", "ddq", "tau"].iter().enumerate();
    let parts: Vec<String> =
        parts.map(|(k, part)| format!("  {part} = v({}:{});\n", k * dof + 1, (k + 1) * dof)).collect();
    let (parts, calls) = (parts.concat(), calls.concat());
    let program = format!(
        "while true\n  line = fgetl(stdin);\n  if ~ischar(line), break; end\n  v = sscanf(line, '%f');\n{parts}{calls}  fprintf('\\n');\nend\n"
    );
    let folder = tempfile::tempdir().unwrap();
    let text = export(&robot, Target::Matlab, &[]).unwrap().text;
    std::fs::write(folder.path().join(format!("{name}_dynamics.m")), text).unwrap();
    std::fs::write(folder.path().join("run_states.m"), program).unwrap();
    let mut octave = Command::new("octave-cli");
    compare(
        octave.args(["--quiet", "--no-init-file", "run_states.m"]).current_dir(folder.path()),
        &robot,
        &expected(&robot),
    );
}
