//! `dynident evaluate ROBOT --states S.csv --quantity Q`.

use super::told;
use crate::Verdict;
use clap::ValueEnum;
use dynident::Quantity;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

/// Options of `evaluate`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// URDF, or D-H table in TOML.
    robot: PathBuf,
    /// Table with columns q1.., dq1.., ddq1.. (tau1.. for forward dynamics), SI units.
    #[arg(long, value_name = "S.csv")]
    states: PathBuf,
    /// What to compute for every row.
    #[arg(long, value_enum)]
    quantity: Chosen,
    /// Write to this file instead of standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Chosen {
    InverseDynamics,
    ForwardDynamics,
    MassMatrix,
    Gravity,
    Regressor,
}

pub(crate) fn run(options: &Options) -> Result<Verdict, String> {
    let quantity = match options.quantity {
        Chosen::InverseDynamics => Quantity::InverseDynamics,
        Chosen::ForwardDynamics => Quantity::ForwardDynamics,
        Chosen::MassMatrix => Quantity::MassMatrix,
        Chosen::Gravity => Quantity::Gravity,
        Chosen::Regressor => Quantity::Regressor,
    };
    let robot = dynident::model::load_robot(&options.robot).map_err(|error| error.to_string())?;
    if let Some(path) = &options.out {
        let mut table = Vec::new();
        dynident::evaluate(&robot.model, &options.states, quantity, &mut table).map_err(told)?;
        dynident::write_whole(path, &table).map_err(told)?;
    } else {
        let mut out = BufWriter::new(io::stdout().lock());
        let done = dynident::evaluate(&robot.model, &options.states, quantity, &mut out);
        match done.map(|_| out.flush()) {
            Ok(_) => {}
            // A reader that has gone (`| head`) has seen what it wanted.
            Err(dynident::Error::Output { source, .. }) if source.kind() == io::ErrorKind::BrokenPipe => {}
            Err(error) => return Err(told(error)),
        }
    }
    Ok(Verdict::Good)
}
