//! Friction under load and with memory in code: compiled without warnings and compared with the prediction of the model
//! along a motion.

use super::common::has;
use core::fmt::Write;
use dynident_dynamics::{BatchWorkspace, Column, Panels, ParametricModel, TermHistory, regressor_panels_following};
use dynident_export::{CodeOptions, RobotModel, Target, export_with};
use dynident_model::sample::Random;
use dynident_model::terms::{
    Coulomb, CoulombShape, DriveInertia, JointMotion, LoadFriction, MaxwellSlip, Offset, TorqueTerm, Viscous,
};
use dynident_model::{InertialParameters, load_robot};
use dynident_testing::repository;
use std::path::Path;
use std::process::Command;

const SAMPLES: usize = 2000;
const STEP_S: f64 = 0.002;

/// Relative to the largest torque: the rounding of all operations, with margin for other compilers.
const TOLERANCE: f64 = 1e-9;

/// Numbers of 32 bits have a rounding error of 6e-8, which some hundred operations and differences of large torques
/// increase.
const TOLERANCE_FLOAT32: f64 = 1e-4;

/// A motion with reversals, and the torques of the model along it, each sample-major.
struct Log {
    dof: usize,
    q: Vec<f64>,
    dq: Vec<f64>,
    ddq: Vec<f64>,
    /// With friction that has a memory.
    with_memory: Vec<f64>,
    /// Without it.
    without: Vec<f64>,
    load_friction: Vec<f64>,
}

impl Log {
    fn sample(&self, all: &[f64], sample: usize) -> Vec<f64> {
        all[sample * self.dof..(sample + 1) * self.dof].to_vec()
    }

    /// The motion and the torque without memory, one line for each sample.
    fn lines(&self) -> String {
        let mut lines = String::new();
        for sample in 0..SAMPLES {
            let all = [&self.q, &self.dq, &self.ddq, &self.without].map(|all| self.sample(all, sample)).concat();
            let _ = writeln!(lines, "{}", all.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" "));
        }
        lines
    }

    /// What a program prints for a sample: the function with state, inverse dynamics, friction under load, forward
    /// dynamics, and the regressor times the parameters.
    fn expected(&self, sample: usize) -> Vec<Vec<f64>> {
        [&self.with_memory, &self.without, &self.load_friction, &self.ddq, &self.without]
            .map(|all| self.sample(all, sample))
            .into()
    }
}

/// Torque of the terms chosen by `wanted` and of the bodies, by the regressor of the model.
fn predicted(robot: &Arm, motion: &JointMotion<'_>, bodies: bool, wanted: impl Fn(&TorqueTerm) -> bool) -> Vec<f64> {
    let terms: Vec<TorqueTerm> = robot.terms.iter().map(|(term, _)| term.clone()).collect();
    let parametric = ParametricModel::new(robot.model.clone(), terms).unwrap();
    let (layout, base, dof) = (parametric.layout(), parametric.base(), parametric.dof());
    let rigid = robot.model.parameter_vector();
    let values = robot.terms.iter().map(|(term, value)| if wanted(term) { *value } else { 0.0 });
    let all: Vec<f64> = rigid.iter().map(|value| if bodies { *value } else { 0.0 }).chain(values).collect();
    let theta = base.values(&all);
    let load = base.values(&[&robot.load_parameters[..], &vec![0.0; robot.terms.len()]].concat());
    let mut history = TermHistory::new(Some(load));
    let mut workspace = BatchWorkspace::new(&robot.model);
    let mut panels = Panels::default();
    regressor_panels_following(&robot.model, &mut workspace, layout, motion, &mut history, &mut panels);
    let mut torque = vec![0.0; dof * motion.samples];
    for joint in 0..dof {
        let columns = layout.joint_columns(joint);
        for (place, &column) in columns.iter().enumerate() {
            let values = &panels.joint(joint)[place * motion.samples..(place + 1) * motion.samples];
            for (sample, value) in values.iter().enumerate() {
                torque[sample * dof + joint] += theta[column] * value;
            }
        }
    }
    torque
}

/// A seven-joint arm with friction under load and with memory. Its load is the torque of other bodies, as in a result.
struct Arm {
    model: dynident_model::Model,
    terms: Vec<(TorqueTerm, f64)>,
    load_parameters: Vec<f64>,
}

impl Arm {
    fn new() -> Self {
        let model = load_robot(repository("robots/iiwa14.urdf")).unwrap().model;
        let load_parameters = model.parameter_vector().iter().map(|value| 0.9 * value).collect();
        let mut terms = Vec::new();
        for joint in 0..model.dof() {
            let shape = CoulombShape::Smooth { width: 0.01 + 0.01 * joint as f64 };
            let slip = |yield_displacement| TorqueTerm::MaxwellSlip(MaxwellSlip { joint, yield_displacement });
            terms.extend([
                (TorqueTerm::DriveInertia(DriveInertia { joint }), 0.4),
                (TorqueTerm::Viscous(Viscous { joint }), 3.0),
                (TorqueTerm::Coulomb(Coulomb { joint, shape }), 2.0),
                (TorqueTerm::Offset(Offset { joint }), 0.3),
                (slip(0.003), 1.5),
                (slip(0.03), 2.5),
            ]);
            if joint % 2 == 1 {
                let shape = if joint == 3 { CoulombShape::Sign { dead_band: 0.01 } } else { shape };
                terms.push((TorqueTerm::Load(LoadFriction { joint, shape }), 0.05 + 0.03 * joint as f64));
            }
        }
        Self { model, terms, load_parameters }
    }

    fn robot(&self) -> RobotModel {
        let all = || self.terms.iter().cloned();
        let parametric = ParametricModel::new(self.model.clone(), Vec::new()).unwrap();
        let mut load = vec![InertialParameters::ZERO; self.model.body_count()];
        let values = parametric.base().values(&self.load_parameters);
        for (column, value) in parametric.base().base_columns().into_iter().zip(values) {
            if let Column::Body { body, parameter } = column {
                load[body].0[parameter] = value;
            }
        }
        let (terms, values) = all().filter(|(term, _)| !term.has_memory()).unzip();
        let (state_terms, state_values) = all().unzip();
        let robot = RobotModel::new(self.model.clone(), terms, values).unwrap();
        robot.with_load(load).unwrap().with_state_terms(state_terms, state_values).unwrap()
    }

    fn log(&self) -> Log {
        let dof = self.model.dof();
        let mut random = Random::new(11);
        let waves: Vec<[f64; 3]> = (0..3 * dof)
            .map(|_| [random.uniform(0.1, 0.6), random.uniform(1.0, 9.0), random.uniform(-3.0, 3.0)])
            .collect();
        let mut motion = [vec![0.0; dof * SAMPLES], vec![0.0; dof * SAMPLES], vec![0.0; dof * SAMPLES]];
        for joint in 0..dof {
            for sample in 0..SAMPLES {
                let time = sample as f64 * STEP_S;
                for [size, rate, phase] in &waves[3 * joint..3 * joint + 3] {
                    let (sin, cos) = (rate * time + phase).sin_cos();
                    motion[0][joint * SAMPLES + sample] += size * sin;
                    motion[1][joint * SAMPLES + sample] += size * rate * cos;
                    motion[2][joint * SAMPLES + sample] -= size * rate * rate * sin;
                }
            }
        }
        let [q, dq, ddq] = &motion;
        let block = JointMotion { samples: SAMPLES, q, dq, ddq };
        let by_sample = |all: &[f64]| -> Vec<f64> {
            (0..SAMPLES).flat_map(|sample| (0..dof).map(move |joint| all[joint * SAMPLES + sample])).collect()
        };
        Log {
            dof,
            with_memory: predicted(self, &block, true, |_| true),
            without: predicted(self, &block, true, |term| !term.has_memory()),
            load_friction: predicted(self, &block, false, TorqueTerm::needs_load),
            q: by_sample(q),
            dq: by_sample(dq),
            ddq: by_sample(ddq),
        }
    }
}

fn in_c(name: &str, dof: usize, columns: usize, real: &str) -> String {
    format!(
        "#include <stdio.h>\n#include \"robot.h\"\ntypedef {real} real;\nstatic void print(const real *v) {{ for (int k = 0; k < {dof}; k++) printf(\"%.17g \", (double)v[k]); }}\n\
         int main(void) {{\n  {name}_state state;\n  {name}_reset(&state);\n  for (;;) {{\n    real v[4 * {dof}], out[{dof}], w[{dof} * {columns}], p[{columns}];\n    \
         for (int k = 0; k < 4 * {dof}; k++) {{ double x; if (scanf(\"%lf\", &x) != 1) return 0; v[k] = (real)x; }}\n    \
         const real *q = v, *dq = v + {dof}, *ddq = v + 2 * {dof}, *tau = v + 3 * {dof};\n    \
         {name}_step(&state, q, dq, ddq, out); print(out);\n    {name}_inverse_dynamics(q, dq, ddq, out); print(out);\n    \
         {name}_load_friction(q, dq, ddq, out); print(out);\n    {name}_forward_dynamics(q, dq, tau, out); print(out);\n    \
         {name}_regressor(q, dq, ddq, w); {name}_parameters(p);\n    \
         for (int j = 0; j < {dof}; j++) {{ out[j] = 0; for (int k = 0; k < {columns}; k++) out[j] += w[j * {columns} + k] * p[k]; }}\n    \
         print(out); printf(\"\\n\");\n  }}\n}}\n"
    )
}

fn in_cpp(name: &str, dof: usize, columns: usize, real: &str) -> String {
    format!(
        "#include <cstdio>\n#include \"robot.hpp\"\nnamespace r = {name}_dynamics;\n\
         static void print(const r::Vector& v) {{ for (auto x : v) std::printf(\"%.17g \", double(x)); }}\n\
         int main() {{\n  r::State state;\n  r::reset(state);\n  for (;;) {{\n    r::Vector q, dq, ddq, tau;\n    \
         for (auto v : {{&q, &dq, &ddq, &tau}}) for (auto& x : *v) {{ double y; if (std::scanf(\"%lf\", &y) != 1) return 0; x = {real}(y); }}\n    \
         print(r::step(state, q, dq, ddq)); print(r::inverse_dynamics(q, dq, ddq));\n    \
         print(r::load_friction(q, dq, ddq)); print(r::forward_dynamics(q, dq, tau));\n    \
         const auto w = r::regressor(q, dq, ddq); const auto p = r::parameters(); r::Vector out{{}};\n    \
         for (std::size_t j = 0; j < {dof}; j++) for (std::size_t k = 0; k < {columns}; k++) out[j] += w[j * {columns} + k] * p[k];\n    \
         print(out); std::printf(\"\\n\");\n  }}\n}}\n"
    )
}

fn in_rust(dof: usize, columns: usize, real: &str) -> String {
    format!(
        "mod robot;\nstruct Std;\nimpl robot::Math for Std {{\n    fn sin(x: {real}) -> {real} {{ x.sin() }}\n    \
         fn cos(x: {real}) -> {real} {{ x.cos() }}\n    fn tanh(x: {real}) -> {real} {{ x.tanh() }}\n}}\n\
         fn main() {{\n    let mut state = robot::State::new();\n    state.reset();\n    for line in std::io::stdin().lines() {{\n        \
         let v: Vec<{real}> = line.unwrap().split(' ').map(|x| x.parse().unwrap()).collect();\n        \
         let part = |k: usize| -> [{real}; {dof}] {{ v[k * {dof}..(k + 1) * {dof}].try_into().unwrap() }};\n        \
         let (q, dq, ddq, tau) = (part(0), part(1), part(2), part(3));\n        \
         let (w, p) = (robot::regressor::<Std>(&q, &dq, &ddq), robot::parameters::<Std>());\n        \
         let mut product = [0.0; {dof}];\n        \
         for j in 0..{dof} {{ for k in 0..{columns} {{ product[j] += w[j * {columns} + k] * p[k]; }} }}\n        \
         let all = [robot::step::<Std>(&mut state, &q, &dq, &ddq), robot::inverse_dynamics::<Std>(&q, &dq, &ddq),\n            \
         robot::load_friction::<Std>(&q, &dq, &ddq), robot::forward_dynamics::<Std>(&q, &dq, &tau), product];\n        \
         for x in all.iter().flatten() {{ print!(\"{{x:?}} \"); }}\n        println!();\n    }}\n}}\n"
    )
}

/// Compiles the program and compares all of its numbers with the log.
fn check(compiler: &[&str], files: [(&str, &str); 2], last: &[&str], log: &Log, tolerance: f64) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, text) in files {
        std::fs::write(at.join(name), text).unwrap();
    }
    let main = files[1].0;
    let output = Command::new(compiler[0])
        .args(&compiler[1..])
        .args([main, "-o", "program"])
        .args(last)
        .current_dir(at)
        .output()
        .unwrap();
    assert!(output.status.success(), "{compiler:?}: {}", String::from_utf8_lossy(&output.stderr));
    std::fs::write(at.join("log"), log.lines()).unwrap();
    compare(Command::new(at.join("program")), &at.join("log"), log, compiler, tolerance);
}

fn compare(mut program: Command, input: &Path, log: &Log, compiler: &[&str], tolerance: f64) {
    let output = program.stdin(std::fs::File::open(input).unwrap()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().count(), SAMPLES);
    let largest = |all: &[f64]| all.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
    let torque = largest(&log.with_memory);
    // Accelerations: the error of the torque times the largest inverse inertia of a joint, below 1 / 0.4 kg m².
    let scales = [torque, torque, torque, largest(&log.ddq).max(torque / 0.4), torque];
    let names = ["step", "inverse_dynamics", "load_friction", "forward_dynamics", "regressor"];
    for (sample, line) in text.lines().enumerate() {
        let mut found = line.split_whitespace().map(|word| word.parse::<f64>().unwrap());
        for ((expected, scale), name) in log.expected(sample).iter().zip(scales).zip(names) {
            for (joint, expected) in expected.iter().enumerate() {
                let found = found.next().unwrap();
                let off = (found - expected).abs();
                assert!(off <= tolerance * scale, "{compiler:?} {name} {joint} sample {sample}: {found} {expected}");
            }
        }
        assert!(found.next().is_none());
    }
}

#[test]
fn compiled_code_follows_the_memory_and_the_load() {
    let arm = Arm::new();
    let (robot, log) = (arm.robot(), arm.log());
    let (name, dof) = (robot.identifier(), log.dof);
    // The memory and the load have a part in the torque.
    let most = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(most(&log.with_memory, &log.without) > 3.9 && most(&log.load_friction, &vec![0.0; SAMPLES * dof]) > 1.0);
    let rustc = std::env::var("RUSTC").unwrap_or("rustc".to_owned());
    for (float32, tolerance) in [(false, TOLERANCE), (true, TOLERANCE_FLOAT32)] {
        let code = |target| {
            let options = CodeOptions { float32, regressor: true, step_width: None };
            export_with(&robot, target, options, &[]).unwrap().text
        };
        let columns = code(Target::C).matches("parameter ").count();
        assert!(columns > 40, "{columns}");
        let real = if float32 { "float" } else { "double" };
        let strict = ["-pedantic", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-O1"];
        for compiler in ["gcc", "clang"].into_iter().filter(|compiler| has(compiler)) {
            let command = [&[compiler, "-std=c99"], &strict[..]].concat();
            let files = [("robot.h", &*code(Target::C)), ("main.c", &*in_c(&name, dof, columns, real))];
            check(&command, files, &["-lm"], &log, tolerance);
        }
        for compiler in ["g++", "clang++"].into_iter().filter(|compiler| has(compiler)) {
            let command = [&[compiler, "-std=c++17"], &strict[..]].concat();
            let files = [("robot.hpp", &*code(Target::Cpp)), ("main.cpp", &*in_cpp(&name, dof, columns, real))];
            check(&command, files, &[], &log, tolerance);
        }
        if has(&rustc) {
            let real = if float32 { "f32" } else { "f64" };
            let files = [("robot.rs", &*code(Target::Rust)), ("main.rs", &*in_rust(dof, columns, real))];
            check(&[&rustc, "--edition", "2021", "-O", "-D", "warnings"], files, &[], &log, tolerance);
        }
    }
}

#[test]
fn octave_follows_the_memory() {
    if !has("octave-cli") {
        println!("skipped: there is no `octave-cli`");
        return;
    }
    let arm = Arm::new();
    let (robot, log) = (arm.robot(), arm.log());
    let (name, dof) = (format!("{}_dynamics", robot.identifier()), log.dof);
    let options = CodeOptions { regressor: true, ..CodeOptions::default() };
    let text = export_with(&robot, Target::Matlab, options, &[]).unwrap().text;
    let program = format!(
        "state = {name}('reset');\nwhile true\n  line = fgetl(stdin);\n  if ~ischar(line), break; end\n  \
         v = reshape(sscanf(line, '%f'), {dof}, 4);\n  q = v(:, 1); dq = v(:, 2); ddq = v(:, 3);\n  [tau, state] = {name}('step', state, q, dq, ddq);\n  \
         all = [tau; {name}('inverse_dynamics', q, dq, ddq); {name}('load_friction', q, dq, ddq); {name}('forward_dynamics', q, dq, v(:, 4))];\n  \
         all = [all; {name}('regressor', q, dq, ddq) * {name}('parameters')];\n  fprintf('%.17g ', all);\n  fprintf('\\n');\nend\n"
    );
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(format!("{name}.m")), text).unwrap();
    std::fs::write(folder.path().join("run_log.m"), program).unwrap();
    std::fs::write(folder.path().join("log"), log.lines()).unwrap();
    let mut octave = Command::new("octave-cli");
    octave.args(["--quiet", "--no-init-file", "run_log.m"]).current_dir(folder.path());
    compare(octave, &folder.path().join("log"), &log, &["octave-cli"], TOLERANCE);
}
