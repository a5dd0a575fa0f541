//! A recording as text, created once and read.

use super::clock::Report;
use super::motion::Motion;
use dynident_dynamics::{BatchWorkspace, inverse_dynamics_batch};
use dynident_lanes::Level;
use dynident_model::Model;
use dynident_model::sample::Random;
use dynident_recording::{FileLog, RecordingError};
use std::hint::black_box;
use std::io::{BufWriter, Error, Write};
use std::path::Path;

const RATE_HZ: f64 = 1000.0;
const BLOCK: usize = 248;

/// Writes `rows` samples at 1 kHz of a smooth motion: time, positions, velocities and torques of every joint, nine
/// digits each; with joint friction and white noise on positions and torques. Keeps an existing file.
pub(crate) fn write(path: &Path, model: &Model, rows: usize) -> Result<(), Error> {
    if path.exists() {
        return Ok(());
    }
    let dof = model.dof();
    // A temporary name prevents use of an incomplete file.
    let unfinished = path.with_extension("part");
    let mut out = BufWriter::new(std::fs::File::create(&unfinished)?);
    write!(out, "t")?;
    for name in ["q", "dq", "tau"] {
        (1..=dof).try_for_each(|joint| write!(out, ",{name}{joint}"))?;
    }
    writeln!(out)?;
    let motion = Motion::fourier(model, rows, rows as f64 / RATE_HZ);
    let mut workspace = BatchWorkspace::with_level(model, Level::detect());
    let mut random = Random::new(5);
    let mut row = 0_usize;
    for block in motion.blocks(BLOCK) {
        let mut tau = vec![0.0; dof * block.samples];
        inverse_dynamics_batch(model, &mut workspace, &block.view(), &mut tau);
        for sample in 0..block.samples {
            write!(out, "{:.3}", row as f64 / RATE_HZ)?;
            let at = |joint: usize| joint * block.samples + sample;
            for joint in 0..dof {
                write!(out, ",{:.8}", block.q[at(joint)] + 1e-5 * random.normal())?;
            }
            for joint in 0..dof {
                write!(out, ",{:.8}", block.dq[at(joint)])?;
            }
            for joint in 0..dof {
                let dq = block.dq[at(joint)];
                let friction = 1.5 * dq + 2.0 * (dq / 0.02).tanh();
                write!(out, ",{:.7}", tau[at(joint)] + friction + 0.05 * random.normal())?;
            }
            writeln!(out)?;
            row += 1;
        }
    }
    out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
    std::fs::rename(unfinished, path)
}

/// Times reading every number of the file, per row.
pub(crate) fn time_reading(path: &Path, report: &Report<'_>) -> Result<(), RecordingError> {
    let rows = read(path)?;
    let bytes = std::fs::metadata(path).map_err(|source| RecordingError::Io { file: path.to_owned(), source })?.len();
    println!(
        r#"{{"job":"operations","robot":"{}","nv":{},"count_of":"read_csv","bytes":{:.1}}}"#,
        report.robot,
        report.dof,
        bytes as f64 / rows.max(1) as f64
    );
    report.time("read_csv", rows, || {
        let _ = black_box(read(path));
    });
    Ok(())
}

fn read(path: &Path) -> Result<usize, RecordingError> {
    let (_, mut table) = FileLog::described_by_itself(path).open_with_format()?;
    let mut rows = 0;
    table.all_rows(&mut |_, row| {
        rows += 1;
        black_box(row);
    })?;
    Ok(rows)
}
