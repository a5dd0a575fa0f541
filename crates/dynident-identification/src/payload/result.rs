//! Estimated payloads: values with error bars, and a physically consistent body.

use super::body::{Determined, NoBodyError, at_centre_of_mass, jacobian};
use super::columns::{LoadColumns, Payload, PayloadColumns};
use super::measured::Measured;
use super::round_body::{ControllerPayload, controller_payload};
use dynident_estimation::Estimate;
use dynident_model::INERTIAL_NAMES;
use dynident_rows::Recording;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A parameter of a payload, or a sum of parameters, that the logs determine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PayloadParameter {
    /// Parameter or sum, for example `Ixx + Iyy`, in the frame of the payload's link.
    pub expression: String,
    /// Unit.
    pub unit: String,
    /// Estimate; zero if the logs do not excite it.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// Half width of the 95 % interval.
    pub half_width_95: f64,
    /// Whether the logs excite the parameter or sum.
    pub excited: bool,
}

/// The physically consistent body that is nearest to the estimated payload, with the distance weighted by the inverse
/// covariance. Values that the logs do not determine follow from physical consistency and a reference body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ConsistentPayload {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link's frame, m.
    pub com_m: [f64; 3],
    /// Inertia about the centre of mass, axes of the link's frame: xx, xy, xz, yy, yz, zz.
    pub inertia_at_com_kgm2: [f64; 6],
    /// Distance of this body from the estimate, in standard deviations.
    pub moved_sigma: f64,
    /// Whether the estimate is not physically consistent, so that this body is on the boundary of the consistent set.
    pub on_the_boundary: bool,
}

/// Result for one payload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PayloadResult {
    /// Name.
    pub name: String,
    /// Link in whose frame the values are given.
    pub link: String,
    /// Training logs with this payload.
    pub logs: Vec<String>,
    /// Estimates of the payload's ten parameters about the link's origin, as single parameters or sums.
    pub parameters: Vec<PayloadParameter>,
    /// Mass, kg; with a zero error bar if the study states it; `None` if the logs do not determine it separately.
    pub mass_kg: Option<Measured>,
    /// Centre of mass in the link's frame, m; `None` for coordinates that the logs do not determine separately.
    pub com_m: [Option<Measured>; 3],
    /// Inertia about the centre of mass, axes of the link's frame, kg m²: xx, xy, xz, yy, yz, zz; `None` for values
    /// that the logs do not determine separately.
    pub inertia_at_com_kgm2: [Option<Measured>; 6],
    /// Parameters that the logs do not determine, as sentences.
    pub not_identified: Vec<String>,
    /// The nearest physically consistent body; `None` if it could not be computed.
    pub possible: Option<ConsistentPayload>,
    /// The body that `export` writes for a robot controller. Values that the logs do not determine are those of a
    /// sphere of the payload's mass, as far as the error bars allow.
    #[serde(default)]
    pub controller: Option<ControllerPayload>,
    /// Reason why there is no physically consistent body.
    pub failure: Option<String>,
    /// Change of each base parameter by the payload; `validate` uses it for logs with this payload.
    pub base_parameters_added: Vec<f64>,
}

/// Results of all estimated payloads.
pub fn payload_results(
    recordings: &[Recording],
    payloads: &[Payload],
    training: &[usize],
    columns: &LoadColumns,
    estimate: &Estimate,
) -> Vec<PayloadResult> {
    columns.payloads.iter().map(|payload| result(recordings, payloads, training, payload, estimate)).collect()
}

fn result(
    recordings: &[Recording],
    payloads: &[Payload],
    training: &[usize],
    columns: &PayloadColumns,
    estimate: &Estimate,
) -> PayloadResult {
    let section = &payloads[columns.payload];
    let excited = |place: usize| !estimate.rank.fixed.iter().any(|fixed| fixed.column == columns.first + place);
    let parameters: Vec<PayloadParameter> = columns
        .expressions()
        .into_iter()
        .enumerate()
        .map(|(place, expression)| PayloadParameter {
            expression,
            unit: unit(columns.kept[place]).to_owned(),
            value: estimate.values[columns.first + place],
            std: estimate.std[columns.first + place],
            half_width_95: estimate.half_width_95[columns.first + place],
            excited: excited(place),
        })
        .collect();
    let figures = figures(columns, estimate, &excited);
    let (possible, controller, failure) = match consistent_bodies(&section.name, columns, estimate, &figures) {
        Ok((possible, controller)) => (Some(possible), Some(controller), None),
        Err(reason) => (None, None, Some(reason.to_string())),
    };
    let added = (0..columns.change.nrows()).map(|row| {
        let of_mass = columns.mass.as_ref().map_or(0.0, |(_, added)| added[row]);
        let estimated = (0..parameters.len()).map(|place| columns.change[(row, place)] * parameters[place].value);
        of_mass + estimated.sum::<f64>()
    });
    PayloadResult {
        name: section.name.clone(),
        link: section.link.clone(),
        logs: training
            .iter()
            .filter(|&&log| recordings[log].payload.as_ref() == Some(&section.name))
            .map(|&log| recordings[log].name.clone())
            .collect(),
        mass_kg: figures[0],
        com_m: core::array::from_fn(|k| figures[1 + k]),
        inertia_at_com_kgm2: core::array::from_fn(|k| figures[4 + k]),
        not_identified: not_identified(columns, &parameters),
        possible,
        controller,
        failure,
        base_parameters_added: added.collect(),
        parameters,
    }
}

/// The physically consistent body that is nearest to the estimate, and the body for a controller.
fn consistent_bodies(
    name: &str,
    columns: &PayloadColumns,
    estimate: &Estimate,
    figures: &[Option<Measured>; 10],
) -> Result<(ConsistentPayload, ControllerPayload), NoBodyError> {
    let data = Determined::of(name, columns, estimate)?;
    let fit = data.nearest_consistent_body()?;
    let nearest: [f64; 10] = core::array::from_fn(|k| fit.parameters[k]);
    let [mass_kg, x, y, z, xx, xy, xz, yy, yz, zz] = at_centre_of_mass(&nearest);
    let possible = ConsistentPayload {
        mass_kg,
        com_m: [x, y, z],
        inertia_at_com_kgm2: [xx, xy, xz, yy, yz, zz],
        moved_sigma: fit.moved_sigma,
        on_the_boundary: fit.bodies.iter().any(|body| body.on_the_boundary),
    };
    Ok((possible, controller_payload(&data, &nearest, figures)?))
}

fn not_identified(columns: &PayloadColumns, parameters: &[PayloadParameter]) -> Vec<String> {
    let mut not_identified: Vec<String> = parameters
        .iter()
        .filter(|p| !p.excited)
        .map(|p| format!("{}: these logs do not separate it from the arm", p.expression))
        .collect();
    let open = |(_, dropped): &(usize, &usize)| columns.mass.is_none() || **dropped != 0;
    not_identified.extend(columns.dropped.iter().enumerate().filter(open).map(|(place, &dropped)| {
        let column = columns.regrouping.column(place);
        let homes: Vec<&str> = (0..parameters.len())
            .filter(|&row| column[row].abs() > 1.0e-9)
            .map(|row| &parameters[row].expression[..])
            .collect();
        if homes.is_empty() {
            format!("{}: no motion of this robot determines it", INERTIAL_NAMES[dropped])
        } else {
            format!("{}: determined only as part of {}", INERTIAL_NAMES[dropped], homes.join(", "))
        }
    }));
    not_identified
}

/// Mass, centre of mass and inertia about the centre of mass; `None` for values that depend on parameters that are not
/// determined separately.
fn figures(columns: &PayloadColumns, estimate: &Estimate, excited: &dyn Fn(usize) -> bool) -> [Option<Measured>; 10] {
    let place = |k: usize| {
        let place = columns.kept.iter().position(|&kept| kept == k)?;
        (columns.alone(place) && excited(place)).then_some(columns.first + place)
    };
    let places: [Option<usize>; 10] = core::array::from_fn(place);
    let mut p: [f64; 10] = core::array::from_fn(|k| places[k].map_or(0.0, |column| estimate.values[column]));
    if let Some((mass, _)) = columns.mass {
        p[0] = mass;
    }
    let mass_known = (places[0].is_some() || columns.mass.is_some()) && p[0] != 0.0;
    let covariance = DMatrix::from_fn(10, 10, |i, j| match (places[i], places[j]) {
        (Some(i), Some(j)) => estimate.covariance[(i, j)],
        _ => 0.0,
    });
    // The interval of a function of several parameters uses the largest quantile of these parameters.
    let width = places
        .iter()
        .flatten()
        .map(|&column| estimate.half_width_95[column] / estimate.std[column].max(f64::MIN_POSITIVE));
    let width = width.fold(0.0, f64::max);
    let (values, jacobian) =
        if mass_known { (at_centre_of_mass(&p), jacobian(&p)) } else { (p, DMatrix::identity(10, 10)) };
    let variances = (&jacobian * covariance * jacobian.transpose()).diagonal();
    core::array::from_fn(|k| {
        let determined = match k {
            0 => places[0].is_some() || columns.mass.is_some(),
            1..=3 => mass_known && places[k].is_some(),
            _ => mass_known && places[1..4].iter().all(Option::is_some) && places[k].is_some(),
        };
        let std = variances[k].max(0.0).sqrt();
        determined.then_some(Measured { value: values[k], std, half_width_95: width * std })
    })
}

fn unit(parameter: usize) -> &'static str {
    match parameter {
        0 => "kg",
        1..=3 => "kg m",
        _ => "kg m^2",
    }
}
