//! Writes a robot description as code, with the inertial parameters of the description and without friction:
//!
//! ```sh
//! cargo run -p dynident-export --example description robots/iiwa14.urdf c > iiwa14.h
//! ```

use dynident_export::{RobotModel, Target, export};
use std::error::Error;
use std::io::Write;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(robot), Some(form)) = (arguments.next(), arguments.next()) else {
        return Err("usage: description ROBOT.urdf FORM".into());
    };
    let target = Target::ALL.into_iter().find(|target| target.name() == form);
    let target =
        target.ok_or_else(|| format!("no form `{form}`; there are {}", Target::ALL.map(Target::name).join(", ")))?;
    let robot = RobotModel::new(dynident_model::load_robot(robot)?.model, Vec::new(), Vec::new())?;
    std::io::stdout().write_all(export(&robot, target, &[])?.text.as_bytes())?;
    Ok(())
}
