//! Measures the time to convert a log with a million samples of seven joints to a motion:
//! `cargo run --release -p dynident-recording --example import_speed [ROWS]`.
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a benchmark for people")]

use dynident_recording::{
    DecimationSettings, Decimator, Log, LogFormat, LogReader, MotionBlock, MotionSettings, MotionStream, RawBlock,
};
use std::io::Write;
use std::time::Instant;

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("long.csv");
    let rows: i32 = std::env::args().nth(1).map_or(1_000_000, |text| text.parse().unwrap());
    let mut out = std::io::BufWriter::new(std::fs::File::create(&file).unwrap());
    let names = |name: &str| (1..=7).map(|i| format!("{name}{i}")).collect::<Vec<_>>().join(",");
    writeln!(out, "t,{},{},{}", names("q"), names("v"), names("tau")).unwrap();
    for i in 0..rows {
        let t = f64::from(i) * 1e-3;
        write!(out, "{t}").unwrap();
        for block in 0..3 {
            for joint in 1..=7 {
                let omega = 0.3 * f64::from(joint) + f64::from(block);
                write!(out, ",{:.9}", (omega * t).sin() + 1e-4 * (991.0 * t * f64::from(joint)).sin()).unwrap();
            }
        }
        writeln!(out).unwrap();
    }
    drop(out);
    let joints: Vec<String> = (1..=7).map(|i| format!("joint_{i}")).collect();
    let format =
        "time = { column = \"t\" }\nposition = { columns = \"q{1..7}\" }\ntorque = { columns = \"tau{1..7}\" }";
    let format: LogFormat = toml::from_str(format).unwrap();
    let start = Instant::now();
    let mut reader = LogReader::open(&Log::file(&file, format.clone(), &joints)).unwrap();
    let mut raw = RawBlock::default();
    while reader.next_block(&mut raw).unwrap() {}
    println!("reading and mapping alone: {:.2} s", start.elapsed().as_secs_f64());
    let start = Instant::now();
    let mut stream = MotionStream::open(&format, &file, &joints, &MotionSettings::default()).unwrap();
    let opened = start.elapsed().as_secs_f64();
    let (mut block, mut samples) = (MotionBlock::default(), 0);
    while stream.next_block(&mut block).unwrap() {
        samples += block.rows;
    }
    let bytes = std::fs::metadata(&file).unwrap().len();
    println!(
        "{samples} samples, {} MB: {:.2} s, {opened:.2} s of this for opening",
        bytes >> 20,
        start.elapsed().as_secs_f64()
    );
    println!("{}", stream.cutoff().evidence);
    // VmHWM is the peak resident set.
    if let Ok(status) = std::fs::read_to_string("/proc/self/status")
        && let Some(line) = status.lines().find(|line| line.starts_with("VmHWM"))
    {
        println!("peak memory {line}");
    }

    let (columns, panel_rows) = (100, 256);
    let mut decimator = Decimator::new(&DecimationSettings::default(), 1000.0, columns).unwrap();
    let panel: Vec<f64> = (0..columns * panel_rows).map(|i| (f64::from(i as u32) * 0.1).sin()).collect();
    let (mut out, mut produced) = (Vec::new(), 0);
    let start = Instant::now();
    let panels = 1000;
    for _ in 0..panels {
        produced += decimator.push(&panel, panel_rows, &mut out);
    }
    let micros = start.elapsed().as_secs_f64() * 1e6 / f64::from(panels) / panel_rows as f64;
    println!(
        "decimation: {micros:.3} us per sample of {columns} columns, {} coefficients, {produced} rows",
        decimator.length()
    );
}
