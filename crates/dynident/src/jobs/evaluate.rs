//! `evaluate`: dynamics for a table of states.

use crate::error::Error;
use dynident_dynamics::{
    Workspace, coriolis_matrix, forward_dynamics, gravity_torque, gravity_torque_derivative, inverse_dynamics,
    mass_matrix, torque_regressor,
};
use dynident_model::{INERTIAL_NAMES, Model};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Quantity to be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Torques from `q`, `dq`, `ddq`.
    InverseDynamics,
    /// Accelerations from `q`, `dq`, `tau`.
    ForwardDynamics,
    /// Mass matrix from `q`, row by row.
    MassMatrix,
    /// Coriolis matrix from `q`, `dq`, row by row.
    CoriolisMatrix,
    /// Gravity torque from `q`.
    Gravity,
    /// Derivative of the gravity torque with respect to position, from `q`, row by row.
    GravityDerivative,
    /// Torque regressor from `q`, `dq`, `ddq`, row by row.
    Regressor,
}

impl Quantity {
    fn groups(self) -> &'static [&'static str] {
        match self {
            Self::InverseDynamics | Self::Regressor => &["q", "dq", "ddq"],
            Self::ForwardDynamics => &["q", "dq", "tau"],
            Self::CoriolisMatrix => &["q", "dq"],
            Self::MassMatrix | Self::Gravity | Self::GravityDerivative => &["q"],
        }
    }

    fn header(self, dof: usize, bodies: usize) -> Vec<String> {
        let numbered = |name: &str| (1..=dof).map(|j| format!("{name}{j}")).collect();
        let matrix = |name: &str| (1..=dof).flat_map(|i| (1..=dof).map(move |j| format!("{name}{i}_{j}"))).collect();
        match self {
            Self::InverseDynamics => numbered("tau"),
            Self::ForwardDynamics => numbered("ddq"),
            Self::Gravity => numbered("g"),
            Self::MassMatrix => matrix("M"),
            Self::CoriolisMatrix => matrix("C"),
            Self::GravityDerivative => matrix("g"),
            Self::Regressor => (1..=dof)
                .flat_map(|row| {
                    (1..=bodies).flat_map(move |body| INERTIAL_NAMES.map(|name| format!("tau{row}_{name}{body}")))
                })
                .collect(),
        }
    }

    /// Computes the values for one state; `state` contains the groups of columns in order.
    fn of_state<'w>(self, model: &Model, workspace: &'w mut Workspace, state: &[f64]) -> &'w [f64] {
        let dof = model.dof();
        let (q, rest) = state.split_at(dof);
        match self {
            Self::MassMatrix => mass_matrix(model, workspace, q),
            Self::CoriolisMatrix => coriolis_matrix(model, workspace, q, rest),
            Self::Gravity => gravity_torque(model, workspace, q),
            Self::GravityDerivative => gravity_torque_derivative(model, workspace, q),
            Self::InverseDynamics => inverse_dynamics(model, workspace, q, &rest[..dof], &rest[dof..]),
            Self::ForwardDynamics => forward_dynamics(model, workspace, q, &rest[..dof], &rest[dof..]),
            Self::Regressor => torque_regressor(model, workspace, q, &rest[..dof], &rest[dof..]),
        }
    }
}

/// Computes `quantity` for every row of the CSV table `states` (header `q1..`, `dq1..`, `ddq1..`, `tau1..` as required,
/// in any order, SI units) and writes CSV with 17 significant digits to `out`. Returns the number of rows.
///
/// # Errors
/// If the table cannot be read, lacks a column, or contains a value that is not finite; if the inertials of a body are
/// unknown; or if `out` cannot be written. Rows before a faulty row remain in `out`.
pub fn evaluate(model: &Model, states: &Path, quantity: Quantity, out: &mut dyn Write) -> Result<u64, Error> {
    let dof = model.dof();
    let unknown = model.bodies_without_prior();
    if !unknown.is_empty() && quantity != Quantity::Regressor {
        let message = format!(
            "bodies {} have no inertial, so their dynamics are unknown: add <inertial>, or request the regressor",
            unknown.join(", ")
        );
        return Err(Error::States { path: states.to_owned(), line: 1, message });
    }

    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(dynident_files::open(states).map_err(|source| Error::File { path: states.to_owned(), source })?);
    let header = reader.headers().map_err(|error| table_error(states, &error))?.clone();
    let places = column_places(&header, states, quantity, dof)?;
    let cannot = |source| Error::Output { path: PathBuf::from("standard output"), source };
    writeln!(out, "{}", quantity.header(dof, model.body_count()).join(",")).map_err(cannot)?;
    let mut workspace = Workspace::new(model);
    let (mut record, mut rows, mut state) = (csv::StringRecord::new(), 0, vec![0.0; places.len()]);
    while reader.read_record(&mut record).map_err(|error| table_error(states, &error))? {
        let line = record.position().map_or(0, csv::Position::line);
        for (value, &place) in state.iter_mut().zip(&places) {
            let field = record.get(place).unwrap_or("");
            *value = field.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| Error::States {
                path: states.to_owned(),
                line,
                message: format!("column `{}`: `{field}` is not a finite number", &header[place]),
            })?;
        }
        let result = quantity.of_state(model, &mut workspace, &state);
        if result.iter().any(|value| !value.is_finite()) {
            let message = "the result is not finite: the state is too large, or a joint moves no inertia".to_owned();
            return Err(Error::States { path: states.to_owned(), line, message });
        }
        for (k, value) in result.iter().enumerate() {
            let comma = if k == 0 { "" } else { "," };
            write!(out, "{comma}{value:.16e}").map_err(cannot)?;
        }
        writeln!(out).map_err(cannot)?;
        rows += 1;
    }
    Ok(rows)
}

fn column_places(
    header: &csv::StringRecord,
    states: &Path,
    quantity: Quantity,
    dof: usize,
) -> Result<Vec<usize>, Error> {
    let names = quantity.groups().iter().flat_map(|group| (1..=dof).map(move |joint| format!("{group}{joint}")));
    let place = |name: String| {
        header.iter().position(|column| column == name).ok_or_else(|| Error::States {
            path: states.to_owned(),
            line: 1,
            message: format!(
                "no column `{name}`: the quantity needs {} each with the numbers 1 to {dof}; the table has {}",
                quantity.groups().join(", "),
                header.iter().collect::<Vec<_>>().join(", ")
            ),
        })
    };
    names.map(place).collect()
}

fn table_error(path: &Path, error: &csv::Error) -> Error {
    let line = error.position().map_or(1, csv::Position::line);
    Error::States { path: path.to_owned(), line, message: error.to_string() }
}
