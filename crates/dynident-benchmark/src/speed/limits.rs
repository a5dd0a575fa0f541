//! Limits of this machine, measured in the same run as the results.

use super::clock::{REPEATS, now_ns};
use dynident_lanes::{Kernel, Lane, Level, dispatch};
use std::fs::File;
use std::hint::black_box;
use std::io::Read;
use std::path::Path;

/// Numbers in an array that is larger than any cache: 64 MiB.
const MEMORY_ARRAY_LEN: usize = 8 << 20;
/// Bytes of text read at once; they stay in the second-level cache.
const TEXT_CHUNK_BYTES: usize = 1 << 18;

/// Prints the peak of every level and the memory bandwidth; only those of `only` unless it is empty.
pub(crate) fn of_processor(levels: &[Level], only: &[String]) {
    let asked = |limit: &str| only.is_empty() || only.iter().any(|only| only == limit);
    if asked("peak_flops") {
        for &level in levels {
            // The best number of chains to hide latency within the registers depends on the level.
            let most = [chains::<4>(level), chains::<8>(level), chains::<12>(level)].into_iter().fold(0.0, f64::max);
            print_limit(level.name(), "peak_flops", most, "multiply-adds of independent chains, two operations each");
        }
    }
    if asked("memory") {
        memory();
    }
}

fn print_limit(build: &str, limit: &str, per_second: f64, what: &str) {
    println!(r#"{{"job":"limit","build":"{build}","limit":"{limit}","per_second":{per_second:.4e},"what":"{what}"}}"#);
}

/// Minimum time of `work`, s.
fn least_s(mut work: impl FnMut()) -> f64 {
    work();
    let times = (0..REPEATS).map(|_| {
        let start = now_ns();
        work();
        now_ns() - start
    });
    1e-9 * times.fold(f64::INFINITY, f64::min)
}

/// `N` independent chains of `steps` multiply-adds.
struct Chains<const N: usize> {
    steps: usize,
}

impl<const N: usize> Kernel for Chains<N> {
    type Output = f64;
    #[inline(always)]
    fn run<T: Lane>(self) -> f64 {
        // The fixed point is one, so nothing overflows or becomes subnormal.
        let (factor, addend) = (T::splat(black_box(0.5)), T::splat(black_box(0.5)));
        let mut values: [T; N] = core::array::from_fn(|k| T::splat(1.0 + k as f64 / 16.0));
        for _ in 0..self.steps {
            for value in &mut values {
                *value = value.mul_add(factor, addend);
            }
        }
        values.into_iter().fold(T::ZERO, |sum, value| sum + value).sum()
    }
}

fn chains<const N: usize>(level: Level) -> f64 {
    let steps = 200_000;
    let seconds = least_s(|| {
        black_box(dispatch(level, Chains::<N> { steps: black_box(steps) }));
    });
    (2 * N * steps * level.lanes()) as f64 / seconds
}

/// Measures the memory bandwidth from the bytes read and written by the program, without the reads of the processor
/// before writing.
fn memory() {
    let (from, more) = (vec![1.0; MEMORY_ARRAY_LEN], vec![2.0; MEMORY_ARRAY_LEN]);
    let mut to = vec![0.0; MEMORY_ARRAY_LEN];
    let seconds = least_s(|| {
        to.copy_from_slice(black_box(&from));
        black_box(&mut to);
    });
    print_limit("", "copy", 16.0 * MEMORY_ARRAY_LEN as f64 / seconds, "bytes read and written, arrays of 64 MiB");
    let seconds = least_s(|| {
        for ((to, from), more) in to.iter_mut().zip(black_box(&from)).zip(black_box(&more)) {
            *to = from + 3.0 * more;
        }
        black_box(&mut to);
    });
    print_limit(
        "",
        "triad",
        24.0 * MEMORY_ARRAY_LEN as f64 / seconds,
        "bytes read and written, a = b + 3 c of 64 MiB each",
    );
}

/// Prints the speed of counting the lines of a text in the system's cache, and of parsing its numbers with the
/// standard library.
pub(crate) fn of_text(path: &Path) -> std::io::Result<()> {
    let bytes = std::fs::metadata(path)?.len() as f64;
    let mut taken = vec![0; TEXT_CHUNK_BYTES];
    let mut failed = Ok(());
    let seconds = least_s(|| failed = lines(path, &mut taken).map(|lines| _ = black_box(lines)));
    failed?;
    print_limit(
        "",
        "newlines",
        bytes / seconds,
        "bytes of a text read from the system's cache and looked at for line ends",
    );
    let text = std::fs::read_to_string(path)?;
    let (header, rows) = text.split_once('\n').unwrap_or_default();
    // A tenth of the text is sufficient for parsing.
    let some: Vec<&str> = rows.lines().take(rows.len() / header.len().max(1) / 30).collect();
    let fields: Vec<&str> = some.iter().flat_map(|line| line.split(',')).collect();
    let length: usize = fields.iter().map(|field| field.len() + 1).sum();
    let seconds = least_s(|| {
        for field in &fields {
            let _ = black_box(field.parse::<f64>());
        }
    });
    print_limit(
        "",
        "floats",
        length as f64 / seconds,
        "bytes of fields that are split already, read by the standard library",
    );
    Ok(())
}

fn lines(path: &Path, taken: &mut [u8]) -> std::io::Result<usize> {
    let (mut file, mut lines) = (File::open(path)?, 0);
    loop {
        let count = file.read(taken)?;
        if count == 0 {
            return Ok(lines);
        }
        // Counted in bytes, so that sixteen counts fit into a vector.
        lines += taken[..count]
            .chunks(255)
            .map(|part| usize::from(part.iter().fold(0_u8, |sum, byte| sum + u8::from(*byte == b'\n'))))
            .sum::<usize>();
    }
}
