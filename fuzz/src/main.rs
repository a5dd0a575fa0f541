//! Mutated inputs for every parser and for the small commands. No input may cause a panic, a hang or a number that is
//! not finite.
//!
//! Runs on stable Rust in one process. Mutates bytes, words and numbers of the seeds in `corpus/`, in rounds over all
//! targets, until the time limit. The inputs depend only on the seed, not on the number of threads.

mod mutation;
mod targets;
mod watch;

use clap::Parser;
use mutation::{Corpus, Mutator};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use targets::{TARGETS, Target};
use watch::Watch;

/// Runs every target on mutated inputs.
#[derive(Parser)]
struct Arguments {
    /// Time limit, s.
    #[arg(long, default_value_t = 60)]
    seconds: u64,
    /// Total number of executions over all targets.
    #[arg(long)]
    executions: Option<u64>,
    /// Number of threads.
    #[arg(long, default_value_t = 2)]
    threads: u64,
    /// Seed of the mutations.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Targets, comma-separated; all by default.
    #[arg(long, value_delimiter = ',')]
    targets: Vec<String>,
    /// Folder for inputs that failed.
    #[arg(long, default_value = "fuzz/found")]
    found: PathBuf,
    /// Run this input once on the given target, without mutation.
    #[arg(long)]
    input: Option<PathBuf>,
}

/// Results of one target so far.
#[derive(Default)]
struct Tally {
    executions: AtomicU64,
    accepted: AtomicU64,
    failures: AtomicU64,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let chosen: Vec<&Target> = TARGETS
        .iter()
        .filter(|target| arguments.targets.is_empty() || arguments.targets.iter().any(|name| name == target.name))
        .collect();
    if chosen.is_empty() || arguments.targets.len() > chosen.len() {
        let names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
        say(&format!("unknown target; the targets are: {}", names.join(", ")));
        return ExitCode::from(2);
    }
    let outcome = match &arguments.input {
        Some(input) => once(chosen[0], input, &arguments.found),
        None => fuzz(&chosen, &arguments),
    };
    match outcome {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::from(1),
        Err(error) => {
            say(&format!("error: {error}"));
            ExitCode::from(2)
        }
    }
}

/// Returns the failures of one input.
fn once(target: &Target, input: &Path, found: &Path) -> Result<u64, std::io::Error> {
    let bytes = std::fs::read(input)?;
    let watch = Watch::new(found, 1);
    let mut run = (target.new)()?;
    let kind = input.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let (accepted, failed) = watch.run(0, target.name, &bytes, &mut || run.run(&kind, &bytes));
    say(&format!(
        "{}: {}",
        target.name,
        if failed {
            "failed"
        } else if accepted {
            "accepted"
        } else {
            "refused"
        }
    ));
    Ok(u64::from(failed))
}

/// Returns the failures of all targets until the time limit.
fn fuzz(chosen: &[&Target], arguments: &Arguments) -> Result<u64, std::io::Error> {
    let corpora: Vec<Corpus> = chosen.iter().map(|target| Corpus::read(target.name)).collect::<Result<_, _>>()?;
    let tallies: Vec<Tally> = chosen.iter().map(|_| Tally::default()).collect();
    let watch = Watch::new(&arguments.found, arguments.threads as usize);
    let (begun, all) = (Instant::now(), AtomicU64::new(0));
    let limit = Duration::from_secs(arguments.seconds);
    let most = arguments.executions.unwrap_or(u64::MAX);
    let worker = |thread: u64| -> Result<(), std::io::Error> {
        let mut runs = chosen.iter().map(|target| (target.new)()).collect::<Result<Vec<_>, _>>()?;
        // Inputs are numbered; with n threads, each thread takes every n-th input.
        let mut round = thread;
        while begun.elapsed() < limit && all.load(Ordering::Relaxed) < most {
            for (k, target) in chosen.iter().enumerate() {
                // Faster targets get more executions, so that each target gets about the same time.
                for repetition in 0..target.repetitions {
                    let mut mutator = Mutator::new(arguments.seed, round * target.repetitions + repetition, k as u64);
                    let (kind, bytes) = mutator.input(&corpora[k]);
                    let (accepted, failed) =
                        watch.run(thread as usize, target.name, &bytes, &mut || runs[k].run(kind, &bytes));
                    tallies[k].executions.fetch_add(1, Ordering::Relaxed);
                    tallies[k].accepted.fetch_add(u64::from(accepted), Ordering::Relaxed);
                    tallies[k].failures.fetch_add(u64::from(failed), Ordering::Relaxed);
                    all.fetch_add(1, Ordering::Relaxed);
                }
            }
            round += arguments.threads;
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..arguments.threads).map(|thread| scope.spawn(move || worker(thread))).collect();
        threads.into_iter().try_for_each(|thread| thread.join().unwrap_or(Ok(())))
    })?;
    let mut failures = 0;
    for (target, tally) in chosen.iter().zip(&tallies) {
        let [executions, accepted, failed] =
            [&tally.executions, &tally.accepted, &tally.failures].map(|count| count.load(Ordering::Relaxed));
        say(&format!("{:<12} {executions:>10} executions, {accepted:>9} accepted, {failed} failed", target.name));
        failures += failed;
    }
    say(&format!(
        "{} executions in {:.0} s, {failures} failed",
        all.load(Ordering::Relaxed),
        begun.elapsed().as_secs_f64()
    ));
    Ok(failures)
}

/// Prints a line; the only place with output.
#[allow(clippy::print_stdout, reason = "a development program")]
fn say(text: &str) {
    println!("{text}");
}
