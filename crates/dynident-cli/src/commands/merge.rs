use super::{Context, factors, message_of};
use crate::Verdict;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Factor files from `reduce` or `merge`, of one robot and one study.
    #[arg(required = true, num_args = 1.., value_name = "FILE")]
    factors: Vec<PathBuf>,
    /// The factor file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    dynident::refuse_overwriting(core::slice::from_ref(&options.out), &options.factors).map_err(message_of)?;
    factors::write(&factors::read_all(&options.factors)?, &options.out, context)?;
    Ok(Verdict::Good)
}
