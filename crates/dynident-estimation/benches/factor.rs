//! Time from rows to triangular factors: 10,000 samples of a seven-joint arm, all joints. Prints one line per case.
//! `cargo bench -p dynident-estimation`

#![allow(clippy::print_stdout, reason = "a benchmark prints")]

use dynident_estimation::factor::{BLOCK_ROWS, FactorWorkspace};
use dynident_estimation::{SegmentSettings, SegmentedFactor, TriangularFactor};
use dynident_lanes::Level;
use std::time::Instant;

/// Number of columns of joints 1 to 7 of a Panda arm.
const COLUMNS: [usize; 7] = [43, 42, 35, 28, 21, 14, 7];
const SAMPLES: usize = 10_000;

fn main() {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let panels: Vec<Vec<f64>> =
        COLUMNS.iter().map(|columns| (0..(columns + 1) * BLOCK_ROWS).map(|_| random()).collect()).collect();
    let all_joints = |which: &[usize], level: Level| {
        let mut workspace = FactorWorkspace::new(level);
        let mut operations = 0.0;
        let mut best = f64::INFINITY;
        for _ in 0..15 {
            let start = Instant::now();
            operations = 0.0;
            for &joint in which {
                let columns = COLUMNS[joint];
                let mut factor = TriangularFactor::new(columns);
                let mut left = SAMPLES;
                while left >= BLOCK_ROWS {
                    factor.absorb_with(&mut workspace, &panels[joint], BLOCK_ROWS).expect("finite rows");
                    left -= BLOCK_ROWS;
                }
                let tail: Vec<f64> = panels[joint].chunks(BLOCK_ROWS).flat_map(|c| &c[..left]).copied().collect();
                factor.absorb_with(&mut workspace, &tail, left).expect("finite rows");
                assert_eq!(factor.rows(), SAMPLES);
                std::hint::black_box(&factor);
                operations += 2.0 * SAMPLES as f64 * ((columns + 1) * (columns + 1)) as f64;
            }
            best = best.min(start.elapsed().as_secs_f64());
        }
        (best * 1.0e9, operations / best * 1.0e-9)
    };
    for level in Level::available() {
        let (ns, gflops) = all_joints(&[0, 1, 2, 3, 4, 5, 6], level);
        println!("factor of 10000 samples, 7 joints, {}: {ns:.0} ns ({gflops:.1} GFLOP/s)", level.name());
    }
    for (name, settings) in [("unknown", SegmentSettings::default()), ("known", SegmentSettings::for_rows(SAMPLES))] {
        let mut best = f64::INFINITY;
        for _ in 0..15 {
            let start = Instant::now();
            for (columns, panel) in COLUMNS.iter().zip(&panels) {
                let mut log = SegmentedFactor::new(*columns, settings).expect("valid settings");
                for _ in 0..SAMPLES / BLOCK_ROWS {
                    log.absorb(panel, BLOCK_ROWS).expect("finite rows");
                }
                std::hint::black_box(&log);
            }
            best = best.min(start.elapsed().as_secs_f64());
        }
        let samples = SAMPLES / BLOCK_ROWS * BLOCK_ROWS;
        println!("segmented factors of {samples} samples, 7 joints, length {name} at first: {:.0} ns", best * 1.0e9);
    }
    for joint in 0..7 {
        let (ns, gflops) = all_joints(&[joint], Level::detect());
        println!(
            "factor of 10000 samples, joint {} ({} columns): {ns:.0} ns ({gflops:.1} GFLOP/s)",
            joint + 1,
            COLUMNS[joint]
        );
    }
}
