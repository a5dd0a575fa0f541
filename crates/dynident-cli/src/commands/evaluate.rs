use super::permission::XacroOptions;
use super::{Context, json, message_of};
use crate::{Verdict, terminal};
use clap::ValueEnum;
use dynident::Quantity;
use dynident::result::{EVALUATION_SCHEMA, EvaluationFile};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// URDF, MJCF, SDF, or D-H table in TOML.
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
    #[command(flatten)]
    xacro: XacroOptions,
}

#[derive(Clone, Copy, ValueEnum)]
enum Chosen {
    InverseDynamics,
    ForwardDynamics,
    MassMatrix,
    CoriolisMatrix,
    Gravity,
    GravityDerivative,
    Regressor,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let quantity = match options.quantity {
        Chosen::InverseDynamics => Quantity::InverseDynamics,
        Chosen::ForwardDynamics => Quantity::ForwardDynamics,
        Chosen::MassMatrix => Quantity::MassMatrix,
        Chosen::CoriolisMatrix => Quantity::CoriolisMatrix,
        Chosen::Gravity => Quantity::Gravity,
        Chosen::GravityDerivative => Quantity::GravityDerivative,
        Chosen::Regressor => Quantity::Regressor,
    };
    if let Some(out) = &options.out {
        let inputs = [options.robot.clone(), options.states.clone()];
        dynident::refuse_overwriting(core::slice::from_ref(out), &inputs).map_err(message_of)?;
    }
    let robot = options.xacro.load_robot(&options.robot)?;
    if context.json || options.out.is_some() {
        let mut table = Vec::new();
        let rows = dynident::evaluate(&robot.model, &options.states, quantity, &mut table).map_err(message_of)?;
        if let Some(path) = &options.out {
            dynident::write_atomically(path, &table).map_err(message_of)?;
        }
        if context.json {
            let table = String::from_utf8_lossy(&table);
            let name = options.quantity.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned());
            terminal::print_document(&object(name, robot.model.dof(), rows, options.out.as_deref(), &table)?)?;
        }
        return Ok(Verdict::Good);
    }
    let mut out = BufWriter::new(io::stdout().lock());
    let done = dynident::evaluate(&robot.model, &options.states, quantity, &mut out);
    let flushed = done.and_then(|_| {
        out.flush().map_err(|source| dynident::Error::Output { path: PathBuf::from("standard output"), source })
    });
    match flushed {
        // If the reader closed the pipe (as `| head` does), it needs no more rows.
        Err(dynident::Error::Output { source, .. }) if source.kind() == io::ErrorKind::BrokenPipe => Ok(Verdict::Good),
        done => done.map(|()| Verdict::Good).map_err(message_of),
    }
}

/// The table as a JSON object; without its numbers if they were written to a file.
fn object(quantity: String, dof: usize, rows: u64, out: Option<&Path>, table: &str) -> Result<String, String> {
    let mut lines = table.lines();
    let columns = lines.next().unwrap_or("").split(',').map(str::to_owned).collect();
    let row = |line: &str| line.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>();
    let values = match out {
        Some(_) => None,
        None => Some(lines.map(row).collect::<Result<_, _>>().map_err(|error| error.to_string())?),
    };
    let file = out.map(|path| path.display().to_string());
    json(&EvaluationFile { schema: EVALUATION_SCHEMA.to_owned(), quantity, dof, rows, columns, file, values })
}
