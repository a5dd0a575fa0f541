//! A law in a file, for programs that are not this one.

use dynident_model::Model;
use dynident_model::laws::{CoulombShape, CouplingEffect, Law, PowerExponent};
use serde_json::{Value, json};

/// The law with its joints by name, its shape in numbers, and its parameter.
pub(super) fn describe(model: &Model, law: &Law, value: f64) -> Value {
    let name = |joint: usize| &model.joints()[joint].name;
    let mut out = match law {
        Law::Viscous(_) => json!({ "kind": "viscous" }),
        Law::Coulomb(law) => json!({ "kind": "coulomb", "shape": shape(law.shape) }),
        Law::DirectionalViscous(law) => {
            json!({ "kind": "directional-viscous", "direction": law.direction.sign().to_string() })
        }
        Law::DirectionalCoulomb(law) => json!({
            "kind": "directional-coulomb", "direction": law.direction.sign().to_string(), "shape": shape(law.shape),
        }),
        Law::Stribeck(law) => {
            json!({ "kind": "stribeck", "speed": law.speed, "exponent": law.exponent, "shape": shape(law.shape) })
        }
        Law::Sigmoid(law) => {
            json!({ "kind": "sigmoid", "steepness": law.steepness, "offset_speed": law.offset_speed })
        }
        Law::Power(law) => json!({
            "kind": "power",
            "exponent": match law.exponent { PowerExponent::CubeRoot => 1.0 / 3.0, PowerExponent::Quadratic => 2.0 },
            "rounding": law.rounding,
        }),
        Law::Load(law) => json!({ "kind": "load", "shape": shape(law.shape) }),
        Law::MaxwellSlip(law) => json!({ "kind": "maxwell-slip", "yield_displacement": law.yield_displacement }),
        Law::TemperatureViscous(law) => {
            json!({ "kind": "temperature-viscous", "reference_c": law.reference_c })
        }
        Law::TemperatureCoulomb(law) => json!({
            "kind": "temperature-coulomb", "reference_c": law.reference_c, "shape": shape(law.shape),
        }),
        Law::Offset(_) => json!({ "kind": "offset" }),
        Law::DriveInertia(_) => json!({ "kind": "drive-inertia" }),
        Law::Coupling(law) => {
            let (effect, step) = match law.effect {
                CouplingEffect::Inertia => ("inertia", Value::Null),
                CouplingEffect::Viscous => ("viscous", Value::Null),
                CouplingEffect::Coulomb(step) => ("coulomb", shape(step)),
            };
            json!({ "kind": "coupling", "effect": effect, "ratios": law.ratios, "shape": step })
        }
    };
    out["joints"] = law.joints().into_iter().map(|joint| json!(name(joint))).collect();
    out["symbol"] = json!(law.symbol());
    out["unit"] = json!(law.unit());
    out["value"] = json!(value);
    out
}

fn shape(shape: CoulombShape) -> Value {
    match shape {
        CoulombShape::Sign { dead_band } => json!({ "step": "sign", "dead_band": dead_band }),
        CoulombShape::Smooth { width } => json!({ "step": "smooth", "width": width }),
    }
}
