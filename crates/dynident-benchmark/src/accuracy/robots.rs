//! The robots of the benchmark.

use super::BenchmarkError;
use dynident_model::{Model, read_urdf};

/// A robot of the benchmark.
#[derive(Clone, Copy, Debug)]
pub struct BenchmarkRobot {
    /// Name on the command line.
    pub name: &'static str,
    urdf: &'static str,
}

/// The registry: one line per robot.
pub const ROBOTS: &[BenchmarkRobot] = &[
    BenchmarkRobot { name: "planar2r", urdf: include_str!("../../robots/planar2r.urdf") },
    BenchmarkRobot { name: "ur10", urdf: include_str!("../../robots/ur10.urdf") },
    BenchmarkRobot { name: "tx40", urdf: include_str!("../../robots/tx40.urdf") },
    BenchmarkRobot { name: "panda", urdf: include_str!("../../robots/panda_arm7.urdf") },
];

impl BenchmarkRobot {
    pub(super) fn model(&self) -> Result<Model, BenchmarkError> {
        read_urdf(self.urdf)
            .map(|robot| robot.model)
            .map_err(|source| BenchmarkError::Robot { robot: self.name.to_owned(), source: Box::new(source) })
    }
}
